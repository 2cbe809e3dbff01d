"""Machines without a length of their own: a tolerance does not know what is little for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import turning, yardsticks
from flexctrl.dynamics.steps import Controlled

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["unsized"]


def unsized(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of a point that has moved by so little that errors count against a unit of length.

    Farther off, they count against the way that it has moved, which has the same unit.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    plan, model = journey.plan, journey.plan.model
    if model.structure.sized or not (isinstance(plan.method.pace, Controlled) and journey.mark.steps):
        return ()
    yard, tolerance = yardsticks(model), plan.tolerance
    way = float(journey.books.sums.moved[~turning(model) & np.isfinite(yard)].max(initial=0.0))
    if not 0.0 < tolerance.relative * way < tolerance.absolute:
        return ()
    fit = tolerance.absolute * 10.0 ** np.floor(np.log10(way))
    return (
        f"nothing in the machine has a length: errors count against one unit of length, and it has moved by {way:.1g} "
        f"of it: give Tolerance({tolerance.relative:g}, {fit:.0e})",
    )
