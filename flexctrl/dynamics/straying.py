"""Parts that have gone farther from where they began than any machine reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import once, turning, yardsticks
from flexctrl.model.plant import Plant

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
    model, moved = journey.plan.model, journey.books.sums.moved
    far = once(model, _far)
    if not (moved > far).any():
        return ()
    worst = int(np.argmax(moved / far))
    blame = "nothing holds it" if journey.plan.feed.controller is None else "the loop is not stable"
    times = _FAR * moved[worst] / far[worst]
    return (f"{model.coordinates[worst]} has gone {times:.1g} times the size of the machine, as if {blame}",)


def _far(model: Plant) -> np.ndarray:
    """A million times the size of the machine in each freedom that travels."""
    return np.where(turning(model), np.inf, _FAR * yardsticks(model))
