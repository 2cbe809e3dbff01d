"""Nodes: what parts have, each its own, and the join table ties together."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import ALL, Vector, parse_point

__all__ = ["Node", "check_length", "check_node", "position_of"]


@frozen
class Node:
    """A node of one part.

    Attributes
    ----------
    part : str
        Name of the part that owns the node.
    index : int
        Its place in the part, from 0.
    position : tuple of float
        (x, y, z) at rest [m].
    freedoms : frozenset of int
        The freedoms it has: all six (0…5), or translations only (0…2) for ropes, springs and points.
    """

    part: str
    index: int
    position: Vector
    freedoms: frozenset[int] = ALL

    def __str__(self) -> str:
        return f"node {self.index} of {self.part}"


def check_node(node: Node, owner: str) -> Node:
    """Return ``node`` if it is one."""
    if not isinstance(node, Node):
        raise StructureError(
            f"{owner}: {shortened(node)} is no node; give e.g. beam.start, beam.node(2) or body.point('hook')"
        )
    return node


def position_of(at: Node | Sequence[float], owner: str) -> Vector:
    """Return the place of a node, or a place given as three numbers."""
    return at.position if isinstance(at, Node) else parse_point(at, owner)


def check_length(a: Vector, b: Vector, owner: str) -> None:
    """Raise StructureError for ends that coincide."""
    if math.dist(a, b) <= 1e-12 * (1.0 + max(map(abs, (*a, *b)))):
        raise StructureError(f"{owner}: start {a} and end {b} coincide; a part needs a length > 0")
