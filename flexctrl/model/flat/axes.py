"""Axes that turn with nodes: seen from them, the matrix of a part that turns as a whole stays the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.native import Wholes
from flexctrl.model.flat.fronts import Plan
from flexctrl.model.model import Model

__all__ = ["Axes", "axes_of"]


@dataclass
class Axes:
    """Which degrees of freedom are seen from axes that turn with nodes.

    Attributes
    ----------
    count, triple_count, pair_count, angle_count : int
    nodes : Wholes
        The nodes with axes.
    triples : Wholes
        First of three degrees of freedom, and the number of their axes.
    pairs : Wholes
        Axes that meet in some piece; −1 for space.
    angles : Wholes
        Turning degrees of freedom without axes.
    """

    count: int
    triple_count: int
    pair_count: int
    angle_count: int
    nodes: Wholes
    triples: Wholes
    pairs: Wholes
    angles: Wholes


def axes_of(model: Model, plan: Plan, pattern: tuple[np.ndarray, np.ndarray]) -> Axes:
    """Give each node that turns all ways axes for its rotations, and for its displacements unless they have some.

    Parameters
    ----------
    model : Model
    plan : Plan
        The order of the degrees of freedom.
    pattern : tuple of numpy.ndarray
        Rows and columns of the entries of the tangent.

    Returns
    -------
    Axes
    """
    motion, position = model.motion, plan.position
    of = np.full(motion.n, -1)
    nodes: list[int] = []
    triples: list[tuple[int, int]] = []
    ropes = {int(motion.nodes[i]) for i, _ in motion.linkage.lines}
    for node, row in enumerate(motion.place):
        if node in ropes or not (row[3:] < motion.n).all():
            continue
        firsts = [p[0] for cells in (row[3:], row[:3]) if (p := _three(cells, of, position)).size]
        if firsts:
            triples += [(int(p), len(nodes)) for p in firsts]
            of[plan.order[np.add.outer(firsts, np.arange(3)).ravel()]] = len(nodes)
            nodes.append(node)
    alone = of < 0
    angles = position[np.flatnonzero(alone & _turning(model))]
    pairs = _pairs(model, pattern, of)
    return Axes(
        count=len(nodes),
        triple_count=len(triples),
        pair_count=len(pairs),
        angle_count=len(angles),
        nodes=np.array(nodes, dtype=int),
        triples=np.array(triples, dtype=int).ravel(),
        pairs=pairs.ravel(),
        angles=angles,
    )


def _three(cells: np.ndarray, of: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return where three degrees of freedom stand, if one after the other and without axes yet."""
    if not (cells < len(of)).all() or (of[cells] >= 0).any():
        return np.zeros(0, dtype=int)
    places = position[cells]
    return places if (np.diff(places) == 1).all() else np.zeros(0, dtype=int)


def _pairs(model: Model, pattern: tuple[np.ndarray, np.ndarray], of: np.ndarray) -> np.ndarray:
    """Return the axes that meet in some piece; what has no direction in space meets nothing."""
    names, motion = model.coordinates, model.motion
    scalar = np.array([name.endswith(("_turn", "_slide", "_source", *motion.scales)) for name in names])
    for i, _ in motion.linkage.lines:
        cells = motion.place[motion.nodes[i], 3:]
        scalar[cells[cells < motion.n]] = True
    rows, columns = pattern
    one, other = of[rows], of[columns]
    meet = ~scalar[rows] & ~scalar[columns] & (one > other)
    return np.unique(np.column_stack([one[meet], other[meet]]), axis=0)


def _turning(model: Model) -> np.ndarray:
    ends = ("_u", "_v", "_w", "_slide", "_source", *model.motion.scales)
    return np.array([not name.endswith(ends) for name in model.coordinates], dtype=bool)
