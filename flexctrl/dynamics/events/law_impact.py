"""Impacts on what a continuous law does, a buffer of one's own: no corner is known beforehand that a step could end at.

As at corners of laws of force, the speed that comes back is at stake, and an error of places does not see it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.events.impact import NO_IMPACT, SMALL, STEPS, Wanted, followed
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Controlled, Point

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["hits"]

_FELT, _MORE = 1.0 / STEPS**2, 4.0
_NUDGE, _TINY = 1e-7, 1e-300


def hits(journey: Journey, after: Point, h: float) -> tuple[int, float]:
    """Return how many steps follow an impact on the law within a step, and how long; none where nothing hits.

    Along the speeds v that the step begins with, ω² = v·ΔK v / v·M v with what the law's stiffness has grown by over
    the step. A law as stiff before is followed by the control of steps.

    Parameters
    ----------
    journey : Journey
        At the start of the step.
    after : Point
        At its end.
    h : float
        [s]

    Returns
    -------
    int
    float
        [s]
    """
    feed, books, before = journey.plan.feed, journey.books, journey.point
    one, other = before.supply, after.supply
    told = not feed.reacting or feed.answering is not None
    if told or one.slid or other.slid or np.array_equal(one.u, other.u):
        return NO_IMPACT
    model, v = feed.model, before.state.v
    twice = 2.0 * model.energy(before.state)[0]
    if twice <= 2.0 * SMALL * books.sums.turnover:
        return NO_IMPACT
    stiff = _answer(journey, after, v, 1.0)
    if not h * h * stiff > _FELT * twice:
        return NO_IMPACT
    soft = _answer(journey, before, v, -1.0)
    if stiff <= _MORE * max(soft, 0.0):
        return NO_IMPACT
    plan = journey.plan
    assert isinstance(plan.method.pace, Controlled)
    wanted = Wanted(plan.tolerance, books.sums.moved, plan.method.pace.steepness)
    return followed(plan.model, (stiff - soft) / twice, wanted)


def _answer(journey: Journey, point: Point, v: np.ndarray, side: float) -> float:
    """By how much the law pushes back along some speeds, v·K v, by differences ahead or back."""
    feed, model, state, x = journey.plan.feed, journey.plan.model, point.state, point.supply.x
    small = side * _NUDGE / max(float(np.abs(v / yardsticks(model)).max()), _TINY)
    here, moved = (
        float(v @ model.loads(state, feed.within(there, x).u))
        for there in (state, model.advance(state, small * v, state.v, state.t))
    )
    return (here - moved) / small
