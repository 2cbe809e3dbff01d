"""Machines without a length of their own, and motions below all tolerances: what is little there is not known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import turning, yardsticks
from flexctrl.dynamics.steps import Controlled

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["little", "unsized"]

_LITTLE, _NOTHING, _FIT = 20.0, 1e-2, 1e-3
"""Absolute tolerances that a motion goes through: a few errors of steps, no more than rounding; what fits."""


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


def little(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of a motion that is little against what each of its steps may err by.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
    """
    plan, reach, tolerance = journey.plan, journey.books.reach, journey.plan.tolerance
    if not (plan.model.structure.sized and isinstance(plan.method.pace, Controlled) and journey.mark.steps):
        return ()
    gone = float((journey.books.sums.moved / reach).max(initial=0.0))
    if not _NOTHING * tolerance.absolute < gone < _LITTLE * tolerance.absolute:
        return ()
    fit = _FIT * 10.0 ** np.floor(np.log10(gone))
    return (
        f"nothing moves by more than {gone:.1g} of the machine's size or of a radian, and each step may err by "
        f"{tolerance.absolute:.1g} of that: give Tolerance({tolerance.relative:g}, {fit:.0e})",
    )
