"""Machines without a length of their own, and motions below all tolerances: what is little there is not known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import components, farthest, turning, yardsticks
from flexctrl.dynamics.steps import Controlled

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["faint", "is_faint", "little", "unsized"]

_LITTLE, _NOTHING, _FIT = 20.0, 1e-2, 1e-3
"""Absolute tolerances that a motion goes through: a few errors of steps, no more than rounding; what fits."""
_FOLLOWED, _MANY = 0.4, 40
"""Radians in a step that are followed; steps of which one in four, looked at, tells how fast a part turns round."""
_ROUNDING = 1e-3
"""Where a part rests beside what moves, and has outputs of its own."""


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
    plan, tolerance = journey.plan, journey.plan.tolerance
    if not (plan.model.structure.sized and isinstance(plan.method.pace, Controlled) and journey.mark.steps):
        return ()
    gone = float((journey.books.sums.moved / journey.books.reach).max(initial=0.0))
    if not _NOTHING * tolerance.absolute < gone < _LITTLE * tolerance.absolute:
        return ()
    fit = _FIT * 10.0 ** np.floor(np.log10(gone))
    return (
        f"nothing moves by more than {gone:.1g} of the machine's size or of a radian, and each step may err by "
        f"{tolerance.absolute:.1g} of that: give Tolerance({tolerance.relative:g}, {fit:.0e})",
    )


def faint(journey: Journey) -> np.ndarray:
    """Return which freedoms are of parts that move by little against what each step may err by, shape (n,).

    Nothing is known of them, whatever is estimated, as steps are as long as if nothing moved there: but where these are
    short for how fast it moves all the same, and many. Samples keep them shorter than the tolerance would.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    numpy.ndarray
    """
    plan, mark, pace = journey.plan, journey.mark, journey.plan.method.pace
    gone = farthest(plan.model, journey.books.sums.moved)
    if not (isinstance(pace, Controlled) and mark.steps):
        return np.zeros(gone.shape, dtype=bool)
    shorter = min(1.0, journey.point.state.t / (mark.steps * mark.size)) if plan.feed.sample_time else 1.0
    allowed = plan.tolerance.absolute * shorter**pace.steepness
    return np.asarray((gone > _ROUNDING * allowed) & (gone < _LITTLE * allowed) & _unresolved(journey))


def _unresolved(journey: Journey) -> np.ndarray:
    """Which freedoms are of parts that turn round, by ω² = Σ h a²/Σ h v², faster than steps follow, shape (n,)."""
    model, sums, mark = journey.plan.model, journey.books.sums, journey.mark
    part, yards = components(model), yardsticks(model)
    swept, bent = (np.bincount(part, weights=some / yards**2) for some in (sums.swept, sums.bent))
    step = journey.point.state.t / mark.steps
    return np.asarray((bent * step**2 > _FOLLOWED**2 * swept)[part] | (mark.steps < _MANY))


def is_faint(journey: Journey, parts: np.ndarray) -> bool:
    """Tell whether all that moves by more than rounding is faint.

    Parameters
    ----------
    journey : Journey
    parts : numpy.ndarray, shape (n,)
        Which freedoms are of faint parts.

    Returns
    -------
    bool
    """
    gone = farthest(journey.plan.model, journey.books.sums.moved)
    worst = int(np.argmax(gone))
    return bool(parts[worst] and gone[worst] > _NOTHING * journey.plan.tolerance.absolute)
