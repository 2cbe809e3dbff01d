"""Responses of proportionally damped models with a few dashpots, against solves with forty digits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from fixtures import structures as s

from flexctrl.linear import modal_sum
from flexctrl.linear.dashpots import dashpots_of
from flexctrl.linear.model import LinearModel

OMEGA = np.array([1e-3, 0.3, 4.0, 90.0, 2e3, 5e4])


def steel_beam(held: tuple[str, ...], beta: float, alpha: float = 0.0) -> LinearModel:
    linear = s.beam(6, held, EI=1e5, rhoA=8.0, length=10.0, beta=beta)
    return replace(linear, C=sp.csc_matrix(linear.C + alpha * linear.M))


def with_dashpots(linear: LinearModel, *ends: tuple[float, dict[int, float]]) -> LinearModel:
    """Dashpots, each with its rate and where it pulls."""
    C = linear.C.toarray()
    for rate, pulls in ends:
        v = np.zeros(len(C))
        v[list(pulls)] = list(pulls.values())
        C += rate * np.outer(v, v)
    return replace(linear, C=sp.csc_matrix(C))


def exact(linear: LinearModel, omega: np.ndarray) -> np.ndarray:
    """With forty digits; free motion does not feel the rounding of K."""
    mp = pytest.importorskip("mpmath", reason="forty digits need mpmath")
    mp.mp.dps = 40
    M, C, K = (mp.matrix(A.toarray().tolist()) for A in (linear.M, linear.C, linear.K))
    modes = linear.modes()
    if modes.rigid:
        R = mp.matrix(modes.shapes[:, : modes.rigid].tolist())
        P = mp.eye(K.rows) - R * (R.T * M * R) ** -1 * R.T * M
        K = P.T * K * P
    columns = []
    for z in (mp.mpc(0, float(w)) for w in omega):
        x = mp.lu_solve(K + z * C + z * z * M, mp.matrix(linear.B[:, 0].tolist()))
        rows = mp.matrix(linear.Cq.tolist()) + z * mp.matrix(linear.Cv.tolist())
        columns.append([complex(y) for y in rows * x])
    return np.array(columns).T[:, None, :]


@pytest.mark.parametrize("held", [("w0",), (), ("w0", "r0")])
@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 1e-6), (0.2, 1e-5), (0.0, 0.0)])
@pytest.mark.parametrize("rate", [1e-4, 5.0, 1e5])
def test_every_digit_at_every_frequency(held, alpha, beta, rate):
    plain = steel_beam(held, beta, alpha)
    linear = with_dashpots(plain, (rate, {2: 1.0}), (3.0 * rate, {5: 1.0, 9: -1.0}))
    dashpots = dashpots_of(linear, linear._modal)
    if rate > 1.0:  # fainter ones are left to others
        assert dashpots.pull.shape[1] == 2
        np.testing.assert_allclose(dashpots.damping, alpha + beta * linear.modes().omega_squared, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(linear.frequency_response(OMEGA).values, exact(linear, OMEGA), rtol=1e-9)


def test_free_motion_feels_no_dashpot_within_the_machine():
    linear = with_dashpots(steel_beam((), 0.0), (50.0, {0: 1.0, 6: -2.0, 12: 1.0}))
    omega = np.array([1e-6, 1e-3])
    dashpots = dashpots_of(linear, linear._modal)
    # it pulls at the ends and in the middle: motion as a rigid rod is not felt
    assert not dashpots.pull[:2].any()
    np.testing.assert_allclose(linear.frequency_response(omega).values, exact(linear, omega), rtol=1e-9)


@pytest.mark.parametrize("rate", [1e-3, 40.0])
def test_next_to_poles_that_only_dashpots_damp(rate):
    linear = with_dashpots(steel_beam(("w0",), 0.0), (rate, {4: 1.0}))
    pole = linear.modes().omega[[2, 5]]
    omega = np.sort(np.concatenate([pole * (1 + d) for d in (-1e-4, -1e-9, 0.0, 1e-12, 1e-7)]))
    np.testing.assert_allclose(linear.frequency_response(omega).values, exact(linear, omega), rtol=1e-9)


def test_velocities_and_several_channels():
    linear = with_dashpots(steel_beam(("w0",), 1e-6), (8.0, {3: 1.0}))
    n = len(linear.coordinates)
    rng = np.random.default_rng(4)
    seen = replace(
        linear, Cq=rng.normal(size=(2, n)), Cv=rng.normal(size=(2, n)), D=np.ones((2, 1)), outputs=("a", "b")
    )
    points = np.geomspace(0.1, 1e4, 700)
    found = seen.frequency_response(points).values
    some = points[::90]
    np.testing.assert_allclose(found[..., ::90], exact(seen, some) + 1.0, rtol=1e-9)


@pytest.mark.parametrize("what", ["many", "pushing", "gyroscopic", "none"])
def test_other_damping_is_left_to_others(what):
    linear = steel_beam(("w0",), 1e-6)
    n = len(linear.coordinates)
    C = linear.C.toarray()
    if what == "many":
        C += np.diag(np.random.default_rng(0).random(n))
    elif what == "pushing":
        C[3, 3] -= 2.0
    elif what == "gyroscopic":
        C[3, 5], C[5, 3] = C[3, 5] + 1.0, C[5, 3] - 1.0
    linear = replace(linear, C=sp.csc_matrix(C))
    assert dashpots_of(linear, linear._modal) is None
    np.testing.assert_allclose(linear.frequency_response(OMEGA).values, exact(linear, OMEGA), rtol=1e-9)


@pytest.mark.parametrize("moving", [False, True])
def test_sums_in_compiled_loops_are_those_of_numpy(moving, monkeypatch):
    pytest.importorskip("llvmlite")
    rng = np.random.default_rng(1)
    values = np.concatenate([[-3.0, 0.0], np.geomspace(1.0, 1e8, 90)])
    still, rate = rng.normal(size=(2, values.size, 5))
    series = modal_sum.ModalSum(
        values,
        0.01 + 1e-3 * np.sqrt(np.abs(values)),
        np.sqrt(np.maximum(values, 0.0)),
        np.maximum(-values, 0.0),
        still,
        rate * moving,
    )
    s_ = 1j * np.geomspace(1e-2, 1e5, 403)
    compiled = series(s_)
    monkeypatch.setattr(modal_sum, "can_compile", lambda: False)
    assert (np.abs(compiled / series(s_) - 1.0) < 1e-9).all()
