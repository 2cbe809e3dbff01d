"""Many steps of a run at once, where its method marches: from sample to sample of a controller too.

A ride does what `Journey` does step by step: it stops at samples, lets the inputs jump, and fills books, rows,
frames and track. States between are not kept; the track makes them by riding again when it is asked for them.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.events.switching import beyond
from flexctrl.dynamics.events.watch import Crossing
from flexctrl.dynamics.inputs import Stepwise
from flexctrl.dynamics.jumping import coming, leapt, torn
from flexctrl.dynamics.march.guarding import EVENT, guarded, warily
from flexctrl.dynamics.march.law_inside import told
from flexctrl.dynamics.march.law_outside import samples
from flexctrl.dynamics.march.legs import Leg, Legs, Opened, same
from flexctrl.dynamics.march.lookout import Lookout
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.record import DONE, SILENT, TURN, TURNED
from flexctrl.dynamics.march.stepper import MarchingStepper
from flexctrl.dynamics.march.weaving import Weaver
from flexctrl.dynamics.records.dense import Dense
from flexctrl.dynamics.steps import Controlled, Fixed
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.errors import ControllerError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ride", "rides"]

_NEAR = 1e-9
_STEPS = 1000
"""Of a ride, from which on another one begins: it is done again as a whole."""
_SECONDS = 0.1
_FAR = 100.0


def ride(journey: Journey, until: float, most: int | None = None) -> bool:
    """Take as many steps of a run as can be marched, until the clock is looked at; tell whether there were any.

    They do not go beyond ``until``; where ``most`` is given, there are no more than that, all before the next stop.

    Between samples only, where some freedom has no mass: the march has no rule for how its place jumps.
    """
    stepper = journey.stepper
    if not isinstance(stepper, MarchingStepper) or not rides(journey):
        return False
    return Ride(journey, stepper, until, most).go()


def rides(journey: Journey) -> bool:
    """Tell whether steps that can be marched are."""
    feed = journey.plan.feed
    left_alone = journey.mark.steps < journey.mark.plain
    if feed.spoken and (journey.point.supply.slid or journey.horizon < math.inf or left_alone):
        return False
    return not (feed.sample_time and weightless(journey.plan.model).size)


def _looked_out(journey: Journey) -> bool:
    """Tell whether events can be looked for from sample to sample of a controller."""
    return bool(journey.plan.feed.sample_time) and not isinstance(journey.stepper, Dense)


class Ride:
    """A ride under way."""

    def __init__(self, journey: Journey, stepper: MarchingStepper, until: float, most: int | None) -> None:
        j = self.journey = journey
        self.stepper, self.marcher, self.supply = stepper, stepper.marcher, j.point.supply
        self.tick, self.until, self.most = 1e-12 * j.plan.until, until, most
        self.faults: list[BaseException] = []
        stepper.enter(j.point)
        sums = j.books.sums
        books = Opened(j.books.first, replace(sums), j.books.dissipates, j.watch.corner_sides.copy())
        self.legs = Legs(stepper, j.point, stepper.memory, books, replace(j.mark))
        self.marcher.about_to(j.mark.size)
        self.marcher.open(j.books.first, sums.moved, j.books.dissipates)
        self.marcher.go_on(sums)
        self.marcher.watch(j.watch.corner_sides, j.point.state)
        self.marcher.follow(j.mark)
        guarded = bool(j.watch.events) and most is None and _looked_out(j)
        self.marcher.keep(guarded or not self._on_steps, *j.rows.due())
        self.weaver: Weaver | None = None
        if self.marcher.march.keeping and not isinstance(stepper, Dense):
            self.weaver = self.marcher.weaver
            self.weaver.set_out(j.point.state)
        turns = self.marcher.march.turns * self.marcher.march.weight
        self.lookout = (
            Lookout(j.watch, self.weaver, j.point.state, turns) if guarded and self.weaver is not None else None
        )
        self.near = self.leapt = False
        pace = j.plan.method.pace
        self.pace = pace.step if isinstance(pace, Fixed) else 0.0
        self.last, self.rejected, self.jumped = j.point.state, self.marcher.march.rejected, True
        self.mute, self.balked = False, False
        self.wary = bool(j.watch.events) or j.plan.feed.spoken
        self.turn: Crossing | None = None

    def go(self) -> bool:
        """Ride on from stop to stop."""
        deadline, m = time.perf_counter() + min(_SECONDS, self.journey.glance), self.marcher.march
        well, taken, parts = True, 0, 0
        while well and m.t < self.until - self.tick:
            stop = self.journey.stops.next
            # samples are not the clock's business: they are taken here
            if (self.lookout is not None or not self.wary) and stop - m.t <= self.tick:
                well = self._renew(stop)
                continue
            taken += sum(part.steps for part in self.legs.parts[parts:])
            parts = len(self.legs.parts)
            if parts and (taken >= _STEPS or self.over(deadline)):
                break
            if self.lookout is None and (self.wary or self.most):
                well = stop - m.t > self.tick and self._leg(stop)
                if well and not self.most and stop - m.t <= self.tick and m.t < self.until - self.tick:
                    self._renew(stop)
                break
            if self._lowered(stop):
                well = told(self, deadline)
            elif self._even(stop):
                well = samples(self, deadline)
            else:
                well = self._leg(stop)
            if self.near and not self.legs.parts:  # up to the very step, and over it
                self.near = False
                well = self._leg(stop)
        some = self._end()
        if self.faults:
            self.journey.pause()  # where it stands now is what a run goes on from
            raise self.faults[0]
        return some

    def over(self, deadline: float) -> bool:
        """Tell whether it is time to end the ride, or Ctrl-C has been pressed."""
        return self.journey.interruption.asked or time.perf_counter() >= deadline

    def _leg(self, stop: float) -> bool:
        """Go on towards a stop; tell whether all is well."""
        t = self.marcher.march.t
        far = self.wary and self.lookout is None
        pacing, count = self.paced(t, stop, _FAR * self.until if far else self.until)
        if not count:
            return False
        status, done = self._travel(pacing, count)
        self.faults += self.marcher.faults()
        if isinstance(pacing, Pacing):
            self.journey.mark.size = self.marcher.march.size
        if done:
            self._passed(Leg(self.supply, t, pacing, done), stop)
            self.supply = self.marcher.supplied(self.supply)
        return self.well(status) and done > 0

    def _travel(self, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take steps; return how they ended, and how many there were."""
        if self.lookout is not None:
            return guarded(self, self.lookout, pacing, count)
        return warily(self, pacing, count) if self.wary else self.marcher.travel(pacing, self.limited(count))

    def inputs(self, t: float, done: int) -> np.ndarray:
        """Return the inputs where steps started, at a time, and after each of them."""
        rows = self.marcher.rows[:done]
        after = self.marcher.inputs(self.supply, t, done).at(np.arange(done), np.ones(done, dtype=bool), rows)
        return np.vstack([self.supply.u, after])

    def limited(self, count: int) -> int:
        return count if self.most is None else min(count, self.most)

    def well(self, status: int) -> bool:
        """Tell whether a march ended well; the step before which it did not is then to be taken by itself."""
        self.balked = status not in (DONE, SILENT, TURNED, TURN, EVENT)
        if status in (TURNED, TURN):
            corner = self._met()
            self.turn = corner if status == TURN else None
        if self.marcher.march.absurd:
            return False
        return status == DONE or (status == TURNED and self._on_steps == (not self.marcher.march.keeping))

    @property
    def _on_steps(self) -> bool:
        """Whether rows are due at the ends of steps only."""
        j = self.journey
        return j.rows.on_steps(j.plan.method.pace, j.plan.feed.sample_time, self.marcher.march.t)

    def _met(self) -> Crossing:
        """Tell of the corner beyond which the march goes on, and of those met with it."""
        watch, m = self.journey.watch, self.marcher.march
        c = m.corners
        turned = np.flatnonzero(c.sides != watch.corner_sides).tolist()
        met = {k: watch.corner(k, c.when, bool(c.sides[k] > 0.0)) for k in turned}
        self.last = self.stepper.leave(self.supply).state  # as a ride that begins here does
        if self.weaver is not None:
            self.weaver.set_out(self.last)
        for corner in met.values():
            watch.cross(corner)
            self.journey.tell(watch.named(corner, self.marcher.rows[m.done - 1, 1:], self.supply.u))
        return met[c.which]

    def _lowered(self, stop: float) -> bool:
        """Tell whether the controller can be asked by the loops themselves from here on."""
        feed = self.journey.plan.feed
        if feed.lowered is None or self.mute or stop > self.until + self.tick:
            return False
        return self._even(stop) if self.pace else self._woven

    @property
    def _woven(self) -> bool:
        """Whether rows are at the ends of steps, or there is who finds them in between."""
        return self.weaver is not None or not self.marcher.march.keeping

    @property
    def ahead(self) -> bool:
        """Whether there is another sample to go to."""
        end = self.until + self.tick
        return self.journey.stops.next <= end and self.marcher.march.t < self.until - self.tick

    def written(self, done: int, before: np.ndarray, commands: np.ndarray) -> None:
        """Write rows after samples: inputs before, and in force from each step's end on."""
        rows, table = self.journey.rows, self.marcher.rows[:done]
        to_jump = self.journey.stops.next - table[-1, 0] <= self.tick  # at the end of the run
        if self.weaver is not None:
            rows.between(self.weaver, table, Stepwise(np.vstack([before, commands])), to_jump)
            return
        states, kept = self.marcher.states(), done - to_jump
        states = states.picked(slice(kept)) if len(states) == done else states
        if kept:
            rows.sampled(table[:kept], commands[:kept], states, 1e-6 * self.journey.mark.size)

    def _even(self, stop: float) -> bool:
        """Tell whether steps of one length go to a sample from where the last one was taken."""
        mark = self.journey.mark
        if not self.pace or not self.journey.plan.feed.sample_time:
            return False
        fits = stop <= self.until + self.tick and (stop - self.marcher.march.t) / self.pace < self.marcher.room
        return fits and mark.left == 0 and self._woven

    def paced(self, t: float, stop: float, until: float) -> tuple[float | Pacing, int]:
        """How steps are taken from here, and how many at most."""
        plan, mark = self.journey.plan, self.journey.mark
        pace, room = plan.method.pace, self.marcher.room
        if isinstance(pace, Controlled):
            tolerance = plan.tolerance
            return Pacing(mark.size, pace.largest, stop, until, tolerance.relative, tolerance.absolute), room
        if not mark.left:
            count = max(1, math.ceil((stop - t) / pace.step - 1e-6)) if math.isfinite(stop) else 0
            mark.size, mark.left = (stop - t) / count if count else pace.step, count or -1
        room = min(room, math.floor((until - t) / mark.size + _NEAR))
        return mark.size, room if mark.left < 0 else min(room, mark.left)

    def _passed(self, leg: Leg, stop: float) -> None:
        """Enter a leg in marks and rows."""
        marcher, mark, rows = self.marcher, self.journey.mark, self.journey.rows
        self.legs.parts.append(leg)
        mark.steps += leg.steps
        mark.left -= leg.steps if mark.left > 0 else 0
        to_jump = stop - marcher.march.t <= self.tick
        if to_jump:
            marcher.rows[leg.steps - 1, 0] = stop
        inputs = marcher.inputs(leg.supply, leg.t, leg.steps)
        if self.weaver is not None:
            rows.between(self.weaver, marcher.rows[: leg.steps], inputs, to_jump)
            return
        states = marcher.states()
        rows.ridden(self.last, marcher.rows[: leg.steps], states, leg.supply, inputs, to_jump)
        self.last = states.newest if len(states) == leg.steps else self.last

    def _renew(self, stop: float) -> bool:
        """Take a sample, or pass a break of a continuous command, and let the inputs jump."""
        j, m = self.journey, self.marcher.march
        m.t = stop
        if abs(self.last.t - stop) < self.tick:
            self.last = self.last.with_(t=stop)
        j.mark.left = 0
        y = self.marcher.rows[m.done - 1, 1:]
        feed, before = j.plan.feed, self.supply
        try:
            self.supply = feed.renewed(stop, y[feed.reads], before)
        except (ControllerError, KeyboardInterrupt) as fault:
            self.faults.append(fault)
            return False
        j.stops.passed += 1
        u = self.supply.u
        if self.weaver is not None:
            self.weaver.at(stop)
        written = j.rows.row(stop, y, u, 1e-6 * j.mark.size)
        if written and self.weaver is not None:
            j.rows.drawn(self.weaver.last)
        elif written and abs(self.last.t - stop) < self.tick:
            j.rows.frame(self.last)
        self.marcher.about_to(coming(j, stop))
        self.jumped = same(u, before.u) or self.marcher.jump(u) == DONE
        self.marcher.under(self.supply)
        if self.lookout is None:
            self.leapt = self.wary and not same(u, before.u)
        else:
            self.leapt = self.lookout.leaps(self.marcher.rows[m.done - 1], u.tolist(), True)
        return self.jumped and not self.leapt

    def _end(self) -> bool:
        """Hand over to the journey; tell whether there were any steps."""
        j, m = self.journey, self.marcher.march
        self.stepper.count()
        self.marcher.watch_no_more()
        j.mark.rejected += m.rejected - self.rejected
        j.mark.follow, j.mark.cap, j.mark.led = m.follow, m.cap, m.led
        if not self.legs.parts:
            return False
        j.balked, j.mark.stuck, j.mark.taken = self.balked, 0, m.taken
        self.legs.end = j.point = self.stepper.leave(self.supply)
        if m.done and abs(j.stops.next - m.t) <= self.tick:  # as read at this sample by a ride that goes on
            j.read = j.point, self.marcher.rows[m.done - 1, 1:].copy()
        j.books.sums = self.marcher.books(j.books.sums)
        j.track.remember(self.legs)
        if not self.leapt:
            j.watch.settle_laws(j.point)
        if self.turn is not None:
            j.point = beyond(j, j.point, self.turn)
        if self.leapt:
            leapt(j)
        if not self.jumped:
            ahead = coming(j, j.point.state.t)  # not the last step: that hangs on where a run is cut
            j.point = torn(j, self.stepper, self.supply, ahead)[1]
            j.books.turn(j.point, ahead)
        return True
