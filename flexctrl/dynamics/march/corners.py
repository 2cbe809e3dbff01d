"""Corners of laws of force in compiled loops: steps that pass one are left to be ended there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.native import Reals, Wholes
from flexctrl.model.flat import Flat
from flexctrl.model.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.model import Model

__all__ = ["Corners", "corners_of", "passes"]


@dataclass
class Corners:
    """The corners of a model's laws of force; see `Kinks`.

    Attributes
    ----------
    lines, twists : int
    ends : Wholes
        Slots of the nodes at the ends of each line.
    drives : Wholes
    at, dust, sides : Reals
        Length or twist of each corner; what is zero but for round-off; the sides the motion is on, 0: not yet known.
    """

    lines: int
    twists: int
    ends: Wholes
    drives: Wholes
    at: Reals
    dust: Reals
    sides: Reals


def corners_of(model: Model) -> Corners:
    """Return the corners of a model."""
    kinks = model.kinks
    (ends, lengths), (drives, twists) = kinks.lines, kinks.shafts
    at = np.append(lengths, twists)
    return Corners(len(lengths), len(twists), NODE_SLOT * ends.ravel(), drives, at, kinks.dust, np.zeros(len(at)))


def passes(c: Corners, f: Flat) -> bool:
    """Tell whether the step under way passes a corner."""
    for k in range(c.lines + c.twists):
        value = length(c, f, k) if k < c.lines else twist(c, f, k - c.lines)
        if not within(c, k, value - c.at[k]):
            return True
    return False


def length(c: Corners, f: Flat, k: int) -> float:
    """Return the length of a line."""
    start = f.z[c.ends[2 * k] :]
    end = f.z[c.ends[2 * k + 1] :]
    square = 0.0
    for j in range(3):
        square += (end[j] - start[j]) * (end[j] - start[j])
    return math.sqrt(square)


def twist(c: Corners, f: Flat, k: int) -> float:
    """Return how far a shaft's ends have turned against each other, on the motor side."""
    i = c.drives[k]
    return f.ratios[i] * f.found[i] - f.z[f.drive_base + DRIVE_SLOT * i]


def within(c: Corners, k: int, value: float) -> bool:
    """Tell whether a value is on the side it was on."""
    return abs(value) <= c.dust[k] or value * c.sides[k] > 0.0
