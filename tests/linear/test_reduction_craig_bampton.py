"""Craig–Bampton against its published table and its laws."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from fixtures import structures as s
from fixtures.random_models import dense_response

from flexctrl.errors import ReductionError
from flexctrl.linear.reduction import BelowFrequency, CraigBampton

MIDDLE = ("w10", "theta10")

TABLE = {
    0: [2.6e-2, 3.4e-1],
    1: [6.8e-5, 6.4e-3],
    2: [2.8e-6, 3.4e-4, 5.7e-4, 1.4e-2],
    3: [4.0e-7, 5.6e-5, 4.1e-5, 1.8e-3, 1.9e-3],
    5: [3.3e-8, 5.1e-6, 1.4e-6, 1.6e-4, 5.7e-5, 9.9e-4],
}


def frequency_errors(full, k):
    omega = full.reduce(CraigBampton(MIDDLE, k)).modes().omega
    return omega / full.modes().omega[: len(omega)] - 1.0


@pytest.mark.parametrize("k", sorted(TABLE))
def test_table_of_a_cantilever_of_twenty_elements(k):
    """Reference case C3: k fixed-interface modes for each half, two significant digits."""
    errors = frequency_errors(s.cantilever(20), k)
    np.testing.assert_allclose(errors[: len(TABLE[k])], TABLE[k], rtol=0.03)


def test_frequencies_come_from_above_and_fall_with_every_mode():
    full = s.cantilever(20)
    errors = [frequency_errors(full, k)[:2] for k in range(6)]
    assert all((e >= -1e-10).all() for e in errors)
    assert all((b <= a + 1e-10).all() for a, b in itertools.pairwise(errors))


def test_modes_below_half_the_lowest_dropped_frequency_are_within_two_percent():
    """The table's own fourth mode for k = 2 (1.4 %, at 0.49 of the dropped frequency) is the worst."""
    full = s.cantilever(20)
    for k in (1, 2, 3, 5):
        both = [s.beam(10, ("w0", "theta0", "w10", "theta10"), length=0.5), s.beam(10, ("w0", "theta0"), length=0.5)]
        dropped = min(half.modes().omega[k] for half in both)
        low = full.modes().omega < 0.5 * dropped
        assert abs(frequency_errors(full, k)[: low.sum()]).max() < 0.02


def test_static_response_to_interface_loads_is_exact():
    full = s.cantilever(20)
    at = [full.coordinates.index(name) for name in MIDDLE]
    load = np.eye(len(full.coordinates))[:, at]
    seen = replace(full, B=load, Cq=load.T, Cv=0 * load.T, D=np.zeros((2, 2)), inputs=("f", "m"), outputs=("w", "t"))
    reduced = seen.reduce(CraigBampton(MIDDLE, 2))
    exact = load.T @ la.solve(full.K.toarray(), load, assume_a="pos")
    found = dense_response(reduced.linear, np.zeros(1))[..., 0]
    np.testing.assert_allclose(found, exact, rtol=1e-9)
    # the interface stiffness itself, free of the conditioning of the solve
    K = full.K.toarray()
    inner = np.setdiff1d(np.arange(len(K)), at)
    schur = K[np.ix_(at, at)] - K[np.ix_(at, inner)] @ la.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, at)])
    error = abs(reduced.linear.K.toarray()[:2, :2] - schur)
    assert error.max() <= 1e-12 * abs(K).max()


def test_rigid_body_modes_are_kept_exactly():
    free = s.beam(20)
    reduced = free.reduce(CraigBampton(MIDDLE, 3))
    modes = reduced.modes()
    assert (reduced.rigid, modes.rigid) == (2, 2)
    assert (modes.omega_squared[:2] == 0.0).all()
    np.testing.assert_allclose(modes.omega[2], 22.3732854481, rtol=1e-4)
    motion = reduced.basis @ modes.shapes[:, :2]
    assert abs(free.K @ motion).max() <= 1e-12 * abs(free.K).max() * abs(motion).max()


def test_interface_names_survive_and_the_basis_expands():
    full = s.cantilever(20, beta=1e-4)
    reduced = full.reduce(CraigBampton(MIDDLE, 2, static_correction=True))
    assert reduced.linear.coordinates == (*MIDDLE, *(f"fixed_mode{j}" for j in range(1, 5)))
    exact = full.Cq @ la.solve(full.K.toarray(), full.B, assume_a="pos")
    np.testing.assert_allclose(dense_response(reduced.linear, np.zeros(1))[..., 0], exact, rtol=1e-11)
    assert reduced.error.worst < 2 * reduced.error_up_to(20.0).worst


def test_modes_can_be_chosen_below_a_frequency():
    full = s.cantilever(20)
    halves = np.concatenate(
        [s.beam(10, held, length=0.5).modes().omega for held in (("w0", "theta0"), ("w0", "theta0", "w10", "theta10"))]
    )
    reduced = full.reduce(CraigBampton(MIDDLE, BelowFrequency(50.0)))
    assert reduced.order == 2 + np.count_nonzero(halves < 2 * np.pi * 50.0)


def test_a_long_piece_is_reduced_sparsely():
    full = s.cantilever(400)
    reduced = full.reduce(CraigBampton(("w200", "theta200"), 4))
    np.testing.assert_allclose(reduced.modes().omega[:4], [3.5160153, 22.034492, 61.697214, 120.90192], rtol=1e-3)


def test_what_cannot_be_reduced_is_refused_by_name():
    with pytest.raises(ReductionError, match=r"'w1O' does not exist.*did you mean"):
        s.cantilever(20).reduce(CraigBampton(("w1O",), 2))
    with pytest.raises(ReductionError, match=r"coordinate '(w|theta)\d+' can still move"):
        s.beam(20).reduce(CraigBampton(("w10",), 2))
    with pytest.raises(ReductionError, match="each once"):
        s.cantilever(20).reduce(CraigBampton(("w10", "w10"), 2))
