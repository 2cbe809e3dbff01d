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
from flexctrl.dynamics.events.watch import Crossing, Watch
from flexctrl.dynamics.events.watching import watched
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.interrupt import Interruption
from flexctrl.dynamics.lookahead import look_ahead
from flexctrl.dynamics.march.ride import ride, rides
from flexctrl.dynamics.march.stepper import MarchingStepper, plain_of
from flexctrl.dynamics.methods.explicit import ExplicitRungeKutta
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.methods.midpoint import ConservingMidpoint
from flexctrl.dynamics.notes.adding import Drift
from flexctrl.dynamics.notes.growing import growth
from flexctrl.dynamics.notes.outputs import OutputErrors
from flexctrl.dynamics.notes.straying import lost, thrown
from flexctrl.dynamics.pacing import controlled, fixed
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track
from flexctrl.dynamics.records.record import Unwritten, writing
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.run import Status, Tolerance
from flexctrl.dynamics.steps import (
    Controlled,
    Counts,
    Exact,
    Fixed,
    Integrator,
    Judging,
    Mark,
    Point,
    StepError,
    Stepper,
    Twofold,
    failed_step,
)
from flexctrl.dynamics.stops import Stops
from flexctrl.errors import ControllerError
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Journey", "Plan"]

_FORESEEN = 20_000
_SECONDS = 0.1
_NONE, _NOTHING = Drift(), OutputErrors({})


