"""How far other runs of a machine are from one, signal by signal, and what of that is its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import reduce

import numpy as np

from flexctrl.dynamics.notes.gap import interpolated
from flexctrl.dynamics.notes.orders import least_order, orders_seen
from flexctrl.dynamics.notes.striking import at_events, in_both, struck
from flexctrl.dynamics.run import Run
from flexctrl.frozen import frozen

__all__ = ["LOST", "NEAR", "Apart", "off_by", "telling"]

_POINTS, NEAR = 4, 1e-9
_STEEP, _MOST, _SHARED = 0.1, 8, 0.3
_ALIKE = 0.97
"""A coarser run in more of the steps is the same run: samples may round steps of any length to one."""
_LEAST = 0.5
"""Of a gap to a finer run no more than twice as much is this one's, where samples keep both short."""
LOST, _SURE = 0.1, 0.25
"""From which share of an output's range a gap is no longer one of small lags (all of it from twice that), and by how
much the order seen may be lower."""


@frozen
class Apart:
    """How far the outputs of another run are from those of a run.

    Attributes
    ----------
    longer : float
        By how much its steps are longer; below 1 it is a finer one.
    free : float
        The share of steps that are.
    most : numpy.ndarray, shape (outputs,)
        In rows, in units of the outputs.
    struck : numpy.ndarray, shape (outputs,)
        In rows at the very instants of events, where forces may jump, or of the other side of one.
    """

    longer: float
    free: float
    most: np.ndarray
    struck: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, run: Run, other: Run, longer: float) -> Apart:
        """Return it of two runs, where both have rows.

        Between its rows the first is somewhere between what it is there and a smooth curve through them. Rows of a run
        that has failed need be no numbers: they tell nothing.
        """
        near = NEAR * run.final.t
        most = _outside((run.t, run.y), (other.t, other.y), near)
        jumped = np.zeros_like(most)
        if len(run.t) >= _POINTS and run.track.stretches and other.track.stretches and len(other.t):
            jumped = struck(run, other)
            most = most if run.track.feed.sample_time else np.maximum(most, _where_steep(run, other, near))
        return cls(longer, _free(run, other, longer), most, jumped)

    @classmethod
    def of_commands(cls, run: Run, other: Run, longer: float) -> Apart:
        """Return it of the inputs of two runs, where both have rows."""
        most = _outside((run.t, run.u), (other.t, other.u), NEAR * run.final.t)
        return cls(longer, _free(run, other, longer), most)

    def left(self, order: np.ndarray) -> np.ndarray:
        """What of a gap is the first run's own, if errors go by powers of the steps."""
        least = _LEAST if self.longer < 1.0 else 1.0
        return self.most / np.maximum(self.free * np.abs(self.longer**order - 1.0), least)


def _free(run: Run, other: Run, longer: float) -> float:
    fewer = other.report.steps / max(run.report.steps, 1)
    return min(max((1.0 - fewer) / (1.0 - 1.0 / longer), _LEAST), 1.0)


_Rows = tuple[np.ndarray, np.ndarray]
"""Times, and what there is at each."""


def _outside(own: _Rows, others: _Rows, near: float) -> np.ndarray:
    """How far rows of another run are outside of what those of a run leave open."""
    (t, values), (when, other) = own, others
    if len(t) < _POINTS:
        return np.zeros(values.shape[1])
    within = (when >= t[0] - near) & (when <= t[-1] + near) & np.isfinite(other).all(axis=1)
    low, high = _between(own, when[within], near)
    there = other[within]
    return np.asarray(np.maximum(np.maximum(low - there, there - high), 0.0).max(axis=0, initial=0.0))


def _where_steep(run: Run, other: Run, near: float) -> np.ndarray:
    """How far outputs of another run are from a run's own where these change most from row to row, there and between,
    and in the rows that are farthest from it.

    What a run does between two rows may be anything, as far as rows tell: all that another one is off by may lie
    between them. It does not where both have many rows at the same times, as samples make them.
    """
    way = np.ptp(run.y, axis=0)
    steep = (np.abs(np.diff(run.y, axis=0)) / np.where(way > 0.0, way, np.inf)).max(axis=1)
    most = np.argsort(-steep)[:_MOST]
    shared = np.abs(other.t[np.clip(np.searchsorted(other.t, run.t - near), 0, len(other.t) - 1)] - run.t) <= near
    rows = np.unique(np.concatenate([most, most + 1, _where_far(run, other, way)]))
    rows = rows[~shared[rows] & ~np.isin(rows, at_events(run))] if shared.mean() < _SHARED else rows[:0]
    between = 0.5 * (run.t[most] + run.t[most + 1])[steep[most] > _STEEP]
    own = [(run.t[k], run.y[k]) for k in rows if in_both(run, other, run.t[k])]
    own += [(t, run.track.moment(t)[1]) for t in between if in_both(run, other, t)]
    apart = (np.abs(other.track.moment(t)[1] - y) for t, y in own)
    return reduce(np.fmax, apart, np.zeros(run.y.shape[1]))


