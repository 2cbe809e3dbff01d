"""Modal truncation: exact DC gain, bounds that hold, selections that select, errors on demand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from fixtures import structures as s
from fixtures.random_models import dense_response

from flexctrl.errors import ReductionError
from flexctrl.linear.reduction import (
    BalancedTruncation,
    BelowFrequency,
    DCGain,
    ModalTruncation,
    MomentMatching,
    Participation,
    RelativeError,
    low_frequency,
    rigid_basis,
)


def two_ports(linear, rates: bool = False):
    """Force and position at the end, and a moment and slope (or rate) at node 3."""
    n = len(linear.coordinates)
    at = linear.coordinates.index("theta3")
    B = np.column_stack([linear.B[:, 0], np.eye(n)[at]])
    C = B.T.copy()
    mask = np.array([[1.0], [0.0 if rates else 1.0]])
    return replace(
        linear,
        B=B,
        Cq=C * mask,
        Cv=C * (1 - mask),
        D=np.zeros((2, 2)),
        inputs=("force", "moment"),
        outputs=("deflection", "slope"),
    )


@pytest.mark.parametrize("keep", [1, 3, 7])
@pytest.mark.parametrize("rates", [False, True])
def test_static_correction_gives_the_static_solution(keep, rates):
    full = two_ports(s.cantilever(8, beta=1e-4), rates)
    reduced = full.reduce(ModalTruncation(keep, static_correction=True))
    exact = full.Cq @ la.solve(full.K.toarray(), full.B, assume_a="pos")
    np.testing.assert_allclose(
        dense_response(reduced.linear, np.zeros(1))[..., 0], exact, atol=1e-12 * abs(exact).max()
    )
    assert reduced.linear.inputs == ("force", "moment")
    assert reduced.linear.outputs == ("deflection", "slope")
    assert reduced.order == keep


def test_static_correction_of_a_free_pair_of_masses_is_the_elastic_part():
    """k/(m s²(m s² + 2k)) = 1/(2 m s²) − 1/(4k) + O(s²)."""
    free = s.model(np.diag([3.0, 3.0]), 50.0 * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    reduced = free.reduce(ModalTruncation(1, static_correction=True))
    assert reduced.rigid == 1
    assert reduced.linear.K.nnz == 0 or abs(reduced.linear.K).max() == 0.0
    np.testing.assert_allclose(reduced.linear.D, [[-1 / 200.0]], rtol=1e-12)
    np.testing.assert_allclose(reduced.linear.Cq @ reduced.linear.B, [[1 / 6.0]], rtol=1e-12)


def test_expansion_at_zero_of_a_dragged_pair():
    """k/((m₁s² + cs + k)(m₂s² + k) − k²) = 1/(cs) − (m₁ + m₂)/c² + O(s)."""
    m1, m2, k, c = 2.0, 5.0, 70.0, 0.3
    pair = s.model(np.diag([m1, m2]), k * np.array([[1.0, -1.0], [-1.0, 1.0]]), C=np.diag([c, 0.0]))
    series = low_frequency(pair, rigid_basis(pair))
    np.testing.assert_allclose(series.double, 0.0, atol=1e-12)
    np.testing.assert_allclose(series.single, [[1 / c]], rtol=1e-12)
    np.testing.assert_allclose(series.constant, [[-(m1 + m2) / c**2]], rtol=1e-10)


def test_expansion_at_zero_with_free_and_dragged_motion_mixed():
    """The two machines above side by side, seen through a rotation of all coordinates."""
    free = s.model(np.diag([3.0, 3.0]), 50.0 * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    pair = s.model(np.diag([2.0, 5.0]), 70.0 * np.array([[1.0, -1.0], [-1.0, 1.0]]), C=np.diag([0.3, 0.0]))
    turn = la.qr(np.random.default_rng(5).standard_normal((4, 4)))[0]
    M, C, K = (turn.T @ la.block_diag(getattr(free, a).toarray(), getattr(pair, a).toarray()) @ turn for a in "MCK")
    both = s.model(M, K, C, B=turn.T @ la.block_diag(free.B, pair.B), Cq=la.block_diag(free.Cq, pair.Cq) @ turn)
    series = low_frequency(both, rigid_basis(both))
    np.testing.assert_allclose(series.double, np.diag([1 / 6.0, 0.0]), atol=1e-11)
    np.testing.assert_allclose(series.single, np.diag([0.0, 1 / 0.3]), atol=1e-9)
    np.testing.assert_allclose(series.constant, np.diag([-1 / 200.0, -7.0 / 0.09]), atol=1e-8)


def test_static_correction_with_a_damper_that_couples_rigid_and_elastic_motion():
    """A free beam with drag at one end: the corrected model has the same constant term at s = 0."""
    full = s.beam(6, beta=1e-5)
    drag = sp.lil_matrix(full.C)
    drag[0, 0] += 0.4
    full = replace(full, C=sp.csc_matrix(drag))
    reduced = full.reduce(ModalTruncation(4, static_correction=True)).linear
    w = np.array([0.03, 0.3])
    gap = abs(dense_response(full, 1j * w) - dense_response(reduced, 1j * w))[0, 0]
    plain = abs(dense_response(full, 1j * w) - dense_response(replace(reduced, D=0 * reduced.D), 1j * w))[0, 0]
    assert gap[0] < 0.02 * plain[0]
    assert gap[0] < 0.2 * gap[1]


@pytest.mark.parametrize("correction", [False, True])
def test_measured_error_is_within_the_bound_and_the_bound_is_not_idle(correction):
    full = two_ports(s.cantilever(8, beta=1e-4))
    reduced = full.reduce(ModalTruncation(4, correction))
    error = reduced.error
    assert (error.absolute <= reduced.bound * (1 + 1e-9)).all()
    assert (error.absolute >= 0.05 * reduced.bound).all()


def test_measured_error_is_that_of_a_dense_scan():
    full = two_ports(s.cantilever(8, beta=1e-4))
    reduced = full.reduce(ModalTruncation(4))
    omega = np.unique(
        np.concatenate(
            [np.geomspace(0.1, 3e3, 4000), full.modes().omega[:, None] @ np.linspace(0.98, 1.02, 801)[None]], axis=None
        )
    )
    gap = abs(dense_response(full, 1j * omega) - dense_response(reduced.linear, 1j * omega)).max(axis=-1)
    np.testing.assert_allclose(reduced.error.absolute, gap, rtol=2e-3)


def test_a_channel_silenced_by_symmetry_does_not_spoil_the_error():
    """A force at the middle of a simply supported beam turns nothing there."""
    beam = s.beam(10, ("w0", "w10"), beta=1e-5)
    names = beam.coordinates
    rows = np.eye(len(names))[[names.index("w5"), names.index("theta5")]]
    seen = replace(beam, B=rows[:1].T, Cq=rows, Cv=0 * rows, D=np.zeros((2, 1)), outputs=("w", "theta"))
    error = seen.reduce(ModalTruncation(8, static_correction=True)).error
    assert error.relative[1, 0] < 1e-6
    assert error.worst == error.relative[0, 0]


def test_participation_leaves_out_what_the_sensor_cannot_see():
    """At the middle of a simply supported beam the even modes stand still."""
    beam = s.beam(10, ("w0", "w10"), beta=1e-5)
    middle = np.eye(len(beam.coordinates))[[beam.coordinates.index("w5")]]
    seen = replace(beam, B=middle.T, Cq=middle, Cv=0 * middle)
    for rule in (Participation(4), DCGain(4)):
        assert seen.reduce(ModalTruncation(rule)).linear.coordinates == ("mode1", "mode3", "mode5", "mode7")


def test_selection_for_one_channel_and_below_a_frequency():
    full = two_ports(s.cantilever(8, beta=1e-4))
    omega = full.modes().omega
    kept = full.reduce(ModalTruncation(BelowFrequency(0.5 * (omega[4] + omega[5]) / (2 * np.pi))))
    np.testing.assert_allclose(kept.modes().omega, omega[:5], rtol=1e-12)
    with pytest.raises(ReductionError, match=r"'defection'.*did you mean 'deflection'"):
        full.reduce(ModalTruncation(Participation(2, outputs=("defection",))))


def test_unstable_and_rigid_modes_are_always_kept():
    upright = s.inverted_chain(5)
    with pytest.raises(ReductionError, match="0 rigid-body and 5 unstable"):
        upright.reduce(ModalTruncation(4))
    growth = upright.reduce(ModalTruncation(5)).modes().growth
    np.testing.assert_allclose(growth[[-1, 0]], [0.51338126, 3.55539039], rtol=1e-7)
    free = s.beam(6)
    with pytest.raises(ReductionError, match="2 rigid-body"):
        free.reduce(ModalTruncation(1))
    assert (free.reduce(ModalTruncation(3)).modes().omega_squared[:2] == 0.0).all()


def test_massless_freedoms_are_condensed_before_the_reduction():
    K = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    full = s.model(np.diag([1.0, 0.0, 2.0]), K, C=0.01 * np.diag([1.0, 0.0, 1.0]))
    reduced = full.reduce(ModalTruncation(2))
    w = np.geomspace(0.05, 5, 50)
    np.testing.assert_allclose(dense_response(reduced.linear, 1j * w), dense_response(full, 1j * w), rtol=1e-10)


@pytest.mark.parametrize("held", [("w0", "theta0"), ()])
def test_an_error_can_be_asked_for_and_a_smaller_model_misses_it(held):
    full = two_ports(s.beam(8, held, beta=1e-4))
    goal = RelativeError(0.002, up_to_hz=60.0)
    reduced = full.reduce(goal)
    assert reduced.error_up_to(60.0).worst <= goal.tolerance
    smaller = full.reduce(ModalTruncation(reduced.order - 1))
    assert smaller.error_up_to(60.0).worst > goal.tolerance
    corrected = full.reduce(goal, using=lambda k: ModalTruncation(k, static_correction=True))
    assert corrected.order <= reduced.order


def test_an_order_above_the_models_own_is_the_model():
    """A search by error doubles the order past the number of freedoms."""
    full = s.cantilever(6, beta=1e-3)
    assert full.reduce(ModalTruncation(999)).order == len(full.coordinates) == 12


def test_an_error_that_cannot_be_met_is_refused():
    with pytest.raises(ReductionError, match="no order up to"):
        s.cantilever(3, beta=1e-4).reduce(RelativeError(1e-3, up_to_hz=1e3), using=lambda k: ModalTruncation(min(k, 1)))


def test_a_large_model_is_reduced_sparsely():
    full = s.grid_frame(17, 30, alpha=0.05, beta=1e-5)
    assert len(full.coordinates) > 1500
    reduced = full.reduce(ModalTruncation(6, static_correction=True))
    np.testing.assert_allclose(reduced.modes().omega, full.modes(6).omega, rtol=1e-10)
    static = sp.linalg.spsolve(full.K.tocsc(), full.B[:, 0])
    np.testing.assert_allclose(dense_response(reduced.linear, np.zeros(1))[0, 0, 0], full.Cq[0] @ static, rtol=1e-9)
    assert reduced.error_up_to(0.5 * reduced.modes().frequencies[-1]).worst < 0.05


def test_models_say_in_a_line_what_they_are():
    linear = s.chain(6)
    reduced = linear.reduce(ModalTruncation(2))
    assert str(reduced).startswith(f"{linear.name}: 2 of 6 coordinates by ModalTruncation")
    assert str(linear).splitlines()[0].startswith(f"{linear.name}: 6 degrees of freedom, ")


def nearly_free(stiffness: float):
    """A damped cantilever whose tip moves against a heavy mass on a faint spring and a damper: a mode near 0."""
    arm = s.cantilever(6, alpha=0.02, beta=1e-4)
    n = len(arm.coordinates)
    tip = arm.coordinates.index("w6")
    M, C, K = (la.block_diag(A.toarray(), x) for A, x in ((arm.M, 3.0), (arm.C, 0.02), (arm.K, stiffness)))
    pull = np.r_[arm.B[:, 0], 0.3][:, None]
    seen = np.zeros((2, n + 1))
    seen[0, tip], seen[1, n - 1], seen[:, n] = 1.0, 1.0, 0.2
    return s.model(M, K, C, B=pull, Cq=seen)


@pytest.mark.parametrize("rule", [4, DCGain(4), Participation(4, outputs=("position2",))])
@pytest.mark.parametrize("correction", [False, True])
def test_a_nearly_free_mode_is_kept(rule, correction):
    full = nearly_free(1e-9)
    reduced = full.reduce(ModalTruncation(rule, correction))
    assert reduced.linear.coordinates[0] == "mode1"
    assert reduced.order == 4
    omega = np.geomspace(1e-5, 3e3, 3000)
    gap = abs(dense_response(full, 1j * omega) - reduced.frequency_response(omega).values).max(axis=-1)
    assert (gap <= 1.01 * reduced.error.absolute).all()
    assert reduced.error.worst < 1e-6  # of the slow mode's swing


def test_static_correction_does_not_spread_a_nearly_free_mode_that_is_left_out():
    """A free mass beside it takes the whole order: the correction is what the bent arm alone would have."""
    full = nearly_free(1e-9)
    rigid = np.zeros((1, 1))
    M, K = la.block_diag(full.M.toarray(), 1.0), la.block_diag(full.K.toarray(), rigid)
    C = la.block_diag(full.C.toarray(), rigid)
    both = s.model(M, K, C, B=np.vstack([full.B, [[1.0]]]), Cq=np.hstack([full.Cq, np.ones((2, 1))]))
    reduced = both.reduce(ModalTruncation(1, static_correction=True))
    assert reduced.linear.coordinates == ("rigid1",)
    arm = s.cantilever(6)
    still = la.solve(arm.K.toarray(), arm.B, assume_a="pos")
    tip, slope = still[arm.coordinates.index("w6"), 0], still[-1, 0]
    np.testing.assert_allclose(reduced.linear.D[:, 0], [tip, slope], rtol=1e-6)


METHODS = [ModalTruncation, BalancedTruncation, lambda order: MomentMatching((0.0,), order)]


def rigid_bodies(seed: int, damping: float = 0.0):
    """Three bodies that nothing holds together, seen at random; the last input and output almost nowhere."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    M = root @ root.T + 0.1 * np.eye(3)
    linear = s.model(M, np.zeros((3, 3)))
    B, Cq = rng.normal(size=(3, 2)), rng.normal(size=(2, 3))
    Cq[1] -= Cq[1] @ la.solve(M, B[:, [1]]) * la.solve(M, B[:, 1]) / np.sum(la.solve(M, B[:, 1]) ** 2)
    return replace(
        linear,
        C=sp.csc_matrix(damping * M),
        B=B,
        Cq=Cq,
        Cv=np.zeros((2, 3)),
        D=np.zeros((2, 2)),
        inputs=("a", "b"),
        outputs=("x", "y"),
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("using", METHODS)
def test_a_machine_of_rigid_motion_alone_has_nothing_to_lose(using, damping, seed):
    """G = Cq M⁻¹ B/(s² + d s), and every method keeps it: its error is rounding, whatever the band."""
    reduced = rigid_bodies(seed, damping).reduce(RelativeError(1e-7, up_to_hz=20.0), using=using)
    assert reduced.error.worst < 1e-7
    assert reduced.error_up_to(0.01).worst < 1e-7
    assert reduced.error.up_to > 0.0
