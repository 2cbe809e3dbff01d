"""Steps that end where something happens: where a law of force switches, just before a corner, at an event."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.dynamics.events import Crossing
from flexctrl.dynamics.steps import Point, StepError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["SHORTEST", "SMALLEST", "Missed", "landed"]

SMALLEST = 1e-12
SHORTEST = 1e-3  # of a run: before that a step may be shorter than those that the clock resolves later
_NEAR = 1e-9
_LANDINGS, _LANDINGS_MOST = 12, 60
_SHORT = (0.0, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2, 0.05, 0.2, 0.5)
_LEAD, _LEAD_MOST, _LEAD_FAR = 1e-8, 1e-7, 1e-4


class Missed(StepError):
    """A step that was to end where something happens, and did not converge: shorter ones may."""


def landed(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to where the first gauge is zero: on a shorter step that may be another one."""
    for _ in range(_LANDINGS):
        after, crossing = _land(journey, before, after, crossing)
        if after is before:
            break
        passed = journey.watch.crossings(journey.track.curve(before, after), before, after)
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
    t, h, gauge, at = before.state.t, after.state.t - before.state.t, crossing.gauge, crossing.t
    low, high = t, t + h
    for _ in range(_LANDINGS):
        if at - t <= SMALLEST * h:
            return before, replace(crossing, t=t)
        try:
            after = journey.stepper.step(before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        off = journey.watch.offset(journey.track.curve(before, after), before, after, gauge)
        if abs(off) <= _NEAR * h:
            break
        left = journey.watch.sides[gauge] * journey.watch.values(after.state, after.supply.u, before.state)[gauge]
        low, high = (at, high) if left > 0.0 else (low, at)
        at = after.state.t + off if low < after.state.t + off < high else 0.5 * (low + high)
    return after, replace(crossing, t=after.state.t)


def _short_of(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to just before a corner.

    What lies beyond a stiff one pulls the end of a longer step back onto it, too late and with another speed: only
    an end on the side of the start tells when the corner is.
    """
    t, h, gauge, watch = before.state.t, after.state.t - before.state.t, crossing.gauge, journey.watch
    lead, side, dust = max(_LEAD * h, 8.0 * math.ulp(t + h)), watch.sides[gauge], watch.dusts[gauge]
    low, high, at, back = t, t + h, crossing.t - lead, lead
    found, when, ahead, misses = before, t, 0.0, 0
    for _ in range(_LANDINGS_MOST):
        if at - t <= SMALLEST * h or high - low <= max(_LEAD_MOST * h, lead):
            break
        try:
            after = _towards(journey, before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        left = side * float(watch.values(after.state, after.supply.u, before.state)[gauge])
        if left <= dust:
            high, back, misses = at, 8.0 * back, misses + 1
            at = max(high - back, 0.5 * (low + high))
            if ahead > 0.0 and misses == 1:
                at = low + (high - low) * ahead / (ahead - left) - lead
                at = at if low < at < high else 0.5 * (low + high)
            continue
        off = watch.offset(journey.track.curve(before, after), before, after, gauge)
        found, low, when = after, after.state.t, after.state.t + max(off, 0.0)
        ahead, misses, missed = left, 0, low < at - lead  # missed: no step ends there
        high = at if missed else high
        if 0.0 <= off <= max((_LEAD_FAR if missed else _LEAD_MOST) * h, lead):
            break
        at = when - lead if low < when - lead < high else 0.5 * (low + high)
    return found, replace(crossing, t=when)


def _towards(journey: Journey, before: Point, h: float) -> Point:
    """Take a step to a corner, or just short of it: where a force jumps there, no step ends on it."""
    for short in _SHORT:
        try:
            return journey.stepper.step(before, h * (1.0 - short))
        except StepError as error:
            failure = error
    raise failure
