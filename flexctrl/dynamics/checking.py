"""Runs made again, coarser, to tell how far the first is off."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import replace

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.dynamics.checkpoint import Checkpoint, machine_of
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.methods.checked import Beside, Checked
from flexctrl.dynamics.notes.beside import PARTED, TOLD, elsewhere, rattles, told_beside
from flexctrl.dynamics.notes.gap import Gap, between
from flexctrl.dynamics.notes.peaks import peaked
from flexctrl.dynamics.records.record import InMemory
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.setting_out import travelled
from flexctrl.dynamics.steps import Fixed
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["Beginning", "Other", "laid_beside", "made", "news"]

_LONGER, _SECONDS = 2.0, 0.2
_NEARER, _LITTLE = 0.5, 0.01
_FARTHER = 5.0 / 3.0
"""How far the last one is, in powers: 243 times the tolerance."""
_ASTRAY, _FASTER = 0.1, 1.3
"""It goes elsewhere where it is a tenth of the motion away, and so much farther than by its order."""
_NEARLY = 0.001
"""A thirtieth of what is noted: coarser runs have told of rattling too little by seven times."""
_UNCHECKED = "how far small differences have grown is not told by another run"


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
    """

    start: State | Rest | Checkpoint | None
    spacing: float | None
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
        kind = repr(other.method), other.tolerance, machine_of(self.feed.model)
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


def _kind(saved: Checkpoint) -> tuple[str, Tolerance, str]:
    """What run stands there: how it is made, and of which machine."""
    return saved.method, saved.tolerance, saved.machine


def _copied(law: Controller | None) -> Controller | None:
    try:
        return copy.deepcopy(law)
    except Exception:  # whatever a law of one's own is made of
        return None


def laid_beside(run: Run, journey: Journey, method: Checked, beginning: Beginning, shorter: float) -> Run:
    """Return the run with what a coarser one tells of it; where that is much, a second one has the last word.

    Where they tell little, one far coarser shows how errors grow with the tolerance, and a note says whether it goes
    elsewhere; of steps of one length the others know enough.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    method : Checked
    beginning : Beginning
    shorter : float
        By how much steps of the run beside are shorter; 1 where they are longer.

    Returns
    -------
    Run
    """
    tolerance = journey.plan.tolerance
    if shorter < 1.0:
        return _told(run, journey, method.finer(tolerance, journey.plan.feed.sample_time, shorter), beginning)[0]
    coarser = method.coarser(tolerance)
    told, other = _told(run, journey, coarser, beginning)
    if other is None or other.run.status is Status.INTERRUPTED:
        return told
    nearby = method.coarser(tolerance, _NEARER)
    quiet = told.report.error < _LITTLE and not news(told, run)
    parted = not quiet and told.report.error > PARTED
    if not quiet:
        told = _nearer(run, told, other, journey, nearby, beginning)
    if told.report.error > TOLD:
        return told
    if parted:
        return elsewhere(told, other.gap, journey, coarser.said)
    if isinstance(method.pace, Fixed):
        return told
    farther = method.coarser(tolerance, _FARTHER)
    standing, third = made(told, journey, farther, beginning)
    if third is None:
        return told
    if quiet:
        standing = _grown(run, standing, other, third, journey, nearby, beginning)
    if standing.report.error > TOLD:
        return standing
    grown = (farther.longer**run.report.order - 1.0) / (coarser.longer**run.report.order - 1.0)
    astray = third.gap.most > max(_ASTRAY, _FASTER * grown * other.gap.most)
    if astray:
        return elsewhere(standing, third.gap, journey, farther.said)
    return _confirmed(run, standing, journey, method, beginning) if rattles(journey) else standing


