"""Corners of laws of force in compiled loops: whether a step passes one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.dynamics.events.nearing import Bracket
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.kernels.native import Reals, Wholes
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT

__all__ = [
    "Corners",
    "beyond",
    "comes_through",
    "corners_of",
    "crossed",
    "over_a_jump",
    "passes",
    "tell_sides",
    "value",
    "within",
]


@dataclass
class Corners:
    """The corners of a model's laws of force; see `Kinks`.

    Attributes
    ----------
    lines, turns, rails, sheaves, jumping : int
        The last ones of the lines lead to sheaves of winches; how many corners there are where forces jump.
    ends : Wholes
        Slots of the nodes at the ends of each line.
    drives : Wholes
    straight : int
        How many of the lines, the first ones, are measured along their directions at rest, in small motion.
    ways : Reals
        These directions (3 each).
    lengths, sums : Reals
        Where lines have corners; weights of driven coordinates and source angles, and where their sums have (3 each).
    wound, shares : Wholes, Reals
        Of each line, the drive that pays it out, and by how much its motor moves the corner.
    travels : Wholes
        Slots of the nodes whose x is how far something has travelled.
    spans : Reals
        Sign and offset of each end of a rail (2 each).
    dust, sides, there : Reals
        What is zero but for round-off; the sides the motion is on, 0: not yet known; room for values.
    jumps, made : Wholes, Reals
        These, and how far beyond each the tangent was made; 0: on it, but for round-off.
    arms : Reals
        Of the lines to sheaves, before the step (3 each).
    last : Wholes
        Which are ends of runs.
    step, change : Reals
        Room for a step and a sum of forces.
    bracket : Bracket
        Of the time when a corner is met.
    turning : int
        Whether steps may end at corners and start anew beyond in the loops.
    which, when : int, float
        The corner where the last one did, and its time.
    """

    LASTING = ("turning",)

    lines: int
    turns: int
    rails: int
    sheaves: int
    jumping: int
    straight: int
    ends: Wholes
    drives: Wholes
    ways: Reals
    lengths: Reals
    sums: Reals
    wound: Wholes
    shares: Reals
    travels: Wholes
    spans: Reals
    dust: Reals
    sides: Reals
    there: Reals
    jumps: Wholes
    made: Reals
    arms: Reals
    last: Wholes
    step: Reals
    change: Reals
    bracket: Bracket
    turning: int
    which: int = 0
    when: float = 0.0


def corners_of(F: Flattened) -> Corners:
    """Return the corners of a model."""
    kinks = F.model.kinks.met
    (ends, lengths), (drives, sums), (travels, spans) = kinks.lines, kinks.shafts, kinks.rails
    sides, there = np.zeros((2, len(kinks.names)))
    counts = len(lengths), len(drives), len(travels), kinks.sheaves, len(kinks.jumps), len(kinks.ways)
    places = (
        NODE_SLOT * ends.ravel(),
        drives,
        kinks.ways.ravel(),
        lengths,
        sums.ravel(),
        *kinks.wound,
        NODE_SLOT * travels,
        spans.ravel(),
    )
    last = np.array([bool(end) for end in kinks.ends], dtype=np.int64)
    step, change = np.zeros((2, F.flat.padded))
    turning = int(bool(kinks.names) and not weightless(F.model).size)
    arms, made, bracket = np.zeros(3 * kinks.sheaves), np.zeros(len(kinks.jumps)), Bracket(0.0, 0.0)
    known, room = (kinks.dust, sides, there, kinks.jumps, made, arms), (step, change)
    return Corners(*counts, *places, *known, last, *room, bracket, turning)


def passes(c: Corners, f: Flat) -> bool:
    """Tell whether the step under way passes a corner."""
    return crossed(c, f) >= 0 or comes_through(c, f)


def crossed(c: Corners, f: Flat) -> int:
    """Return the first corner that the step under way passes; −1 if it passes none."""
    for k in range(c.lines + c.turns + c.rails):
        if not within(c, k, value(c, f, k)):
            return k
    return -1


def tell_sides(c: Corners, f: Flat) -> None:
    """Note how far beyond corners where forces jump the motion is."""
    for i in range(c.jumping):
        k = c.jumps[i]
        c.made[i] = clear_of(value(c, f, k), c.dust[k])


def over_a_jump(c: Corners, f: Flat) -> bool:
    """Tell whether forces jump between where the tangent was made and where the motion is."""
    away = False
    for i in range(c.jumping):
        k = c.jumps[i]
        away = away or c.made[i] * clear_of(value(c, f, k), c.dust[k]) < 0.0
    return away


def clear_of(value: float, dust: float) -> float:
    """Return a value if it is clear of zero, else 0."""
    return value if abs(value) > dust else 0.0


def value(c: Corners, f: Flat, k: int) -> float:
    """Return how far a part is beyond its corner."""
    if k < c.lines:
        return stretch(c, f, k)
    if k < c.lines + c.turns:
        return turn(c, f, k - c.lines)
    i = k - c.lines - c.turns
    return c.spans[2 * i] * f.z[c.travels[i]] + c.spans[2 * i + 1]


def comes_through(c: Corners, f: Flat) -> bool:
    """Tell whether some line to a sheave may have come through it over the step; take up where they all are."""
    came = False
    for k in range(c.lines - c.sheaves, c.lines):
        came = through(c, f, k) or came
    return came


def stretch(c: Corners, f: Flat, k: int) -> float:
    """Return how far a line is beyond its corner."""
    start = f.z[c.ends[2 * k] :]
    end = f.z[c.ends[2 * k + 1] :]
    out = c.shares[k] * f.z[f.drive_base + DRIVE_SLOT * c.wound[k]] if c.shares[k] != 0.0 else 0.0
    return beyond(c, k, end[0] - start[0], end[1] - start[1], end[2] - start[2]) - out


def beyond(c: Corners, k: int, x: float, y: float, z: float) -> float:
    """Return how far a line along an arm is beyond its corner."""
    if k < c.straight:
        way = c.ways[3 * k :]
        return way[0] * x + way[1] * y + way[2] * z - c.lengths[k]
    return math.sqrt(x * x + y * y + z * z) - c.lengths[k]


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
