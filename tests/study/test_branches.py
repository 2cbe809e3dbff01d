"""Branches of a root locus: symmetric about the real axis, unbroken, and whole where they meet."""

from __future__ import annotations

import control as ct
import matplotlib as mpl
import numpy as np
import pytest
from plants import chain
from scipy.linalg import block_diag
from scipy.signal import tf2ss

from flexctrl.plots.root_locus import plot_root_locus
from flexctrl.study.loop import open_loop
from flexctrl.study.root_locus import root_locus

mpl.use("Agg")


def with_deadbeat_poles():
    """A sampled swing beside three poles so fast that rounding is all that is left of their z, in mixed states."""
    swing = ct.sample_system(ct.ss(*tf2ss([1.0, 1.0], [1, 0.4, 4])), 0.1)
    mixed = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 5)))[0]
    states = np.linalg.inv(mixed) @ block_diag(swing.A, np.diag([0.0, 1e-19, -3e-20])) @ mixed
    drive, sense = np.vstack([swing.B, np.full((3, 1), 1e-17)]), np.hstack([swing.C, np.full((1, 3), 1e-3)])
    return open_loop(ct.ss(states, np.linalg.inv(mixed) @ drive, sense @ mixed, [[0.0]], 0.1))


LOOPS = {
    "two lags": open_loop(ct.ss(*tf2ss([1.0], [1, 2, 0]))),
    "swing": open_loop(ct.ss(*tf2ss([25.0], [1, 0.1, 16, 0, 0])), ct.tf([1, 0.1], [0.01, 1])),
    "chain": open_loop(chain(4, beta=0.02), ct.tf([5, 1], [1e-4, 0.02, 1]), "force", "x1"),
    "sampled lags": open_loop(ct.sample_system(ct.ss(*tf2ss([1.0], [1, 2, 0])), 0.05)),
    "sampled chain": open_loop(chain(3, beta=0.02), ct.sample_system(ct.tf([5, 1], [0.05, 1]), 0.1), "force", "x1"),
    "negative z": open_loop(ct.sample_system(ct.ss(*tf2ss([1.0], [1, 0.02, 1])), 0.1), ct.tf([2, -1.8], [1, 0.2], 0.1)),
    "from negative z": open_loop(ct.ss([[-1.1, 0.3], [-0.3, -0.3]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 1.0)),
    "along negative z": open_loop(ct.ss(*tf2ss([1.0], np.poly([-0.5, -0.7 + 0.02j, -0.7 - 0.02j]).real), 1.0)),
    "deadbeat": with_deadbeat_poles(),
}
every_loop = pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)


def gap(points: np.ndarray, others: np.ndarray) -> float:
    """The farthest that one of the points is from its nearest other."""
    return max(float(abs(others - p).min()) for p in points)


@every_loop
def test_poles_at_every_gain_are_symmetric_about_the_real_axis(loop):
    """Also as s, where a negative z is at ±iπ/dt; but for the gain at which a branch is cut."""
    locus = root_locus(loop, np.geomspace(1e-3, 30.0, 150))
    for row, s in zip(locus.loci, locus.in_s().loci, strict=True):
        assert gap(row.conj(), row) <= 1e-12 * abs(row).max()
        s = s[np.isfinite(s)]
        there = np.concatenate([s, s[abs(s.imag) * loop.dt > 3.14159265].conj()])
        assert len(s) < len(row) or gap(s.conj(), there) <= 1e-9 * abs(s).max()


@every_loop
def test_what_is_drawn_is_symmetric_about_the_real_axis(loop):
    """Every point of every line inside the picture has its mirror image on a line, as near as can be seen."""
    ax = plot_root_locus({"loop": root_locus(loop, np.geomspace(1e-3, 30.0, 150))})
    size = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    points = []
    for line in (line for line in ax.lines if line.get_linewidth() == 1.3 and len(line.get_xdata())):
        ends = np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float)
        points.append((ends[:-1] + share * np.diff(ends, axis=0)).reshape(-1, 2))
    drawn = np.vstack(points)
    left, low = (limits[0] for limits in (ax.get_xlim(), ax.get_ylim()))
    drawn = (drawn - [left, 0.0]) / size
    drawn = drawn[(abs(drawn - [0.5, 0.0]) <= 0.5).all(axis=1) & np.isfinite(drawn).all(axis=1)] @ [1.0, 1.0j]
    assert low < 0
    assert gap(np.unique(np.round(drawn, 3)).conj(), drawn) < 0.01


