"""Rows at events: forces may jump there, and a row is of one side of that."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np

from flexctrl.dynamics.run import Run

__all__ = ["at_events", "in_both", "struck"]

_MOST, _BEYOND = 8, 1e-3
"""Events that are looked at, and which share of a step is just beyond one."""


def struck(run: Run, other: Run) -> np.ndarray:
    """Return how far outputs jump in rows at the instants of events: just beyond, or as another run is there.

    Or in rows that may be on the other side of an event, if that is off by as much as the two have it apart: both may
    be late, one more than the other.

    Parameters
    ----------
    run, other : Run
        With their tracks.

    Returns
    -------
    numpy.ndarray, shape (outputs,)
    """
    jumps = []
    for k in [k for k in at_events(run) if in_both(run, other, run.t[k])][:_MOST]:
        beyond = run.t[k] + _BEYOND * (run.t[k + 1] - run.t[k])
        jumps += [np.abs(moment[1] - run.y[k]) for moment in (run.track.moment(beyond), other.track.moment(run.t[k]))]
    for t in [t for t in _missed_by_rows(run, other) if in_both(run, other, t)][:_MOST]:
        beside = _BEYOND * run.track.step(t)
        jumps.append(np.abs(run.track.moment(t + beside)[1] - run.track.moment(t - beside)[1]))
    return reduce(np.fmax, jumps, np.zeros(run.y.shape[1]))


def _missed_by_rows(run: Run, other: Run) -> Iterator[float]:
    """Events that are as near to a row as two runs have them apart: on which side of it they are nobody knows."""
    for event, same in zip(run.events, other.events, strict=False):
        if event.name != same.name:
            return
        late = abs(same.t - event.t)
        low, high = np.searchsorted(run.t, (event.t - late, event.t + late))
        if low < high:
            yield event.t


def in_both(run: Run, other: Run, t: float) -> bool:
    """Tell whether a time is within what two runs have kept of their steps.

    Parameters
    ----------
    run, other : Run
    t : float
        [s]

    Returns
    -------
    bool
    """
    return bool(max(run.track.starts[0], other.track.starts[0]) < t < min(run.final.t, other.final.t))


def at_events(run: Run) -> np.ndarray:
    """Return the rows at the instants of events, or so near that another run may well be past them; without the last.

    Parameters
    ----------
    run : Run

    Returns
    -------
    numpy.ndarray of int
    """
    events = np.array([event.t for event in run.events])
    rows = np.clip(np.searchsorted(run.t, events), 1, len(run.t) - 1)
    rows = rows - (events - run.t[rows - 1] < run.t[rows] - events)
    off, step = np.abs(run.t[rows] - events), np.diff(run.t, append=run.t[-1])[rows]
    return np.unique(rows[off < _BEYOND * step])
