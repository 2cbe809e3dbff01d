"""Events in a ride: steps up to the first one in which something may happen, taken again from where they began.

That one is taken in the loops too, as if nothing were looked for, and looked at closely from outside. Only where the
run ends in it is it left to a plain step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexctrl.dynamics.events.foresight import calm_steps
from flexctrl.dynamics.march.lookout import FAR, Lookout
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.onlooking import looked_at
from flexctrl.dynamics.march.spoken import straight_steps
from flexctrl.dynamics.march.stepper import Memory
from flexctrl.dynamics.records.books import Sums

if TYPE_CHECKING:
    from flexctrl.dynamics.march.ride import Ride

__all__ = ["EVENT", "Begun", "go_back", "guarded", "next_span", "warily"]

FEWEST, _WIDEST = 8, 1024
"""Steps that are looked at together."""
_SHYEST = 4
"""After so many tries of no use a law is left to plain steps, 15 of them, before the next."""
EVENT = -1
"""How a march ends where an event may be near."""


class Begun(NamedTuple):
    """Where a leg started: what it takes to take its steps again, and what had been counted."""

    point: Any
    memory: Memory
    sums: Sums
    due: float
    newton: int
    factorisations: int
    rejected: int
    h: float
    follow: int
    cap: float
    led: float
    taken: float

    @classmethod
    def of(cls, ride: Ride) -> Begun:
        """Return where a ride is."""
        m, marcher = ride.marcher.march, ride.marcher
        point, sums = ride.stepper.leave(ride.supply), marcher.books(ride.journey.books.sums)
        counted = m.newton, m.factorisations, m.rejected
        return cls(point, ride.stepper.memory, sums, m.due, *counted, m.h, m.follow, m.cap, m.led, m.taken)


def guarded(ride: Ride, lookout: Lookout, pacing: float | Pacing, count: int) -> tuple[int, int]:
    """Take steps up to the first one in which an event may happen, whatever there is beyond that."""
    begun, u = Begun.of(ride), ride.supply.u
    ride.marcher.march.turned = 0.0
    status, done = ride.marcher.travel(pacing, count)
    few = done < FEWEST and ride.marcher.march.turned <= FAR
    if few and lookout.passes(0, done, begun.point.state.t, ride.marcher.rows, u.tolist()):
        return status, done
    calm, _ = lookout.calm(ride.marcher.rows[:done], np.tile(u, (done + 1, 1)))
    if calm < done:
        go_back(ride, begun)
        status, done = (EVENT, ride.marcher.travel(pacing, calm)[1]) if calm else watched(ride, begun, pacing)
        lookout.sides_of(ride.journey.watch)
    lookout.pass_by(ride.marcher.rows[:done], np.tile(u, (done + 1, 1)))
    return status, done


def warily(ride: Ride, pacing: float | Pacing, count: int) -> tuple[int, int]:
    """Take steps up to the first one in which an event may happen; return how it ended, and how many there were.

    What is looked at does not depend on the end of the run: a run that goes on looks at the same.
    """
    j, watch, begun, t = ride.journey, ride.journey.watch, Begun.of(ride), ride.marcher.march.t
    spoken = j.plan.feed.spoken
    if j.stops.next - t < FEWEST * j.mark.size:
        if spoken:
            return EVENT, 0
        return watched(ride, begun, pacing) if t + j.mark.size <= ride.until + ride.tick else (EVENT, 0)
    sizes, span = watch.sizes.copy(), watch.span
    ride.marcher.march.turned = 0.0
    status, done = ride.marcher.travel(pacing, min(count, span))
    calm = _calm(ride, begun, done)
    fitting = int(np.searchsorted(ride.marcher.rows[:done, 0], ride.until + ride.tick, "right"))
    looked = min(calm, fitting)
    if spoken and (straight := straight_steps(ride, begun, looked)) < looked:
        calm = straight
    if fitting < calm and j.saved is None:
        j.saved = replace(j.snapshot(), sizes=sizes, span=span)
    if fitting or not done:  # else it is looked at again by a run that goes on
        watch.span = next_span(span, calm, calm < done)
        if spoken:
            j.mark.doubts = 0 if calm else min(j.mark.doubts + 1, _SHYEST)
            j.mark.plain = j.mark.steps + 2**j.mark.doubts - 1
    wanted = ride.limited(min(calm, fitting))
    if wanted == done:
        return status, done
    go_back(ride, begun)
    if wanted:
        return EVENT, ride.marcher.travel(pacing, wanted)[1]
    return watched(ride, begun, pacing) if fitting and not spoken else (EVENT, 0)


def _calm(ride: Ride, begun: Begun, done: int) -> int:
    """How many of the steps just taken are over before an event may happen."""
    watch = ride.journey.watch
    if not watch.events:
        return done
    if ride.marcher.march.turned > FAR:
        return 0
    within = ride.stepper.within(begun.point, ride.journey.mark.size)
    inputs = ride.inputs(begun.point.state.t, done)
    return calm_steps(watch, begun.point, ride.marcher.rows[:done], inputs, within)


def next_span(span: int, calm: int, near: bool) -> int:
    """Return at how many steps (or samples) is looked next, after ``calm`` ones of a span before something was near."""
    return max(FEWEST, 2 * calm) if near else min(_WIDEST, 2 * span)


def watched(ride: Ride, begun: Begun, pacing: float | Pacing) -> tuple[int, int]:
    """Take one step and note the events in it; none where it is to be taken by itself, as the run may end in it."""
    status, done, clear = looked_at(ride, begun.point, pacing)
    if clear:
        return status, done
    go_back(ride, begun)
    return EVENT, 0


def go_back(ride: Ride, begun: Begun) -> None:
    """Go back to where a leg started."""
    m, books = ride.marcher.march, ride.journey.books
    keeping, spacing = bool(m.keeping), m.spacing
    m.factorisations = begun.factorisations
    ride.stepper.recall(begun.memory)
    ride.stepper.enter(begun.point)
    m.newton, m.rejected, m.size, m.h = begun.newton, begun.rejected, ride.journey.mark.size, begun.h
    ride.marcher.open(books.first, begun.sums.moved, books.dissipates)
    ride.marcher.go_on(begun.sums)
    ride.marcher.watch(ride.journey.watch.corner_sides, begun.point.state)
    m.follow, m.cap, m.led, m.taken = begun.follow, begun.cap, begun.led, begun.taken
    ride.marcher.keep(keeping, begun.due, spacing)
