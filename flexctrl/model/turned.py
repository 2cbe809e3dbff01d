"""The angle about an axis that is left of a rotation when the tilt of the axis is undone, followed over steps."""

from __future__ import annotations

import math

from flexctrl.kernels.native import Reals

__all__ = ["across", "angle_went", "face", "turned"]

_HALF, _TURN = math.pi, 2.0 * math.pi


def turned(R: Reals, base: Reals, axis: Reals, about: float) -> float:
    """Return that angle of baseᵀ R, with the whole turns that bring it next to what it is about."""
    sine = 0.0
    cosine = 0.0
    for i in range(3):
        j = i + 1 if i < 2 else 0
        k = 3 - i - j
        axial = across(base, R, k, j) - across(base, R, j, k)
        sine += axis[i] * axial
        cosine += across(base, R, i, i)
        for m in range(3):
            cosine -= axis[i] * axis[m] * across(base, R, i, m)
    angle = math.atan2(sine, cosine)
    return angle + _TURN * math.floor((about - angle) / _TURN + 0.5)


def face(R: Reals, base: Reals, q: Reals) -> None:
    """Write a quaternion of baseᵀ R, of any length: by its largest part (Shepperd 1978)."""
    trace = across(base, R, 0, 0) + across(base, R, 1, 1) + across(base, R, 2, 2)
    most = trace
    largest = 3
    for i in range(3):
        if across(base, R, i, i) > most:
            most = across(base, R, i, i)
            largest = i
    for i in range(3):
        j = i + 1 if i < 2 else 0
        k = 3 - i - j
        axial = across(base, R, k, j) - across(base, R, j, k)
        if largest == 3:
            q[0] = 1.0 + trace
            q[1 + i] = axial
        if largest == i:
            q[0] = axial
            q[1 + i] = 1.0 + 2.0 * most - trace
            q[1 + j] = across(base, R, i, j) + across(base, R, j, i)
            q[1 + k] = across(base, R, i, k) + across(base, R, k, i)


def angle_went(before: Reals, now: Reals, axis: Reals, about: float) -> float:
    """Return how far that angle goes on the way from a quaternion to another; about so far, if it is over half a turn.

    The way is a turn, the shorter one. On it the scalar part and that along the axis go along an arc of an ellipse,
    less than half of it: however near the axis comes to its opposite, where both are zero, it passes on one side.
    """
    likewise = 0.0
    for i in range(4):
        likewise += before[i] * now[i]
    sign = 1.0 if likewise >= 0.0 else -1.0
    along = 0.0
    then = 0.0
    for i in range(3):
        along += axis[i] * before[1 + i]
        then += sign * axis[i] * now[1 + i]
    scalar = sign * now[0]
    swept = 2.0 * math.atan2(before[0] * then - along * scalar, before[0] * scalar + along * then)
    if about > _HALF or about < -_HALF:
        swept += _TURN * math.floor((about - swept) / _TURN + 0.5)
    return swept


def across(base: Reals, R: Reals, i: int, j: int) -> float:
    """Return an entry of baseᵀ R."""
    return base[i] * R[j] + base[3 + i] * R[3 + j] + base[6 + i] * R[6 + j]
