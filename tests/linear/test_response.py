"""Frequency responses against closed forms, dense solves and python-control, on grids that miss nothing."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.sparse as sp
from fixtures import structures as s
from fixtures.random_models import dense_response

from flexctrl.errors import LinearizationError, StructureError
from flexctrl.linear.condense import scaled
from flexctrl.linear.reduction import BalancedTruncation, ModalTruncation
from flexctrl.linear.reduction.states import states_transfer
from flexctrl.linear.transfer import direct_transfer, transfer


def local_dampers(linear, rate: float):
    """The model with a dashpot to ground at its first and middle coordinate."""
    n = len(linear.coordinates)
    C = sp.lil_matrix((n, n))
    C[0, 0], C[n // 2, n // 2] = rate, 2 * rate
    return replace(linear, C=sp.csc_matrix(linear.C + C))


def chain_response(n: int, beta: float, omega: np.ndarray) -> np.ndarray:
    """Closed form of x_n / f_1 on the fixed-free chain: sum over sine shapes."""
    j = np.arange(1, n + 1)
    theta = (2 * j - 1) * np.pi / (2 * n + 1)
    lam = (2 * np.sin(theta / 2)) ** 2
    shape = 4 / (2 * n + 1) * np.sin(theta) * np.sin(n * theta)
    s_ = 1j * omega[:, None]
    return (shape / (lam * (1 + beta * s_) + s_**2)).sum(axis=1)


def test_six_mass_chain_against_its_sine_sum():
    omega = np.geomspace(0.01, 3, 400)
    ours = s.six_mass_chain().frequency_response(omega).values[0, 0]
    # beyond the last pole the terms of the sum cancel to 1e-5 of their size
    np.testing.assert_allclose(ours, chain_response(6, 0.02, omega), rtol=3e-11)


@pytest.mark.parametrize("omega", [0.05, 1.0, 4.0])
def test_crane_transfer_functions(omega):
    M, m, l = 3.355, 1.0, 0.5
    H = s.crane(M, m, l).frequency_response([omega])
    z = 1j * omega
    position = (l * z**2 + s.G) / (z**2 * (M * l * z**2 + (M + m) * s.G))
    sway = -1 / (M * l * z**2 + (M + m) * s.G)
    assert H.channel("position", "force")[0] == pytest.approx(position, rel=1e-13)
    assert H.channel("sway_angle", "force")[0] == pytest.approx(sway, rel=1e-13)


@pytest.mark.parametrize("damping", ["rayleigh", "local"])
def test_against_python_control_on_a_dense_grid(damping):
    """1e-9 relative, python-control working on the well-conditioned modal realisation."""
    linear = s.chain(40, mass=2.0, stiffness=800.0, beta=1e-4)
    linear = linear if damping == "rayleigh" else local_dampers(linear, 0.3)
    omega = np.geomspace(0.05, 39, 2000)
    ours = linear.frequency_response(omega)
    theirs = control.frequency_response(linear.to_ss(), omega)
    np.testing.assert_allclose(ours.values, theirs.frdata, rtol=1e-9)
    back = ours.to_control()
    assert isinstance(back, control.FrequencyResponseData)
    assert (back.input_labels, back.output_labels) == (["force1"], ["position1"])
    np.testing.assert_array_equal(back.frdata, ours.values)


def test_default_grid_holds_every_lightly_damped_peak():
    """ζ = 1e-5 … 1e-3: the response at each peak of the grid is the peak of the closed form."""
    linear = s.chain(12, beta=1e-3)
    response = linear.frequency_response()
    modes = linear.modes()
    crest = modes.omega * np.sqrt(1 - 2 * modes.damping**2)
    for i, peak in enumerate(crest):
        near = np.abs(response.omega / peak - 1) < 3 * modes.damping[i]
        exact = np.abs(chain_response(12, 1e-3, np.array([peak])))[0]
        assert response.magnitude[0, 0, near].max() > 0.999999 * exact
        flank = np.abs(response.omega / peak - 1) < modes.damping[i]
        assert np.count_nonzero(flank) >= 8


def test_default_grid_holds_anti_resonances():
    """Collocated response of an undamped chain: zeros are the poles of the chain with mass 1 held."""
    n = 8
    linear = s.chain(n)
    linear = replace(linear, Cq=np.eye(n)[:1])
    rest = s.chain(n - 1)
    rest = s.model(rest.M, rest.K)
    zeros = rest.modes().omega
    response = linear.frequency_response()
    for zero in zeros:
        assert np.abs(response.omega / zero - 1).min() < 1e-6
        near = np.abs(response.omega / zero - 1) < 1e-5
        assert response.magnitude[0, 0, near].min() < 1e-4
    assert np.isfinite(response.values).all()


def test_reading_between_the_points_is_accurate():
    response = s.six_mass_chain().frequency_response()
    middle = np.sqrt(response.omega[1:] * response.omega[:-1])
    log = 0.5 * (np.log(response.magnitude[0, 0, 1:]) + np.log(response.magnitude[0, 0, :-1]))
    exact = np.log(np.abs(chain_response(6, 0.02, middle)))
    assert np.abs(log - exact).max() < 0.03


def test_integrator_starts_above_zero_and_refuses_zero():
    linear = s.crane(3.355, 1.0, 0.5)
    assert linear.frequency_response().omega[0] > 0
    with pytest.raises(LinearizationError, match="start above 0"):
        linear.frequency_response([0.0, 1.0])
    sway = linear.select(outputs=["sway_angle"])
    assert sway.frequency_response([0.0]).values[0, 0, 0] == pytest.approx(-1 / (4.355 * s.G), rel=1e-12)
    with pytest.raises(LinearizationError, match="infinite"):
        s.model(np.eye(1), np.array([[4.0]])).frequency_response([2.0])


def test_repeated_modes_give_a_response_that_no_basis_changes():
    """Two equal planes turned by 0.7 rad against the force: compare with dense solves."""
    one = s.cantilever(6, beta=1e-4)
    c, sn = np.cos(0.7), np.sin(0.7)
    T = np.kron(np.array([[c, -sn], [sn, c]]), np.eye(12))
    M, K, C = (T.T @ sp.block_diag([A] * 2).toarray() @ T for A in (one.M, one.K, one.C))
    linear = s.model(M, K, C=C, B=np.eye(24)[:, [10]], Cq=np.eye(24)[[10, 22]])
    omega = np.geomspace(1, 100, 80)
    np.testing.assert_allclose(
        linear.frequency_response(omega).values[0],
        dense_response(linear, 1j * omega)[0],
        rtol=1e-8,
    )


def test_modal_direct_and_residual_routes_agree():
    frame = s.grid_frame(9, 40, alpha=0.02, beta=1e-5)
    top = frame.modes(12).omega[-1]
    z = 1j * np.geomspace(0.2, top, 40)
    series = transfer(frame, top)(z)
    solved = direct_transfer(scaled(frame))(z)
    assert len(frame.coordinates) == 1200
    np.testing.assert_allclose(series, solved, rtol=1e-9)


@pytest.mark.parametrize("friction", [0.5, 40.0, "critical"])
def test_damping_that_couples_the_modes(friction):
    """Trolley friction on a free chain, light, heavy, and defective (two equal real poles), against dense solves."""
    n = 6
    K = s.chain(n).K.tolil()
    K[0, 0] = 1.0
    C = np.zeros((n, n))
    C[0, 0] = 0.5 if friction == "critical" else friction
    if friction == "critical":
        # a seventh mass of its own, critically damped: [[0, 1], [-1, -2]] has one eigenvector only
        M, K = np.eye(n + 1), sp.block_diag([K, [[1.0]]])
        C = np.block([[C, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[2.0]])]])
        C[0, n] = C[n, 0] = 1e-4
    else:
        M = np.eye(n)
    linear = s.model(M, K, C=C, Cq=np.eye(len(M))[[0, -1]])
    assert not linear._modal.classical
    omega = np.geomspace(1e-3, 3, 60)
    np.testing.assert_allclose(linear.frequency_response(omega).values, dense_response(linear, 1j * omega), rtol=1e-8)
    with pytest.raises(LinearizationError, match="start above 0"):
        linear.frequency_response([0.0])


def test_output_blind_to_the_integrator_has_its_static_value():
    """Trolley with friction: the sway angle under a constant force is that of steady travel, none."""
    linear = replace(s.crane(3.355, 1.0, 0.5), C=sp.csc_matrix(np.diag([4.0, 0.1])))
    sway = linear.select(outputs=["sway_angle"]).frequency_response([0.0, 1e-6]).values[0, 0]
    assert abs(sway[0]) < 1e-15
    assert abs(sway[1]) < 1e-6


@pytest.mark.parametrize("laub", [True, False])
def test_398_states_against_python_control_with_and_without_slycot(laub, monkeypatch):
    def missing(self, x):
        raise ImportError

    if not laub:
        monkeypatch.setattr(control.StateSpace, "slycot_laub", missing)
    arm = s.beam(99, ("w0",), EI=1e5, rhoA=8.0, length=10.0, beta=1e-7)
    omega = np.geomspace(0.1, 1e4, 50)
    theirs = control.frequency_response(arm.to_ss(), omega).frdata
    np.testing.assert_allclose(theirs, arm.frequency_response(omega).values, rtol=1e-9)


@pytest.mark.slow
def test_six_thousand_freedoms_in_linear_memory():
    """20 modes and 1000 points of a damped frame: right against direct solves; memory doubles with the size."""
    peaks = []
    for storeys in (100, 200):
        frame = s.grid_frame(9, storeys, alpha=0.01, beta=1e-5)
        tracemalloc.start()
        modes = frame.modes(20)
        omega = np.geomspace(0.1 * modes.omega[0], modes.omega[-1], 1000)
        response = frame.frequency_response(omega)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert len(frame.coordinates) == 6000
    some = slice(0, 1000, 111)
    solved = direct_transfer(scaled(frame))(1j * omega[some])
    np.testing.assert_allclose(response.values[..., some], solved, rtol=1e-7)
    assert peaks[1] < 2.4 * peaks[0]
    residual = frame.K @ modes.shapes - frame.M @ modes.shapes * modes.omega_squared
    assert np.abs(residual).max() < 1e-9 * np.abs(frame.K @ np.abs(modes.shapes)).max()


def test_velocity_outputs_and_feedthrough():
    linear = s.six_mass_chain()
    speed = replace(linear, Cq=0 * linear.Cq, Cv=linear.Cq, D=np.array([[0.25]]))
    omega = np.geomspace(0.1, 5, 50)
    both = linear.frequency_response(omega).values, speed.frequency_response(omega).values
    np.testing.assert_allclose(both[1], 1j * omega * both[0] + 0.25, rtol=1e-13)
    np.testing.assert_allclose(speed.to_ss()(1j * omega), both[1][0, 0], rtol=1e-10)


def test_follower_load_response_and_poles():
    """Unsymmetric K: Ziegler-like pair, against dense solves and the quadratic formula."""
    linear = s.model(np.diag([2.0, 1.0]), [[3.0, -1.5], [0.5, 2.0]], C=np.diag([0.02, 0.01]))
    omega = np.geomspace(0.1, 5, 40)
    np.testing.assert_allclose(linear.frequency_response(omega).values, dense_response(linear, 1j * omega), rtol=1e-11)
    poles = linear.damped_poles()
    det = np.polysub(np.polymul([2.0, 0.02, 3.0], [1.0, 0.01, 2.0]), [-1.5 * 0.5])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(np.roots(det)), rtol=1e-12)


def test_bad_requests_are_refused():
    linear = s.six_mass_chain()
    with pytest.raises(StructureError, match="rad/s"):
        linear.frequency_response([-1.0])
    for model in (linear, linear.reduce(BalancedTruncation(4)), linear.reduce(ModalTruncation(2))):
        with pytest.raises(StructureError, match=r"omega = \[\]; expected .*, one at least"):
            model.frequency_response([])
    with pytest.raises(StructureError, match="span"):
        linear.frequency_response(span=(0.0, 1.0))
    with pytest.raises(StructureError, match="did you mean 'force1'"):
        linear.frequency_response([1.0]).channel("position1", "force2")


@pytest.mark.parametrize("points", [1, 7, 40])
def test_states_answer_alike_one_point_or_many(points):
    """Few points go one by one, many together: either is D + C (sI − A)⁻¹ B."""
    rng = np.random.default_rng(4)
    A, B, C, D = (rng.normal(size=shape) for shape in ((12, 12), (12, 2), (3, 12), (3, 2)))
    s = 1j * np.geomspace(0.1, 10.0, points)
    found = states_transfer(A, B, C, D)(s)
    for k, each in enumerate(s):
        expected = D + C @ np.linalg.solve(each * np.eye(12) - A, B)
        assert found[:, :, k] == pytest.approx(expected, rel=1e-10)


def test_on_a_pole_states_answer_with_a_large_number():
    evaluate = states_transfer(np.diag([0.0, -1.0]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    for points in ([0.0], [0.0, 1.0, 2.0]):
        assert 1e12 < abs(evaluate(np.array(points))[0, 0, 0]) < np.inf
