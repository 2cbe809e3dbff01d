"""Steps that end where something happens: where a law of force switches, just before a corner, at an event."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from flexctrl.dynamics.events import Crossing
from flexctrl.dynamics.steps import Point, StepError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["SHORTEST", "SMALLEST", "Missed", "landed"]

SMALLEST = 1e-12
SHORTEST = 1e-3  # of a run: before that a step may be shorter than those that the clock resolves later
_NEAR = 1e-9
_LANDINGS, _LANDINGS_MOST, _QUICK = 12, 60, 8
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
    t, h, gauge, watch = before.state.t, after.state.t - before.state.t, crossing.gauge, journey.watch
    bracket, at, last = _Bracket(max(t, crossing.low), min(t + h, crossing.high)), crossing.t, None
    for _ in range(_LANDINGS):
        if at - t <= SMALLEST * h:
            return before, replace(crossing, t=t)
        try:
            after = journey.stepper.step(before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        left = watch.left(after, before, crossing)
        if last is None:
            off = watch.offset(journey.track.curve(before, after), before, after, gauge)
        else:
            off = _to_zero(last, (at, left)) if abs(left) > watch.dusts[gauge] else 0.0
        if abs(off) <= _NEAR * h:
            break
        bracket.narrow(at, left)
        last = at, left
        at = bracket.within(at + off)
    return after, replace(crossing, t=after.state.t)


def _to_zero(last: tuple[float, float], now: tuple[float, float]) -> float:
    """Return how much later than now a value is zero that has changed as it has since another time; NaN for never."""
    (a, fa), (b, fb) = last, now
    return -fb * (b - a) / (fb - fa) if fb != fa else math.nan


@dataclass
class _Bracket:
    """Two times between which a value falls through zero, and what it is there where that is known."""

    low: float
    high: float
    ahead: float = 0.0
    behind: float = 0.0
    count: int = 0

    def narrow(self, at: float, left: float) -> None:
        """Take a time for one of the two."""
        self.count += 1
        if left > 0.0:
            self.low, self.ahead = at, left
        else:
            self.high, self.behind = at, left

    def within(self, at: float) -> float:
        """Return a time if it is between the two; else where a straight line is zero, or the middle."""
        if self.count >= _QUICK:
            return 0.5 * (self.low + self.high)
        if not self.low < at < self.high and self.ahead > 0.0 > self.behind:
            at = self.low + (self.high - self.low) * self.ahead / (self.ahead - self.behind)
        return at if self.low < at < self.high else 0.5 * (self.low + self.high)


def _short_of(journey: Journey, before: Point, after: Point, crossing: Crossing) -> tuple[Point, Crossing]:
    """Take the step again, to just before a corner.

    What lies beyond a stiff one pulls the end of a longer step back onto it, too late and with another speed: only
    an end on the side of the start tells when the corner is.
    """
    t, h, gauge, watch = before.state.t, after.state.t - before.state.t, crossing.gauge, journey.watch
    lead, dust = max(_LEAD * h, 8.0 * math.ulp(t + h)), watch.dusts[gauge]
    bracket, at = _Bracket(t, t + h), crossing.t - lead
    found, when, last, back = before, t, None, lead
    for _ in range(_LANDINGS_MOST):
        if at - t <= SMALLEST * h or bracket.high - bracket.low <= max(_LEAD_MOST * h, lead):
            break
        try:
            after = _towards(journey, before, at - t)
        except StepError as error:
            raise Missed(error.worst, str(error)) from error
        curve, end = journey.track.curve(before, after), after.state.t
        left = watch.left(after, before, crossing)
        above = left - dust
        off = watch.offset(curve, before, after, gauge) if above > 0.0 or last is None else 0.0
        on = _to_zero(last, (end, above)) if last else off
        missed = above > 0.0 and end < at - lead  # no step ends there
        bracket.narrow(end if above > 0.0 else at, above)
        if above <= 0.0:
            last, back = (at, above), 4.0 * back
            at = bracket.within(at + on - back)
            continue
        bracket.high = at if missed else bracket.high
        found, when, last, back = after, end + max(off, 0.0), (end, above), lead
        if 0.0 <= off * above / left <= max((_LEAD_FAR if missed else _LEAD_MOST) * h, lead):
            break
        at = bracket.within(end + on - lead)
    return found, replace(crossing, t=when)


def _towards(journey: Journey, before: Point, h: float) -> Point:
    """Take a step to a corner, or just short of it: where a force jumps there, no step ends on it."""
    for short in _SHORT:
        try:
            return journey.stepper.step(before, h * (1.0 - short))
        except StepError as error:
            failure = error
    raise failure
