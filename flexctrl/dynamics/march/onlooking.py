"""One step of a ride, looked at closely for events: taken in the loops as if nothing were looked for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flexctrl.dynamics.events.crossings import crossings, offset
from flexctrl.dynamics.events.event import Direction, EventError
from flexctrl.dynamics.events.watch import TOGETHER, Crossing, Watch
from flexctrl.dynamics.march.record import TURN, TURNED
from flexctrl.dynamics.records.dense import Dense
from flexctrl.dynamics.records.tensions import Interval

if TYPE_CHECKING:
    from flexctrl.dynamics.march.marching import Pacing
    from flexctrl.dynamics.march.ride import Ride

__all__ = ["looked_at"]


def looked_at(ride: Ride, before: Any, pacing: float | Pacing) -> tuple[int, int, bool]:
    """Take a step and note the events in it.

    Returns
    -------
    status, done : int
        How it ended, and whether there was one.
    clear : bool
        Whether that is all: the run does not end in it, nor does a function of signals fail.
    """
    status, done, after = _step(ride, before, pacing)
    if not done:
        return status, 0, True
    j, watch = ride.journey, ride.journey.watch.onlooking
    curve = j.track.curve(before, after)
    try:
        found = crossings(watch, curve, before, after, j.rows.every)
        told, ended = [(c, curve.at(c.t)) for c in found], []
        if status in (TURNED, TURN):
            ended = [c for c in _at_corner(ride, watch, before, after) if c.gauge not in _gauges(found)]
        if any(watch.stops(c.gauge) and not j.is_over(c) for c in (*found, *ended)):
            return status, done, False
        for crossing in found:  # where a step goes back over one that is not told of, it ends on the other side
            watch.cross(crossing)
        watch.settle(after)
    except EventError:
        return status, done, False
    interval = Interval(before.state, after.state, curve.seen)
    for crossing in ended:
        watch.cross(crossing)
    for crossing, state in (*told, *((c, after.state) for c in ended)):
        j.happens(crossing, state, before.supply.u, interval)
    count = len(watch.events)
    j.watch.sides[:count], j.watch.sizes[:count] = watch.sides, watch.sizes
    return status, done, True


def _gauges(found: list[Crossing]) -> set[int]:
    return {c.gauge for c in found}


def _step(ride: Ride, before: Any, pacing: float | Pacing) -> tuple[int, int, Any]:
    """Take a step; return how it ended, whether there was one, and its end: before what may be a corner."""
    marcher, m = ride.marcher, ride.marcher.march
    if isinstance(ride.stepper, Dense):
        status, done = marcher.travel(pacing, 1)
        return status, done, ride.stepper.leave(ride.supply)
    keeping, due = m.keeping, m.due
    m.keeping = 1
    status, done = marcher.travel(pacing, 1)
    m.keeping = keeping
    if not done:
        return status, 0, before
    after = replace(before, state=marcher.states()[0], supply=marcher.supplied(ride.supply))
    if not keeping and after.state.t < due:
        m.kept, m.due = 0, due
    return status, done, after


def _at_corner(ride: Ride, watch: Watch, before: Any, after: Any) -> list[Crossing]:
    """Events at the very corner that ended a step, which it ends just before: they happen with it."""
    curve, corners, found = ride.journey.track.curve(before, after), ride.marcher.march.corners, []
    for gauge, direction in enumerate(watch.directions):
        rising = watch.sides[gauge] < 0.0
        missed = Direction.FALLING if rising else Direction.RISING
        if watch.sides[gauge] == 0.0 or direction is missed:
            continue
        if 0.0 <= offset(watch, curve, before, after, gauge) <= TOGETHER * ride.journey.mark.size:
            found.append(Crossing(corners.when, gauge, bool(rising)))
    return found
