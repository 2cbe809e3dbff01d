"""The time after a step, in compiled loops and in plain ones."""

from __future__ import annotations

import math

__all__ = ["later"]

_ROUND_OFF = 1e-15


def later(t: float, h: float) -> float:
    """Return the time a step of length h after t: where that is a multiple of h but for round-off, the multiple.

    Summed up step by step, times would drift off the grid on which rows are due.
    """
    end = t + h
    whole = math.floor(end / h + 0.5) * h
    if abs(whole - end) <= _ROUND_OFF * end:
        return whole
    return end
