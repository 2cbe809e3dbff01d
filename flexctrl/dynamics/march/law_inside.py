"""A ride from sample to sample of a controller in the loops."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.jumping import coming
from flexctrl.dynamics.march.guarding import Begun, go_back, next_span
from flexctrl.dynamics.march.law import Sampling
from flexctrl.dynamics.march.legs import Told
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.record import DONE, SILENT
from flexctrl.kernels.native import Packed

if TYPE_CHECKING:
    from flexctrl.dynamics.march.ride import Ride

__all__ = ["told"]

_FIRST, _MORE = 8, 256.0
_SECONDS = 0.02


def told(ride: Ride, deadline: float) -> bool:
    """Go from sample to sample with a controller in the loops; tell whether all is well."""
    j, marcher, mark, stops = ride.journey, ride.marcher, ride.journey.mark, ride.journey.stops
    m, (sampling, law) = marcher.march, marcher.heed(j.plan.feed)
    law.pace, law.last, law.nearly = ride.pace, ride.until + ride.tick, ride.until - ride.tick
    law.room = marcher.room
    paced = ride.pace or ride.paced(m.t, math.inf, ride.until)[0]
    pacing = paced if isinstance(paced, Pacing) else None
    status, wanted, done = DONE, _FIRST, 1
    while status == DONE and done and ride.ahead:
        law.passed, law.legs, law.wanted, law.away = stops.passed, 0, min(wanted, law.room), 0
        if not law.first <= stops.passed < law.first + law.samples:
            law.first, law.samples = sampling.ahead(stops.passed, ride.until)
        sampling.state[:] = ride.supply.x
        began = time.perf_counter()
        status = _asked(ride, law, sampling, pacing and pacing._replace(size=mark.size))
        took = max(time.perf_counter() - began, 1e-9)
        wanted = max(1, int(wanted * min(_MORE, _SECONDS / took)))
        done = m.done
        _enter_told(ride, law, sampling, pacing)
        if mark.left or ride.lookout is not None or ride.over(deadline):
            break
    ride.mute = status == SILENT
    if m.jumping:
        marcher.about_to(coming(j, m.t))
        ride.jumped = status == DONE and marcher.jump(ride.supply.u) == DONE
        m.jumping = 0
    return ride.mute or (ride.well(status) and ride.jumped and done > 0 and not ride.near)


def _asked(ride: Ride, law: Packed, sampling: Sampling, pacing: Pacing | None) -> int:
    """Go from sample to sample, no farther than where the leg starts in which an event may happen."""
    if ride.lookout is None:
        return ride.marcher.sampled(pacing)
    watch, begun, m = ride.journey.watch, Begun.of(ride), ride.marcher.march
    law.wanted = min(watch.span, law.room)
    status = ride.marcher.sampled(pacing)
    table, inputs = _looked_at(ride, law)
    calm, jump = ride.lookout.calm(table, inputs)
    width = 3 + law.inputs + law.states
    ends = np.cumsum(law.told[: law.legs * width].reshape(law.legs, width)[:, 2])
    legs = int(np.searchsorted(ends, min(calm, jump), "right"))
    ride.near = calm < len(table) or jump <= len(table)
    ride.leapt = bool(legs) and int(ends[legs - 1]) == jump
    watch.span = next_span(watch.span, legs, ride.near)
    if legs < law.legs or calm < len(table):
        go_back(ride, begun)
        law.passed, law.legs, law.wanted, law.away = ride.journey.stops.passed, 0, legs, 0
        sampling.state[:], m.jumping, m.done, m.kept = ride.supply.x, 0, 0, 0
        status = ride.marcher.sampled(pacing) if legs else DONE
    ride.lookout.pass_by(*_looked_at(ride, law))
    return status


def _looked_at(ride: Ride, law: Packed) -> tuple[np.ndarray, np.ndarray]:
    """Rows after steps under a law in the loops; inputs before and after each of them."""
    done, inputs = ride.marcher.march.done, law.inputs
    commands = law.rows[: done * inputs].reshape(done, inputs)
    return ride.marcher.rows[:done], np.vstack([ride.supply.u, commands])


def _enter_told(ride: Ride, law: Packed, sampling: Sampling, pacing: Pacing | None) -> None:
    """Enter samples in marks and rows."""
    j, m, mark, inputs = ride.journey, ride.marcher.march, ride.journey.mark, law.inputs
    j.stops.passed = law.passed
    width = 3 + inputs + law.states
    table = law.told[: law.legs * width].reshape(law.legs, width)
    mark.steps += m.done
    mark.size = m.size if pacing is not None else m.h
    mark.left = m.wanted - m.done if ride.pace and law.legs and m.done else 0
    before = ride.supply.u
    ride.supply = Supply(ride.marcher.flattened.flat.u.copy(), sampling.state.copy(), ride.supply.rate)
    if m.done:
        ride.legs.parts.append(Told(ride.supply.rate, table.copy(), inputs, law.period, pacing))
        ride.written(m.done, before, law.rows[: m.done * inputs].reshape(m.done, inputs))
