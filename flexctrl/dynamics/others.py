"""Runs made again in other steps, from where a run began."""

from __future__ import annotations

import copy
import time
from dataclasses import replace

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.dynamics.checkpoint import Checkpoint, machine_of
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.methods.checked import Beside
from flexctrl.dynamics.notes.gap import Gap, between
from flexctrl.dynamics.records.digest import Digest
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.setting_out import travelled
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["UNCHECKED", "Beginning", "Other", "made", "noted", "seen_until", "standing"]

_LONGER, _SECONDS, _ALIKE, _NEAR = 2.0, 2.0, 0.01, 1e-9
UNCHECKED = "how far small differences have grown is not told by another run"


@frozen
class Beginning:
    """Where a run begins, for others to begin there too.

    Attributes
    ----------
    start : State, Rest, Checkpoint or None
    spacing : float or None
        Of rows [s].
    feed : Feed
    spare : Controller or None
        As it was before the run, as a law in Python may remember what it is asked; None where it cannot be copied.
    cost : float
        Processor time that the run has taken: what else goes on, or a law waits for, is no measure of others [s].
    """

    start: State | Rest | Checkpoint | None
    spacing: float | None
    feed: Feed
    spare: Controller | None
    cost: float = 0.0

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
        return Beginning(start, spacing, feed, None if feed.continuous else _copied(feed.controller))

    @property
    def again(self) -> Feed | None:
        """What feeds another run; None where a law's memory is not what it was."""
        if self.feed.controller is None or self.feed.continuous or self.feed.lowered is not None:
            return replace(self.feed, met=[])
        law = _copied(self.spare)
        return None if law is None else replace(self.feed, controller=law, met=[])

    def beside(self, other: Beside) -> State | Rest | Checkpoint | None:
        """Return where another run is to begin: where it stood when the run was cut, or where the whole began."""
        if not isinstance(self.start, Checkpoint):
            return self.start
        kind = repr(other.method), other.tolerance, machine_of(self.feed.model), self.feed.told_law
        stood = (saved for saved in self.start.origin.others if _kind(saved) == kind)
        return next(stood, self.start.origin.state)

    @property
    def t(self) -> float:
        """When the run goes on [s]."""
        return _time(self.start)

    @property
    def steps(self) -> int:
        """Taken before."""
        return self.start.mark.steps if isinstance(self.start, Checkpoint) else 0


def _time(start: State | Rest | Checkpoint | None) -> float:
    return start.t if isinstance(start, Checkpoint) else 0.0


def _kind(saved: Checkpoint) -> tuple[str, Tolerance, str, str]:
    """What run stands there: how it is made, of which machine, and under which law."""
    return saved.method, saved.tolerance, saved.machine, saved.law


def _copied(law: Controller | None) -> Controller | None:
    try:
        return copy.deepcopy(law)
    except Exception:  # whatever a law of one's own is made of
        return None


@frozen
class Other:
    """A run beside another one.

    Attributes
    ----------
    run : Run
    gap : Gap
        How far it is from the first: nothing where it has ended at once.
    beside : Beside
        How it was made.
    whole : Run
        It from where it began, which may be before the first goes on.
    """

    run: Run
    gap: Gap
    beside: Beside
    whole: Run


