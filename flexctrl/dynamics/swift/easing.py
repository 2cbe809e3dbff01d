"""Freedoms of first order that settle within a step: how they set out after a jump.

What tends to its balance as exp(−λt) begins with the rate λD and its change −λ²D. A step that does not see the time
1/λ makes nonsense of these. So they are chosen anew: those from which Newmark's formulas, with the change of the rate
that there is at the end, arrive at the place and the rate that there are at the end. What they push feels their mean
over the step: a motor whose torque is there after a thousandth of it is pushed from the outset.
"""

from __future__ import annotations

import math

__all__ = ["eased_change", "eased_rate", "felt_rate", "unresolved"]

_SEEN = 2.0
_FLAT = 0.02


def unresolved(rate: float, change: float, h: float) -> bool:
    """Tell whether a rate that changes like this is gone, or nearly, after a step."""
    return rate * change < 0.0 and abs(change) * h > _SEEN * abs(rate)


def eased_change(rate: float, change: float, h: float, beta: float, gamma: float) -> float:
    """Return the change of the rate to set out with; none where the end does not depend on it alone (ρ near 0)."""
    slope = 0.5 + beta - gamma
    if slope < _FLAT:
        return 0.0
    z = -change / rate * h
    left = math.exp(-z)
    way = rate * h * ((1.0 - left) / z + beta * z * left)
    return (rate * left * (1.0 + gamma * z) * h - way) / (h * h * slope)


def eased_rate(rate: float, change: float, h: float, beta: float, gamma: float) -> float:
    """Return the rate to set out with."""
    z = -change / rate * h
    left = math.exp(-z)
    way = rate * ((1.0 - left) / z + beta * z * left)
    return way - h * (0.5 - beta) * eased_change(rate, change, h, beta, gamma)


def felt_rate(rate: float, change: float, h: float, beta: float, gamma: float) -> float:
    """Return the rate whose mean with the one that a step ends with is the mean over it.

    Where the end does not depend on how the rate changes (ρ near 0) the step begins and ends with the mean.
    """
    if 0.5 + beta - gamma < _FLAT:
        return eased_rate(rate, change, h, beta, gamma)
    return eased_rate(rate, change, h, 0.25, 0.5)
