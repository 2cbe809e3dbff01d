"""Audit of freedoms and exact condensation: the limit of vanishing mass, names, refusals."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from fixtures import structures as s
from fixtures.random_models import dense_response, with_little_mass, with_massless

from flexctrl.errors import LinearizationError, MechanismError
from flexctrl.linear.condense import Freedom, audit, condense

S_POINTS = 1j * np.geomspace(0.03, 30, 25)


def extrapolated(values: list[np.ndarray], ratio: float) -> np.ndarray:
    """Richardson in powers ε, ε², … of values at ε, ε/ratio, ε/ratio²."""
    table = list(values)
    for order in range(1, len(values)):
        factor = ratio**order
        table = [(factor * b - a) / (factor - 1) for a, b in pairwise(table)]
    return table[0]


def refined_pole(linear, pole: complex) -> complex:
    """Newton on s² M + s C + K being singular, from a start nearby (left and right null vectors)."""
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    for _ in range(8):
        u, _, vh = la.svd(K + pole * C + pole**2 * M)
        left, right = u[:, -1].conj(), vh[-1].conj()
        pole -= (left @ (K + pole * C + pole**2 * M) @ right) / (left @ (C + 2 * pole * M) @ right)
    return pole


@pytest.mark.parametrize("aligned", [True, False])
@pytest.mark.parametrize("damped", [0, 2])
@pytest.mark.parametrize("seed", range(4))
def test_response_and_poles_are_the_limit_of_vanishing_mass(seed, aligned, damped):
    linear = with_massless(np.random.default_rng(seed), 9, 4, aligned, damped)
    steps = 1e-7 / 4.0 ** np.arange(4)
    limit = extrapolated([dense_response(with_little_mass(linear, e), S_POINTS) for e in steps], 4.0)
    reduced = condense(linear)
    assert len(reduced.coordinates) == 9 - 4 + damped
    for H in (dense_response(reduced, S_POINTS), reduced.to_ss()(S_POINTS), linear.to_ss()(S_POINTS)):
        assert np.abs(H - limit).max() < 1e-8 * np.abs(limit).max()
    poles = linear.damped_poles()
    assert poles.size == 2 * 5 + damped

    def continued(e: float) -> np.ndarray:
        light = with_little_mass(linear, e)
        return np.array([refined_pole(light, pole) for pole in poles])

    limit_poles = extrapolated([continued(e) for e in steps], 4.0)
    assert (np.abs(poles - limit_poles) < 1e-8 * np.abs(poles)).all()


@pytest.mark.parametrize("aligned", [True, False])
def test_condensed_static_response_is_exact(aligned):
    linear = with_massless(np.random.default_rng(7), 12, 5, aligned)
    reduced = condense(linear)
    full = linear.Cq @ la.solve(linear.K.toarray(), linear.B)
    part = reduced.Cq @ la.solve(reduced.K.toarray(), reduced.B) + reduced.D
    np.testing.assert_allclose(part, full, rtol=1e-11)
    assert np.abs(reduced.D).max() > 1e-3 * np.abs(full).max()


def test_drive_angle_without_inertia_in_series_with_ground():
    """k = 1000 to the load, 500 to ground: one mode, the static stiffness of both in series, D = 1/1500."""
    linear = s.model(
        np.diag([0.0, 5.0]),
        [[1500, -1000], [-1000, 1000]],
        B=[[1.0], [0.0]],
        Cq=np.eye(2),
        coordinates=("drive", "load"),
    )
    reduced = condense(linear)
    assert reduced.coordinates == ("load",)
    assert reduced.modes().omega == pytest.approx([8.164965809277260], rel=1e-14)
    assert reduced.K.toarray() == pytest.approx(np.array([[1000 * 500 / 1500]]), rel=1e-14)
    np.testing.assert_allclose(reduced.D, [[1 / 1500], [0.0]], rtol=1e-14)
    np.testing.assert_allclose(reduced.B, [[1000 / 1500]], rtol=1e-14)


def test_names_parts_and_inputs_survive():
    linear = s.model(np.diag([0.0, 5.0]), [[1500, -1000], [-1000, 1000]], inputs=("torque",), outputs=("angle",))
    reduced = condense(linear)
    assert (reduced.inputs, reduced.outputs, reduced.name) == (("torque",), ("angle",), "linear")
    assert condense(reduced) is reduced


def test_audit_labels_every_freedom():
    K = np.array([[2, -1, 0, 0], [-1, 2, 0, 0], [0, 0, 3, 0], [0, 0, 0, 0.0]])
    linear = s.model(
        np.diag([1.0, 0, 0, 0]), K, C=np.diag([0, 0, 0.5, 0]), coordinates=("x", "twist", "creep", "loose")
    )
    report = audit(linear)
    assert report.labels == (Freedom.DYNAMIC, Freedom.STATIC, Freedom.RELAXING, Freedom.MECHANISM)
    assert report.mechanisms == (("loose",),)
    assert "1 massless but stiff: twist" in str(report)


def test_mechanism_across_two_coordinates_names_both():
    K = np.zeros((3, 3))
    K[0, 0] = 4.0
    K[1:, 1:] = [[1, -1], [-1, 1]]
    linear = s.model(np.diag([1.0, 0, 0]), K, coordinates=("x", "turn_a", "turn_b"))
    with pytest.raises(MechanismError, match="turn_a with turn_b"):
        condense(linear)


@pytest.mark.parametrize("seed", range(200))
def test_planted_mechanism_is_found_and_nothing_else_is(seed):
    """Random stiff model with massless freedoms: sound as it is, refused with one stiffness cut out."""
    rng = np.random.default_rng(seed)
    linear = with_massless(rng, 10, 4, aligned=True)
    linear = replace(linear, C=sp.csc_matrix((10, 10)))
    assert not audit(linear).mechanisms
    name = audit(linear).named(Freedom.STATIC)[int(rng.integers(4))]
    i = linear.coordinates.index(name)
    K = linear.K.toarray()
    K[i, :] = K[:, i] = 0.0
    with pytest.raises(MechanismError, match=rf"\b{name}\b"):
        condense(replace(linear, K=sp.csc_matrix(K)))


def test_soft_but_real_stiffness_is_not_a_mechanism():
    """A massless angle held by 1e-9 of its neighbour's stiffness."""
    linear = s.model(np.diag([0.0, 1.0]), [[1e-3, 0], [0, 1e6]])
    assert audit(linear).named(Freedom.STATIC) == ("q1",)


