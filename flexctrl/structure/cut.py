"""Ropes cut into pieces, pinned end to end."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise

import numpy as np

from flexctrl.errors import StructureError
from flexctrl.structure.freedoms import FREEDOMS
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import Joint, Pin, Support
from flexctrl.structure.lines import Rope, RopePiece
from flexctrl.structure.nodes import Node
from flexctrl.structure.outputs import Output, Tension
from flexctrl.structure.refine import with_nodes
from flexctrl.structure.structure import Structure

__all__ = ["cut_ropes"]


def cut_ropes(structure: Structure, heavy: Collection[str]) -> tuple[Structure, dict[str, tuple[str, ...]]]:
    """Return a structure whose heavy ropes are cut into their elements and whose other ropes have no mass.

    Parameters
    ----------
    structure : Structure
    heavy : collection of str
        Names of the ropes that keep their mass; the pieces of a rope of several elements are called ``rope0``,
        ``rope1`` …

    Returns
    -------
    Structure
    dict of str to tuple of str
        The pieces of each rope that is cut.

    Raises
    ------
    StructureError
        For ropes to be cut in a structure that is tied by a table of numbers.
    """
    ropes = [e for e in structure.elements if isinstance(e, Rope) and (e.rhoA or e.elements > 1)]
    if not ropes:
        return structure, {}
    pieces = {rope.name: _pieces(rope) if rope.name in heavy else (_bare(rope),) for rope in ropes}
    several = {name: found for name, found in pieces.items() if len(found) > 1}
    if not several:
        elements = [pieces.get(e.name, (e,))[0] for e in structure.elements]
        return structure.with_(elements=elements), {}
    if isinstance(structure.joints, JoinTable):
        raise StructureError(
            f"RopeMass: structure {structure.name!r} is tied by a join table of numbers, with no rows for the nodes of "
            f"{', '.join(several)}; give it joints, or ropes of one element"
        )
    cut = structure.with_(
        elements=[piece for e in structure.elements for piece in pieces.get(e.name, (e,))],
        joints=[*(with_nodes(j, lambda n: _moved(several, n)) for j in structure.joints), *_joints(structure, several)],
        drives=[with_nodes(d, lambda n: _moved(several, n)) for d in structure.drives],
        inputs=[with_nodes(i, lambda n: _moved(several, n)) for i in structure.inputs],
        outputs=[_output(several, with_nodes(o, lambda n: _moved(several, n))) for o in structure.outputs],
    )
    return cut, {name: tuple(p.name for p in found) for name, found in several.items()}


def _bare(rope: Rope) -> Rope:
    return Rope(rope.name, rope.start.position, rope.end.position, rope.EA, rope.length, rope.damping)


def _pieces(rope: Rope) -> tuple[Rope, ...]:
    count = rope.elements
    if count == 1:
        return (rope,)
    places = np.linspace(rope.start.position, rope.end.position, count + 1).tolist()
    return tuple(RopePiece(rope, i, a, b) for i, (a, b) in enumerate(pairwise(places)))


def _moved(pieces: dict[str, tuple[Rope, ...]], node: Node) -> Node:
    """The node of the pieces where a node of the rope was."""
    found = pieces.get(node.part)
    return node if found is None else found[0].start if node.index == 0 else found[-1].end


def _output(pieces: dict[str, tuple[Rope, ...]], output: Output) -> Output:
    """A rope's tension is measured at its start."""
    if isinstance(output, Tension) and output.line in pieces:
        return replace(output, line=pieces[output.line][0].name)
    return output


def _joints(structure: Structure, pieces: dict[str, tuple[Rope, ...]]) -> list[Joint]:
    """Pins between pieces; what is held out of a plane at both ends of a rope is held between them, too."""
    assert not isinstance(structure.joints, JoinTable)
    found: list[Joint] = []
    for name, parts in pieces.items():
        held = {(j.node.index, j.held) for j in structure.joints if isinstance(j, Support) and j.node.part == name}
        both = {freedoms for _, freedoms in held if {(0, freedoms), (1, freedoms)} <= held and len(freedoms) < 3}
        for first, second in pairwise(parts):
            found.append(Pin(first.end, second.start))
            found += [Support(first.end, [FREEDOMS[f] for f in sorted(freedoms)]) for freedoms in both]
    return found
