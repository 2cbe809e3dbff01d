"""One step of a run, of a fixed length or of one chosen by its error, tried again shorter where that is needed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from flexctrl.dynamics.events.ending import ends_before
from flexctrl.dynamics.events.impact import NO_IMPACT
from flexctrl.dynamics.events.landing import Missed, towards
from flexctrl.dynamics.events.law_impact import hits
from flexctrl.dynamics.events.nearing import SHORTEST, SMALLEST
from flexctrl.dynamics.events.switching import lead, lengthen
from flexctrl.dynamics.run import Status
from flexctrl.dynamics.steps import Controlled, Point, StepError

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["controlled", "fixed"]

_NEAR = 1e-9
_HALVED, _PIECES, _CRUMBLED = 32, 64, 256
"""Where a step under a continuous law falls apart into more pieces, and those before it, which did too, have into so
many in all, it chatters; of each no more count than can be of a layer at a start.
"""
_CAPS, _SHORTER = 2.0, 0.25
"""Steps in which a law is hit are no longer than that many that follow the impact; longer ones are cut to a share."""


def fixed(journey: Journey, stop: float, until: float) -> None:
    """Take a step of one length, towards a stop."""
    mark, t = journey.mark, journey.point.state.t
    if not mark.left:
        length = journey.plan.method.pace.step  # type: ignore[union-attr]
        count = max(1, math.ceil((stop - t) / length - 1e-6)) if math.isfinite(stop) else 0
        mark.size, mark.left = (stop - t) / count if count else length, count or -1
    before = mark.rejected
    most = before + _HALVED if journey.plan.feed.reacting and journey.crumbled > _CRUMBLED else math.inf
    room = math.floor((until - t) / mark.size + _NEAR)
    if not room:
        if not ends_before(journey, stop):
            _take(journey, until - t, stop, most)
        return
    lengthen(journey, mark.size)
    _take(journey, mark.size, stop, most)
    pieces = mark.rejected - before
    journey.crumbled = journey.crumbled + min(pieces, _PIECES) if pieces > _HALVED else 0
    if mark.left > 0:
        mark.left -= 1


def controlled(journey: Journey, stop: float, until: float) -> None:
    """Take a step whose error is allowed, towards a stop."""
    pace, mark, t = journey.plan.method.pace, journey.mark, journey.point.state.t
    assert isinstance(pace, Controlled)
    left = stop - t
    h = min(mark.size, pace.largest)
    h = min(h, mark.cap) if mark.follow else h
    h = left if h > 0.99 * left else 0.5 * left if h > 0.5 * left else h
    h = min(h, journey.horizon - t)
    if t + h > until + journey.tick:
        if ends_before(journey, stop):
            return
        h = until - t
    after, h, size, factor = _tried(journey, pace, h)
    if factor > 1.3 and h > 0.5 * size:
        size = h * min(2.5, factor)
    elif factor < 1.0:
        size = h * factor
    mark.size, mark.led, mark.follow = size, 0.0, max(0, mark.follow - 1)
    try:
        journey.accept(after, stop)
    except Missed:
        mark.rejected += 1
        mark.size = 0.25 * h


def _tried(journey: Journey, pace: Controlled, h: float) -> tuple[Point, float, float, float]:
    """Take shorter and shorter steps until the error of one is allowed.

    Returns where it ends, its length, the length meant before, and by what its error lets that grow.
    """
    mark, t, why = journey.mark, journey.point.state.t, ""
    counts, worst = journey.stepper.counts, journey.stepper.counts.worst
    size, hit = mark.size, NO_IMPACT
    while True:
        if mark.led and h != mark.led:
            lead(journey, h)
        if h < SMALLEST * max(SHORTEST * journey.plan.until, t):
            worst, why = (worst, why) if why else _reason(journey, 4.0 * h)
            raise StepError(worst, f"the step fell to {h:.1e} s at t = {t:.6g} s: {why}")
        try:
            after = journey.step(journey.point, h)
        except StepError as failure:
            why, worst = str(failure), failure.worst
            mark.rejected += 1
            size = h = 0.25 * h
            continue
        error = journey.stepper.error(journey.point, after, h, journey.books.sums.moved, journey.plan.tolerance)
        factor = 0.9 * max(error, 1e-9) ** (-1.0 / pace.steepness)
        if error <= 1.0:
            steps, cap = hits(journey, after, h) if h > _CAPS * hit[1] else hit
            if h <= _CAPS * cap:
                mark.follow, mark.cap = steps, cap
            elif steps:
                mark.rejected += 1
                hit, size = (steps, cap), max(_SHORTER * h, cap)
                h = size
                continue
            return after, h, size, factor
        mark.rejected += 1
        why, worst = f"its error was {error:.3g} times what the Tolerance allows", counts.worst
        size = h = h * max(0.2, factor)


def _reason(journey: Journey, h: float) -> tuple[int, str]:
    """Why compiled loops have rejected a step, which keep no word of it: its worst freedom, and what is said."""
    try:
        after = journey.step(journey.point, h)
    except StepError as failure:
        return failure.worst, str(failure)
    error = journey.stepper.error(journey.point, after, h, journey.books.sums.moved, journey.plan.tolerance)
    return journey.stepper.counts.worst, f"its error was {error:.3g} times what the Tolerance allows"


def _take(journey: Journey, h: float, stop: float, most: float) -> None:
    """A step of fixed length; where it does not converge, in halves, until so many tries are rejected in all."""
    try:
        after = journey.step(journey.point, h)
    except StepError as failure:
        journey.mark.rejected += 1
        if journey.mark.rejected > most:
            why = f"steps of {journey.mark.size:.3g} s fall apart into more than {_HALVED} pieces: {failure}"
            remedy = "the law may jump with what it reads: take AdaptiveAlpha or GeneralizedAlpha, which slide there"
            raise StepError(failure.worst, f"{why}; {remedy}") from failure
        if h >= 2e-3 * journey.mark.size:
            return _halved(journey, h, stop, most)
        after = _short_of_its_end(journey, h, failure)
    try:
        journey.accept(after, stop)
    except Missed:
        journey.mark.rejected += 1
        if h < 2e-3 * journey.mark.size:
            raise
        _halved(journey, h, stop, most)


def _short_of_its_end(journey: Journey, h: float, failure: StepError) -> Point:
    """Take a step a little shorter: its end, and that of all its halves, may be just where a force jumps."""
    try:
        if journey.watch.corner_names:
            return towards(journey, journey.point, h)
    except StepError:
        pass
    why = f"{failure}; steps up to {journey.mark.size:.3g} s have failed too; take AdaptiveAlpha"
    raise StepError(failure.worst, why) from failure


def _halved(journey: Journey, h: float, stop: float, most: float) -> None:
    """Take a step in two; what ends the first short of its half is made up by the second."""
    end = journey.point.state.t + h
    _take(journey, 0.5 * h, stop, most)
    if journey.status is Status.FINISHED and (left := end - journey.point.state.t) > SMALLEST * h:
        _take(journey, left, stop, most)
