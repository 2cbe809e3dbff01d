"""Inputs that nothing feels, and inputs that come twice: with the equilibrium that a run begins in, and by a law."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.model.equilibrium import Rest

if TYPE_CHECKING:
    from flexctrl.design.controller import Controller
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.others import Beginning

__all__ = ["twice", "unfelt"]

_ALIKE = 0.2
"""A law of deviations commands next to nothing at rest, one that bears a load by itself about all of it."""


def unfelt(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of inputs of a linear model that are in force and act on nothing but what is held.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    plan = journey.plan
    if not isinstance(plan.model, LinearPlant) or plan.model.linear.certificate is None:
        return ()
    feed, names = plan.feed, plan.model.inputs
    commanded = () if feed.controller is None else feed.writes
    used = [name for i, name in enumerate(names) if feed.base[i] or i in commanded]
    return plan.model.linear.certificate.heard(used).notes


def twice(
    journey: Journey, start: object, inputs: Mapping[str, float] | None, beginning: Beginning | None
) -> tuple[str, ...]:
    """Return what is to be said of a law that commands at the start about what the equilibrium there brings along.

    Parameters
    ----------
    journey : Journey
        At its end.
    start : object
        Where it began.
    inputs : mapping of str to float or None
        What was given in place of what an equilibrium brings.
    beginning : Beginning or None
        With the law as it was then; without, what hardware lets through later is not told of.

    Returns
    -------
    tuple of str
    """
    feed, u = journey.plan.feed, journey.origin.u
    if not isinstance(start, Rest) or inputs is not None or feed.controller is None or not u.size:
        return ()
    brought, named = feed.base, journey.plan.model.inputs
    late = _wished(journey, beginning)
    if late.size:
        u = feed.base.copy()
        np.add.at(u, list(feed.writes), late)
    then = " once that has come through" if late.size else ""
    found = [i for i in feed.writes if brought[i] and abs(u[i] - 2.0 * brought[i]) <= _ALIKE * abs(brought[i])]
    return tuple(
        f"{named[i]}: the equilibrium that it starts from brings {brought[i]:.5g} along and the controller commands "
        f"{u[i] - brought[i]:.5g} at the start, so {u[i]:.5g} act{then}; if the controller is to give all of it, "
        "start=rest.state"
        for i in found
    )


def _wished(journey: Journey, beginning: Beginning | None) -> np.ndarray:
    """What a law commands at the start that hardware lets through by and by; empty where all of it comes at once."""
    if beginning is None or _held_back(journey.plan.feed.controller) is None:
        return np.zeros(0)
    feed = beginning.again
    law = _held_back(feed.controller) if feed else None
    if feed and law:
        with suppress(Exception):  # of which the run's status tells
            read = feed.measured(journey.origin.state)
            return np.asarray(law.command(0.0, law.initial(), read), dtype=float).ravel()
    return np.zeros(0)


def _held_back(law: Controller | None) -> Controller | None:
    """The controller inside all that delays commands, or limits their rates."""
    from flexctrl.design.hardware import Delayed, RateLimited  # not for runs without a controller
    from flexctrl.design.wrapping import Wrapper

    found = None
    while isinstance(law, Wrapper):
        if (isinstance(law, Delayed) and law.samples) or isinstance(law, RateLimited):
            found = law.controller
        law = law.controller
    return found
