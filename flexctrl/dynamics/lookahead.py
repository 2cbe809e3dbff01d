"""Continuous laws that change with time as nobody has told: looked at before each step, so that none passes a pulse.

A trajectory knows its breaks; of any other function of time, or a law of one's own, nothing is known but what it says.
With what it reads held, it is asked at instants of no rhythm all over the step to come. Where it leaves the straight
line between the ends of the step by more than a share of how much it has changed so far within any step, the step is
ended before; a jump is found by bisection, and steps end there as at a break.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.dynamics.steps import Controlled, Fixed
from flexctrl.errors import ControllerError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["FEWEST", "OF_RUN", "look_ahead", "without_rhythm"]

FEWEST, OF_RUN = 32, 4096
"""Instants in a step, and in as much as the whole run."""
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
_BENT, _CUT = 0.02, 0.005
"""What steps may leave the line by; where those of one length do not, shorter ones leave it by little, as no error of
theirs keeps them short."""
_ENOUGH, _AHEAD = 8, 8.0
_LEAST, _STEEP = 1e-6, 8.0
_TOUCH = 1e-9
_DEEPEST, _SMALLEST = 40, 1e-12
_ROUND_OFF = 1e-12


class _Course(NamedTuple):
    """What a law says from the start of a step on: times (k,), values (k, signals), and the swings that count."""

    times: np.ndarray
    values: np.ndarray
    swings: np.ndarray

    @property
    def _slopes(self) -> np.ndarray:
        return np.asarray((np.abs(np.diff(self.values, axis=0)) / self.swings).max(axis=1) / np.diff(self.times))

    @property
    def steepest(self) -> int:
        """Between which two instants it changes fastest: after that of this number."""
        return int(np.argmax(self._slopes))

    @property
    def steep(self) -> bool:
        """Whether it may jump: it changes far faster in one place than in most."""
        slopes, at = self._slopes, self.steepest
        change = slopes[at] * (self.times[at + 1] - self.times[at])
        return bool(change > _LEAST and slopes[at] > _STEEP * np.median(slopes))

    def bends(self, end: int) -> float:
        """By how much it leaves the line to an instant, at most."""
        share = (self.times[: end + 1] - self.times[0]) / (self.times[end] - self.times[0])
        line = self.values[0] + share[:, None] * (self.values[end] - self.values[0])
        return float((np.abs(self.values[: end + 1] - line) / self.swings).max())


def look_ahead(journey: Journey) -> None:
    """Have the next step end where the law's own course in time bends, or jumps.

    Parameters
    ----------
    journey : Journey
        Its horizon is set, and its next stop where there is a jump before the others.
    """
    journey.horizon = math.inf
    plan, mark, stops, t = journey.plan, journey.mark, journey.stops, journey.point.state.t
    if not plan.feed.untold or stops.found < math.inf or journey.point.supply.slid:
        return  # where it slides, a law jumps with whatever moves, time or places
    chosen = isinstance(plan.method.pace, Controlled)
    span = min(mark.size if chosen else plan.method.pace.step, stops.next - t)  # type: ignore[union-attr]
    limit = _CUT if not chosen and _cut_lately(journey) else _BENT
    if min(span, plan.until - t) <= journey.tick:
        return
    try:
        end, jumps = _clear(journey, span, limit)  # also beyond the end, as a run does that goes on
    except ControllerError:
        try:
            end, jumps = _clear(journey, min(span, plan.until - t), limit)
        except ControllerError:  # what it says when it is asked in earnest is told then
            return
    if jumps or (end < math.inf and not chosen):
        stops.found = end
        plan.feed.meet(end)
        mark.left = 0
    else:
        journey.horizon = end


def _cut_lately(journey: Journey) -> bool:
    """Whether a step of one length has been ended by what is said in it: so are all that come instead of it."""
    met, step = journey.plan.feed.met, journey.plan.method.pace.step  # type: ignore[union-attr]
    return any(0.0 <= journey.point.state.t - t < (1.0 - _TOUCH) * step for t in met)


def _clear(journey: Journey, span: float, limit: float) -> tuple[float, bool]:
    """Until when the law may be taken for a line in time, infinity if all along a span; and whether it jumps there.

    All along, it may leave the line by a limit; what is cut from a span leaves it by little.
    """
    t, until, steady = journey.point.state.t, journey.plan.until, isinstance(journey.plan.method.pace, Fixed)
    for tried in range(_DEEPEST):
        course = _course(journey, span)
        last = len(course.times) - 1
        if not tried and steady and limit == _BENT and course.bends(last) > limit:
            course = course._replace(swings=_swings_ahead(journey, span, course))
        if course.steep and (jump := _first_jump(journey, course)) < math.inf:
            return jump, True
        if course.bends(last) <= limit:
            return (float(course.times[last]) if tried else math.inf), False
        limit = _CUT if steady else _BENT
        bent = next(end for end in range(2, last + 1) if course.bends(end) > limit)
        if bent > _ENOUGH:
            return float(course.times[bent - 1]), False
        span = float(course.times[bent]) - t
        if span < _SMALLEST * until:
            break
    return t + span, False


def _first_jump(journey: Journey, course: _Course) -> float:
    """When the law jumps first; infinity if it does not."""
    first, t = math.inf, journey.point.state.t
    for _ in range(_DEEPEST):
        if not course.steep or (jump := _jump(journey, course)) is None or not t < jump < first:
            break
        first = jump
        if first - t <= journey.tick:
            break
        course = _course(journey, (1.0 - 4.0 * _TOUCH) * (first - t))
    return first


def _course(journey: Journey, span: float) -> _Course:
    """Ask the law over a span from here; closely only if that shows what is passed over otherwise."""
    course = _asked(journey, span, FEWEST)
    closely = math.ceil(OF_RUN * min(span / journey.plan.until, 1.0))
    if closely > FEWEST and not course.steep and course.bends(len(course.times) - 1) <= _BENT:
        swings = journey.mark.swings
        closer = _asked(journey, span, closely)
        if closer.bends(len(closer.times) - 1) > 2.0 * _BENT:
            return closer
        journey.mark.swings = swings  # how long the run is has no say in what it does
    return course


def _swings_ahead(journey: Journey, span: float, course: _Course) -> np.ndarray:
    """The swings that count in steps of one length: those of some steps to come, too, as what sets out gently bends."""
    try:
        return _asked(journey, _AHEAD * span, FEWEST).swings
    except ControllerError:  # it may say nothing there
        return course.swings


def _asked(journey: Journey, span: float, count: int) -> _Course:
    t, mark = journey.point.state.t, journey.mark
    beyond = span < journey.stops.next - t  # what jumps right at the end is seen, too
    inner = without_rhythm(np.arange(count), count)
    shares = np.concatenate([[0.0], inner, [1.0 + (_TOUCH if beyond else -_TOUCH)]])
    times = t + span * np.sort(shares)
    values = np.array(list(_said(journey, times.tolist())))
    swing = np.ptp(values, axis=0)
    swing[swing <= _ROUND_OFF * np.abs(values).max(axis=0)] = 0.0
    before = np.array(mark.swings) if mark.swings else np.zeros(swing.size)
    mark.swings = tuple(np.maximum(swing, before).tolist())
    return _Course(times, values, np.where(np.array(mark.swings) > 0.0, mark.swings, math.inf))


def without_rhythm(i: np.ndarray, count: int | np.ndarray) -> np.ndarray:
    """Return shares of a span, one in each of so many parts of it, at instants that come again with no period.

    Parameters
    ----------
    i : numpy.ndarray of int
        The parts.
    count : int or numpy.ndarray of int
        How many there are.

    Returns
    -------
    numpy.ndarray
    """
    return np.asarray((i + (_GOLDEN * i + 0.5) % 1.0) / count)


def _said(journey: Journey, times: list[float]) -> Iterator[list[float]]:
    """What the law would say at some times, if it read what it does here."""
    feed, point = journey.plan.feed, journey.point
    y, x = feed.measured(point.state), point.supply.x
    for t in times:
        u, rate = feed.answer(t, y, x)
        yield [*u, *rate.tolist()]


def _jump(journey: Journey, course: _Course) -> float | None:
    """The first instant after the jump where a course is steepest; None if it is none."""
    at = course.steepest
    (a, b), (low, high) = course.times[at : at + 2].tolist(), course.values[at : at + 2]
    whole = np.max(np.abs(high - low) / course.swings)
    while a < (middle := 0.5 * (a + b)) < b:
        said = np.array(*_said(journey, [middle]))
        if np.max(np.abs(said - low) / course.swings) > np.max(np.abs(high - said) / course.swings):
            b, high = middle, said
        else:
            a, low = middle, said
    return b if np.max(np.abs(high - low) / course.swings) > 0.5 * whole else None