def test_a_cut_between_two_sides_takes_no_pole_out_of_the_picture():
    """A pair that has met at a negative z parts again, where either branch may go to the other's side."""
    loop = LOOPS["along negative z"]
    locus = root_locus(loop, np.geomspace(1e-5, 0.1, 150))
    lines = [line for line in plot_root_locus(locus).lines if line.get_linewidth() == 1.3]
    drawn = np.concatenate([line.get_xdata() + 1j * np.asarray(line.get_ydata()) for line in lines])
    assert gap(np.log(locus.loci.ravel()), drawn[np.isfinite(drawn)]) < 1e-9


def test_a_deadbeat_pole_stays_at_minus_23_over_the_sampling_time():
    locus = root_locus(LOOPS["deadbeat"], np.geomspace(1e-3, 30.0, 150)).in_s()
    fast = locus.loci[:, (locus.loci.real < -200.0).any(axis=0)]
    assert fast.shape[1] == 3
    np.testing.assert_allclose(fast, np.log(1e-10) / 0.1)


@pytest.mark.parametrize("count", [2, 7, 400, 1000])
@pytest.mark.parametrize(("name", "gain", "pole"), [("two lags", 1.0, -1.0), ("sampled lags", None, None)])
def test_where_branches_meet_there_is_a_gain_however_many_are_given(name, gain, pole, count):
    """s² + 2s + k: at k = 1; sampled, the discriminant of z² + a z + b + k (c z + d) is zero."""
    loop = LOOPS[name]
    if gain is None:
        num, den = np.poly(loop.zeros) * float((loop.C @ loop.B).item()), np.poly(loop.poles)
        (a, b), (c, d) = den[1:], num
        gain = min(k.real for k in np.roots([c**2, 2 * a * c - 4 * d, a**2 - 4 * b]) if k.real > 0)
        pole = -(a + gain * c) / 2
    locus = root_locus(loop, np.geomspace(0.1 * gain, 30.0 * gain, count))
    met = abs(locus.gains / gain - 1).argmin()
    assert locus.gains[met] == pytest.approx(gain, rel=1e-6)
    np.testing.assert_allclose(locus.loci[met], pole, atol=2e-3 * abs(pole if not loop.dt else 1 - pole))


@pytest.mark.parametrize("name", ["two lags", "sampled lags"])
def test_a_meeting_before_the_first_gain_asked_for_is_found(name):
    """Branches leave the open loop's poles along the real axis, however late the first gain is."""
    locus = root_locus(LOOPS[name], np.geomspace(20.0, 60.0, 400)).in_s()
    assert (locus.loci[1].imag == 0).all()
    apart = abs(locus.loci[:, 0] - locus.loci[:, 1])
    assert 0 < apart[1:].argmin() < len(apart) - 1
    assert apart.min() < 0.01
    np.testing.assert_allclose(locus.loci[apart.argmin()], -1.0, atol=0.05)


def test_branches_of_a_sampled_loop_go_on_along_the_side_that_they_come_from():
    """A pair that meets at a negative z: in s one branch stays above, one below, and none jumps."""
    loop = open_loop(ct.ss([[-0.5, 0.3], [-0.3, -0.5]], [[0.0], [1.0]], [[-1.0, 0.0]], [[0.0]], 1.0))
    locus = root_locus(loop, np.geomspace(0.01, 0.35, 50)).in_s()
    assert np.isfinite(locus.loci).all()
    np.testing.assert_allclose(np.sort(locus.loci[-1].imag), [-np.pi, np.pi])
    assert abs(np.diff(locus.loci, axis=0)).max() < 0.3
