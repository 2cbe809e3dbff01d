"""Parts that have gone farther from where they began than any machine reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import turning, yardsticks

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["strayed"]

_FAR = 1e6


def strayed(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of a machine that has left: its loop may not be stable, or nothing holds it.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
        Empty while no freedom that travels has gone a million times the size of the machine.
    """
    model = journey.plan.model
    yards = np.where(turning(model), np.inf, yardsticks(model))
    way = journey.books.sums.moved / yards
    if not way.size or not way.max() > _FAR:
        return ()
    worst = int(np.argmax(way))
    blame = "nothing holds it" if journey.plan.feed.controller is None else "the loop is not stable"
    return (f"{model.coordinates[worst]} has gone {way[worst]:.1g} times the size of the machine, as if {blame}",)
