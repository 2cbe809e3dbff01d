"""Until when runs beside another one agree with each other: of a part that was cut, they alone know the rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.notes.beside import TOLD
from flexctrl.dynamics.notes.gap import between, gap_at, is_short
from flexctrl.dynamics.notes.right import is_after_a_cut
from flexctrl.dynamics.others import Other
from flexctrl.dynamics.run import Run

__all__ = ["agreed"]

_SECOND = 2.0
_LOOKS = 64
"""Instants at which two are looked at."""


def agreed(other: Other, known: tuple[Other, ...], journey: Journey, order: float) -> Callable[[float], float]:
    """Return until when a run beside agrees with the nearest one known, from where both began.

    What goes on from a part that was cut may be near one of them by chance, wrong as both are. Nothing is asked
    where others have been laid beside all of it, nor of methods of high order, which part as tolerances tell.

    Parameters
    ----------
    other : Other
    known : tuple of Other
    journey : Journey
        How the run went that they are beside.
    order : float
        Of its method.

    Returns
    -------
    callable
        No later than a time [s].
    """
    if not known or not is_after_a_cut(journey) or order > _SECOND:
        return float
    nearest = min(known, key=lambda one: one.beside.longer)
    left = abs(nearest.beside.longer**order - other.beside.longer**order)
    return lambda right: _apart_from(nearest.whole, other.whole, journey, right, TOLD * left)


def _apart_from(one: Run, other: Run, journey: Journey, right: float, least: float) -> float:
    """Until when two are apart by no more than so much, no later than a time."""
    end = min(right, one.final.t, other.final.t)
    if is_short(one, other, journey):
        t = np.linspace(max(one.track.starts[0], other.track.starts[0]), end, _LOOKS + 1)
        size = np.array([gap_at(one, other, journey, s) for s in t[1:].tolist()])
    else:
        gap = between(one, other, journey, max(one.report.steps, other.report.steps))
        t, size = np.append(max(one.t[0], other.t[0]), gap.t), gap.size
    wrong = size > least
    return min(right, float(t[int(np.argmax(wrong))])) if wrong.any() else right