def test_small_inertia_is_not_masslessness():
    linear = s.geared(1e-12, 1e5, 5.0, 1000.0)
    assert set(audit(linear).labels) == {Freedom.DYNAMIC}


def test_velocity_of_a_freedom_that_jumps_is_refused_by_name():
    linear = s.model(
        np.diag([0.0, 5.0]),
        [[1500, -1000], [-1000, 1000]],
        Cq=[[0.0, 0.0]],
        Cv=[[1.0, 0.0]],
        inputs=("torque",),
        outputs=("drive_speed",),
    )
    with pytest.raises(LinearizationError, match=r"'drive_speed'.*'torque'"):
        condense(linear)
    with pytest.raises(LinearizationError, match="drive_speed"):
        linear.to_ss()
    fine = replace(linear, B=np.array([[0.0], [1.0]]))
    np.testing.assert_allclose(fine.to_ss()(S_POINTS), dense_response(fine, S_POINTS)[0, 0], rtol=1e-12)


def test_rotations_without_rotary_inertia_of_a_beam():
    """Lumped masses on a Hermite beam: Guyan on the massless rotations is exact; Rayleigh damping relaxes them."""
    free = s.cantilever(12, EI=3e4, rhoA=5.0, length=6.0)
    lumped = np.array([5.0 * 0.5 if name.startswith("w") else 0.0 for name in free.coordinates])
    lumped[-2] /= 2
    linear = replace(free, M=sp.csc_matrix(np.diag(lumped)))
    assert len(audit(linear).named(Freedom.STATIC)) == 12
    exact = la.eigvals(linear.K.toarray(), linear.M.toarray())
    finite = np.sort(exact[np.abs(exact) < 1e12].real)
    np.testing.assert_allclose(linear.modes().omega_squared[:6], finite[:6], rtol=1e-8)
    damped = replace(linear, C=1e-3 * linear.K)
    assert damped.to_ss().nstates == 2 * 12 + 12
    relaxing = damped.damped_poles()
    assert np.count_nonzero(np.abs(relaxing + 1e3) < 1e-9) == 12
    H = damped.frequency_response(S_POINTS.imag * 30).values
    np.testing.assert_allclose(H, dense_response(damped, S_POINTS * 30), rtol=1e-8)


def test_dashpot_without_spring_creeps_exactly():
    """c q̇ = u beside an oscillator: a first-order integrator, pole 0 exactly."""
    linear = s.model(np.diag([0.0, 1.0]), np.diag([0.0, 4.0]), C=np.diag([2.0, 0.0]), Cq=np.eye(2))
    poles = linear.damped_poles()
    assert poles[0] == 0
    np.testing.assert_allclose(linear.to_ss()(0.5j)[0, 0], 1 / (2 * 0.5j), rtol=1e-14)
    with pytest.raises(LinearizationError, match="start above 0"):
        linear.frequency_response([0.0])


def test_massless_directions_across_the_coordinates_of_a_large_frame():
    """No rotary inertia, and axes at every node that mix its three freedoms: 310 null vectors, none aligned."""
    frame = s.grid_frame(9, 30, clamped=False)
    nodes = len(frame.coordinates) // 3
    turning = sp.diags(np.tile([1.0, 1.0, 0.0], nodes))
    plain = replace(frame, M=sp.csc_matrix(turning @ frame.M @ turning))
    rng = np.random.default_rng(0)
    T = sp.block_diag([la.qr(rng.standard_normal((3, 3)))[0] for _ in range(nodes)], format="csc")
    mixed = plain.projected(T, plain.coordinates)
    assert len(audit(mixed).named(Freedom.STATIC)) == nodes
    modes = mixed.modes(8)
    assert (modes.massless, modes.rigid) == (nodes, 3)
    np.testing.assert_allclose(modes.omega[3:], plain.modes(8).omega[3:], rtol=1e-10)


def test_large_sparse_model_with_massless_rotations():
    """1200 freedoms, half of them massless: audited and condensed without a dense n × n step for M."""
    free = s.cantilever(600, EI=1.0, rhoA=1.0, length=600.0)
    mass = np.array([1.0 if name.startswith("w") else 0.0 for name in free.coordinates])
    linear = replace(free, M=sp.csc_matrix(sp.diags(mass)))
    modes = linear.modes(3)
    assert modes.massless == 600
    np.testing.assert_allclose(modes.omega, np.array([1.8751041, 4.6940911, 7.8547574]) ** 2 / 600**2, rtol=2e-3)