def _confirmed(run: Run, told: Run, journey: Journey, method: Checked, beginning: Beginning) -> Run:
    """The run with what a finer one tells of it, if that is more.

    Where corners come one after another errors go by no power of the steps: what coarser runs make of them may well be
    too little, if it is not far less than what would be noted.
    """
    if news(told, run) or max(told.report.error, *told.report.output_errors.values(), 0.0) < _NEARLY:
        return told
    again = replace(run, checkpoint=told.checkpoint)
    finer = _told(again, journey, method.finer(journey.plan.tolerance, 0.0, 0.5), beginning)[0]
    if finer.report.error > told.report.error:
        return _as_much(finer, told)
    notes = (*told.report.notes, *(note for note in finer.report.notes if note not in run.report.notes))
    return _as_much(replace(told, checkpoint=finer.checkpoint, report=replace(told.report, notes=notes)), finer)


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
    """

    run: Run
    gap: Gap
    beside: Beside


def _order(near: Other, far: Other, most: float) -> float:
    """The order of errors as two runs beside show it: of what they are apart no more than all is the finer one's.

    With errors that grow as rᵖ the gaps are as rᵖ − 1; what does not grow so, as where corners come one after another,
    has a lower order than its method.
    """
    from scipy.optimize import brentq

    if not near.gap.most or _reached(near.run) != _reached(far.run):
        return most
    one, other = math.log(near.beside.longer), math.log(far.beside.longer)
    ratio, least = far.gap.most / near.gap.most, min(math.log(2.0) / one, most)

    def short(order: float) -> float:
        return math.expm1(order * other) - ratio * math.expm1(order * one)

    if short(least) >= 0.0:
        return least
    return float(brentq(short, least, most)) if short(most) > 0.0 else most


def _grown(
    run: Run, told: Run, other: Other, far: Other, journey: Journey, nearby: Beside, beginning: Beginning
) -> Run:
    """The run with what is told of it where errors grow as they do from the one to the other run beside."""
    order = _order(other, far, run.report.order)
    if order == run.report.order:
        return told
    known = _said(replace(run, checkpoint=told.checkpoint), other, journey, beginning, order)
    much = known.report.error > TOLD or news(known, run)
    return _nearer(run, known, other, journey, nearby, beginning) if much else known


def news(told: Run, run: Run) -> bool:
    """Tell whether a run beside has notes of its own.

    Parameters
    ----------
    told : Run
        With what others tell.
    run : Run
        Without.

    Returns
    -------
    bool
    """
    return not set(told.report.notes) <= set(run.report.notes)


def _nearer(run: Run, told: Run, other: Other, journey: Journey, nearby: Beside, beginning: Beginning) -> Run:
    """What a second one tells, unless it ended before the first."""
    standing, second = made(replace(run, checkpoint=told.checkpoint), journey, nearby, beginning)
    if second is None:
        return told
    if _reached(second.run) < _reached(other.run):
        return _standing(told, second.run.checkpoint)
    order, parted = run.report.order, told.report.error > PARTED
    feared = told.report.error / (other.beside.longer**order - 1.0) if parted else 0.0
    seen = order if parted else _order(second, other, order)
    nearer = _said(standing, second, journey, beginning, seen, feared)
    return _as_much(nearer, told) if nearer.report.error == told.report.error == run.report.drift else nearer


def _as_much(run: Run, other: Run) -> Run:
    """The run with no less told of outputs than another one tells: where sums have the word, both are guesses."""
    shares, others = run.report.output_errors, other.report.output_errors
    most = {name: max(share, others.get(name, 0.0)) for name, share in shares.items()}
    return replace(run, report=replace(run.report, output_errors=most))


def _reached(other: Run) -> float:
    """Until when a run tells of another; one that an end of the machine's own stops is not early."""
    return math.inf if other.status is Status.STOPPED else other.final.t


def _told(run: Run, journey: Journey, beside: Beside, beginning: Beginning) -> tuple[Run, Other | None]:
    """The run with what one other tells, and that one; None if there is none."""
    standing, other = made(run, journey, beside, beginning)
    return (standing, None) if other is None else (_said(standing, other, journey, beginning, run.report.order), other)


def _said(run: Run, other: Other, journey: Journey, beginning: Beginning, order: float, feared: float = 0.0) -> Run:
    """The run with what one other tells, if errors are of an order."""
    if other.run.final.t <= beginning.t:
        return _noted(run, f"{_UNCHECKED}, which ended at t = {other.run.final.t:.3g} s")
    told = told_beside(run, other.run, other.gap, journey, other.beside.longer, order, feared)
    return peaked(told, other.run, journey, other.beside.longer) if other.beside.longer < 1.0 else told


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
    end, feed, start = run.final.t, beginning.again, beginning.beside(beside)
    if feed is None:
        return _noted(run, f"{_UNCHECKED}: the controller cannot be copied"), None
    changed = replace(journey.plan, model=feed.model, feed=feed, method=beside.method, tolerance=beside.tolerance)
    work = (end - _time(start)) / (end - beginning.t)
    if not isinstance(start, Checkpoint):  # the whole way, of which this run has gone the last part
        work = max(work, run.report.steps / max(run.report.steps - beginning.steps, 1))
    work /= min(beside.longer, 1.0)
    latest = time.perf_counter() + _LONGER * work * run.report.wall_s + _SECONDS

    def ended(share: float) -> None:
        if time.perf_counter() > latest:
            raise KeyboardInterrupt

    spacing = beginning.spacing if len(run.t) > 1 else end  # a run that keeps no rows is compared where it ends
    if isinstance(start, Checkpoint):
        spacing = start.every
    try:
        unwatched = replace(changed, until=end, tell=ended, autosave=None)
        _, other = travelled(unwatched, start, (), InMemory(), spacing)
    except (FlexctrlError, KeyboardInterrupt) as fault:
        return _noted(run, f"{_UNCHECKED}, which ends where it begins ({fault or 'interrupted'})"), None
    first = journey.origin.u
    if len(first) and len(other.u) and other.t[0] == 0.0 and not np.array_equal(first, other.u[0]):
        return _noted(run, f"{_UNCHECKED}: the controller, asked anew, does not begin alike (keep memory in x)"), None
    standing = _standing(run, other.checkpoint)
    if other.final.t <= beginning.t:
        return standing, Other(other, Gap.unseen(run), beside)
    try:
        return standing, Other(other, between(run, other, journey, run.report.steps - beginning.steps), beside)
    except (ArithmeticError, ValueError) as fault:  # numbers of a run that has failed need be none in between
        return _noted(standing, f"{_UNCHECKED}, whose numbers fail ({fault})"), None


def _standing(run: Run, other: Checkpoint) -> Run:
    """The run, with where the other one stands for what goes on from there."""
    origin = run.checkpoint.origin
    others = (*(saved for saved in origin.others if _kind(saved) != _kind(other)), other)
    return replace(run, checkpoint=replace(run.checkpoint, origin=replace(origin, others=others)))


def _noted(run: Run, note: str) -> Run:
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))
