"""How parts are tied: each joint says which freedoms of two coincident nodes are the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import (
    ALL,
    FREEDOMS,
    ROTATIONS,
    TRANSLATIONS,
    Vector,
    parse_direction,
    parse_freedoms,
)
from flexctrl.structure.nodes import Node, check_node


def _check_nodes(kind: str, *nodes: Node) -> None:
    for node in nodes:
        check_node(node, kind)
    if len(nodes) == 2 and nodes[0].part == nodes[1].part:
        raise StructureError(f"{kind}: ties {nodes[0]} to {nodes[1]}; give nodes of two different parts")


@frozen
class Support:
    """Fulcrum restraint: freedoms of a node held at zero.

    Parameters
    ----------
    node : Node
    held : str or iterable of str
        Freedoms, e.g. ``"v w"`` or ``"u v w θz"`` (``rx ry rz`` are the rotations in ASCII); default ``"all"``.

    Raises
    ------
    StructureError
        For an unknown freedom, or one the node does not have.
    """

    node: Node
    held: frozenset[int]

    def __init__(self, node: Node, held: str | Sequence[str] = "all") -> None:
        _check_nodes("Support", node)
        freedoms = parse_freedoms(held, f"Support of {node}")
        if freedoms == ALL:
            freedoms &= node.freedoms
        if freedoms - node.freedoms:
            names = " ".join(FREEDOMS[i] for i in sorted(freedoms - node.freedoms))
            raise StructureError(f"Support of {node}: holds {names}, which this node does not have; hold only u v w")
        object.__setattr__(self, "node", node)
        object.__setattr__(self, "held", freedoms)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The supported node."""
        return (self.node,)

    def __str__(self) -> str:
        return f"Support of {self.node}"


@dataclass(frozen=True, init=False)
class InPlane(Support):
    """What `planar` holds of a node. On all nodes of a beam it holds what is between them too, on any mesh."""


@frozen
class Weld:
    """Rigid bond: all freedoms of both nodes are the same; it bears forces and moments in all directions.

    Parameters
    ----------
    first, second : Node
        Coincident nodes of two parts.

    Raises
    ------
    StructureError
        For what is no node, or nodes of one part; in a `Structure`, for nodes that do not coincide.
    """

    first: Node
    second: Node

    def __post_init__(self) -> None:
        _check_nodes("Weld", self.first, self.second)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both nodes."""
        return (self.first, self.second)

    @property
    def shared(self) -> frozenset[int]:
        """Freedoms that are the same."""
        return ALL

    def __str__(self) -> str:
        return f"Weld of {self.first} to {self.second}"


@frozen
class Pin:
    """Ball joint: displacements are the same, rotations are each node's own; it bears forces and no moments.

    Parameters
    ----------
    first, second : Node
        Coincident nodes of two parts; points, ropes and springs have no rotations and are joined by pins.

    Raises
    ------
    StructureError
        For what is no node, or nodes of one part; in a `Structure`, for nodes that do not coincide.
    """

    first: Node
    second: Node

    def __post_init__(self) -> None:
        _check_nodes("Pin", self.first, self.second)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both nodes."""
        return (self.first, self.second)

    @property
    def shared(self) -> frozenset[int]:
        """Freedoms that are the same."""
        return TRANSLATIONS

    def __str__(self) -> str:
        return f"Pin of {self.first} to {self.second}"


@frozen
class Hinge:
    """One rotation is free: about an axis that rides with the first node.

    The second node's own freedom is its absolute rotation about the axis, so that the join table
    and the drive matrices read as in the paper; its other rotations follow the first node.

    Parameters
    ----------
    first, second : Node
        Coincident nodes of two parts; the first is the master.
    axis : str or sequence of 3 floats
        Direction of the hinge axis at rest, global axes; positive angles turn right-handed about it.

    Raises
    ------
    StructureError
        For what is no node, nodes of one part or without rotations, and what is no direction.
    """

    first: Node
    second: Node
    axis: Vector

    def __init__(self, first: Node, second: Node, axis: str | Sequence[float]) -> None:
        _check_nodes("Hinge", first, second)
        for node in (first, second):
            if not node.freedoms >= ROTATIONS:
                raise StructureError(f"Hinge of {first} to {second}: {node} has no rotations; use Pin")
        object.__setattr__(self, "first", first)
        object.__setattr__(self, "second", second)
        object.__setattr__(self, "axis", parse_direction(axis, f"Hinge of {first} to {second}"))

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both nodes."""
        return (self.first, self.second)

    @property
    def shared(self) -> frozenset[int]:
        """Freedoms that are the same (for a skew axis: up to the turn about it)."""
        return ALL - {3 + main_axis(self.axis)}

    def __str__(self) -> str:
        return f"Hinge of {self.first} to {self.second}"


@frozen
class Slide:
    """One translation is free: along a direction that rides with the first node.

    The second node's own freedom is its absolute displacement along the direction; all others
    are the same.

    Parameters
    ----------
    first, second : Node
        Nodes of two parts that coincide as drawn; the first is the master.
    along : str or sequence of 3 floats
        Direction at rest, global axes; positive displacements of the second node go along it.

    Raises
    ------
    StructureError
        For what is no node, nodes of one part, and what is no direction; in a `Structure`, for nodes without rotations.
    """

    first: Node
    second: Node
    along: Vector

    def __init__(self, first: Node, second: Node, along: str | Sequence[float]) -> None:
        _check_nodes("Slide", first, second)
        object.__setattr__(self, "first", first)
        object.__setattr__(self, "second", second)
        object.__setattr__(self, "along", parse_direction(along, f"Slide of {first} to {second}"))

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both nodes."""
        return (self.first, self.second)

    @property
    def shared(self) -> frozenset[int]:
        """Freedoms that are the same (for a skew direction: up to the motion along it)."""
        return ALL - {main_axis(self.along)}

    def __str__(self) -> str:
        return f"Slide of {self.first} to {self.second}"


def main_axis(direction: Vector) -> int:
    """Return 0, 1 or 2: the axis a direction is nearest to."""
    return max(range(3), key=lambda i: (abs(direction[i]), -i))


Joint: TypeAlias = Support | Weld | Pin | Hinge | Slide
"""Any joint; each has ``nodes``."""

__all__ = ["Hinge", "InPlane", "Joint", "Pin", "Slide", "Support", "Weld", "main_axis"]
