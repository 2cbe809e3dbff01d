"""The same machine on a finer mesh."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from flexctrl.errors import StructureError
from flexctrl.structure.elements import Beam, Node
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.structure import Structure

T = TypeVar("T")


def refine(structure: Structure, factor: int) -> Structure:
    """Return a structure whose beams have ``factor`` times as many elements.

    Joints, drives, signals stay where they are: node i of a beam becomes node ``factor``·i.

    Parameters
    ----------
    structure : Structure
    factor : int
        At least 1.

    Returns
    -------
    Structure

    Raises
    ------
    StructureError
        For a factor that is no whole number ≥ 1, or a structure tied by a table of numbers.
    """
    if factor != int(factor) or factor < 1:
        raise StructureError(f"refine: factor = {factor!r}; expected a whole number ≥ 1")
    if isinstance(structure.joints, JoinTable):
        raise StructureError(
            f"refine: structure {structure.name!r} is tied by a join table of numbers, with no rows for new nodes; "
            "give it joints"
        )
    finer = {
        e.name: Beam(e.name, e.start.position, e.end.position, e.section, elements=factor * e.elements, up=e.up)
        for e in structure.elements
        if isinstance(e, Beam)
    }

    def moved(node: Node) -> Node:
        return finer[node.part].node(factor * node.index) if node.part in finer else node

    return structure.with_(
        elements=[finer.get(e.name, e) for e in structure.elements],
        joints=[_with_nodes(j, moved) for j in structure.joints],
        drives=[_with_nodes(d, moved) for d in structure.drives],
        inputs=[_with_nodes(i, moved) for i in structure.inputs],
        outputs=[_with_nodes(o, moved) for o in structure.outputs],
    )


def _with_nodes(value: T, moved: Any) -> T:
    """Return a frozen value with every node in it replaced; it was checked when it was made."""
    assert is_dataclass(value)
    copy = object.__new__(type(value))
    for f in fields(value):
        object.__setattr__(copy, f.name, _replaced(getattr(value, f.name), moved))
    return copy


def _replaced(value: Any, moved: Any) -> Any:
    if isinstance(value, Node):
        return moved(value)
    return tuple(_replaced(v, moved) for v in value) if isinstance(value, tuple) else value


__all__ = ["refine"]
