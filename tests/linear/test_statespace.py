"""Exports to python-control and damped poles: exact integrators, names, conditioning, control design."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.sparse as sp
from fixtures import structures as s
from fixtures.random_models import dense_response

from flexctrl.errors import LinearizationError
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import ModalForm, PhysicalForm

needs_slycot = pytest.mark.skipif(not control.slycot_check(), reason="slycot is not installed")
SOLVERS = ["scipy", pytest.param("slycot", marks=needs_slycot)]


def test_names_go_along():
    ss = s.crane(3.355, 1.0, 0.5).to_ss()
    assert ss.input_labels == ["force"]
    assert ss.output_labels == ["position", "sway_angle"]
    assert ss.state_labels == ["rigid1_q", "rigid1_v", "mode2_q", "mode2_v"]


def test_rigid_modes_are_exact_double_integrators():
    linear = s.beam(40, EI=1e5, rhoA=8.0, length=10.0, beta=1e-6)
    ss = linear.to_ss()
    np.testing.assert_array_equal(ss.A[:4, :4], np.kron(np.eye(2), [[0, 1], [0, 0]]))
    assert np.count_nonzero(linear.damped_poles() == 0) == 4
    assert not ss.A[:4, 4:].any()
    assert not ss.A[4:, :4].any()
    flexible = ss.A[4:, 4:]
    assert np.abs(flexible + flexible.T - 2 * np.diag(np.diag(flexible))).max() < 1e-15 * np.abs(flexible).max()


def test_crane_poles_and_zeros():
    linear = s.crane(3.355, 1.0, 0.5)
    np.testing.assert_allclose(np.abs(linear.damped_poles()), [0, 0, 5.046582, 5.046582], rtol=1e-6)
    ss = linear.select(outputs=["position"]).to_ss()
    np.testing.assert_allclose(np.abs(ss.zeros()), [4.429447] * 2, rtol=1e-6)


@pytest.mark.parametrize("form", [ModalForm(), PhysicalForm()])
def test_both_forms_have_the_same_transfer(form):
    linear = replace(s.geared(0.02, 10.0, 5.0, 1000.0), C=sp.csc_matrix(np.diag([0.03, 0.4])))
    z = 1j * np.geomspace(0.1, 100, 30)
    np.testing.assert_allclose(linear.to_ss(form)(z), dense_response(linear, z), rtol=1e-10)


def test_general_damping_of_a_free_machine_keeps_its_zero_exact():
    """Friction on the trolley: one pole 0 exactly, the rest from det(s² M + s C + K)."""
    linear = replace(s.crane(3.355, 1.0, 0.5), C=sp.csc_matrix(np.diag([4.0, 0.0])))
    poles = linear.damped_poles()
    assert np.count_nonzero(poles == 0) == 1
    M, m, l, c = 3.355, 1.0, 0.5, 4.0
    cubic = np.polyadd(
        np.polymul([M + m, c], [m * l * l, 0.0, m * s.G * l]), -((m * l) ** 2) * np.array([1.0, 0, 0, 0])
    )
    rest = poles[poles != 0]
    np.testing.assert_allclose(np.sort_complex(rest), np.sort_complex(np.roots(cubic)), rtol=1e-12)


def test_classical_poles_have_no_cancellation():
    """Overdamped by 1e8 and nearly critical: both roots to 1e-15."""
    for d, k in ((1e8, 1.0), (2.0, 1.0 - 1e-12), (0.3, 9.0)):
        poles = s.model(np.eye(1), [[k]], C=[[d]]).damped_poles()
        assert np.prod(poles).real == pytest.approx(k, rel=1e-14)
        assert poles.sum().real == pytest.approx(-d, rel=1e-14)


def test_unstable_modes_keep_both_signs():
    poles = np.sort(s.inverted_chain(5).damped_poles().real)
    roots = np.sqrt(np.polynomial.laguerre.lagroots([0, 0, 0, 0, 0, 1]))
    np.testing.assert_allclose(poles, np.sort(np.concatenate([-roots, roots])), rtol=1e-10)
    ss = s.inverted_chain(5).to_ss()
    assert np.count_nonzero(ss.poles().real > 0) == 5


@pytest.mark.parametrize("method", SOLVERS)
@pytest.mark.parametrize(
    ("data", "effort", "tolerance"), [((3.355, 1.0, 0.5), 1.0, 1e-8), ((59008.0, 65000.0, 25.0), 1e-9, 1e-7)]
)
def test_lqr_on_a_free_crane(data, effort, tolerance, method):
    """Two poles at 0: Riccati residual small beside its terms, closed loop stable."""
    ss = s.crane(*data).to_ss()
    Q, R = ss.C.T @ ss.C, np.array([[effort]])
    gain, X, poles = control.lqr(ss, Q, R, method=method)
    residual = ss.A.T @ X + X @ ss.A - X @ ss.B @ np.linalg.solve(R, ss.B.T @ X) + Q
    assert np.abs(residual).max() < tolerance * np.abs(Q).max()
    assert (poles.real < 0).all()
    closed = np.sort_complex(np.linalg.eigvals(ss.A - ss.B @ gain))
    np.testing.assert_allclose(closed, np.sort_complex(poles), rtol=1e-6)


def test_lqr_on_a_nearly_unstable_inverted_chain():
    ss = s.inverted_chain(5).to_ss()
    _, _, poles = control.lqr(ss, np.eye(10), np.eye(1), method="scipy")
    assert (poles.real < 0).all()


@pytest.mark.parametrize(("elements", "method"), [(60, "scipy"), pytest.param(99, "slycot", marks=needs_slycot)])
def test_lqr_on_a_flexible_arm_of_400_states(elements, method):
    """Hinged Hermite beam, one double integrator and modes over six decades: Riccati residual, closed loop."""
    arm = s.beam(elements, ("w0",), EI=1e5, rhoA=8.0, length=10.0, beta=1e-7)
    ss = arm.to_ss()
    assert ss.nstates == 4 * elements + 2
    Q, R = ss.C.T @ ss.C, np.eye(1)
    gain, X, poles = control.lqr(ss, Q, R, method=method)
    residual = ss.A.T @ X + X @ ss.A - X @ ss.B @ ss.B.T @ X + Q
    assert np.abs(residual).max() < 1e-8 * np.abs(X @ ss.A).max()
    closed = np.linalg.eigvals(ss.A - ss.B @ gain)
    assert closed.real.max() == pytest.approx(poles.real.max(), rel=1e-6)
    assert closed.real.max() < 0


def test_chosen_modes_only():
    linear = s.cantilever(20, beta=1e-5)
    modes = linear.modes().select([0, 2])
    ss = linear.to_ss(modes=modes)
    assert ss.state_labels == ["mode1_q", "mode1_v", "mode2_q", "mode2_v"]
    np.testing.assert_allclose(np.sort(np.abs(ss.poles()))[::2], modes.omega, rtol=1e-12)
    with pytest.raises(LinearizationError, match="modal form only"):
        linear.to_ss(PhysicalForm(), modes=modes)


def test_large_models_ask_for_a_choice():
    linear = s.chain(1100, beta=1e-3)
    with pytest.raises(LinearizationError, match="1100 freedoms"):
        linear.to_ss()
    assert linear.to_ss(modes=linear.modes(4)).nstates == 8


def test_sparse_poles_of_a_large_damped_chain():
    """Rayleigh-damped chain of 1100, treated as general: closed-form poles."""
    linear = s.chain(1100, mass=1.0, stiffness=1e4, beta=1e-3)
    omega = s.chain_omega(1100, 1.0, 1e4)[:4]
    exact = -0.5e-3 * omega**2 + 1j * omega * np.sqrt(1 - (0.5e-3 * omega) ** 2)
    found = linear.damped_poles(8)
    np.testing.assert_allclose(found[found.imag > 0], exact, rtol=1e-8)


def test_sparse_poles_of_a_free_chain_with_a_grounded_damper():
    n = 1100
    K = s.chain(n).K.tolil()
    K[0, 0] = 1.0
    C = sp.csc_matrix(([0.7], ([0], [0])), shape=(n, n))
    linear = s.model(sp.identity(n), K, C=C)
    poles = linear.damped_poles(6)
    assert np.count_nonzero(poles == 0) == 1
    z = poles[3]
    # free-free chain ended by a dashpot: continued fraction of the chain's drive-point stiffness at mass 1
    stiffness = z * z
    for _ in range(n - 1):
        stiffness = stiffness / (1 + stiffness) + z * z
    assert abs(stiffness + 0.7 * z) < 1e-7 * abs(0.7 * z)


@pytest.mark.parametrize("stiffness", [2.0**20, 2.0**34])
@pytest.mark.parametrize("masses", [5, 60])
def test_no_physical_form_says_zero_where_the_modal_form_does(masses, stiffness):
    """A r = 0 to the last bit for the free motion r of a chain, and its double pole splits by the root of ε."""
    K = stiffness * (2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    K[0, 0] = K[-1, -1] = stiffness
    names = tuple(f"x{i}" for i in range(masses))
    push, seen = np.eye(masses)[:, :1], np.eye(masses)[-1:]
    none = 0.0 * seen, np.zeros((1, 1))
    free = LinearModel(np.eye(masses), 0.0 * K, K, push, seen, *none, names, ("u",), ("y",))
    physical, fastest = free.to_ss(PhysicalForm()), 2.0 * np.sqrt(stiffness)
    moved = physical.A @ np.concatenate([np.ones(masses), np.zeros(masses)])
    assert not moved.any()
    assert 1e-11 < np.sort(np.abs(np.linalg.eigvals(physical.A)))[0] / fastest < 1e-7  # processors differ
    assert (free.damped_poles()[:2] == 0.0).all()
    assert np.sort(np.abs(np.linalg.eigvals(free.to_ss().A)))[1] == 0.0