def _where_far(run: Run, other: Run, way: np.ndarray) -> np.ndarray:
    """The rows in which outputs are farthest from smooth curves through another run's, of those that are so most."""
    rows = np.flatnonzero((run.t > other.t[0]) & (run.t < other.t[-1]))
    if len(other.t) < _POINTS:
        return rows[:0]
    apart = np.abs(interpolated(other.t, other.y, run.t[rows]) - run.y[rows]) / np.where(way > 0.0, way, np.inf)
    apart[~np.isfinite(apart)] = 0.0
    far = np.argsort(-apart, axis=0)[:2]
    order = np.argsort(-np.take_along_axis(apart, far, axis=0), axis=None)
    return rows[far.ravel()[order[: 2 * _MOST]]]


def telling(run: Run, others: Sequence[tuple[Run, float]]) -> list[tuple[Run, float]]:
    """Return those that tell something of a run: that ended as late, if any did, in other steps than its own.

    Parameters
    ----------
    run : Run
    others : sequence of (Run, float)
        By how much their steps are longer.

    Returns
    -------
    list of (Run, float)
    """
    ended = [each for each in others if each[0].final.t >= run.final.t * (1.0 - NEAR)] or others
    unlike = [each for each in ended if each[1] < 1.0 or each[0].report.steps < _ALIKE * run.report.steps]
    return [each for each in unlike if len(each[0].t)]


def off_by(apart: list[Apart], ways: np.ndarray, order: float, steady: bool) -> np.ndarray:
    """Return by how much signals may be off: by a finer run if there is one, else by the nearest coarser one.

    What rings in a coarser run may have lost its phase there: gaps that are a fifth of all that there is go by no power
    of the steps, if no farther run shows that they do; nor does a farther one whose gap is that large.
    Where the order seen is less than the method's, part of what is off goes by none, and is in all runs alike: no less
    is told than the geometric mean of what the order leaves and all of the gap.
    A finer one may be near by chance, where each impact adds its own: no less is told than the geometric mean of what
    it tells and what coarser ones do.

    Parameters
    ----------
    apart : list of Apart
        One at least.
    ways : numpy.ndarray, shape (signals,)
        What they go through.
    order : float
        Of the method.
    steady : bool
        Whether steps are of one length.

    Returns
    -------
    numpy.ndarray, shape (signals,)
    """
    near, *farther = sorted(apart, key=lambda a: a.longer)
    single = not farther or near.longer == farther[-1].longer
    known = near.longer < 1.0 or (steady and single)
    least = np.full(near.most.shape, order if known else least_order(near.longer, order))
    if near.longer < 1.0:
        own, coarser = near.left(least), [a for a in farther if a.longer > 1.0]
        return np.maximum(own, np.sqrt(own * off_by(coarser, ways, order, steady))) if coarser else own
    seen = (
        least if single else orders_seen(near.most, farther[-1].most, (near.longer, farther[-1].longer), (least, order))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        if not single and (farther[-1].most > 2.0 * LOST * ways)[ways > 0.0].any():
            seen = least  # nor does one that has lost its phase show any power
        off = near.left(seen)
        lost = np.where(ways > 0.0, np.clip(near.most / ways / LOST - 1.0, 0.0, 1.0), 0.0)
    sure = ~np.full(off.shape, single) & (seen > order - _SURE)
    mean = np.sqrt(off * near.most) if not known else off
    return np.where(sure, off, np.maximum(off + lost * (near.most - off), mean))


def _between(rows: _Rows, t: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """The least and the most that signals with some rows may be at some times."""
    when, values = rows
    after = np.clip(np.searchsorted(when, t), 1, len(when) - 1)
    curve = interpolated(when, values, t)
    low, high = np.minimum(curve, values[after]), np.maximum(curve, values[after])
    low, high = np.minimum(low, values[after - 1]), np.maximum(high, values[after - 1])
    for row in (after - 1, after):
        there = np.abs(when[row] - t)[:, None] <= near
        low, high = np.where(there, values[row], low), np.where(there, values[row], high)
    return low, high
