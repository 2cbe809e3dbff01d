"""Whole turns that a search for an equilibrium adds to angles which are only shown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from flexctrl.model.balance import Balance
from flexctrl.model.state import State
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import RigidBody
from flexctrl.structure.drives import RotaryDrive
from flexctrl.structure.structure import Structure

__all__ = ["recounted"]

_TURNED = 1.0
"""What is held and goes farther may take other parts round [rad, sizes of the machine]."""


def recounted(balance: Balance, start: State, state: State) -> State:
    """Return where masses have led a machine, without whole turns on the way there that it knows nothing of.

    They lead it by no path of its own, over and over maybe. Turns count that drives and beams bear, and those through
    which something held is turned.

    Parameters
    ----------
    balance : Balance
    start : State
        Of the search.
    state : State
        Its end.

    Returns
    -------
    State
        Angles that outputs show are as near to those of the start as the pose allows, where nothing counts turns.
    """
    twists = balance.model.motion.twists
    if not state.shown.size or balance.astray(start) > _TURNED:
        return state
    near = twists.next_to(start.shown, state.R)
    if (np.abs(near - state.shown) < np.pi).all():
        return state
    bears = _bearing(balance.model.structure)
    return replace(state, shown=np.where(bears[twists.at] == bears[twists.base], state.shown, near))


def _bearing(structure: Structure) -> np.ndarray:
    """The lowest number of the nodes, the ground last, through which each node bears whole turns of others."""
    lead, pairs = np.arange(len(structure.nodes) + 1), list(_pairs(structure))
    while any(lead[one] != lead[other] for one, other in pairs):
        for one, other in pairs:
            lead[[one, other]] = min(lead[one], lead[other])
    return lead


def _pairs(structure: Structure) -> Iterator[tuple[int, int]]:
    """Nodes whose turns against each other something bears: a part, joints that hold all rotations, or a drive."""
    number, ground = structure.number, len(structure.nodes)
    for part in structure.elements:
        if isinstance(part, Beam | RigidBody):
            yield from pairwise(map(number, part.nodes))
    first = {(0, 0, 0): ground}  # of the nodes with the same rotations; none at all is that of the ground
    for i, row in enumerate(structure.join_table.rows):
        yield first.setdefault(row[3:], i), i
    for drive in structure.drives:
        if isinstance(drive, RotaryDrive):
            yield number(drive.node), ground if drive.against is None else number(drive.against)
