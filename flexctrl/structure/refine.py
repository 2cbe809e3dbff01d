"""The same machine on a finer or a coarser mesh."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import gcd
from typing import Any, TypeVar

from flexctrl.errors import StructureError, check_kind, did_you_mean, shortened
from flexctrl.structure.beams import Beam
from flexctrl.structure.freedoms import FREEDOMS, check_whole, listed
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import InPlane, Joint
from flexctrl.structure.lines import Rope
from flexctrl.structure.nodes import Node
from flexctrl.structure.planes import held_across
from flexctrl.structure.structure import Structure

T = TypeVar("T")


def refine(structure: Structure, factor: int) -> Structure:
    """Return a structure whose beams and ropes have ``factor`` times as many elements.

    Joints, drives, signals stay where they are: node i of a beam becomes node ``factor``·i. A plane in which all nodes
    of a beam are held (`planar`) holds those of the new mesh.

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
    if not isinstance(structure, Structure):
        raise StructureError(f"refine: {shortened(structure)} is no Structure")
    check_whole(factor, "factor", "refine", least=1)
    _check_joints(structure, "refine")
    meshed = _meshed(structure, {b.name: factor * b.elements for b in _beams(structure)})
    return meshed.with_(elements=[_finer(e, factor) if isinstance(e, Rope) else e for e in meshed.elements])


def coarsen(structure: Structure, of: Sequence[str] = ()) -> Structure:
    """Return a structure whose beams have as few elements as the nodes in use allow.

    A node is in use if something is joined to it, held, driven, loaded or measured there; a plane in which all nodes of
    a beam are held (`planar`) takes none, and holds those of the new mesh. Elements of a beam stay of one length, so
    that nodes in use at 2 and 6 of 8 elements leave 4. For `ComponentModes`, which needs few.

    Parameters
    ----------
    structure : Structure
    of : sequence of str
        Names of the beams; default: all.

    Returns
    -------
    Structure

    Raises
    ------
    StructureError
        For a name that is no beam of the structure, or a structure tied by a table of numbers.
    """
    check_kind(structure, Structure, "coarsen: structure", "a Structure")
    beams = {b.name: b for b in _beams(structure)}
    for name in listed(of, "coarsen: of"):
        if name not in beams:
            raise StructureError(
                f"coarsen: structure {structure.name!r} has no beam {name!r}{did_you_mean(name, list(beams))}"
            )
    _check_joints(structure, "coarsen")
    used = [n for group in _users(structure) for value in group for n in _nodes_in(value)]
    wanted = {
        name: b.elements // gcd(b.elements, *(n.index for n in used if n.part == name))
        for name, b in beams.items()
        if not of or name in of
    }
    return _meshed(structure, wanted)


def renamed(name: str, before: Structure, after: Structure) -> str:
    """Return what a freedom is called, of a node within a beam, where the beam has another number of elements.

    Parameters
    ----------
    name : str
        ``"girder.3.u"``, or a coordinate's name as ``"girder_3_u"``.
    before, after : Structure
        The same machine on two meshes.

    Returns
    -------
    str
        The name itself where its node is not told by a number.

    Raises
    ------
    StructureError
        If there is no node at that place any more.
    """
    counts = {b.name: b.elements for b in _beams(after)}
    for beam in _beams(before):
        match = re.fullmatch(rf"{re.escape(beam.name)}([._])(-?\d+)([._]\w+)", name)
        if not match or counts.get(beam.name, beam.elements) == beam.elements:
            continue
        place, rest = divmod(beam.node(int(match[2])).index * counts[beam.name], beam.elements)
        if rest:
            raise StructureError(
                f"hold {name!r}: beam {beam.name!r} has no node there with {counts[beam.name]} elements, for "
                f"{beam.elements}; hold one of its ends, or a node that something is joined to"
            )
        return f"{beam.name}{match[1]}{place}{match[3]}"
    return name


def _beams(structure: Structure) -> list[Beam]:
    return [e for e in structure.elements if isinstance(e, Beam)]


def _users(structure: Structure) -> tuple[Any, ...]:
    others = [e for e in structure.elements if not isinstance(e, Beam)]
    return others, _joints(structure), structure.drives, structure.inputs, structure.outputs


def _joints(structure: Structure) -> list[Joint]:
    """The joints without what a plane holds within beams."""
    assert not isinstance(structure.joints, JoinTable)
    within = {(b.name, i) for b in _beams(structure) if held_across(structure, b) for i in range(1, b.elements)}
    return [j for j in structure.joints if not (isinstance(j, InPlane) and (j.node.part, j.node.index) in within)]


def _nodes_in(value: Any) -> Iterator[Node]:
    if isinstance(value, Node):
        yield value
    elif isinstance(value, tuple):
        for v in value:
            yield from _nodes_in(v)
    elif is_dataclass(value):
        yield from _nodes_in(tuple(getattr(value, f.name) for f in fields(value)))


def _check_joints(structure: Structure, verb: str) -> None:
    if isinstance(structure.joints, JoinTable):
        raise StructureError(
            f"{verb}: structure {structure.name!r} is tied by a join table of numbers, with no rows for other nodes; "
            "give it joints"
        )


def _meshed(structure: Structure, elements: Mapping[str, int]) -> Structure:
    """Return a structure with some beams of other numbers of elements, multiples or divisors of those they had."""
    old = {b.name: b for b in _beams(structure)}
    new = {
        name: Beam(name, b.start.position, b.end.position, b.section, elements=elements[name], up=b.up)
        for name, b in old.items()
        if name in elements
    }

    def moved(node: Node) -> Node:
        if node.part not in new:
            return node
        return new[node.part].node(node.index * new[node.part].elements // old[node.part].elements)

    within = [(n, held_across(structure, b)) for b in old.values() for n in new.get(b.name, b).nodes[1:-1]]
    planes = [InPlane(n, [FREEDOMS[f] for f in sorted(held)]) for n, held in within if held]
    return structure.with_(
        elements=[new.get(e.name) or e for e in structure.elements],
        joints=[*(with_nodes(j, moved) for j in _joints(structure)), *planes],
        drives=[with_nodes(d, moved) for d in structure.drives],
        inputs=[with_nodes(i, moved) for i in structure.inputs],
        outputs=[with_nodes(o, moved) for o in structure.outputs],
    )


def _finer(rope: Rope, factor: int) -> Rope:
    ends, count = (rope.start.position, rope.end.position), factor * rope.elements
    return Rope(rope.name, *ends, rope.EA, rope.length, rope.damping, rhoA=rope.rhoA, elements=count)


def with_nodes(value: T, moved: Any) -> T:
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


__all__ = ["coarsen", "refine", "with_nodes"]
