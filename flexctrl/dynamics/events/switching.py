"""A run goes on under another law of force: where one switches, and beyond the corner of one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.dynamics.events.impact import Wanted, lasts
from flexctrl.dynamics.events.landing import Missed
from flexctrl.dynamics.events.nearing import LEAST, NUDGES
from flexctrl.dynamics.events.watch import Crossing
from flexctrl.dynamics.march.stepper import plain_of
from flexctrl.dynamics.scales import farthest
from flexctrl.dynamics.steps import Controlled, Joining, Point, Stepper
from flexctrl.dynamics.swift.thrown import AT_HAND
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["anew", "beyond", "is_brief", "lead", "lengthen", "withheld"]


def anew(journey: Journey, at: Point, switch: int) -> Point:
    """Start anew under the law of force that holds from now on."""
    supply = journey.plan.feed.restart(at.state, at.supply)
    state = journey.plan.model.switches.after(at.state, supply.u, switch)
    journey.watch.switched()
    return journey.stepper.renew(replace(at, state=state), supply, journey.mark.size)


def is_brief(journey: Journey, before: Point, after: Point, slid: Point, switch: int) -> bool:
    """Tell whether a contact that breaks loose here sticks again at once, for all that a step can see.

    Where steps are chosen, they are shortened first, until what one makes of the slip is within tolerance.
    """
    switches, h = journey.plan.model.switches, slid.state.t - before.state.t
    if after.state.t > before.state.t or switches.phases(before.state)[switch] == STUCK:
        return False
    if isinstance(journey.plan.method.pace, Controlled):
        held, v, moved = switches.withheld(before.state, switch), slid.state.v, journey.books.sums.moved
        slip = h * np.abs(v - switches.still(held, v)) / journey.books.reach
        if (slip > journey.plan.tolerance.of(farthest(journey.plan.model, moved))).any():
            raise Missed(journey.stepper.counts.worst, "a slip is over within less than the step")
    return True


def withheld(journey: Journey, at: Point, switch: int) -> Point:
    """Hold for a step what would slip for less than that, whatever pulls; after it, that is tried again."""
    state = journey.plan.model.switches.withheld(at.state, switch)
    journey.watch.withheld(switch)
    return journey.stepper.renew(
        replace(at, state=state), journey.plan.feed.restart(state, at.supply), journey.mark.size
    )


def beyond(journey: Journey, at: Point, corner: Crossing) -> Point:
    """Start anew just beyond a corner, where forces and what they dissipate may have jumped."""
    end, at, watch, sign = at, at.firm, journey.watch, 1.0 if corner.rising else -1.0
    span = max(LEAST * journey.mark.size, corner.t - at.state.t)
    state, v = at.state, at.state.v
    for _ in range(NUDGES):
        moved = journey.plan.model.advance(at.state, span * v, v, at.state.t)
        if sign * watch.values(moved, at.supply.u)[corner.gauge] > watch.dusts[corner.gauge]:
            state = moved
            break
        span *= 4.0
    _meet(journey, end, state, corner.t)
    supply = journey.plan.feed.restart(state, at.supply)
    _follow(journey, at.state, state, supply.u)
    journey.point = replace(at, state=state, supply=supply)
    step = min(journey.mark.size, journey.mark.cap) if journey.mark.follow else journey.mark.size
    lead(journey, step)
    journey.books.turn(journey.point, step)
    return journey.point


def _meet(journey: Journey, end: Point, state: State, t: float) -> None:
    """Note the corners that the way beyond one has led over: they are met with it."""
    for corner in journey.watch.passed(state, t):
        journey.watch.cross(corner)
        journey.happens(corner, end.state, end.supply.u)


def lead(journey: Journey, h: float) -> None:
    """Start anew where the run stands, with a step about to be taken."""
    stepper: Stepper[Any] = plain_of(journey.stepper)
    joined = stepper.join if isinstance(stepper, Joining) else stepper.renew
    journey.point = joined(journey.point, journey.point.supply, h)
    journey.mark.led = h if isinstance(journey.plan.method.pace, Controlled) else 0.0
    journey.mark.taken = h


def lengthen(journey: Journey, h: float) -> None:
    """Make accelerations anew where those of a far shorter step would throw parts over the one about to be taken."""
    if h > AT_HAND * journey.mark.taken > 0.0:
        stepper: Any = plain_of(journey.stepper)
        journey.point = stepper.lengthen(journey.point, h) if isinstance(stepper, Joining) else journey.point
    journey.mark.taken = h


def _follow(journey: Journey, before: State, after: State, u: np.ndarray) -> None:
    """Follow an impact by short steps, where steps are chosen and would not see it."""
    plan, sums = journey.plan, journey.books.sums
    if not isinstance(plan.method.pace, Controlled):
        return
    wanted = Wanted(plan.tolerance, sums.moved, plan.method.pace.steepness)
    journey.mark.follow, journey.mark.cap = lasts(plan.model, before, after, u, wanted, sums.turnover)
