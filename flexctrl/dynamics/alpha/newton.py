"""When Newton's method has solved a step: the same for plain steps and for compiled loops."""

from __future__ import annotations

__all__ = ["ASTRAY", "ITERATIONS", "POOR", "small_enough"]

ITERATIONS = 12
POOR = 0.25
"""Corrections that shrink by no more than this ask for a fresh tangent."""
ASTRAY = 1.5
"""What steps turn beyond what was foreseen leads to another root [rad]."""
_ROUND_OFF = 1e-13
"""Corrections below this that do not shrink any more are round-off."""


def small_enough(size: float, contraction: float, tolerance: float) -> bool:
    """Tell whether a correction of this size was the last that is needed, or can be had."""
    return size <= tolerance or (contraction > POOR and size <= _ROUND_OFF)
