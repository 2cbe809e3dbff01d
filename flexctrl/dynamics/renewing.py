"""Inputs that jump, at sample instants and breaks: accelerations jump with them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.jumping import coming, leapt, torn, under
from flexctrl.dynamics.march.ride import rides
from flexctrl.dynamics.march.stepper import MarchingStepper
from flexctrl.dynamics.steps import Twofold

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["renew"]


def renew(journey: Journey, stop: float) -> None:
    """Give new inputs at a sample instant or break; accelerations jump with them."""
    read, y = journey.read_here, journey.outputs_here
    if journey.point.state.t != stop:
        journey.point = replace(journey.point, state=journey.point.state.with_(t=stop))
    feed, before = journey.plan.feed, journey.point.supply
    fresh = feed.renewed(stop, y[feed.reads], before)
    journey.stops.go_by(stop)  # not before the law has answered: a run that it ends goes on by asking it again
    journey.mark.left = 0
    same = np.array_equal(fresh.u, before.u)
    if same:
        several, point = journey.stepper, journey.point
        journey.point = several.fed(point, fresh) if isinstance(several, Twofold) else replace(point, supply=fresh)
    else:
        _jump(journey, fresh, coming(journey, stop))
    if not (journey.watch.idle or same):
        leapt(journey)
    journey.rows.here(journey.point, 1e-6 * journey.mark.size, read)  # as rides have it: before inputs jump


def _jump(journey: Journey, fresh: Supply, step: float) -> None:
    """Let the inputs jump, as a ride does where steps are marched, with a step about to be taken."""
    stepper, held = journey.stepper, journey.point
    if isinstance(stepper, MarchingStepper) and journey.plan.model.switches.names and rides(journey):
        journey.balked = False
        held, after = torn(journey, stepper, fresh, step)
    else:
        held = replace(held, state=under(journey, fresh.u))
        after = stepper.renew(held, fresh, step)
    journey.point = after
    journey.books.jump(held, after, step)
