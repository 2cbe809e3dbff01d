"""When Newton's method has solved a step: the same for plain steps and for compiled loops."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["ASTRAY", "ITERATIONS", "POOR", "circling", "small_enough", "wanted"]

ITERATIONS = 12
POOR = 0.25
"""Corrections that shrink by no more than this ask for a fresh tangent."""
ASTRAY = 1.5
"""What steps turn beyond what was foreseen leads to another root [rad]."""
_ROUND_OFF = 1e-13
"""Corrections below this that do not shrink any more are round-off."""
_ALIKE = 1e-4


def small_enough(size: float, contraction: float, tolerance: float, exact: bool) -> bool:
    """Tell whether a correction of this size was the last that is needed, or can be had."""
    can_be = tolerance if exact else _ROUND_OFF
    return size <= wanted(tolerance, exact) or (contraction > POOR and size <= can_be)


def wanted(tolerance: float, exact: bool) -> float:
    """Return the size of the last correction; exact steps end near stiff flanks, whose force is felt in last digits."""
    return min(tolerance, _ROUND_OFF) if exact else tolerance


def circling(sizes: Sequence[float]) -> bool:
    """Tell whether the last corrections are of one size: from one side of a jump of forces to the other and back.

    It spares plain steps, each of whose corrections takes milliseconds, the rest of them; loops go through them all.
    """
    last = sizes[-3:]
    return len(last) == 3 and max(last) - min(last) <= _ALIKE * max(last)
