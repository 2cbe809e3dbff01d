"""Vibrations that samples set going, that steps do not resolve, and that a law hears in what it reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.shocks import shocks
from flexctrl.dynamics.run import Run

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["heard"]

_TURNED, _MUCH = 0.5, 2e-3
"""Radians in a step, from where on steps err by much of a vibration; what counts, of the range of a reading."""


def heard(run: Run, journey: Journey) -> bool:
    """Tell whether a sampled law reads vibrations that its samples set going and steps do not resolve.

    Parameters
    ----------
    run : Run
        Of such a law, with rows.
    journey : Journey
        At its end.

    Returns
    -------
    bool
        False for machines of more than 200 degrees of freedom.
    """
    feed, ranges = journey.plan.feed, np.ptp(run.y, axis=0)
    least = _TURNED * journey.mark.steps / journey.point.state.t
    trains = (shock for shock in shocks(run, journey) if shock.train.sizes)
    return any(bool((shock.unseen(least) > _MUCH * ranges)[feed.reads].any()) for shock in trains)
