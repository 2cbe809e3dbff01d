"""Runs made again, coarser, to tell how far the first is off."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, replace

import numpy as np

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.methods.checked import Checked
from flexctrl.dynamics.notes.beside import told_beside
from flexctrl.dynamics.records.record import InMemory
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.setting_out import travelled
from flexctrl.errors import FlexctrlError
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["Beginning", "laid_beside"]

_LONGER, _SECONDS = 2.0, 0.2
_NEARER = 0.5
_UNCHECKED = "how far small differences have grown is not told by a coarser run"


@dataclass(frozen=True)
class Beginning:
    """Where a run begins, for others to begin there too.

    Attributes
    ----------
    start : State, Rest or None
    spacing : float or None
        Of rows [s].
    feed : Feed or None
        As before the run: a law in Python may remember what it is asked. None where that cannot be copied.
    """

    start: State | Rest | None
    spacing: float | None
    feed: Feed | None

    @staticmethod
    def of(start: State | Rest | None, spacing: float | None, feed: Feed) -> Beginning:
        """Return where a run is about to begin.

        Parameters
        ----------
        start : State, Rest or None
        spacing : float or None
        feed : Feed

        Returns
        -------
        Beginning
        """
        return Beginning(start, spacing, _copied(feed))


def _copied(feed: Feed) -> Feed | None:
    """A feed whose controller remembers by itself; None where its memory cannot be copied."""
    if feed.controller is None or feed.continuous or feed.lowered is not None:
        return replace(feed, met=[])
    try:
        return replace(feed, controller=copy.deepcopy(feed.controller), met=[])
    except Exception:  # whatever a law of one's own is made of
        return None


def laid_beside(run: Run, journey: Journey, method: Checked, beginning: Beginning) -> Run:
    """Return the run with what a coarser one tells of it; where that is to be noted, a second one has the last word.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    method : Checked
    beginning : Beginning

    Returns
    -------
    Run
        As it is where the coarser run fails, or takes far longer and is ended.
    """
    if beginning.feed is None:
        return _noted(run, f"{_UNCHECKED}: the controller cannot be copied")
    told = _told(run, journey, method, beginning, 1.0)
    if set(told.report.notes) <= set(run.report.notes):
        return told
    nearer = _told(run, journey, method, beginning, _NEARER)
    return nearer if nearer is not run else told


def _told(run: Run, journey: Journey, method: Checked, beginning: Beginning, share: float) -> Run:
    """The run with what one coarser one tells; that is ended where it takes far longer."""
    assert beginning.feed is not None
    plan, end = journey.plan, run.final.t
    beside, feed = method.coarser(plan.tolerance, share), _copied(beginning.feed)
    if feed is None:
        return run
    latest = time.perf_counter() + _LONGER * run.report.wall_s + _SECONDS

    def ended(share: float) -> None:
        if time.perf_counter() > latest:
            raise KeyboardInterrupt

    changed = replace(plan, feed=feed, method=beside.method, tolerance=beside.tolerance)
    spacing = beginning.spacing if len(run.t) > 1 else end  # a run that keeps no rows is compared where it ends
    try:
        unwatched = replace(changed, until=end, tell=ended, autosave=None)
        _, coarse = travelled(unwatched, beginning.start, (), InMemory(), spacing)
    except (FlexctrlError, KeyboardInterrupt):
        return run
    if len(run.u) and len(coarse.u) and run.t[0] == coarse.t[0] and not np.array_equal(run.u[0], coarse.u[0]):
        return _noted(run, f"{_UNCHECKED}: the controller, asked anew, does not begin alike (keep its memory in x)")
    return told_beside(run, coarse, journey, beside.longer)


def _noted(run: Run, note: str) -> Run:
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))
