"""Nodes by readable names: ``girder.start``, ``girder.3``, ``hook.eye``, ``load``."""

from __future__ import annotations

from collections.abc import Sequence

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.elements import Part
from flexctrl.structure.nodes import Node
from flexctrl.structure.trolleys import Trolley


def node_of(elements: Sequence[Part], name: str) -> Node:
    """Return the node of a name.

    Parameters
    ----------
    elements : sequence of Part
        The parts whose nodes may be named.
    name : str
        ``part.start``, ``part.end`` or, for beams, ``part.3`` (counted from 0, or from the end if
        negative); ``mass`` alone; a rigid body's name alone (its centre of mass) or ``body.point``;
        ``trolley`` or ``trolley.travel``.

    Returns
    -------
    Node

    Raises
    ------
    StructureError
        If there is no such part or node; says which there are.
    """
    parts = {part.name: part for part in elements}
    part, _, point = name.partition(".")
    if part not in parts:
        raise StructureError(f"{name!r} names no node: there is no element {part!r}{did_you_mean(part, parts)}")
    return _node(parts[part], point, name)


def _node(part: Part, point: str, name: str) -> Node:
    known = _points(part)
    if point in known:
        return known[point]
    digits = point.removeprefix("-")
    if isinstance(part, Beam) and digits.isascii() and digits.isdecimal():
        return part.node(int(point))
    shown = [f"{part.name}.{key}" if key else part.name for key in known]
    more = f", {part.name}.0 … {part.name}.{part.elements}" if isinstance(part, Beam) else ""
    raise StructureError(f"{name!r} names no node of {part.name!r}; it has {', '.join(shown)}{more}")


def _points(part: Part) -> dict[str, Node]:
    if isinstance(part, Trolley):
        return {"": part.node, "travel": part.travel}
    if isinstance(part, PointMass):
        return {"": part.node}
    if isinstance(part, RigidBody):
        return {"": part.node} | {key: part.point(key) for key in part.points}
    return {"start": part.start, "end": part.end}


__all__ = ["node_of"]
