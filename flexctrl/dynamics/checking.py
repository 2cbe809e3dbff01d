"""Runs made again, coarser, to tell how far the first is off."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass, replace

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.dynamics.checkpoint import Checkpoint
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.methods.checked import Beside, Checked
from flexctrl.dynamics.notes.beside import kept_short, told_beside
from flexctrl.dynamics.records.record import InMemory
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.setting_out import Anew, travelled
from flexctrl.errors import FlexctrlError
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["Beginning", "laid_beside"]

_LONGER, _SECONDS = 2.0, 0.2
_NEARER, _LITTLE = 0.5, 0.01
_UNCHECKED = "how far small differences have grown is not told by another run"


@dataclass(frozen=True)
class Beginning:
    """Where a run begins, for others to begin there too.

    Attributes
    ----------
    start : State, Rest, Anew or None
    spacing : float or None
        Of rows [s].
    steps : int
        Taken before.
    feed : Feed
    spare : Controller or None
        As it was before the run, as a law in Python may remember what it is asked; None where it cannot be copied.
    """

    start: State | Rest | Anew | None
    spacing: float | None
    steps: int
    feed: Feed
    spare: Controller | None

    @staticmethod
    def of(start: State | Rest | Checkpoint | None, spacing: float | None, feed: Feed) -> Beginning:
        """Return where a run is about to begin.

        Parameters
        ----------
        start : State, Rest, Checkpoint or None
        spacing : float or None
        feed : Feed

        Returns
        -------
        Beginning
        """
        spare = None if feed.continuous else _copied(feed.controller)
        if isinstance(start, Checkpoint):
            return Beginning(Anew(start), spacing, start.mark.steps, feed, spare)
        return Beginning(start, spacing, 0, feed, spare)

    @property
    def again(self) -> Feed | None:
        """What feeds another run; None where a law's memory is not what it was."""
        if self.feed.controller is None or self.feed.continuous or self.feed.lowered is not None:
            return replace(self.feed, met=[])
        law = _copied(self.spare)
        return None if law is None else replace(self.feed, controller=law, met=[])


def _copied(law: Controller | None) -> Controller | None:
    try:
        return copy.deepcopy(law)
    except Exception:  # whatever a law of one's own is made of
        return None


def laid_beside(run: Run, journey: Journey, method: Checked, beginning: Beginning) -> Run:
    """Return the run with what a coarser one tells of it; where that is much, a second one has the last word.

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
    """
    tolerance = journey.plan.tolerance
    if kept_short(journey):
        return _told(run, journey, method.finer(tolerance, journey.plan.feed.sample_time), beginning)[0]
    told, other = _told(run, journey, method.coarser(tolerance), beginning)
    quiet = told.report.error < _LITTLE and set(told.report.notes) <= set(run.report.notes)
    if quiet or other is None or other.status is Status.INTERRUPTED:
        return told
    nearer, second = _told(run, journey, method.coarser(tolerance, _NEARER), beginning)
    return told if second is None or _reached(second) < _reached(other) else nearer


def _reached(other: Run) -> float:
    """Until when a run tells of another; one that an end of the machine's own stops is not early."""
    return math.inf if other.status is Status.STOPPED else other.final.t


def _told(run: Run, journey: Journey, beside: Beside, beginning: Beginning) -> tuple[Run, Run | None]:
    """The run with what one other tells, and that one, ended where it takes far longer; None if there is none."""
    plan, end, feed = journey.plan, run.final.t, beginning.again
    if feed is None:
        return _noted(run, f"{_UNCHECKED}: the controller cannot be copied"), None
    latest = time.perf_counter() + _LONGER / min(beside.longer, 1.0) * run.report.wall_s + _SECONDS

    def ended(share: float) -> None:
        if time.perf_counter() > latest:
            raise KeyboardInterrupt

    changed = replace(plan, feed=feed, method=beside.method, tolerance=beside.tolerance)
    spacing = beginning.spacing if len(run.t) > 1 else end  # a run that keeps no rows is compared where it ends
    try:
        unwatched = replace(changed, until=end, tell=ended, autosave=None)
        _, other = travelled(unwatched, beginning.start, (), InMemory(), spacing)
    except (FlexctrlError, KeyboardInterrupt) as fault:
        return _noted(run, f"{_UNCHECKED}, which ends where it begins ({fault or 'interrupted'})"), None
    if len(run.u) and len(other.u) and run.t[0] == other.t[0] and not np.array_equal(run.u[0], other.u[0]):
        return _noted(run, f"{_UNCHECKED}: the controller, asked anew, does not begin alike (keep memory in x)"), None
    try:
        return told_beside(run, other, journey, beside.longer, run.report.steps - beginning.steps), other
    except (ArithmeticError, ValueError) as fault:  # numbers of a run that has failed need be none in between
        return _noted(run, f"{_UNCHECKED}, whose numbers fail ({fault})"), None


def _noted(run: Run, note: str) -> Run:
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))
