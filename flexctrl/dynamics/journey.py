"""A run under way: steps of a method from stop to stop, with books, events and records."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from flexctrl.dynamics.checkpoint import Autosave, Checkpoint, machine_of
from flexctrl.dynamics.events.event import EventError, Occurrence
from flexctrl.dynamics.events.switching import beyond
from flexctrl.dynamics.events.watch import TOGETHER, Crossing, Watch
from flexctrl.dynamics.events.watching import watched
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.interrupt import Interruption
from flexctrl.dynamics.lookahead import look_ahead
from flexctrl.dynamics.losing import foresee, look_back, remedy
from flexctrl.dynamics.march.ride import ride
from flexctrl.dynamics.march.stepper import plain_of
from flexctrl.dynamics.notes.adding import Drift
from flexctrl.dynamics.notes.growing import growth
from flexctrl.dynamics.notes.outputs import OutputErrors
from flexctrl.dynamics.origin import Origin
from flexctrl.dynamics.pacing import controlled, fixed
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track
from flexctrl.dynamics.records.record import Unwritten, writing
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.records.tensions import Interval
from flexctrl.dynamics.renewing import renew
from flexctrl.dynamics.run import Status, Tolerance
from flexctrl.dynamics.said import FAULTS
from flexctrl.dynamics.steps import (
    Brief,
    Counts,
    Exact,
    Fixed,
    Integrator,
    Judging,
    Mark,
    Point,
    StepError,
    Stepper,
    failed_step,
)
from flexctrl.dynamics.stops import Stops
from flexctrl.dynamics.unheld import bare, needed
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen
from flexctrl.model.modal_region import beyond_modes
from flexctrl.model.model import Model
from flexctrl.model.overturned import bent, overturned, twirled
from flexctrl.model.places import wandered
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Journey", "Plan"]

_SECONDS, _AHEAD = 0.1, 10.0
_NONE, _NOTHING, _UNREAD = Drift(), OutputErrors({}), np.zeros(0)


@frozen
class Plan:
    """What a run is to do.

    Attributes
    ----------
    model : Plant
    feed : Feed
    method : Integrator
    tolerance : Tolerance
    until : float
    tell : callable
        Told the share done, now and then.
    autosave : Autosave or None
    began : float
        Wall-clock time [s].
    """

    model: Plant
    feed: Feed
    method: Integrator
    tolerance: Tolerance
    until: float
    tell: Callable[[float], None]
    autosave: Autosave | None
    began: float


@dataclass
class Journey:
    """One run under way.

    Attributes
    ----------
    plan : Plan
    stepper : Stepper
    point : Point
    stops : Stops
    books : Books
    watch : Watch
    rows : Rows
    track : Track
    mark : Mark
    origin : Origin
        Where the whole run began.
    bent : str
        What is to be said of elements that are bent far at either end.
    begin : float
        When this part of the run began [s].
    told : float
        Events up to this time have been told by the run that this one goes on from [s].
    balked : bool
        Whether many steps at once have just ended before one that is to be taken by itself.
    crumbled : int
        Into how many pieces steps of one length have fallen apart, one after the other.
    horizon : float
        Until when the law is known to follow a line, with what it reads held [s]; infinity if nothing is in sight.
    seen : tuple of int and float
        How many steps had been taken when their number was last foreseen, and when that was [s].
    read : tuple of Point or None and numpy.ndarray
        Where compiled loops have read outputs last, and these.
    interruption : Interruption
        Whether Ctrl-C has been pressed.
    """

    plan: Plan
    stepper: Stepper[Any]
    point: Any
    stops: Stops
    books: Books
    watch: Watch
    rows: Rows
    track: Track
    mark: Mark
    origin: Origin
    events: list[Occurrence] = field(default_factory=list)
    status: Status = Status.FINISHED
    message: str = ""
    fault: BaseException | None = None
    notes: tuple[str, ...] = ()
    drift: Drift = _NONE
    outputs: OutputErrors = _NOTHING
    bent: str = ""
    begin: float = 0.0
    told: float = -math.inf
    balked: bool = False
    crumbled: int = 0
    horizon: float = math.inf
    seen: tuple[int, float] = (0, 0.0)
    saved: Checkpoint | None = None
    read: tuple[Any, np.ndarray] = (None, _UNREAD)
    interruption: Interruption = field(default_factory=Interruption)
    _memory: Any = None
    _counts: Counts = field(default_factory=Counts)
    _told: float = 0.0
    _kept: float = 0.0

    def travel(self) -> None:
        """Go on to the end, or as far as it goes."""
        self.pause()
        began = self.point
        try:
            with self.interruption:
                self._through_stops()
                self.interruption.check()  # it may have been pressed in the last step
        except KeyboardInterrupt:
            self.status, self.message = Status.INTERRUPTED, f"interrupted at t = {self.point.state.t:.6g} s"
        except (ControllerError, EventError, Unwritten) as error:
            self.fail(error)
        except (ArithmeticError, ValueError) as error:
            failure = self._failure(error, self.point)
            self.stepper.counts.worst = failure.worst
            model, worst = self.plan.model, failure.worst
            remedy = f"; {needed(model, worst)}" if bare(model, worst) else ""
            where = f"worst freedom: {model.coordinates[worst]}{remedy}"
            self.status, self.message = Status.FAILED, f"{self._cause(str(failure))}; {where}"
        self.saved = self.saved or self.snapshot()
        self.books.close(self.point)
        try:
            self._judge()
            if self.status in (Status.FINISHED, Status.STOPPED):
                self._look_for_growth(began)
                self._look_at_parts(began.state)
        except KeyboardInterrupt:
            self.status, self.message = Status.INTERRUPTED, f"interrupted at t = {self.point.state.t:.6g} s"

    @cached_property
    def judging(self) -> Judging[Any] | None:
        """What tells local errors of steps; None where a linear model is integrated exactly."""
        plain = plain_of(self.stepper)
        return plain if isinstance(plain, Judging) else None

    def step(self, point: Any, h: float) -> Any:
        """Return the point a step later.

        Raises
        ------
        StepError
            If it does not converge, or its numbers fail on the way.
        """
        return self._taken(self.stepper.step, point, h)

    def exactly(self, point: Any, h: float) -> Any:
        """Return the point a step later, solved to the last digits where that can be: whether it ends before a corner.

        Raises
        ------
        StepError
            As `step` does.
        """
        stepper = self.stepper
        return self._taken(stepper.exactly if isinstance(stepper, Exact) else stepper.step, point, h)

    def briefly(self, point: Any, h: float) -> Any:
        """Return the point a step later, solved to the last digits by a march alone.

        Raises
        ------
        StepError
            As `step` does, and where there is no march.
        """
        stepper = self.stepper
        return self._taken(stepper.briefly if isinstance(stepper, Brief) else stepper.step, point, h)

    def _taken(self, step: Callable[[Any, float], Any], point: Any, h: float) -> Any:
        try:
            return step(point, h)
        except StepError:
            raise
        except (ArithmeticError, ValueError) as error:
            raise self._failure(error, point) from error

    def _failure(self, error: Exception, point: Any) -> StepError:
        return failed_step(error, self.stepper.counts.worst, point.state.t)

    def _cause(self, failure: str) -> str:
        """What has failed, and an element that is turned too far, which no smaller step helps."""
        model = self.plan.model
        turned = overturned(model, self.point.state) if isinstance(model, Model) else ""
        return f"at t = {self.point.state.t:.6g} s {turned} ({failure})" if turned else failure

    def fail(self, error: Exception) -> None:
        """End as failed, for what is no fault of the step."""
        come = where = f"t = {self.point.state.t:.6g} s"
        if isinstance(error, ControllerError) and error.asked is not None:
            where = f"t = {error.asked:.6g} s"
        ahead = f"; the run had come to {come}" if where != come else ""
        self.status, self.message = Status.FAILED, f"{error} ({where}{ahead})"
        self.fault = error.__cause__

    def _tell_progress(self) -> None:
        try:
            self.plan.tell(self.point.state.t / self.plan.until)
        except FAULTS as error:
            raise Unwritten(f"progress raised {type(error).__name__}: {error}") from error

    def _judge(self) -> None:
        """Hold an end by the clock or by an event against the books; others are told what these say beside."""
        if self.status in (Status.FINISHED, Status.STOPPED) and (unresolved := self.books.unresolved):
            ended = f" (it would have ended: {self.message})" if self.message else ""
            self.status = Status.FAILED
            self.message = self._cause(f"{unresolved} at t = {self.point.state.t:.6g} s{ended}; {remedy(self)}")
        elif self.status is not Status.FAILED:
            self.notes += self.books.doubts

    def _look_for_growth(self, began: Any) -> None:
        """Tell of a loop that grows and that steps do not see grow: as a failure, where that is so all the time."""
        try:
            found = growth(self, (began.state, began.supply))
        except (ControllerError, ArithmeticError, ValueError) as error:  # beside where it was, a law may say nothing
            self.notes += (f"whether the loop grows could not be told: {error}",)
            return
        if found is not None and found.missed:
            self.status, self.message = Status.FAILED, str(found)
        elif found is not None:
            self.notes += (str(found),)

    def _look_at_parts(self, began: State) -> None:
        """Tell of what bends far, passes half a turn in a step or leaves its modes, where the run begins or ends."""
        model, size = self.plan.model, self.point.state.t / max(self.mark.steps, 1)
        if isinstance(model, Model):
            ends = (began, self.point.state)
            self.bent = bent(model, ends)
            modal, turning = beyond_modes(model, ends, self.books.sums.moved), twirled(model, ends, size)
            said = (turning, self.bent, modal, wandered(model, *ends))
            self.notes += tuple(note for note in said if note)

    @property
    def tick(self) -> float:
        """What times are told apart by [s]."""
        return 1e-12 * self.plan.until

    def _through_stops(self) -> None:
        end, self._told = self.plan.until - self.tick, time.perf_counter()
        self._kept = self._told
        while self.status is Status.FINISHED:
            if (t := self.point.state.t) >= end:
                return
            look_ahead(self)
            if (stop := self.stops.next) - t <= self.tick:
                renew(self, stop)
                self.pause()
                continue
            self.go(stop, self.plan.until)
            self.pause()
            look_back(self)
            if (now := time.perf_counter()) - self._told > _SECONDS:
                self._told = now
                self._tell_progress()
                foresee(self)
            if self.plan.autosave is not None and now - self._kept > self.plan.autosave.seconds:
                self._kept = now
                self._keep(self.plan.autosave.path)
            self.interruption.check()

    def pause(self) -> None:
        """Take note of what later steps depend on, and what they have cost so far."""
        self._memory, self._counts = self.stepper.memory, replace(self.stepper.counts)

    def go(self, stop: float, until: float, most: int | None = None) -> None:
        """Go on towards a stop, by many steps at once (``most`` of them) or by one, not passing ``until``."""
        if not self.balked and ride(self, until, most):
            return
        begun = self.snapshot()
        try:
            if isinstance(self.plan.method.pace, Fixed):
                fixed(self, stop, until)
            else:
                controlled(self, stop, until)
        except KeyboardInterrupt:  # a step in pieces is taken again as a whole
            self.saved = self.saved or begun
            raise
        self.balked = False

    @property
    def glance(self) -> float:
        """After how long at most a run looks at the clock on the wall [s]."""
        autosave = self.plan.autosave
        return _SECONDS if autosave is None else min(_SECONDS, autosave.seconds)

    def _keep(self, path: str | Path) -> None:
        """Write a checkpoint of where the run stands, and all rows until there."""
        self.rows.recorder.flush()
        with writing(path):
            (self.saved or self.snapshot()).put(path)

    def snapshot(self) -> Checkpoint:
        """Return where the run stands."""
        return Checkpoint(
            machine_of(self.plan.model),
            repr(self.plan.method),
            self.plan.method.pace,
            self.plan.tolerance,
            self.plan.feed.base,
            self.plan.feed.told_law,
            self.watch.told,
            self.point,
            self._memory,
            self.stops.passed,
            self.stops.found,
            replace(self.mark),
            self.rows.count,
            self.rows.every,
            replace(self.books.sums, moved=self.books.sums.moved.copy()),
            self.books.first,
            self.watch.sides.copy(),
            self.watch.sizes.copy(),
            self.watch.span,
            self._counts,
            self.told,
            self.balked,
            self.read_here,
            self.origin,
        )

    @property
    def read_here(self) -> np.ndarray:
        """What compiled loops have read where the run stands, at a sample that is due; empty if they have not."""
        return self.read[1] if self.read[0] is self.point else _UNREAD

    @property
    def outputs_here(self) -> np.ndarray:
        """The outputs where the run stands, as what has come there has read them."""
        return read if (read := self.read_here).size else self.plan.model.measure(self.point.state)

    def end_by(self, crossings: Sequence[Crossing], t: float) -> None:
        """End the run if any of what happens at an instant ends it; say which do."""
        watch = self.watch
        if ends := [end for c in crossings if watch.stops(c.gauge) and (end := watch.last_word(c.gauge))]:
            self.status, self.message = Status.STOPPED, f"{' and '.join(ends)} at t = {t:.6g} s"

    def accept(self, after: Point, stop: float) -> None:
        """Enter a step in the books, rows and track, up to where something ended it."""
        before, corner = self.point, None
        if not self.watch.idle:
            after, corner = watched(self, before, after)
            if after.state.t == before.state.t:
                self.point = after if corner is None else beyond(self, after, corner)
                return
        curve = self.track.curve(before, after)
        if self.books.looking and self.judging is not None:
            missed = self.judging.missed(before, after)
            self.books.miss(missed, after, after.state.t - before.state.t)
        self.books.enter(before, after, curve)
        self.point = after
        self.mark.steps += 1
        self.track.keep((after.state,), before, after)
        self.rows.within(before, after, stop - after.state.t <= self.tick)
        if corner is not None:
            self.point = beyond(self, after, corner)

    def is_over(self, crossing: Crossing) -> bool:
        """Tell whether an event asked for has been told, or is beyond the end."""
        return crossing.gauge < len(self.watch.events) and crossing.t <= self.told

    def happens(self, crossing: Crossing, state: State, u: np.ndarray, interval: Interval | None = None) -> None:
        """Note an event, unless that has been done, in a state that may be within a step."""
        if crossing.t > self.told and not self._just_told(crossing):
            self.events.append(self.watch.occurrence(crossing, state, u, interval))

    def _just_told(self, crossing: Crossing) -> bool:
        """Whether an event asked for has been told ahead, with what the step before ended at."""
        if crossing.gauge >= len(self.watch.events):
            return False
        name = self.watch.events[crossing.gauge].name
        last = next((e.t for e in reversed(self.events) if e.name == name), -np.inf)
        return last <= self.point.state.t and abs(crossing.t - last) <= _AHEAD * TOGETHER * self.mark.size

    def tell(self, event: Occurrence) -> None:
        """Note what has happened on the way of many steps, unless that has been done."""
        if event.t > self.told:
            self.events.append(event)
