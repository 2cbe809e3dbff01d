"""Steps that end where something happens: where a law of force switches, just before a corner, at an event."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.dynamics.events.crossings import met, offset
from flexctrl.dynamics.events.nearing import (
    ASTRAY,
    LANDINGS,
    LEAD,
    LEAD_MOST,
    MOST,
    SMALLEST,
    TRIES,
    Bracket,
    inside,
    narrow,
    near_enough,
    shorter,
    to_zero,
)
from flexctrl.dynamics.events.watch import Crossing
from flexctrl.dynamics.steps import Brief, Point, StepError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Missed", "landed", "towards"]

_NEAR = 1e-9


class Missed(StepError):
    """A step that was to end where something happens, and did not converge: shorter ones may."""


def landed(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to where the first gauge is zero: on a shorter step that may be another one."""
    for _ in range(LANDINGS):
        after, crossing = _land(journey, before, after, crossing)
        if after is before:
            break
        passed = met(journey.watch, journey.track.curve, before, after)
        ends = (
            c for c in passed if c.gauge != crossing.gauge and journey.watch.stops(c.gauge) and not journey.is_over(c)
        )
        first = next(ends, None)
        if first is None:
            break
        crossing = first
    return after, crossing


def _land(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to where a gauge is zero; where it is at once, there is none.

    Forces may jump at a corner: the step ends just before it, so that one law holds all along.
    """
    corner = crossing.gauge >= len(journey.watch.events) + len(journey.watch.names)
    if corner and not journey.watch.last_word(crossing.gauge):
        return _short_of(journey, before, after, crossing)
    t, h, gauge, watch = before.state.t, after.state.t - before.state.t, crossing.gauge, journey.watch
    bracket, at, last = Bracket(max(t, crossing.low), min(t + h, crossing.high)), crossing.t, None
    for _ in range(LANDINGS):
        if at - t <= SMALLEST * h:
            return before, replace(crossing, t=t)
        try:
            after = journey.step(before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        left = watch.left(after, before, crossing)
        if last is None:
            off = offset(watch, journey.track.curve(before, after), before, after, gauge)
        else:
            off = to_zero(*last, at, left) if abs(left) > watch.dusts[gauge] else 0.0
        if abs(off) <= _NEAR * h:
            break
        narrow(bracket, at, left)
        last = at, left
        at = inside(bracket, at + off)
    return after, replace(crossing, t=after.state.t)


def _short_of(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to just before a corner.

    What lies beyond a stiff one pulls the end of a longer step back onto it, too late and with another speed: only
    an end on the side of the start tells when the corner is. It is where what goes on beyond it is.
    """
    t, h, gauge, watch = before.state.t, after.state.t - before.state.t, crossing.gauge, journey.watch
    lead, dust = max(LEAD * h, 8.0 * math.ulp(t + h)), watch.dusts[gauge]
    bracket, at = Bracket(t, t + h), crossing.t - lead
    found, when, last, back = before, t, None, lead
    for _ in range(MOST):
        if at - t <= SMALLEST * h or bracket.high - bracket.low <= max(LEAD_MOST * h, lead):
            break
        try:
            after = towards(journey, before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        (first, final), end = (before.firm, after.firm), after.state.t
        left = watch.left(final, first, crossing)
        above = left - dust
        off = (
            offset(watch, journey.track.curve(first, final), first, final, gauge)
            if above > 0.0 or last is None
            else 0.0
        )
        on = to_zero(*last, end, above) if last else off
        missed = above > 0.0 and end < at - lead  # no step ends there
        narrow(bracket, end if above > 0.0 else at, above)
        if above <= 0.0:
            last, back = (at, above), 4.0 * back
            at = inside(bracket, at + on - back)
            continue
        bracket.high = at if missed else bracket.high
        found, when, last, back = after, end + (max(off, 0.0) if off < math.inf else 0.0), (end, above), lead
        if near_enough(off * above / left, h, lead, missed):
            break
        at = inside(bracket, end + (off if missed else on) - lead)
    if found is not before and when - found.state.t > ASTRAY * h:
        name = watch.corner_names[gauge - len(watch.events) - len(watch.names)]
        why = f"the longest step that ends short of the corner of {name} leaves {when - found.state.t:.1e} s to it"
        raise Missed(journey.stepper.counts.worst, why)
    return found, replace(crossing, t=when)


def towards(journey: Journey, before: Point, h: float) -> Point:
    """Take a step to a corner, or just short of it: where a force jumps there, no step ends on it.

    Where a march ends nowhere, plain steps hardly ever do, and take a thousand times as long: they are asked last.
    """
    for take in [journey.briefly, journey.exactly] if isinstance(journey.stepper, Brief) else [journey.exactly]:
        for k in range(TRIES):
            journey.interruption.check()  # of a step that ends nowhere there may be hundreds
            try:
                return take(before, h * (1.0 - shorter(k)))
            except StepError as error:
                failure = error
    raise failure
