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

__all__ = ["bend", "lead", "sway_back", "sway_on", "turned_by", "unturned"]


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


def sway_back(R: Reals, bent: Reals, force: Reals, moment: Reals) -> None:
    """See a force and a moment from axes as they were; add to the force what the moment does, on turns that follow."""
    m0 = R[0] * moment[0] + R[3] * moment[1] + R[6] * moment[2]
    m1 = R[1] * moment[0] + R[4] * moment[1] + R[7] * moment[2]
    m2 = R[2] * moment[0] + R[5] * moment[1] + R[8] * moment[2]
    curved = bent[0] * m0 + bent[1] * m1 + bent[2] * m2
    twisted = bent[0] * bent[3] + bent[1] * bent[4] + bent[2] * bent[5]
    f0 = R[0] * force[0] + R[3] * force[1] + R[6] * force[2] + (bent[3] * curved - m0 * twisted)
    f1 = R[1] * force[0] + R[4] * force[1] + R[7] * force[2] + (bent[4] * curved - m1 * twisted)
    f2 = R[2] * force[0] + R[5] * force[1] + R[8] * force[2] + (bent[5] * curved - m2 * twisted)
    force[0] = f0
    force[1] = f1
    force[2] = f2
    moment[0] = m0
    moment[1] = m1
    moment[2] = m2


def sway_on(R: Reals, bent: Reals, place: Reals, turn: Reals) -> None:
    """Add to a turn what the displacement lacks in shear; see both from space."""
    moved = bent[3] * place[0] + bent[4] * place[1] + bent[5] * place[2]
    twisted = bent[0] * bent[3] + bent[1] * bent[4] + bent[2] * bent[5]
    a0 = turn[0] + (bent[0] * moved - place[0] * twisted)
    a1 = turn[1] + (bent[1] * moved - place[1] * twisted)
    a2 = turn[2] + (bent[2] * moved - place[2] * twisted)
    turned_by(R, place)
    turn[0] = R[0] * a0 + R[1] * a1 + R[2] * a2
    turn[1] = R[3] * a0 + R[4] * a1 + R[5] * a2
    turn[2] = R[6] * a0 + R[7] * a1 + R[8] * a2


def turned_by(R: Reals, x: Reals) -> None:
    """Turn a vector."""
    first = R[0] * x[0] + R[1] * x[1] + R[2] * x[2]
    second = R[3] * x[0] + R[4] * x[1] + R[5] * x[2]
    x[2] = R[6] * x[0] + R[7] * x[1] + R[8] * x[2]
    x[0] = first
    x[1] = second


def unturned(R: Reals, x: Reals) -> None:
    """Turn a vector back."""
    first = R[0] * x[0] + R[3] * x[1] + R[6] * x[2]
    second = R[1] * x[0] + R[4] * x[1] + R[7] * x[2]
    x[2] = R[2] * x[0] + R[5] * x[1] + R[8] * x[2]
    x[0] = first
    x[1] = second
