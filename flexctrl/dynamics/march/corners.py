"""Corners of laws of force in compiled loops: steps that pass one are left to be ended there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.native import Reals, Wholes
from flexctrl.model.flat.flat import Flat
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.model import Model

__all__ = ["Corners", "corners_of", "passes", "within"]


@dataclass
class Corners:
    """The corners of a model's laws of force; see `Kinks`.

    Attributes
    ----------
    lines, turns, rails, sheaves : int
        The last ones of the lines lead to sheaves of winches.
    ends : Wholes
        Slots of the nodes at the ends of each line.
    drives : Wholes
    lengths, sums : Reals
        Where lines have corners; weights of driven coordinates and source angles, and where their sums have (3 each).
    travels : Wholes
        Slots of the nodes whose x is how far something has travelled.
    spans : Reals
        Sign and offset of each end of a rail (2 each).
    dust, sides : Reals
        What is zero but for round-off; the sides the motion is on, 0: not yet known.
    arms : Reals
        Of the lines to sheaves, before the step (3 each).
    """

    lines: int
    turns: int
    rails: int
    sheaves: int
    ends: Wholes
    drives: Wholes
    lengths: Reals
    sums: Reals
    travels: Wholes
    spans: Reals
    dust: Reals
    sides: Reals
    arms: Reals


def corners_of(model: Model) -> Corners:
    """Return the corners of a model."""
    kinks = model.kinks
    (ends, lengths), (drives, sums), (travels, spans) = kinks.lines, kinks.shafts, kinks.rails
    sides = np.zeros(len(kinks.names))
    counts = len(lengths), len(drives), len(travels), kinks.sheaves
    places = NODE_SLOT * ends.ravel(), drives, lengths, sums.ravel(), NODE_SLOT * travels, spans.ravel()
    return Corners(*counts, *places, kinks.dust, sides, np.zeros(3 * kinks.sheaves))


def passes(c: Corners, f: Flat) -> bool:
    """Tell whether the step under way passes a corner."""
    for k in range(c.lines + c.turns):
        value = stretch(c, f, k) if k < c.lines else turn(c, f, k - c.lines)
        if not within(c, k, value):
            return True
    for k in range(c.lines - c.sheaves, c.lines):
        if through(c, f, k):
            return True
    for k in range(c.rails):
        left = c.spans[2 * k] * f.z[c.travels[k]] + c.spans[2 * k + 1]
        if not within(c, c.lines + c.turns + k, left):
            return True
    return False


def stretch(c: Corners, f: Flat, k: int) -> float:
    """Return how far a line is beyond its corner."""
    start = f.z[c.ends[2 * k] :]
    end = f.z[c.ends[2 * k + 1] :]
    square = 0.0
    for j in range(3):
        square += (end[j] - start[j]) * (end[j] - start[j])
    return math.sqrt(square) - c.lengths[k]


def through(c: Corners, f: Flat, k: int) -> bool:
    """Tell whether a line to a sheave may have come through it over the step."""
    a = c.ends[2 * k]
    b = c.ends[2 * k + 1]
    arm = c.arms[3 * (k + c.sheaves - c.lines) :]
    along = 0.0
    for j in range(3):
        now = f.z[b + j] - f.z[a + j]
        along += arm[j] * now
        arm[j] = now
    return along < 0.0


def turn(c: Corners, f: Flat, k: int) -> float:
    """Return how far a drive is beyond its corner."""
    i = c.drives[k]
    own = f.z[f.drive_base + DRIVE_SLOT * i]
    return c.sums[3 * k] * f.found[i] + c.sums[3 * k + 1] * own - c.sums[3 * k + 2]


def within(c: Corners, k: int, value: float) -> bool:
    """Tell whether a value is on the side it was on."""
    return abs(value) <= c.dust[k] or value * c.sides[k] > 0.0
