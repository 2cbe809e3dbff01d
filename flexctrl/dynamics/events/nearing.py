"""How steps near a corner of a law of force: the same for plain steps and for compiled loops."""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexctrl.kernels.native import seldom

__all__ = [
    "ASTRAY",
    "LANDINGS",
    "LEAD",
    "LEAST",
    "MOST",
    "NUDGES",
    "SHORTEST",
    "SMALLEST",
    "TRIES",
    "Bracket",
    "inside",
    "narrow",
    "near_enough",
    "shorter",
    "to_zero",
]

SMALLEST = 1e-12
SHORTEST = 1e-3  # of a run: before that a step may be shorter than those that the clock resolves later
LANDINGS, MOST = 12, 60
"""Corners that a step is shortened to, one after the other; steps taken to one of them."""
LEAD, LEAD_MOST, _LEAD_FAR = 1e-8, 1e-7, 1e-4
"""Shares of a step left to a corner: by intent, at most, and at most where no step ends nearer."""
ASTRAY = 1e-3
"""With more of a step left where the search ends, steps jump from short of the corner to beyond: it is another's."""
NUDGES, LEAST = 8, 1e-9
"""How often the way beyond a corner is lengthened; the share of a step that it is at first."""
TRIES = 9
_QUICK = 8


@dataclass
class Bracket:
    """Two times between which a value falls through zero, and what it is there where that is known."""

    low: float
    high: float
    ahead: float = 0.0
    behind: float = 0.0
    count: int = 0


@seldom
def narrow(b: Bracket, at: float, left: float) -> None:
    """Take a time for one of the two."""
    b.count += 1
    if left > 0.0:
        if at >= b.low:  # where a step ends short of what was asked, another may have come nearer
            b.low = at
            b.ahead = left
    else:
        b.high = at
        b.behind = left


@seldom
def inside(b: Bracket, at: float) -> float:
    """Return a time if it is between the two; else where a straight line is zero, or the middle."""
    if b.count >= _QUICK:
        return 0.5 * (b.low + b.high)
    if not (b.low < at and at < b.high) and b.ahead > 0.0 and b.behind < 0.0:
        at = b.low + (b.high - b.low) * b.ahead / (b.ahead - b.behind)
    return at if b.low < at and at < b.high else 0.5 * (b.low + b.high)


@seldom
def to_zero(before: float, was: float, now: float, value: float) -> float:
    """Return how much later than now a value is zero that has changed as it has since another time; NaN for never."""
    return value * (now - before) / (was - value) if was != value else math.nan


@seldom
def near_enough(left: float, h: float, lead: float, missed: bool) -> bool:
    """Tell whether so little time is left to a corner that a step may end there; ``missed``: where none ends nearer."""
    return left >= 0.0 and left <= max((_LEAD_FAR if missed else LEAD_MOST) * h, lead)


@seldom
def shorter(k: int) -> float:
    """Return by what share a step to a corner is shorter in a try: where a force jumps there, no step ends on it."""
    if k < 2:
        return 1e-9 * float(k)
    if k < 6:
        return math.pow(10.0, float(2 * k - 12))
    return 0.05 if k == 6 else 0.2 if k == 7 else 0.5
