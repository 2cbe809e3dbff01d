"""The whole machine: parts, joints, drives and signals, checked once."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.chains import BeamChain
from flexctrl.structure.drives import Drive, LinearDrive
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import FREEDOMS, TRAVEL, check_name, listed, parse_direction
from flexctrl.structure.inputs import Input
from flexctrl.structure.join_table import JoinTable, join
from flexctrl.structure.joints import InPlane, Joint, main_axis
from flexctrl.structure.nodes import Node, check_node
from flexctrl.structure.outputs import Output
from flexctrl.structure.relations import Group, Track
from flexctrl.structure.soundness import COINCIDE, check_sound
from flexctrl.structure.trolleys import Trolley, tracks_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@frozen
class Structure:
    """A machine: its parts, how they are tied, driven, pushed and measured.

    Parameters
    ----------
    elements : sequence of Beam, Rope, Spring, PointMass, RigidBody or Trolley
        The parts; their nodes are numbered in this order.
    joints : sequence of Support, Weld, Pin, Hinge or Slide, or a JoinTable
        How nodal freedoms are tied. A `JoinTable` made from rows may stand in place of joints.
    drives : sequence of RotaryDrive, LinearDrive or Winch
    inputs : sequence of Force, Torque, FollowerForce, FollowerTorque, MotorTorque or WindSpeed
    outputs : sequence of Position, Velocity, Rotation, …
    name : str

    Raises
    ------
    StructureError
        For names used twice or unknown, nodes that are not of this structure, joints between nodes
        that do not coincide, a drive about an axis its joint holds, or a structure in separate pieces.
    """

    elements: tuple[Part, ...]
    joints: tuple[Joint, ...] | JoinTable = ()
    drives: tuple[Drive, ...] = ()
    inputs: tuple[Input, ...] = ()
    outputs: tuple[Output, ...] = ()
    name: str = "structure"

    def __init__(
        self,
        elements: Sequence[Part],
        joints: Sequence[Joint] | JoinTable = (),
        drives: Sequence[Drive] = (),
        inputs: Sequence[Input] = (),
        outputs: Sequence[Output] = (),
        name: str = "structure",
    ) -> None:
        object.__setattr__(self, "name", check_name(name, "Structure"))
        object.__setattr__(self, "elements", _typed(elements, Part, "elements"))
        tied = joints if isinstance(joints, JoinTable) else _typed(joints, Joint, "joints")
        object.__setattr__(self, "joints", tied)
        object.__setattr__(self, "drives", _typed(drives, Drive, "drives"))
        object.__setattr__(self, "inputs", _typed(inputs, Input, "inputs"))
        object.__setattr__(self, "outputs", _typed(outputs, Output, "outputs"))
        if not self.elements:
            raise StructureError("Structure: has no elements; give at least one Beam, PointMass or RigidBody")
        check_sound(self)

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """All nodes of all parts, in order; node 1 of the join table is the first."""
        return tuple(node for part in self.elements for node in part.nodes)

    @cached_property
    def join_table(self) -> JoinTable:
        """The join table of nodes, as in the paper."""
        if isinstance(self.joints, JoinTable):
            return dataclasses.replace(
                self.joints,
                labels=tuple(f"{n.part} {n.index}" for n in self.nodes),
                drive_labels=tuple(d.name for d in self.drives),
            )
        return join(self.nodes, self.joints, self.drives, self.bodies, self.tracks)

    @cached_property
    def bodies(self) -> tuple[Group, ...]:
        """The rigid bodies with more than one node, as groups of node numbers (from 0)."""
        parts = [p for p in self.elements if isinstance(p, RigidBody) and p.points]
        return tuple(Group(p.name, tuple(self._places[n.part, n.index] for n in p.nodes)) for p in parts)

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """How trolleys follow their rails, in node numbers (from 0)."""
        return tracks_of(self.elements, self._places)

    def number(self, node: Node) -> int:
        """Return a node's place in `nodes`, from 0 (the join table counts from 1).

        Parameters
        ----------
        node : Node

        Returns
        -------
        int

        Raises
        ------
        StructureError
            If no part of the structure has the node.
        """
        check_node(node, f"structure {self.name!r}")
        place = self._places.get((node.part, node.index))
        mine = None if place is None else self.nodes[place]
        if (
            place is None
            or mine is None
            or mine.freedoms != node.freedoms
            or math.dist(mine.position, node.position) > COINCIDE * self.size
        ):
            known = {n.part for n in self.nodes}
            hint = "; take the node from the part of that name that the structure has"
            hint = hint if node.part in known else f"; add {node.part} to its elements"
            raise StructureError(f"{node} at {node.position} is not in structure {self.name!r}{hint}")
        return place

    def part(self, name: str) -> Part | Drive:
        """Return the element or drive of a name.

        Parameters
        ----------
        name : str

        Returns
        -------
        Part or Drive

        Raises
        ------
        StructureError
            If there is none.
        """
        parts = {p.name: p for p in (*self.elements, *self.drives)}
        if not isinstance(name, str) or name not in parts:
            raise StructureError(f"structure {self.name!r} has no part {name!r}{did_you_mean(name, parts)}")
        return parts[name]

    def with_(
        self,
        *,
        elements: Sequence[Part] | None = None,
        joints: Sequence[Joint] | JoinTable | None = None,
        drives: Sequence[Drive] | None = None,
        inputs: Sequence[Input] | None = None,
        outputs: Sequence[Output] | None = None,
        name: str | None = None,
    ) -> Structure:
        """Return a copy with some fields replaced; what is left out stays.

        Parameters
        ----------
        elements, joints, drives, inputs, outputs, name
            As for the constructor.

        Returns
        -------
        Structure
        """
        return Structure(
            self.elements if elements is None else elements,
            self.joints if joints is None else joints,
            self.drives if drives is None else drives,
            self.inputs if inputs is None else inputs,
            self.outputs if outputs is None else outputs,
            self.name if name is None else name,
        )

    @cached_property
    def size(self) -> float:
        """Largest extent of the structure [m], the yardstick for coincidence; or what else of it has a length.

        Where all is at one place, the greater of the radius of gyration of all bodies and the travel by which a wheel
        or pinion turns by a radian. A point that no such drive moves has no length: a metre, or whatever the unit is.
        """
        return self._extent or self._own_length or 1.0

    @property
    def sized(self) -> bool:
        """Whether anything in the structure has a length."""
        return (self._extent or self._own_length) > 0.0

    @cached_property
    def box(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The least and the greatest coordinates that parts are drawn at [m]; travels are at no place."""
        travels = [part.travel for part in self.elements if isinstance(part, Trolley)]
        along = list(zip(*(node.position for node in self.nodes if node not in travels), strict=True))
        return tuple(map(min, along)), tuple(map(max, along))

    @cached_property
    def _extent(self) -> float:
        """How far nodes are apart along the axes at most; 0 where that is but rounding."""
        lows, highs = self.box
        extent = max(b - a for a, b in zip(lows, highs, strict=True))
        return extent if extent > 1e-12 * max(map(abs, (*lows, *highs))) else 0.0

    @cached_property
    def _own_length(self) -> float:
        """The longest length that parts at one place have of their own [m], 0 if none."""
        bodies = [e for e in self.elements if isinstance(e, RigidBody)]
        mass = sum(e.mass for e in self.elements if isinstance(e, PointMass | RigidBody))
        turned = 0.5 * sum(body.inertia[i][i] for body in bodies for i in range(3))  # Σ m r², whatever the axes
        radii = [drive.radius for drive in self.drives if isinstance(drive, LinearDrive)]
        return max([math.sqrt(turned / mass) if mass > 0.0 else 0.0, *radii])

    @cached_property
    def _places(self) -> dict[tuple[str, int], int]:
        return {(n.part, n.index): i for i, n in enumerate(self.nodes)}

    def plot(self) -> Figure:
        """Draw the machine: parts, node numbers of the join table, joints and drives.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.overview import structure_figure

        return structure_figure(self)


def planar(structure: Structure, normal: str = "z") -> Structure:
    """Hold every freedom out of a plane: the plane problem in its 3-D clothes.

    Parameters
    ----------
    structure : Structure
    normal : str
        ``"x"``, ``"y"`` or ``"z"``: the axis across the plane. Kept are the two displacements in the
        plane and the rotation about the normal.

    Returns
    -------
    Structure

    Raises
    ------
    StructureError
        If ``normal`` is no axis, or the joints are given as a table.
    """
    if not isinstance(structure, Structure):
        raise StructureError(f"planar: {shortened(structure)} is no Structure")
    direction = parse_direction(normal, "planar")
    axis = main_axis(direction)
    if abs(direction[axis]) < 1.0 - 1e-12:
        raise StructureError(f"planar: the normal {normal!r} is no global axis; give 'x', 'y' or 'z'")
    if isinstance(structure.joints, JoinTable):
        raise StructureError("planar: the joints are a JoinTable; give its rows with columns='u v θz' instead")
    kept = {(axis + 1) % 3, (axis + 2) % 3, 3 + axis}
    across = [(node, node.freedoms - kept) for node in structure.nodes if node.freedoms != TRAVEL]
    supports = [InPlane(node, [FREEDOMS[f] for f in sorted(held)]) for node, held in across]
    return structure.with_(joints=(*structure.joints, *supports))


def _typed(items: Iterable, kinds: object, what: str) -> tuple:
    found = tuple(listed(items, f"Structure: {what}"))
    allowed = kinds.__args__  # type: ignore[attr-defined]
    for item in found:
        if not isinstance(item, allowed):
            names = ", ".join(k.__name__ for k in (*allowed, *[Trolley] * (PointMass in allowed)))
            raise StructureError(f"Structure: {shortened(item)} among {what}; expected one of {names}{_belongs(item)}")
    return found


def _belongs(item: object) -> str:
    """Where what stands in a wrong list belongs."""
    if isinstance(item, BeamChain):
        return f"; of a chain put *{item.name}.beams among elements and *{item.name}.welds among joints"
    lists = {"elements": Part, "joints": Joint, "drives": Drive, "inputs": Input, "outputs": Output}
    right = [what for what, kinds in lists.items() if isinstance(item, kinds)]
    return f"; put a {type(item).__name__} among {right[0]}" if right else ""


__all__ = ["Structure", "planar"]