@dataclass(frozen=True)
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
    told : float
        Events up to this time have been told by the run that this one goes on from [s].
    balked : bool
        Whether many steps at once have just ended before one that is to be taken by itself.
    horizon : float
        Until when the law is known to follow a line, with what it reads held [s]; infinity if nothing is in sight.
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
    events: list[Occurrence] = field(default_factory=list)
    status: Status = Status.FINISHED
    message: str = ""
    fault: BaseException | None = None
    notes: tuple[str, ...] = ()
    drift: Drift = _NONE
    outputs: OutputErrors = _NOTHING
    told: float = -math.inf
    balked: bool = False
    horizon: float = math.inf
    saved: Checkpoint | None = None
    _memory: Any = None
    _counts: Counts = field(default_factory=Counts)
    _told: float = 0.0
    _kept: float = 0.0
    _seen: tuple[int, float] = (0, 0.0)

    def travel(self) -> None:
        """Go on to the end, or as far as it goes."""
        self._pause()
        began = self.point
        try:
            with Interruption() as interruption:
                self._through_stops(interruption)
        except KeyboardInterrupt:
            self.status, self.message = Status.INTERRUPTED, f"interrupted at t = {self.point.state.t:.6g} s"
        except (ControllerError, EventError, Unwritten) as error:
            self.fail(error)
        except (ArithmeticError, ValueError) as error:
            failure = self._failure(error, self.point)
            self.stepper.counts.worst = failure.worst
            worst = self.plan.model.coordinates[failure.worst]
            self.status, self.message = Status.FAILED, f"{failure}; worst freedom: {worst}"
        self.saved = self.saved or self.snapshot()
        self.books.close(self.point)
        self._judge()
        if self.status in (Status.FINISHED, Status.STOPPED):
            self._look_for_growth(began)

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

    def _taken(self, step: Callable[[Any, float], Any], point: Any, h: float) -> Any:
        try:
            return step(point, h)
        except StepError:
            raise
        except (ArithmeticError, ValueError) as error:
            raise self._failure(error, point) from error

    def _failure(self, error: Exception, point: Any) -> StepError:
        return failed_step(error, self.stepper.counts.worst, point.state.t)

    def fail(self, error: Exception) -> None:
        """End as failed, for what is no fault of the step."""
        self.status, self.message = Status.FAILED, f"{error} (t = {self.point.state.t:.6g} s)"
        self.fault = error.__cause__

    def _judge(self) -> None:
        """Hold an end by the clock or by an event against the books; others are told what these say beside."""
        if self.status in (Status.FINISHED, Status.STOPPED) and (unresolved := self.books.unresolved):
            ended = f" (it would have ended: {self.message})" if self.message else ""
            self.status = Status.FAILED
            self.message = f"{unresolved} at t = {self.point.state.t:.6g} s{ended}; {self._remedy}"
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

    @property
    def tick(self) -> float:
        """What times are told apart by [s]."""
        return 1e-12 * self.plan.until

    def _through_stops(self, interruption: Interruption) -> None:
        end, self._told = self.plan.until - self.tick, time.perf_counter()
        self._kept = self._told
        while self.status is Status.FINISHED:
            if (t := self.point.state.t) >= end:
                return
            look_ahead(self)
            if (stop := self.stops.next) - t <= self.tick:
                self._renew(stop)
                self._pause()
                continue
            self.go(stop, self.plan.until)
            self._pause()
            if apart := self.plan.model.apart(self.point.state):
                raise StepError(self.stepper.counts.worst, f"{apart} (t = {self.point.state.t:.6g} s)")
            if self.books.overflown:
                where = f"at t = {self.point.state.t:.6g} s; look at the commands and at the start"
                raise StepError(self.stepper.counts.worst, f"energies are beyond all numbers {where}")
            if nonsense := self.books.nonsense:
                where = f"at t = {self.point.state.t:.6g} s; {self._remedy}"
                raise StepError(self.stepper.counts.worst, f"{nonsense} {where}")
            self._look_back()
            if (now := time.perf_counter()) - self._told > _SECONDS:
                self._told = now
                self.plan.tell(self.point.state.t / self.plan.until)
                self._foresee()
            if self.plan.autosave is not None and now - self._kept > self.plan.autosave.seconds:
                self._kept = now
                self._keep(self.plan.autosave.path)
            interruption.check()

    def _look_back(self) -> None:
        """Raise StepError where a loop has thrown the machine away: chosen steps would be ever more and shorter."""
        where, remedy = f"at t = {self.point.state.t:.6g} s", "look at signs and gains of the controller"
        if lost(self):
            gone = f"{where} a part has gone so far that no number tells the shape of the machine any more"
            raise StepError(self.stepper.counts.worst, f"the loop is not stable: {gone}; {remedy}")
        if isinstance(self.plan.method.pace, Controlled) and (worst := thrown(self)) is not None:
            gone = f"{where} a part has gone a million times the size of the machine, ever faster"
            raise StepError(worst, f"the loop is not stable: {gone}; {remedy}, or end the run before")

    def _pause(self) -> None:
        """Take note of what later steps depend on, and what they have cost so far."""
        self._memory, self._counts = self.stepper.memory, replace(self.stepper.counts)

    def go(self, stop: float, until: float, most: int | None = None) -> None:
        """Go on towards a stop, by many steps at once (``most`` of them) or by one, not passing ``until``."""
        if not self.balked and ride(self, until, most):
            return
        if isinstance(self.plan.method.pace, Fixed):
            fixed(self, stop, until)
        else:
            controlled(self, stop, until)
        self.balked = False

    @property
    def _remedy(self) -> str:
        """What to do where steps of this length make energy."""
        pace, method = self.plan.method.pace, self.plan.method
        if isinstance(method, Richardson):
            finer = f"steps smaller than {pace.step:g} s" if isinstance(pace, Fixed) else "a smaller Tolerance"
            return f"the coarser of the two runs of Richardson no longer follows the motion: take {finer}"
        if isinstance(method, ExplicitRungeKutta):
            return "stiff parts are for implicit methods: take AdaptiveAlpha, or GeneralizedAlpha(step)"
        if not isinstance(pace, Fixed):
            return "give a smaller Tolerance"
        smaller = f"take steps smaller than {pace.step:g} s, or AdaptiveAlpha, which finds them"
        motion, switches = self.plan.model.motion, self.plan.model.switches
        if isinstance(method, ConservingMidpoint) or motion.flows.size or switches.names or self.books.sums.lost:
            return smaller
        return f"{smaller}, or ConservingMidpoint({pace.step:g}), which keeps energies of springs in such steps"

    @property
    def glance(self) -> float:
        """After how long at most a run looks at the clock on the wall [s]."""
        autosave = self.plan.autosave
        return _SECONDS if autosave is None else min(_SECONDS, autosave.seconds)

    def _keep(self, path: str | Path) -> None:
        """Write a checkpoint of where the run stands, and all rows until there."""
        self.rows.recorder.flush()
        with writing(path):
            (self.saved or self.snapshot()).save(path)

    def _foresee(self) -> None:
        """Raise StepError if the run would take more steps than it may, at the pace of the latter half of them."""
        pace, steps, t = self.plan.method.pace, self.mark.steps, self.point.state.t
        before, since = self._seen
        if not isinstance(pace, Controlled) or steps < max(_FORESEEN, 2 * before):
            return
        self._seen = steps, t
        mean = (t - since) / (steps - before)
        left = (self.plan.until - t) / mean if mean > 0.0 else math.inf
        if before and steps + left > pace.most:
            raise StepError(
                self.stepper.counts.worst,
                f"steps are {mean:.1e} s long on average at t = {t:.6g} s: {left:.1e} more of them to "
                f"{self.plan.until:g} s; look for rates beyond what is meant, stiff parts or a contact that chatters, "
                f"give a larger Tolerance or a shorter run, or allow them with most_steps (now {pace.most:g})",
            )

    def snapshot(self) -> Checkpoint:
        """Return where the run stands."""
        return Checkpoint(
            machine_of(self.plan.model),
            repr(self.plan.method),
            self.plan.method.pace,
            self.plan.tolerance,
            self.plan.feed.base,
            self.plan.feed.told_law,
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
        )

    def _renew(self, stop: float) -> None:
        """New inputs at a sample instant or break; accelerations jump with them."""
        if self.point.state.t != stop:
            self.point = replace(self.point, state=self.point.state.with_(t=stop))
        self.stops.go_by(stop)
        self.mark.left = 0
        feed, before, state = self.plan.feed, self.point.supply, self.point.state
        fresh = feed.restart(state, before) if feed.continuous else feed.sample(state, before)
        if np.array_equal(fresh.u, before.u):
            several, point = self.stepper, self.point
            self.point = several.fed(point, fresh) if isinstance(several, Twofold) else replace(point, supply=fresh)
        else:
            self._jump(fresh, self.coming(stop))
        if not self.watch.idle and not np.array_equal(fresh.u, before.u):
            self.leapt()
        self.rows.here(self.point, 1e-6 * self.mark.size)

    def _jump(self, fresh: Supply, step: float) -> None:
        """Let the inputs jump, as a ride does where steps are marched, with a step about to be taken."""
        stepper, held, leapt = self.stepper, self.point, None
        if isinstance(stepper, MarchingStepper) and self.plan.model.switches.names and rides(self):
            leapt = stepper.leap(held, fresh, step)
            stepper = stepper.plain
        if leapt is None:
            held = replace(held, state=self.under(fresh.u))
            leapt = stepper.renew(held, fresh, step)
        self.point = leapt
        self.books.jump(held, leapt, step)

    def coming(self, t: float) -> float:
        """Return the length of the step after a stop, which is over."""
        pace, left = self.plan.method.pace, self.stops.next - t
        if not isinstance(pace, Fixed):
            return self.mark.size
        return left / max(1, math.ceil(left / pace.step - 1e-6)) if math.isfinite(left) else pace.step

    def under(self, u: np.ndarray) -> State:
        """Return the state under inputs that have jumped; note what breaks loose with them."""
        switches, state = self.plan.model.switches, self.point.state
        torn = switches.under(state, u)
        loose = (switches.phases(state) == STUCK) & (switches.phases(torn) != STUCK)
        for switch in np.flatnonzero(loose):
            self.happens(Crossing(state.t, len(self.watch.events) + int(switch), True), state, u)
        return torn

    def leapt(self) -> None:
        """Note the events that a jump of the inputs has brought about; one of them may end the run."""
        watch, point = self.watch, self.point
        leaps = watch.leaps(point)
        for crossing in leaps:
            watch.reach(crossing)
        leaps = [crossing for crossing in leaps if not self.is_over(crossing)]
        for crossing in leaps:
            self.happens(crossing, point.state, point.supply.u)
        self.end_by(leaps, point.state.t)
        watch.settle(point)

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

    def happens(self, crossing: Crossing, state: State, u: np.ndarray) -> None:
        """Note an event, unless that has been done."""
        if crossing.t > self.told:
            self.events.append(self.watch.occurrence(crossing, state, u))

    def tell(self, event: Occurrence) -> None:
        """Note what has happened on the way of many steps, unless that has been done."""
        if event.t > self.told:
            self.events.append(event)
