"""Parts that have gone farther from where they began than any machine reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import once, turning, yardsticks
from flexctrl.model.plant import Plant

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["astray", "strayed"]

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
    worst = astray(journey)
    if worst is None:
        return ()
    model, moved = journey.plan.model, journey.books.sums.moved
    blame = "nothing holds it" if journey.plan.feed.controller is None else "the loop is not stable"
    times = _FAR * moved[worst] / once(model, _far)[worst]
    return (f"{model.coordinates[worst]} has gone {times:.1g} times the size of the machine, as if {blame}",)


def astray(journey: Journey) -> int | None:
    """Return the freedom that has gone farthest beyond a million times the size of the machine, None if none has."""
    far, moved = once(journey.plan.model, _far), journey.books.sums.moved
    return int(np.argmax(moved / far)) if (moved > far).any() else None


def _far(model: Plant) -> np.ndarray:
    """A million times the size of the machine in each freedom that travels."""
    return np.where(turning(model), np.inf, _FAR * yardsticks(model))
