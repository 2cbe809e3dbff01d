"""Continuous laws of many states that plain steps ask: what makes a run slow, and what does not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.dynamics.law_state import MANY

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["many_states"]


def many_states(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of a continuous law that implicit steps ask in Python, twice a state for its slope.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    feed = journey.plan.feed
    plain = getattr(journey.stepper, "fine", journey.stepper)  # of two that go side by side (`Richardson`)
    if not (feed.continuous and isinstance(plain, Stepper) and journey.mark.steps):
        return ()
    states = np.size(journey.point.supply.x)
    if states < MANY:
        return ()
    return (
        f"the continuous law has {states} states and was asked in Python at every step: give it a sample time, "
        "Sampled(law, …), and it is asked once a sample",
    )
