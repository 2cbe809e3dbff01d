"""Moment matching: moments match, structure stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from fixtures import structures as s

from flexctrl.errors import ReductionError
from flexctrl.linear.reduction import ModalTruncation, MomentMatching, RelativeError


def moments(linear, point: complex, count: int) -> np.ndarray:
    """Taylor coefficients of Cq (s²M + sC + K)⁻¹ B at a point, by plain dense recursion."""
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    P0, P1 = K + point * C + point**2 * M, C + 2 * point * M
    rows = [la.solve(P0, linear.B)]
    rows.append(la.solve(P0, -P1 @ rows[0]))
    for _ in range(count - 2):
        rows.append(la.solve(P0, -P1 @ rows[-1] - M @ rows[-2]))
    return np.array([(linear.Cq @ row) for row in rows[:count]])


@pytest.mark.parametrize("point", [0.0, 25.0, 30j])
def test_twice_as_many_moments_match_as_there_are_derivatives_on_each_side(point):
    full = s.cantilever(6, beta=1e-3)
    full = replace(full, B=np.eye(12)[:, [4]])
    blocks = 2
    order = blocks * 2 * (2 if isinstance(point, complex) else 1)
    reduced = full.reduce(MomentMatching((point,), order)).linear
    exact, found = moments(full, point, 2 * blocks), moments(reduced, point, 2 * blocks)
    np.testing.assert_allclose(found, exact, rtol=1e-8)


def test_symmetry_definiteness_and_stability_are_kept():
    reduced = s.cantilever(10, alpha=0.01, beta=1e-4).reduce(MomentMatching((0.0, 40j, 200j), 9))
    for A in (reduced.linear.M, reduced.linear.C, reduced.linear.K):
        dense = A.toarray()
        np.testing.assert_allclose(dense, dense.T, atol=1e-12 * abs(dense).max())
        assert np.linalg.eigvalsh(0.5 * (dense + dense.T)).min() > 0
    assert (reduced.damped_poles().real < 0).all()
    assert reduced.order == 9


def test_free_body_keeps_its_rigid_motion_exactly():
    full = s.beam(8, beta=1e-4)
    reduced = full.reduce(MomentMatching((0.0, 30j), 8))
    modes = reduced.modes()
    assert modes.rigid == 2
    assert reduced.linear.coordinates[:3] == ("rigid1", "rigid2", "krylov1")
    np.testing.assert_allclose(modes.omega[2], 22.3732854481, rtol=1e-3)
    assert reduced.error_up_to(4.0).worst < 1e-3


def test_velocity_outputs_are_spanned_too():
    full = s.cantilever(6, beta=1e-3)
    full = replace(full, Cv=full.Cq, Cq=np.eye(12)[[4]])
    reduced = full.reduce(MomentMatching((20.0,), 6))
    w = np.array([20.0])

    def value(linear):
        A = (linear.K + 20 * linear.C + 400 * linear.M).toarray()
        return (linear.Cq + w[0] * linear.Cv) @ la.solve(A, linear.B)

    np.testing.assert_allclose(value(reduced.linear), value(full), rtol=1e-10)


def test_an_error_can_be_asked_for():
    full = s.cantilever(10, beta=1e-4)
    goal = RelativeError(0.01, up_to_hz=20.0)
    reduced = full.reduce(goal, using=lambda k: MomentMatching((0.0, 60j), k))
    assert reduced.error_up_to(20.0).worst <= 0.01


def test_a_pole_as_point_and_too_small_an_order_are_refused():
    pair = s.model(np.diag([1.0, 1.0]), np.array([[2.0, -1.0], [-1.0, 2.0]]))
    with pytest.raises(ReductionError, match="pole"):
        pair.reduce(MomentMatching((1j,), 2))
    with pytest.raises(ReductionError, match="2 rigid-body"):
        s.beam(4).reduce(MomentMatching((0.0,), 2))


def test_repeated_reduction_is_a_reduction():
    full = s.cantilever(10, beta=1e-4)
    twice = full.reduce(MomentMatching((0.0, 40j), 10)).linear.reduce(ModalTruncation(3))
    np.testing.assert_allclose(twice.modes().omega, full.modes().omega[:3], rtol=1e-4)
    assert isinstance(twice.linear.M, sp.csc_matrix)


def test_the_error_of_a_large_model_is_measured_where_the_reduced_one_can_have_modes():
    """1,008 freedoms: the highest Ritz value, hundreds of modes up, is no frequency to measure the full model at."""
    frame = s.grid_frame(13, 23, beta=1e-3, clamped=False)
    assert len(frame.coordinates) == 1008
    reduced = frame.reduce(MomentMatching((0.0, 20j), 16))
    highest = frame.modes(16).omega[-1]
    assert abs(reduced.damped_poles()).max() > 3.0 * highest
    assert reduced.error.up_to == pytest.approx(3.0 * highest)
    inside = np.linspace(0.05, 0.2, 7) * highest
    gap = frame.frequency_response(inside).values - reduced.frequency_response(inside).values
    assert (abs(gap).max(axis=-1) <= reduced.error.absolute * (1 + 1e-9)).all()


def test_an_order_above_the_models_own_is_the_model():
    """A search by error doubles the order past the number of freedoms; the columns beyond are rounding."""
    full = s.cantilever(6, beta=1e-3)
    reduced = full.reduce(MomentMatching((0.0, 30j), 20))
    assert reduced.order == len(full.coordinates) == 12
    assert reduced.error.worst < 1e-8
    found = full.reduce(RelativeError(1e-9), using=lambda order: MomentMatching((0.0, 30j), order))
    assert found.order <= 12
