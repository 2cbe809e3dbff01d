"""Vibrations that a method does not move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.linear_motion.exact import ExactStepper
from flexctrl.dynamics.march.stepper import plain_of

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["left_out"]


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
