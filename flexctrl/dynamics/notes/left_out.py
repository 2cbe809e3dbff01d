"""What a run may leave out: vibrations that a method does not move, pulses that nobody has told of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.linear_motion.exact import ExactStepper
from flexctrl.dynamics.lookahead import FEWEST, OF_RUN
from flexctrl.dynamics.march.stepper import plain_of

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["left_out", "passed_over"]

_FEW = OF_RUN // FEWEST
"""In more steps than that they are looked at more closely than the run as a whole."""


def left_out(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of vibrations that `Exact` was asked to leave out: no error counts them.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    stepper = plain_of(journey.stepper)
    if not isinstance(stepper, ExactStepper) or not np.isfinite(stepper.equations.slowest_left):
        return ()
    slowest = stepper.equations.slowest_left / (2.0 * np.pi)
    return (
        f"vibrations from {slowest:.3g} Hz up stay where constant loads hold them, as Exact(modes={stepper.modes}) "
        "asks: no error told counts what they would move",
    )


def passed_over(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of functions of time that long steps may have passed over.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    plan = journey.plan
    if not plan.feed.untold or journey.mark.steps >= _FEW:
        return ()
    return (
        f"functions of time were looked at every {plan.until / OF_RUN:.1g} s, as steps are long: what they do within "
        "less may have been passed over; give it as Step or Table, which tell when, or the method a largest_step",
    )
