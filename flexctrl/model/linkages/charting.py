"""Making a chart: which rotations, ropes, hinges and slides need more than the integral of their rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexctrl.model.linkages.chart import Chart, Follower, LeaningRope, TurningNode
from flexctrl.model.model import Model
from flexctrl.model.motion import Motion
from flexctrl.model.state import State
from flexctrl.structure.freedoms import IDENTIFIERS, ROTATIONS
from flexctrl.structure.ties import Ride, Turn

__all__ = ["chart_of"]


def chart_of(model: Model, reference: State) -> Chart:
    """Return the chart of a model about a shape.

    Parameters
    ----------
    model : Model
    reference : State

    Returns
    -------
    Chart
    """
    motion = model.motion
    lines = {int(motion.nodes[i]): axes for i, axes in motion.linkage.lines}
    turning = [i for i, node in enumerate(model.structure.nodes) if node.freedoms >= ROTATIONS]
    wide, rotations = _widened(motion, _rotations(motion, turning), model)
    extra = np.zeros(wide.n - motion.n)
    start = replace(reference, q=np.append(reference.q, extra), v=np.zeros(wide.n), t=0.0)
    hinges = tuple(_hinge(motion, f) for f in motion.linkage.follows if isinstance(f, Turn) and _owns(motion, f))
    slides = tuple(
        _hinge(motion, f) for f in motion.linkage.follows if isinstance(f, Ride) and f.along and _owns(motion, f)
    )
    leaning = tuple(found for node, axes in lines.items() if (found := _line(motion, node, axes)))
    return Chart(model, wide, start, rotations, tuple(leaning), hinges, slides)


def _owns(motion: Motion, follow: Turn | Ride) -> bool:
    return 0 < follow.own <= motion.linkage.free


def _hinge(motion: Motion, f: Turn | Ride) -> Follower:
    axis = f.axis if isinstance(f, Turn) else f.along
    return Follower(
        int(motion.nodes[f.node]), int(motion.nodes[f.master]), np.array(axis), int(motion.linked[f.own - 1])
    )


def _line(motion: Motion, node: int, axes: np.ndarray) -> LeaningRope | None:
    """A rope that can lean one way only turns about a fixed axis."""
    places = motion.place[node, 3:]
    free = np.flatnonzero(places < motion.n)
    if len(free) < 2:
        return None
    main = next(k for k in range(3) if k not in free)
    return LeaningRope(node, axes, main, (int(places[free[0]]), int(places[free[1]])))


def _rotations(motion: Motion, nodes: Sequence[int]) -> dict[tuple[int, int, int], list[int]]:
    """Nodes that turn about several axes, by the numbers of their freedoms; −1 for what a loop computes."""
    found: dict[tuple[int, int, int], list[int]] = {}
    local = {int(n): i for i, n in enumerate(motion.nodes)}
    linkage = motion.linkage
    for node in nodes:
        row = motion.place[node, 3:].tolist()
        cells = linkage.cells[local[node], 3:] if node in local else np.zeros(3, dtype=int)
        computed = (cells >= linkage.free) & (cells < linkage.free + len(linkage.loops))
        a, b, c = (-1 if computed[k] else number for k, number in enumerate(row))
        if sum(k < motion.n for k in (a, b, c)) > 1:
            found.setdefault((a, b, c), []).append(node)
    return found


def _widened(
    motion: Motion, turning: dict[tuple[int, int, int], list[int]], model: Model
) -> tuple[Motion, tuple[TurningNode, ...]]:
    """Give each rotation coordinates of its own; freedoms that lack one are added behind the others."""
    taken = _single(motion, turning)
    names, rotations = list(motion.names), []
    place = np.where(motion.place == motion.n, -1, motion.place)
    for triple, nodes in turning.items():
        chosen = []
        for k, number in enumerate(triple):
            if number == -1 or (number < motion.n and number not in taken):
                chosen.append(number)
                taken.add(number)
            else:
                first = model.structure.nodes[nodes[0]]
                chosen.append(len(names))
                names.append(f"{first.part}_{first.index}_{IDENTIFIERS[3 + k]}")
        place[nodes, 3:] = chosen
        rotations.append(TurningNode(nodes[0], (chosen[0], chosen[1], chosen[2])))
    if len(names) == motion.n:
        return motion, tuple(rotations)
    return _renumbered(motion, tuple(names), place), tuple(rotations)


def _single(motion: Motion, turning: dict[tuple[int, int, int], list[int]]) -> set[int]:
    """Freedoms that are the angle about a fixed axis somewhere."""
    several = {n for nodes in turning.values() for n in nodes}
    rows = [row for node, row in enumerate(motion.place[:, 3:].tolist()) if node not in several]
    return {number for row in rows for number in row if number < motion.n}


def _renumbered(motion: Motion, names: tuple[str, ...], place: np.ndarray) -> Motion:
    """The motion with more freedoms, also in its linkage."""
    old, linkage = motion.n, motion.linkage
    wide = np.where(place < 0, len(names), place)
    sources, inner = (np.where(k == old, len(names), k) for k in (motion.sources, motion.inner))
    rows = wide[motion.nodes]
    added = sorted({int(k) for k in rows[:, 3:].ravel() if old <= k < len(names)})
    order = {number: linkage.free + i for i, number in enumerate(added)}
    shifted = np.where(linkage.cells >= linkage.free, linkage.cells + len(added), linkage.cells)
    cells = shifted.copy()
    for i, row in enumerate(rows.tolist()):
        cells[i] = [order.get(number, cell) for number, cell in zip(row, shifted[i].tolist(), strict=True)]
    zero = np.zeros(len(names))
    return replace(
        motion,
        names=names,
        place=wide,
        sources=sources,
        inner=inner,
        linkage=replace(
            linkage,
            cells=cells,
            follows=_shifted(linkage.follows, linkage.free, len(added)),
            free=linkage.free + len(added),
        ),
        linked=np.append(motion.linked, added).astype(int),
        rest=replace(motion.rest, q=zero, v=zero),
    )


def _shifted(follows: Sequence, free: int, added: int) -> tuple:
    """Dependent freedoms come after the added ones."""
    return tuple(replace(f, own=f.own + added) if getattr(f, "own", 0) > free else f for f in follows)
