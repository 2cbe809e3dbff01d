"""Readings that are far off, and what a law makes of them: what it moves is known no better than these."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.percent import percent
from flexctrl.errors import FlexctrlError

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.run import Run

__all__ = ["heeded"]

_MUCH, _HEEDED = 0.2, 0.05
"""What readings are off by, of their range, and what commands change by that, of theirs, for a note."""
_SAID = (
    "the law reads {name}, which may be off by {off} of its range, and by that its commands by {far} of theirs: what "
    "these move may be off by more than is told of it"
)


def heeded(run: Run, journey: Journey, feed: Feed | None) -> Run:
    """Return a run with notes on readings that are far off and that commands go by.

    Parameters
    ----------
    run : Run
        With what is told of its outputs.
    journey : Journey
        At its end.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    Run
    """
    if feed is None or feed.controller is None or not feed.reads.size or not len(run.y):
        return run
    t, x, y, known = journey.point.state.t, journey.point.supply.x, run.y[-1, feed.reads], run.report.output_errors
    way, notes = np.ptp(run.u, axis=0), []
    off = np.array([known.get(run.outputs[i], 0.0) for i in feed.reads])
    with suppress(FlexctrlError, ArithmeticError, ValueError):  # beside where it was, a law may say nothing
        for i in np.flatnonzero(off >= _MUCH).tolist():
            d = np.zeros(len(y))
            d[i] = 0.5 * off[i] * np.ptp(run.y[:, feed.reads[i]])
            both = [feed.told(t, x, at)[0] if feed.sample_time else feed.answer(t, at, x)[0] for at in (y - d, y + d)]
            change = np.abs(np.subtract(*map(np.array, both)))[way > 0.0] / way[way > 0.0]
            if change.max(initial=0.0) >= _HEEDED:
                told = {"off": percent(off[i]), "far": percent(min(float(change.max()), 1.0))}
                notes.append(_SAID.format(name=run.outputs[feed.reads[i]], **told))
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes))) if notes else run
