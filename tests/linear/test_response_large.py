"""Responses of large models whose damping is not α M + β K: against sparse solves at single frequencies."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from fixtures import structures as s

from flexctrl.errors import LinearizationError
from flexctrl.linear import direct, sampled
from flexctrl.linear.direct import state_at


def frame(storeys: int, clamped: bool = True):
    return s.grid_frame(9, storeys, alpha=0.01, beta=1e-5, clamped=clamped)


def tightened(linear):
    """Stiffness that the damping does not know: what weight and preload add to K."""
    share = np.random.default_rng(1).uniform(0.0, 1.0, linear.K.shape[0])
    return replace(linear, K=sp.csc_matrix(linear.K + sp.diags(1e-5 * share * linear.K.diagonal())))


def dragged(linear, rate: float):
    """Two dashpots to ground."""
    n = linear.K.shape[0]
    drag = np.zeros(n)
    drag[[n // 9 * 3, n // 6 * 3]] = rate
    return replace(linear, C=sp.csc_matrix(linear.C + sp.diags(drag)))


def spinning(linear):
    """A gyroscopic force on every node."""
    skew = sp.kron(sp.identity(linear.K.shape[0] // 3), [[0.0, 16.0, 0.0], [-16.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    return replace(linear, C=sp.csc_matrix(linear.C + skew))


CASES = {
    "geometric stiffness": lambda n: tightened(frame(n)),
    "light dashpots": lambda n: dragged(frame(n), 300.0),
    "dashpots that hold": lambda n: dragged(frame(n), 1e6),
    "gyroscopic": lambda n: spinning(frame(n)),
    "free, geometric stiffness": lambda n: tightened(frame(n, clamped=False)),
    "free, gyroscopic": lambda n: spinning(frame(n, clamped=False)),
}


def band(linear, count: int):
    omega = linear.modes(20).omega
    return np.geomspace(0.1 * omega[omega > 0][0], omega[-1], count)


def solved(linear, omega):
    """(K + iωC − ω²M)⁻¹ B by scipy, in the model's own coordinates, two steps of refinement."""
    values = []
    for w in omega:
        A = sp.csc_matrix(linear.K + 1j * w * linear.C - w**2 * linear.M)
        lu, x = sla.splu(A), 0.0
        for _ in range(3):
            x = x + lu.solve(linear.B - A @ x if np.ndim(x) else linear.B.astype(complex))
        values.append(linear.D + (linear.Cq + 1j * w * linear.Cv) @ x)
    return np.stack(values, axis=-1)


class Counted:
    """How many sparse factorisations the response makes."""

    def __enter__(self):
        self.solves = 0

        def counting(model):
            state = state_at(model)

            def one(z):
                self.solves += 1
                return state(z)

            return one

        self._patches = [patch.object(module, "state_at", counting) for module in (sampled, direct)]
        for each in self._patches:
            each.start()
        return self

    def __exit__(self, *_):
        for each in self._patches:
            each.stop()


@pytest.mark.parametrize("case", CASES)
def test_a_few_solves_serve_a_thousand_frequencies(case):
    linear = CASES[case](10)
    omega = band(linear, 400)
    with Counted() as work:
        response = linear.frequency_response(omega)
    some = slice(3, None, 37)
    np.testing.assert_allclose(response.values[..., some], solved(linear, omega[some]), rtol=1e-9)
    assert work.solves <= 60


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_above_a_thousand_freedoms(case):
    linear = CASES[case](40)
    assert len(linear.coordinates) >= 1200
    omega = band(linear, 1000)
    with Counted() as work:
        response = linear.frequency_response(omega)
    some = slice(7, None, 53)
    np.testing.assert_allclose(response.values[..., some], solved(linear, omega[some]), rtol=1e-9)
    assert work.solves <= 80


def test_many_inputs_velocities_and_a_silent_channel():
    linear = tightened(frame(9))
    n = len(linear.coordinates)
    ports = np.array([n - 3, n - 2, n // 2, n // 3, n - 1])
    silent = np.zeros((1, n))
    linear = replace(
        linear,
        B=np.eye(n)[:, ports],
        Cq=np.vstack([np.eye(n)[ports[:2]], silent]),
        Cv=np.vstack([np.eye(n)[ports[2:4]], silent]),
        D=np.arange(15.0).reshape(3, 5) * 1e-9,
        inputs=tuple(f"u{i}" for i in range(5)),
        outputs=("a", "b", "c"),
    )
    omega = band(linear, 60)
    some = slice(0, None, 7)
    values = linear.frequency_response(omega).values
    np.testing.assert_allclose(values[..., some], solved(linear, omega[some]), rtol=1e-9)


def test_a_free_machine_at_rest_where_its_motion_is_seen_and_where_not():
    """The stretch of a member under a constant push is that under a very slow one; the place is infinite."""
    linear = spinning(frame(9, clamped=False))
    n = len(linear.coordinates)
    stretch = np.zeros((1, n))
    stretch[0, 0], stretch[0, 3] = -1.0, 1.0
    stretched = replace(linear, Cq=stretch)
    omega = np.r_[0.0, band(linear, 40)]
    still = stretched.frequency_response(omega).values[0, 0, 0]
    slow = solved(stretched, [1e-4])[0, 0, 0]
    assert still == pytest.approx(slow.real, rel=1e-3)
    assert stretched.frequency_response([0.0]).values[0, 0, 0] == still
    with pytest.raises(LinearizationError, match="start above 0"):
        linear.frequency_response(omega)


def test_few_points_are_solved_one_by_one():
    linear = tightened(frame(10))
    with Counted() as work:
        linear.frequency_response([10.0, 20.0, 30.0])
    assert work.solves == 3


def test_adaptive_grid_shows_the_peaks():
    """With light damping each peak of the grid is the peak of direct solves around it."""
    linear = tightened(frame(9))
    response = linear.frequency_response(span=(1.0, float(linear.modes(6).omega[4])))
    size = response.magnitude[0, 0]
    crests = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
    assert crests.size >= 2
    for i in crests:
        fine = response.omega[i] * (1.0 + np.linspace(-1e-4, 1e-4, 21))
        assert size[i] > 0.999 * np.abs(solved(linear, fine)).max()


@pytest.mark.slow
def test_work_and_memory_grow_with_the_size_alone():
    """1,500, 3,000 and 6,000 freedoms: as many factorisations, and memory in proportion."""
    solves, peaks, sizes = [], [], (50, 100, 200)
    for storeys in sizes:
        linear = tightened(frame(storeys))
        omega = band(linear, 1000)
        tracemalloc.start()
        with Counted() as work:
            linear.frequency_response(omega)
        solves.append(work.solves)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert max(solves) <= 1.5 * min(solves) <= 90
    exponent = np.polyfit(np.log(sizes), np.log(peaks), 1)[0]
    assert exponent < 1.15