def made(run: Run, journey: Journey, beside: Beside, beginning: Beginning) -> tuple[Run, Other | None]:
    """Return the run with where one other stands, and that one, ended where it takes far longer.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    beside : Beside
        How the other is made.
    beginning : Beginning
        Where it begins, and of which machine it is.

    Returns
    -------
    Run, Other or None
        None if the other tells nothing; a note says why.
    """
    if run.final.t <= beginning.t:
        return run, None
    if journey.interruption.asked:
        return noted(run, f"{UNCHECKED} (interrupted)"), None
    end, feed, start = run.final.t, beginning.again, beginning.beside(beside)
    if feed is None:
        return noted(run, f"{UNCHECKED}: the controller cannot be copied"), None
    changed = replace(journey.plan, model=feed.model, feed=feed, method=beside.method, tolerance=beside.tolerance)
    work = (end - _time(start)) / (end - beginning.t)
    if not isinstance(start, Checkpoint):  # the whole way, of which this run has gone the last part
        work = max(work, run.report.steps / max(run.report.steps - beginning.steps, 1))
    work /= min(beside.longer, 1.0)
    latest = time.thread_time() + _LONGER * work * beginning.cost + _SECONDS

    def ended(share: float) -> None:
        if time.thread_time() > latest:
            raise KeyboardInterrupt

    spacing = beginning.spacing if len(run.t) > 1 else end  # a run that keeps no rows is compared where it ends
    if isinstance(start, Checkpoint):
        spacing = start.every
    try:
        unwatched = replace(changed, until=end, tell=ended, autosave=None)
        _, other = travelled(unwatched, start, (), Digest(), spacing)
    except (FlexctrlError, KeyboardInterrupt) as fault:
        return noted(run, f"{UNCHECKED}, which ends where it begins ({fault or 'interrupted'})"), None
    if not _begins_alike(run, other, journey):
        return noted(run, f"{UNCHECKED}: the controller, asked anew, does not begin alike (keep memory in x)"), None
    reached = end if other.status is Status.STOPPED else min(other.final.t, end)
    told, whole = seen_until(standing(run, other.checkpoint), reached), other
    other = _since(beginning.t, whole)
    if other.final.t <= beginning.t:
        return told, Other(other, Gap.unseen(run), beside, whole)
    try:
        return told, Other(other, between(run, other, journey, run.report.steps - beginning.steps), beside, whole)
    except (ArithmeticError, ValueError) as fault:  # numbers of a run that has failed need be none in between
        return noted(told, f"{UNCHECKED}, whose numbers fail ({fault})"), None


def _since(begin: float, other: Run) -> Run:
    """Another run from where one goes on: what came before, peaks and events, is not in that one."""
    rows = other.t >= begin * (1.0 - _NEAR)
    events = tuple(event for event in other.events if not begin or event.t > begin)
    return replace(other, t=other.t[rows], y=other.y[rows], u=other.u[rows], events=events)


def _begins_alike(run: Run, other: Run, journey: Journey) -> bool:
    """Whether a law says the same when it reads the same: how fast what has no mass sets out hangs on the steps."""
    first = journey.origin.u
    if not (len(first) and len(other.u)) or other.t[0] or np.array_equal(first, other.u[0]):
        return True
    if len(run.t) and not run.t[0]:
        reads = journey.plan.feed.reads
        return not np.array_equal(run.y[0, reads], other.y[0, reads])
    return np.allclose(first, other.u[0], rtol=_ALIKE, atol=_ALIKE * np.abs(first).max())


def standing(run: Run, other: Checkpoint) -> Run:
    """Return a run with where another one stands for what goes on from there.

    Parameters
    ----------
    run : Run
    other : Checkpoint
        Of the other one.

    Returns
    -------
    Run
    """
    origin = run.checkpoint.origin
    others = (*(saved for saved in origin.others if _kind(saved) != _kind(other)), other)
    return replace(run, checkpoint=replace(run.checkpoint, origin=replace(origin, others=others)))


def seen_until(run: Run, t: float) -> Run:
    """Return a run with until when others have been laid beside it for what goes on from there.

    Parameters
    ----------
    run : Run
    t : float
        [s]

    Returns
    -------
    Run
    """
    return replace(run, checkpoint=replace(run.checkpoint, origin=run.checkpoint.origin.seen_until(t)))


def noted(run: Run, *notes: str) -> Run:
    """Return a run with more notes.

    Parameters
    ----------
    run : Run
    *notes : str

    Returns
    -------
    Run
    """
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes)))
