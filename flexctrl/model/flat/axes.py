"""Axes that turn with nodes: seen from them, the matrix of a part that turns as a whole stays the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.native import Reals, Wholes
from flexctrl.mechanics.corotation import PARAMETERS
from flexctrl.model.flat.fronts import Plan
from flexctrl.model.model import Model

__all__ = ["Axes", "axes_of"]


@dataclass
class Axes:
    """Which degrees of freedom are seen from axes that turn with nodes.

    Attributes
    ----------
    count, pair_count, angle_count : int
    nodes : Wholes
        The nodes with axes, in the order of elimination.
    triples : Wholes, (2 count,)
        First of the three rotations that are seen from each, and of the three displacements; −1: of none.
    pairs : Wholes
        Axes that meet in some piece; −1 for space.
    angles : Wholes
        Turning degrees of freedom without axes.
    swaying : int
        How many axes stand within beams so finely divided that their elements resist shear twice as much as stretching.
    beside : Wholes, (2 count,)
        Of such axes the ones before and after along the beam.
    share : Reals, (count,)
        One over the length between these; 0 elsewhere.
    """

    count: int
    pair_count: int
    angle_count: int
    nodes: Wholes
    triples: Wholes
    pairs: Wholes
    angles: Wholes
    swaying: int
    beside: Wholes
    share: Reals


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
    found: list[tuple[int, int, int]] = []
    ropes = {int(motion.nodes[i]) for i, _ in motion.linkage.lines}
    for node, row in enumerate(motion.place):
        if node in ropes or not (row[3:] < motion.n).all():
            continue
        turning, moving = (_three(cells, of, position) for cells in (row[3:], row[:3]))
        if max(turning, moving) >= 0:
            of[plan.order[[p + i for p in (turning, moving) if p >= 0 for i in range(3)]]] = len(found)
            found.append((node, turning, moving))
    nodes, of = _in_order(np.array(found, dtype=int).reshape(-1, 3), of)
    alone = of < 0
    angles = position[np.flatnonzero(alone & _turning(model))]
    pairs = _pairs(model, pattern, of)
    beside, share = _beside(model, of, len(nodes))
    return Axes(
        count=len(nodes),
        pair_count=len(pairs),
        angle_count=len(angles),
        nodes=nodes[:, 0].copy(),
        triples=nodes[:, 1:].ravel(),
        pairs=pairs.ravel(),
        angles=angles,
        swaying=int(np.count_nonzero(share)),
        beside=beside.ravel(),
        share=share,
    )


def _three(cells: np.ndarray, of: np.ndarray, position: np.ndarray) -> int:
    """Return where three degrees of freedom begin, if one stands after the other, without axes yet; −1 elsewhere."""
    if not (cells < len(of)).all() or (of[cells] >= 0).any():
        return -1
    places = position[cells]
    return int(places[0]) if (np.diff(places) == 1).all() else -1


def _in_order(nodes: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axes in the order of what is seen from them, and the ones of each degree of freedom (−1: none)."""
    order = np.argsort(nodes[:, 1:].max(axis=1, initial=-1), kind="stable")
    number = np.append(np.argsort(order), -1)
    return nodes[order], number[of]


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


def _beside(model: Model, of: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the axes before and after each within a finely divided beam, and one over the length between them.

    Where a beam ends, what it is joined to would be strained by what undoes its shear.
    """
    beside = np.repeat(np.arange(count)[:, None], 2, axis=1)
    ways, length = np.zeros((count, 2), dtype=int), np.zeros(count)
    for one, other, span in _fine(model, of):
        for here, there, way in ((one, other, 1), (other, one, 0)):
            beside[here, way] = there
            ways[here, way] += 1
            length[here] += span
    within = (ways == 1).all(axis=1)
    return beside, np.divide(1.0, length, out=np.zeros(count), where=within)


def _fine(model: Model, of: np.ndarray) -> list[tuple[int, int, float]]:
    """Return the axes at both ends of elements that resist shear twice as much as stretching, and their lengths."""
    place = model.motion.place
    found: list[tuple[int, int, float]] = []
    axes = np.append(of, -1)[np.minimum(place, len(of))]
    seen = np.append(np.where((axes == axes[:, :1]).all(axis=1), axes[:, 0], -1), -1)
    for family in model.forces.families:
        if family.kernels.kind.slope is not None:
            p = dict(zip(PARAMETERS, family.parameters.T, strict=False))
            shear = 2.0 * np.maximum(p["a_y"] + p["b_y"], p["a_z"] + p["b_z"]) / p["L"]
            ends = seen[family.nodes]
            fine = (shear > 2.0 * p["EA"]) & (ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])
            found += zip(*ends[fine].T.tolist(), p["L"][fine].tolist(), strict=True)
    return found


def _turning(model: Model) -> np.ndarray:
    ends = ("_u", "_v", "_w", "_slide", "_source", *model.motion.scales)
    return np.array([not name.endswith(ends) for name in model.coordinates], dtype=bool)
