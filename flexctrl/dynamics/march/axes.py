"""Factorised matrices seen from axes that turn with the nodes: compiled loops.

A part that turns as a whole keeps its matrix in axes that turn with it. What makes a factorised matrix stale
is that axes that meet in a piece have turned against each other; see also `swaying`.
"""

from __future__ import annotations

from flexctrl.dynamics.march.record import Factors
from flexctrl.dynamics.march.swaying import bend, lead, sway_back, sway_on, turned_by, unturned
from flexctrl.kernels.eights import eight, larger, largest
from flexctrl.kernels.native import Reals
from flexctrl.model.flat.axes import Axes
from flexctrl.model.flat.fronts import Fronts
from flexctrl.model.flat.solving import copy_on, solve_own
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import NODE_SLOT

__all__ = ["mark", "solved", "solved_with", "turned_too_far"]


def mark(axes: Axes, factors: Factors, f: Flat) -> None:
    """Remember the axes: the matrix is made now."""
    for k in range(axes.count):
        R = f.z[NODE_SLOT * axes.nodes[k] + 3 :]
        for i in range(9):
            factors.made[9 * k + i] = R[i]
            factors.turned[9 * k + i] = 1.0 if i % 4 == 0 else 0.0
    if factors.swaying > 0:
        lead(axes, f, factors.bends)
    for k in range(axes.angle_count):
        factors.angles[k] = f.q[axes.angles[k]] + f.step[axes.angles[k]]
    copy_on(f.posed, f.z, factors.place)


def turned_too_far(axes: Axes, factors: Factors, f: Flat, most: float) -> bool:
    """Tell whether the machine has turned in itself since the matrix was made; work out how the axes have."""
    for k in range(axes.angle_count):
        i = axes.angles[k]
        if abs(f.q[i] + f.step[i] - factors.angles[k]) > most:
            return True
    for k in range(axes.count):
        since(f.z[NODE_SLOT * axes.nodes[k] + 3 :], factors.made[9 * k :], factors.turned[9 * k :])
    if factors.swaying > 0:
        bend(axes, factors.turned, factors.bends)
    if axes.pair_count == 0:
        return False
    apart = 0.0 * eight(factors.made)
    rest = 0.0
    for k in range(axes.pair_count):
        one = factors.turned[9 * axes.pairs[2 * k] :]
        if axes.pairs[2 * k + 1] >= 0:
            other = factors.turned[9 * axes.pairs[2 * k + 1] :]
            apart = larger(apart, abs(eight(one) - eight(other)))
            rest = max(rest, abs(one[8] - other[8]))
        else:
            rest = max(rest, tilt(one))
    return max(largest(apart), rest) > most


def since(R: Reals, made: Reals, turned: Reals) -> None:
    """Work out R madeᵀ."""
    turned[0] = R[0] * made[0] + R[1] * made[1] + R[2] * made[2]
    turned[1] = R[0] * made[3] + R[1] * made[4] + R[2] * made[5]
    turned[2] = R[0] * made[6] + R[1] * made[7] + R[2] * made[8]
    turned[3] = R[3] * made[0] + R[4] * made[1] + R[5] * made[2]
    turned[4] = R[3] * made[3] + R[4] * made[4] + R[5] * made[5]
    turned[5] = R[3] * made[6] + R[4] * made[7] + R[5] * made[8]
    turned[6] = R[6] * made[0] + R[7] * made[1] + R[8] * made[2]
    turned[7] = R[6] * made[3] + R[7] * made[4] + R[8] * made[5]
    turned[8] = R[6] * made[6] + R[7] * made[7] + R[8] * made[8]


def tilt(a: Reals) -> float:
    """Return the largest difference of the entries of a rotation from those of none."""
    most = 0.0
    for i in range(9):
        most = max(most, abs(a[i] - 1.0) if i % 4 == 0 else abs(a[i]))
    return most


def solved(axes: Axes, factors: Factors, fronts: Fronts, b: Reals) -> None:
    """Solve in place with the matrix as it would be now."""
    solved_with(axes, factors, fronts, factors.down, factors.up, b)


def solved_with(axes: Axes, factors: Factors, fronts: Fronts, down: Reals, up: Reals, b: Reals) -> None:
    """Do so with its numbers as they are kept somewhere."""
    turn_back(axes, factors, b)
    solve_own(fronts, down, up, b, factors.work, factors.wide)
    turn_on(axes, factors, b)


def turn_back(axes: Axes, factors: Factors, b: Reals) -> None:
    """See forces from the axes as they were."""
    for k in range(axes.count):
        moment = axes.triples[2 * k]
        force = axes.triples[2 * k + 1]
        if factors.swaying > 0 and axes.share[k] > 0.0:
            sway_back(factors.turned[9 * k :], factors.bends[6 * k :], b[force:], b[moment:])
        else:
            if force >= 0:
                unturned(factors.turned[9 * k :], b[force:])
            if moment >= 0:
                unturned(factors.turned[9 * k :], b[moment:])


def turn_on(axes: Axes, factors: Factors, b: Reals) -> None:
    """See motions in the axes as they were from space."""
    for k in range(axes.count):
        turn = axes.triples[2 * k]
        place = axes.triples[2 * k + 1]
        if factors.swaying > 0 and axes.share[k] > 0.0:
            sway_on(factors.turned[9 * k :], factors.bends[6 * k :], b[place:], b[turn:])
        else:
            if place >= 0:
                turned_by(factors.turned[9 * k :], b[place:])
            if turn >= 0:
                turned_by(factors.turned[9 * k :], b[turn:])
