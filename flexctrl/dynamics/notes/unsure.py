"""Signals that move by no more than what the tolerance lets a step err by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.outputs import reach, seen
from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.dynamics.steps import Controlled
from flexctrl.model.model import Model
from flexctrl.structure.outputs import Position, SwayAngle

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["unsure"]

_CLEAR = 10.0


def unsure(journey: Journey, y: np.ndarray) -> tuple[str, ...]:
    """Return what is to be said of places and angles whose motion the tolerance does not tell from errors.

    Errors are relative to how far what is coupled has moved: a sway of milliradians under a hoist of ten metres may be
    all error. Steps that samples keep shorter than the tolerance would have them err by less.

    Parameters
    ----------
    journey : Journey
        At its end, of steps of second order.
    y : numpy.ndarray, shape (rows, outputs)

    Returns
    -------
    tuple of str
    """
    plan, mark, state, moved = journey.plan, journey.mark, journey.point.state, journey.books.sums.moved
    model, tolerance = plan.model, plan.tolerance
    chosen = isinstance(plan.method.pace, Controlled) and plan.method.order == 2 and mark.steps > 0
    if not (chosen and isinstance(model, Model) and len(y) > 2):
        return ()
    judged = [i for i, o in enumerate(model.structure.outputs) if isinstance(o, Position | SwayAngle)]
    shorter = min(1.0, state.t / (mark.steps * mark.size)) ** 3
    yards = yardsticks(model)
    yards = np.where(np.isfinite(yards), yards, 0.0)
    allowed = shorter * (reach(journey) @ (yards * tolerance.of(farthest(model, moved))))
    way, far = seen(journey, y)
    found = [i for i in judged if i in far and way[i] < _CLEAR * allowed[i]]
    return tuple(
        f"{model.outputs[i]} has moved by {way[i]:.2g}, and each step may err by {allowed[i]:.2g} in it under "
        f"Tolerance({tolerance.relative:g}, {tolerance.absolute:g}): give a smaller one, or it may be all error"
        for i in found
    )
