"""A ride from sample to sample of a controller in Python."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.jumping import coming
from flexctrl.dynamics.march.guarding import Begun, go_back
from flexctrl.dynamics.march.legs import Held
from flexctrl.dynamics.march.lookout import FAR
from flexctrl.dynamics.march.record import DONE
from flexctrl.errors import ControllerError

if TYPE_CHECKING:
    from flexctrl.dynamics.march.ride import Ride

__all__ = ["samples"]

_AT_ONCE = 1000
"""Steps from one look at the clock to the next, if these are several samples': asking a law takes longer than that."""


def samples(ride: Ride, deadline: float) -> bool:
    """Go from sample to sample while there is room for rows; tell whether all is well.

    With a controller at every step this is most of a run, so what is done for a sample is done here at once.
    """
    marcher, stops, mark = ride.marcher, ride.journey.stops, ride.journey.mark
    last, nearly, pace, room = ride.until + ride.tick, ride.until - ride.tick, ride.pace, marcher.room
    told, reads, sample = ride.journey.plan.feed.told, ride.journey.plan.feed.reads, stops.sample
    clock, steps, times, y = marcher.clock, marcher.steps, marcher.times, marcher.readings
    held, first = Held(ride.supply.rate, []), ride.supply.u
    t, h, u, x, done, status = clock[0], mark.size, ride.supply.u.tolist(), ride.supply.x, 0, DONE
    turned = marcher.march.cell("turned")
    begun, lookout = None if ride.lookout is None else Begun.of(ride), ride.lookout
    marcher.begin()
    while True:
        stop = (stops.passed + 1) * sample
        count = math.ceil((stop - t) / pace - 1e-6) or 1
        wanted = done + count
        if wanted > (min(room, _AT_ONCE) if done else room) or stop > last:
            break
        h, start = (stop - t) / count, done
        turned[0] = 0.0
        status = marcher.on(h, wanted)
        done = steps[0]
        far = lookout is not None and turned[0] > FAR
        if lookout is not None and (far or not lookout.passes(start, done, t, marcher.rows, u)):
            assert begun is not None
            ride.near, status, done = True, _again(ride, begun, held, u), start
            break
        if done > start:
            held.samples.append((t, h, done - start, u, x))
        if status == DONE and done == wanted:
            times[done - 1] = stop
        if status != DONE or done < wanted or stop >= nearly:
            mark.left = wanted - done
            break
        t = clock[0] = stop
        before = u
        try:
            u, x = told(stop, x, y[done - 1].take(reads))
        except (ControllerError, KeyboardInterrupt) as fault:
            ride.faults.append(fault)
            break
        stops.passed += 1
        if u != before:
            marcher.jumps(u)
        if lookout is not None and lookout.leaps(marcher.rows[done - 1], u, False):
            ride.near = ride.leapt = True
            break
        if ride.over(deadline):
            break
    h = held.samples[-1][1] if ride.near and held.samples else mark.size if ride.near else h
    mark.size, ride.supply = h, Supply(np.array(u), x, held.rate)
    return _sampled(ride, held, first, done, status)


def _sampled(ride: Ride, held: Held, first: np.ndarray, done: int, status: int) -> bool:
    """Enter samples in marks and rows, and let the inputs jump if they are about to; tell whether all is well."""
    marcher, m, mark = ride.marcher, ride.marcher.march, ride.journey.mark
    mark.steps += done
    if done:
        ride.legs.parts.append(held)
        ride.written(done, first, held.commands(ride.supply.u))
    if m.jumping:
        marcher.about_to(coming(ride.journey, m.t))
        ride.jumped = status == DONE and marcher.jump(ride.supply.u) == DONE
        m.jumping = 0
        mark.left = 0
    return ride.well(status) and ride.jumped and not ride.faults and not ride.near


def _again(ride: Ride, begun: Begun, held: Held, u: list[float]) -> int:
    """Take the steps of samples again, up to where others inputs ``u`` are in force; return how that ended."""
    marcher, wanted, status, now = ride.marcher, 0, DONE, ride.supply.u.tolist()
    go_back(ride, begun)
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
        marcher.clock[0] = marcher.times[wanted - 1] = ride.journey.stops.passed * ride.journey.stops.sample
    if u != now:
        marcher.jumps(u)
    return status
