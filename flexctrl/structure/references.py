"""What inputs and outputs refer to: nodes, drives and lines by name."""

from __future__ import annotations

from flexctrl.errors import StructureError, shortened
from flexctrl.structure.drives import LinearDrive, RotaryDrive, Winch
from flexctrl.structure.freedoms import ROTATIONS
from flexctrl.structure.nodes import Node, check_node

__all__ = ["DRIVES", "name_of", "signal_node"]

DRIVES = (RotaryDrive, LinearDrive, Winch)


def signal_node(node: Node, owner: str, rotations: bool) -> Node:
    """Return a node, which has rotations where they are asked for."""
    if rotations and not check_node(node, owner).freedoms >= ROTATIONS:
        raise StructureError(f"{owner}: {node} has no rotations; take a node of a beam or rigid body")
    return check_node(node, owner)


def name_of(part: object, kinds: tuple[type, ...], owner: str) -> str:
    """Return the name of a part of some kinds, or the name given."""
    if not isinstance(part, (str, *kinds)):
        names = " or ".join(k.__name__ for k in kinds)
        raise StructureError(f"{owner} = {shortened(part)}; expected a {names}, or the name of one")
    return part if isinstance(part, str) else part.name  # type: ignore[attr-defined]
