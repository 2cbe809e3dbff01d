"""Shear of finely divided beams, seen from axes that have turned by different amounts: compiled loops.

Seen from nodes' axes whose turns change by κ along a beam, a displacement x of it as a whole strains it by −κ × x.
Elements shorter than 2.4 radii of gyration resist shear, by 12 EI/L², twice as much as stretching, or more: their
factorised matrix would soon be worth nothing, though no element has changed its shape. A node that turns by
κ (t·x) − x (t·κ) more, t the direction of the beam, undoes the shear. Forces follow, by the transposed.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.march.weave import dotted
from flexctrl.kernels.native import Reals
from flexctrl.model.flat.axes import Axes
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import NODE_SLOT

__all__ = ["bend", "lead", "sway_back", "sway_on", "unturned"]


def lead(axes: Axes, f: Flat, bends: Reals) -> None:
    """Enter which way fine beams lead, at nodes whose turns are nil now."""
    for k in range(axes.count):
        before = f.z[NODE_SLOT * axes.nodes[axes.beside[2 * k]] :]
        after = f.z[NODE_SLOT * axes.nodes[axes.beside[2 * k + 1]] :]
        square = 0.0
        for i in range(3):
            bends[6 * k + i] = 0.0
            bends[6 * k + 3 + i] = after[i] - before[i]
            square += bends[6 * k + 3 + i] * bends[6 * k + 3 + i]
        for i in range(6 * k + 3, 6 * k + 6):
            bends[i] = bends[i] / math.sqrt(square) if square > 0.0 else 0.0


def bend(axes: Axes, turned: Reals, bends: Reals) -> None:
    """Work out how fast turns change along fine beams, seen from each node's axes as they were."""
    for k in range(axes.count):
        if axes.share[k] > 0.0:
            before = turned[9 * axes.beside[2 * k] :]
            after = turned[9 * axes.beside[2 * k + 1] :]
            half = 0.5 * axes.share[k]
            bent = bends[6 * k :]
            bent[0] = half * (dotted(after[6:], before[3:]) - dotted(after[3:], before[6:]))
            bent[1] = half * (dotted(after[0:], before[6:]) - dotted(after[6:], before[0:]))
            bent[2] = half * (dotted(after[3:], before[0:]) - dotted(after[0:], before[3:]))
            unturned(turned[9 * k :], bent)


def sway_back(bent: Reals, force: Reals, moment: Reals) -> None:
    """Add to a force what the moment does, on turns that follow displacements."""
    way = bent[3:]
    curved = dotted(bent, moment)
    twisted = dotted(bent, way)
    for i in range(3):
        force[i] += way[i] * curved - moment[i] * twisted


def sway_on(bent: Reals, x: Reals, turn: Reals) -> None:
    """Add to a turn what the displacement lacks in shear."""
    way = bent[3:]
    moved = dotted(way, x)
    twisted = dotted(bent, way)
    for i in range(3):
        turn[i] += bent[i] * moved - x[i] * twisted


def unturned(R: Reals, x: Reals) -> None:
    """Turn a vector back."""
    first = R[0] * x[0] + R[3] * x[1] + R[6] * x[2]
    second = R[1] * x[0] + R[4] * x[1] + R[7] * x[2]
    x[2] = R[2] * x[0] + R[5] * x[1] + R[8] * x[2]
    x[0] = first
    x[1] = second
