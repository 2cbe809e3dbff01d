"""Many steps of a run at once, where its method marches: from sample to sample of a controller too.

A ride does what `Journey` does step by step: it stops at samples, lets the inputs jump, and fills books, rows,
frames and track. States between are not kept; the track makes them by riding again when it is asked for them.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexctrl.dynamics.books import Sums
from flexctrl.dynamics.dense import Dense
from flexctrl.dynamics.events import Crossing
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.foresight import calm_steps
from flexctrl.dynamics.march.law import Sampling
from flexctrl.dynamics.march.legs import Held, Leg, Legs, Opened, Told, same
from flexctrl.dynamics.march.lookout import FAR, Lookout
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.record import DONE, SILENT, TURN, TURNED
from flexctrl.dynamics.march.stepper import MarchingStepper, Memory
from flexctrl.dynamics.march.weaving import Weaver
from flexctrl.dynamics.settling import weightless
from flexctrl.dynamics.steps import Controlled, Fixed
from flexctrl.dynamics.switching import beyond
from flexctrl.errors import ControllerError
from flexctrl.kernels.native import Packed

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ride"]

_NEAR = 1e-9
_SECONDS = 0.1
_FIRST = 8
_MORE = 256.0
_SHARE = 0.2
_FAR = 100.0
_FEWEST, _WIDEST = 8, 1024
_EVENT = -1  # how a march ends where an event may be near


def ride(journey: Journey, until: float, most: int | None = None) -> bool:
    """Take as many steps of a run as can be marched, for about a tenth of a second; tell whether there were any.

    They do not go beyond ``until``; where ``most`` is given, there are no more than that, all before the next stop.

    Between samples only, where some freedom has no mass: the march has no rule for how its place jumps.
    """
    stepper, plan = journey.stepper, journey.plan
    if not isinstance(stepper, MarchingStepper):
        return False
    if journey.watch.events and _near_stop(journey) and (most is not None or not _looked_out(journey)):
        return False
    if plan.feed.sample_time and weightless(plan.model).size:
        return False
    return _Ride(journey, stepper, until, most).go()


def _near_stop(journey: Journey) -> bool:
    """Tell whether there are so few steps to the next stop that events are better looked for in each of them."""
    return journey.stops.next - journey.point.state.t < _FEWEST * journey.mark.size


def _looked_out(journey: Journey) -> bool:
    """Tell whether events can be looked for from sample to sample of a controller."""
    return bool(journey.plan.feed.sample_time) and not isinstance(journey.stepper, Dense)


class Begun(NamedTuple):
    """Where a leg started: what it takes to take its steps again, and what had been counted."""

    point: Any
    memory: Memory
    sums: Sums
    due: float
    newton: int
    factorisations: int
    rejected: int


class _Ride:
    """A ride under way."""

    def __init__(self, journey: Journey, stepper: MarchingStepper, until: float, most: int | None) -> None:
        j = self.journey = journey
        self.stepper, self.marcher, self.supply = stepper, stepper.marcher, j.point.supply
        self.tick, self.until, self.most = 1e-12 * j.plan.until, until, most
        self.faults: list[ControllerError | KeyboardInterrupt] = []
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
        self.mute, self.wary, self.balked = False, bool(j.watch.events), False
        self.turn: Crossing | None = None

    def go(self) -> bool:
        """Ride on from stop to stop."""
        deadline, m = time.perf_counter() + _SECONDS, self.marcher.march
        well = True
        while well and m.t < self.until - self.tick:
            stop = self.journey.stops.next
            # samples are not the clock's business: they are taken here
            if (self.lookout is not None or not self.wary) and stop - m.t <= self.tick:
                well = self._renew(stop)
                continue
            if self.legs.parts and time.perf_counter() >= deadline:
                break
            if self.lookout is None and (self.wary or self.most):
                well = stop - m.t > self.tick and self._leg(stop)
                break
            if self._lowered(stop):
                well = self._told(deadline)
            elif self._even(stop):
                well = self._samples(deadline)
            else:
                well = self._leg(stop)
            if self.near and not self.legs.parts:  # up to the very step
                well = self._leg(stop)
        some = self._end()
        if self.faults:
            raise self.faults[0]
        return some

    def _leg(self, stop: float) -> bool:
        """Go on towards a stop; tell whether all is well."""
        t = self.marcher.march.t
        far = self.wary and self.lookout is None
        pacing, count = self._paced(t, stop, _FAR * self.until if far else self.until)
        if not count:
            return False
        status, done = self._travel(pacing, count)
        if isinstance(pacing, Pacing):
            self.journey.mark.size = self.marcher.march.size
        if done:
            self._passed(Leg(self.supply, t, pacing, done), stop)
        return self._well(status) and done > 0

    def _travel(self, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take steps; return how they ended, and how many there were."""
        if self.lookout is not None:
            return self._guarded(self.lookout, pacing, count)
        return self._wary(pacing, count) if self.wary else self.marcher.travel(pacing, self._limited(count))

    def _guarded(self, lookout: Lookout, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take steps up to the first one in which an event may happen, whatever there is beyond that."""
        begun, u = self._begun(), self.supply.u
        self.marcher.march.turned = 0.0
        status, done = self.marcher.travel(pacing, count)
        few = done < _FEWEST and self.marcher.march.turned <= FAR
        if few and lookout.passes(0, done, begun.point.state.t, self.marcher.rows, u.tolist()):
            return status, done
        calm, _ = lookout.calm(self.marcher.rows[:done], np.tile(u, (done + 1, 1)))
        if calm < done:
            self._back(begun)
            status, done = _EVENT, self.marcher.travel(pacing, calm)[1] if calm else 0
        lookout.pass_by(self.marcher.rows[:done], np.tile(u, (done + 1, 1)))
        return status, done

    def _limited(self, count: int) -> int:
        return count if self.most is None else min(count, self.most)

    def _well(self, status: int) -> bool:
        """Tell whether a march ended well; the step before which it did not is then to be taken by itself."""
        self.balked = status not in (DONE, SILENT, TURNED, TURN, _EVENT)
        if status in (TURNED, TURN):
            corner = self._met()
            self.turn = corner if status == TURN else None
        return status == DONE or (status == TURNED and self._on_steps == (not self.marcher.march.keeping))

    @property
    def _on_steps(self) -> bool:
        """Whether rows are due at the ends of steps only."""
        j = self.journey
        return j.rows.on_steps(j.plan.method.pace, j.plan.feed.sample_time, self.marcher.march.t)

    def _met(self) -> Crossing:
        """Tell of the corner beyond which the march goes on."""
        watch, m = self.journey.watch, self.marcher.march
        corner = watch.corner(m.corners.which, m.corners.when, bool(m.corners.sides[m.corners.which] > 0.0))
        watch.cross(corner)
        self.journey.tell(watch.named(corner, self.marcher.rows[m.done - 1, 1:], self.supply.u))
        return corner

    def _wary(self, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take steps up to the first one in which an event may happen; return how it ended, and how many there were.

        What is looked at does not depend on the end of the run: a run that goes on looks at the same.
        """
        j, watch, begun = self.journey, self.journey.watch, self._begun()
        sizes, span = watch.sizes.copy(), watch.span
        self.marcher.march.turned = 0.0
        status, done = self.marcher.travel(pacing, min(count, span))
        far = self.marcher.march.turned > FAR
        calm = 0 if far else calm_steps(watch, begun.point, self.marcher.rows[:done], self.supply.u)
        watch.span = min(_WIDEST, 2 * span) if calm == done else max(_FEWEST, 2 * calm)
        fitting = int(np.searchsorted(self.marcher.rows[:done, 0], self.until + self.tick, "right"))
        if fitting < calm and j.saved is None:
            j.saved = replace(j.snapshot(), sizes=sizes, span=span)
        wanted = self._limited(min(calm, fitting))
        if wanted == done:
            return status, done
        self._back(begun)
        return _EVENT, self.marcher.travel(pacing, wanted)[1] if wanted else 0

    def _begun(self) -> Begun:
        m, j = self.marcher.march, self.journey
        point = self.stepper.leave(self.supply)
        sums = self.marcher.books(j.books.sums)
        return Begun(point, self.stepper.memory, sums, m.due, m.newton, m.factorisations, m.rejected)

    def _back(self, begun: Begun) -> None:
        """Go back to where a leg started."""
        m, books = self.marcher.march, self.journey.books
        keeping, spacing = bool(m.keeping), m.spacing
        m.factorisations = begun.factorisations
        self.stepper.recall(begun.memory)
        self.stepper.enter(begun.point)
        m.newton, m.rejected, m.size = begun.newton, begun.rejected, self.journey.mark.size
        self.marcher.open(books.first, begun.sums.moved, books.dissipates)
        self.marcher.go_on(begun.sums)
        self.marcher.watch(self.journey.watch.corner_sides, begun.point.state)
        self.marcher.follow(self.journey.mark)
        self.marcher.keep(keeping, begun.due, spacing)

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
    def _ahead(self) -> bool:
        """Whether there is another sample to go to."""
        end = self.until + self.tick
        return self.journey.stops.next <= end and self.marcher.march.t < self.until - self.tick

    def _told(self, deadline: float) -> bool:
        """Go from sample to sample with a controller in the loops; tell whether all is well."""
        j, marcher, mark, stops = self.journey, self.marcher, self.journey.mark, self.journey.stops
        m, (sampling, law) = marcher.march, marcher.heed(j.plan.feed)
        law.pace, law.last, law.nearly = self.pace, self.until + self.tick, self.until - self.tick
        law.room = marcher.room
        paced = self.pace or self._paced(m.t, math.inf, self.until)[0]
        pacing = paced if isinstance(paced, Pacing) else None
        status, wanted, done = DONE, _FIRST, 1
        while status == DONE and done and self._ahead:
            law.passed, law.legs, law.wanted, law.away = stops.passed, 0, min(wanted, law.room), 0
            if not law.first <= stops.passed < law.first + law.samples:
                law.first, law.samples = sampling.ahead(stops.passed, self.until)
            sampling.state[:] = self.supply.x
            began = time.perf_counter()
            status = self._asked(law, sampling, pacing and pacing._replace(size=mark.size))
            took = max(time.perf_counter() - began, 1e-9)
            wanted = max(1, int(wanted * min(_MORE, _SHARE * _SECONDS / took)))
            done = m.done
            self._enter_told(law, sampling, pacing)
            if mark.left or self.lookout is not None or time.perf_counter() >= deadline:
                break
        self.mute = status == SILENT
        if m.jumping:
            self.jumped = status == DONE and marcher.jump(self.supply.u) == DONE
            m.jumping = 0
        return self.mute or (self._well(status) and self.jumped and done > 0 and not self.near)

    def _asked(self, law: Packed, sampling: Sampling, pacing: Pacing | None) -> int:
        """Go from sample to sample, no farther than where the leg starts in which an event may happen."""
        if self.lookout is None:
            return self.marcher.sampled(pacing)
        watch, begun, m = self.journey.watch, self._begun(), self.marcher.march
        law.wanted = min(watch.span, law.room)
        status = self.marcher.sampled(pacing)
        table, inputs = self._looked_at(law)
        calm, jump = self.lookout.calm(table, inputs)
        width = 3 + law.inputs + law.states
        ends = np.cumsum(law.told[: law.legs * width].reshape(law.legs, width)[:, 2])
        legs = int(np.searchsorted(ends, min(calm, jump), "right"))
        self.near = calm < len(table) or jump <= len(table)
        self.leapt = bool(legs) and int(ends[legs - 1]) == jump
        watch.span = max(_FEWEST, 2 * legs) if self.near else min(_WIDEST, 2 * watch.span)
        if legs < law.legs or calm < len(table):
            self._back(begun)
            law.passed, law.legs, law.wanted, law.away = self.journey.stops.passed, 0, legs, 0
            sampling.state[:], m.jumping, m.done, m.kept = self.supply.x, 0, 0, 0
            status = self.marcher.sampled(pacing) if legs else DONE
        self.lookout.pass_by(*self._looked_at(law))
        return status

    def _looked_at(self, law: Packed) -> tuple[np.ndarray, np.ndarray]:
        """Rows after steps under a law in the loops; inputs before and after each of them."""
        done, inputs = self.marcher.march.done, law.inputs
        commands = law.rows[: done * inputs].reshape(done, inputs)
        return self.marcher.rows[:done], np.vstack([self.supply.u, commands])

    def _enter_told(self, law: Packed, sampling: Sampling, pacing: Pacing | None) -> None:
        """Enter samples in marks and rows."""
        j, m, mark, inputs = self.journey, self.marcher.march, self.journey.mark, law.inputs
        j.stops.passed = law.passed
        width = 3 + inputs + law.states
        table = law.told[: law.legs * width].reshape(law.legs, width)
        mark.steps += m.done
        mark.size = m.size if pacing is not None else m.h
        mark.left = m.wanted - m.done if self.pace and law.legs and m.done else 0
        before = self.supply.u
        self.supply = Supply(self.marcher.flattened.flat.u.copy(), sampling.state.copy(), self.supply.rate)
        if m.done:
            self.legs.parts.append(Told(self.supply.rate, table.copy(), inputs, law.period, pacing))
            self._written(m.done, before, law.rows[: m.done * inputs].reshape(m.done, inputs))

    def _written(self, done: int, before: np.ndarray, commands: np.ndarray) -> None:
        """Write rows after samples: inputs before, and in force from each step's end on."""
        rows, table = self.journey.rows, self.marcher.rows[:done]
        if self.weaver is not None:
            rows.between(self.weaver, table, np.vstack([before, commands]), False)
        else:
            rows.sampled(table, commands, self.marcher.states(), 1e-6 * self.journey.mark.size)

    def _even(self, stop: float) -> bool:
        """Tell whether steps of one length go to a sample from where the last one was taken."""
        mark = self.journey.mark
        if not self.pace or not self.journey.plan.feed.sample_time:
            return False
        fits = stop <= self.until + self.tick and (stop - self.marcher.march.t) / self.pace < self.marcher.room
        return fits and mark.left == 0 and self._woven

    def _samples(self, deadline: float) -> bool:
        """Go from sample to sample while there is room for rows; tell whether all is well.

        With a controller at every step this is most of a run, so what is done for a sample is done here at once.
        """
        marcher, stops, mark = self.marcher, self.journey.stops, self.journey.mark
        last, nearly, pace, room = self.until + self.tick, self.until - self.tick, self.pace, marcher.room
        told, reads, sample = self.journey.plan.feed.told, self.journey.plan.feed.reads, stops.sample
        clock, steps, times, y = marcher.clock, marcher.steps, marcher.times, marcher.readings
        held, first = Held(self.supply.rate, []), self.supply.u
        t, h, u, x, done, status = clock[0], mark.size, self.supply.u.tolist(), self.supply.x, 0, DONE
        turned = marcher.march.cell("turned")
        begun, lookout = None if self.lookout is None else self._begun(), self.lookout
        marcher.begin()
        while True:
            stop = (stops.passed + 1) * sample
            count = math.ceil((stop - t) / pace - 1e-6) or 1
            wanted = done + count
            if wanted > room or stop > last:
                break
            h, start = (stop - t) / count, done
            turned[0] = 0.0
            status = marcher.on(h, wanted)
            done = steps[0]
            far = lookout is not None and turned[0] > FAR
            if lookout is not None and (far or not lookout.passes(start, done, t, marcher.rows, u)):
                assert begun is not None
                self.near, status, done = True, self._again(begun, held, u), start
                break
            if done > start:
                held.samples.append((t, h, done - start, u, x))
            if status != DONE or done < wanted or stop >= nearly:
                mark.left = wanted - done
                break
            t = clock[0] = times[done - 1] = stop
            stops.passed += 1
            before = u
            try:
                u, x = told(stop, x, y[done - 1].take(reads))
            except (ControllerError, KeyboardInterrupt) as fault:
                self.faults.append(fault)
                break
            if u != before:
                marcher.jumps(u)
            if lookout is not None and lookout.leaps(marcher.rows[done - 1], u):
                self.near = self.leapt = True
                break
            if time.perf_counter() >= deadline:
                break
        h = held.samples[-1][1] if self.near and held.samples else mark.size if self.near else h
        mark.size, self.supply = h, Supply(np.array(u), x, held.rate)
        return self._sampled(held, first, done, status)

    def _sampled(self, held: Held, first: np.ndarray, done: int, status: int) -> bool:
        """Enter samples in marks and rows, and let the inputs jump if they are about to; tell whether all is well."""
        marcher, m, mark = self.marcher, self.marcher.march, self.journey.mark
        mark.steps += done
        if done:
            self.legs.parts.append(held)
            self._written(done, first, held.commands(self.supply.u))
        if m.jumping:
            self.jumped = status == DONE and marcher.jump(self.supply.u) == DONE
            m.jumping = 0
            mark.left = 0
        return self._well(status) and self.jumped and not self.faults and not self.near

    def _again(self, begun: Begun, held: Held, u: list[float]) -> int:
        """Take the steps of samples again, up to where others inputs ``u`` are in force; return how that ended."""
        marcher, wanted, status, now = self.marcher, 0, DONE, self.supply.u.tolist()
        self._back(begun)
        marcher.march.jumping = 0
        marcher.begin()
        for t, h, steps, told, _ in held.samples:
            if wanted:
                marcher.clock[0] = marcher.times[wanted - 1] = t
            if told != now:
                marcher.jumps(told)
            wanted, now = wanted + steps, told
            status = marcher.on(h, wanted)
            if status != DONE:
                return status
        if wanted:
            marcher.clock[0] = marcher.times[wanted - 1] = self.journey.stops.passed * self.journey.stops.sample
        if u != now:
            marcher.jumps(u)
        return status

    def _paced(self, t: float, stop: float, until: float) -> tuple[float | Pacing, int]:
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
        if self.weaver is not None:
            inputs = np.tile(leg.supply.u, (leg.steps + 1, 1))
            rows.between(self.weaver, marcher.rows[: leg.steps], inputs, to_jump)
            return
        states = marcher.states()
        rows.ridden(self.last, marcher.rows[: leg.steps], states, leg.supply, to_jump)
        self.last = states[-1] if len(states) == leg.steps else self.last

    def _renew(self, stop: float) -> bool:
        """Take a sample and let the inputs jump."""
        j, m = self.journey, self.marcher.march
        m.t = stop
        if abs(self.last.t - stop) < self.tick:
            self.last = self.last.with_(t=stop)
        j.stops.passed += 1
        j.mark.left = 0
        y = self.marcher.rows[m.done - 1, 1:]
        feed, before = j.plan.feed, self.supply
        try:
            self.supply = feed.sampled(stop, y[feed.reads], before)
        except (ControllerError, KeyboardInterrupt) as fault:
            self.faults.append(fault)
            return False
        u = self.supply.u
        if self.weaver is not None:
            self.weaver.at(stop)
        written = j.rows.row(stop, y, u, 1e-6 * j.mark.size)
        if written and self.weaver is not None:
            j.rows.drawn(self.weaver.last)
        elif written and abs(self.last.t - stop) < self.tick:
            j.rows.frame(self.last)
        self.jumped = same(u, before.u) or self.marcher.jump(u) == DONE
        self.leapt = self.lookout is not None and self.lookout.leaps(self.marcher.rows[m.done - 1], u.tolist())
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
        j.balked, j.mark.stuck = self.balked, 0
        self.legs.end = j.point = self.stepper.leave(self.supply)
        j.books.sums = self.marcher.books(j.books.sums)
        j.track.remember(self.legs)
        if not j.watch.idle and not self.leapt:
            j.watch.settle(j.point)
        if self.turn is not None:
            j.point = beyond(j, j.point, self.turn)
        if self.leapt:
            j.leapt()
        if not self.jumped:
            held = replace(j.point, state=j.under(self.supply.u))
            j.point = self.stepper.plain.renew(held, self.supply, j.mark.size)
        return True
