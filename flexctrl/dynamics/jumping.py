"""What comes of inputs that jump: a step of another length, contacts that break loose, events."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.events.watch import Crossing
from flexctrl.dynamics.steps import Fixed
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.alpha.point import AlphaPoint
    from flexctrl.dynamics.feed import Supply
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.march.stepper import MarchingStepper

__all__ = ["coming", "leapt", "torn", "under"]


def coming(journey: Journey, t: float) -> float:
    """Return the length of the step after a stop, which is over."""
    pace, left = journey.plan.method.pace, journey.stops.next - t
    if not isinstance(pace, Fixed):
        return journey.mark.size
    return pace.between(left) if math.isfinite(left) else pace.step


def under(journey: Journey, u: np.ndarray) -> State:
    """Return the state under inputs that have jumped; note what breaks loose with them."""
    switches, state = journey.plan.model.switches, journey.point.state
    torn = switches.under(state, u)
    loose = (switches.phases(state) == STUCK) & (switches.phases(torn) != STUCK)
    for switch in np.flatnonzero(loose):
        journey.happens(Crossing(state.t, len(journey.watch.events) + int(switch), True), state, u)
    return torn


def torn(journey: Journey, stepper: MarchingStepper, fresh: Supply, step: float) -> tuple[AlphaPoint, AlphaPoint]:
    """Let inputs jump under which contacts may not hold; return the point before and after.

    What breaks loose does so in a step by itself, whoever lets the inputs jump.
    """
    held = journey.point
    after = stepper.leap(held, fresh, step)
    if after is None:
        journey.balked, held = True, replace(held, state=under(journey, fresh.u))
        after = stepper.plain.renew(held, fresh, step)
    return held, after


def leapt(journey: Journey) -> None:
    """Note the events that a jump of the inputs has brought about; one of them may end the run."""
    watch, point = journey.watch, journey.point
    leaps = watch.leaps(point)
    for crossing in leaps:
        watch.reach(crossing)
    leaps = [crossing for crossing in leaps if not journey.is_over(crossing)]
    for crossing in leaps:
        journey.happens(crossing, point.state, point.supply.u)
    journey.end_by(leaps, point.state.t)
    watch.settle(point)
