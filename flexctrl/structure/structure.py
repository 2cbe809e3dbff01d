"""The whole machine: parts, joints, drives and signals, checked once."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.structure.drives import Drive, RotaryDrive, Winch
from flexctrl.structure.elements import Node, Part, RigidBody, Rope, Spring, check_node
from flexctrl.structure.freedoms import FREEDOMS, TRAVEL, check_name, listed, parse_direction
from flexctrl.structure.join_table import JoinTable, Row, drive_row, join
from flexctrl.structure.joints import Hinge, Joint, Slide, Support, Weld, main_axis
from flexctrl.structure.relations import Group, Track
from flexctrl.structure.signals import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    FollowerForce,
    FollowerTorque,
    Force,
    Input,
    MotorTorque,
    Output,
    Position,
    Rotation,
    SwayAngle,
    Tension,
    Torque,
    Velocity,
)
from flexctrl.structure.trolleys import Trolley, check_rails, check_travels, tracks_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COINCIDE = 1e-6


@dataclass(frozen=True)
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
        _check_names(self)
        _check_nodes(self)
        _check_table(self)
        _check_trolleys(self)
        _check_coincidence(self)
        _check_drives(self)
        _check_pieces(self)

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
            or math.dist(mine.position, node.position) > _COINCIDE * self.size
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
        """Largest extent of the structure [m], the yardstick for coincidence."""
        lows, highs = zip(*((min(c), max(c)) for c in zip(*(n.position for n in self.nodes), strict=True)), strict=True)
        return max(*(b - a for a, b in zip(lows, highs, strict=True)), 1e-12)

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
    supports = [Support(node, [FREEDOMS[f] for f in sorted(held)]) for node, held in across]
    return structure.with_(joints=(*structure.joints, *supports))


def _typed(items: Iterable, kinds: object, what: str) -> tuple:
    found = tuple(listed(items, f"Structure: {what}"))
    allowed = kinds.__args__  # type: ignore[attr-defined]
    for item in found:
        if not isinstance(item, allowed):
            names = ", ".join(k.__name__ for k in allowed)
            raise StructureError(f"Structure: {shortened(item)} among {what}; expected one of {names}{_belongs(item)}")
    return found


def _belongs(item: object) -> str:
    """Where what stands in a wrong list belongs."""
    lists = {"elements": Part, "joints": Joint, "drives": Drive, "inputs": Input, "outputs": Output}
    right = [what for what, kinds in lists.items() if isinstance(item, kinds)]
    return f"; put a {type(item).__name__} among {right[0]}" if right else ""


def _check_names(s: Structure) -> None:
    parts = [item.name for item in (*s.elements, *s.drives)]
    signals = [item.name for item in (*s.inputs, *s.outputs)]
    for kind, names in (("part", parts), ("signal", signals)):
        twice = next((name for name, count in Counter(names).items() if count > 1), None)
        if twice is not None:
            raise StructureError(f"Structure {s.name!r}: the {kind} name {twice!r} is used twice; rename one")


def _check_nodes(s: Structure) -> None:
    used: list[tuple[object, Node | None]] = []
    if not isinstance(s.joints, JoinTable):
        used += [(j, n) for j in s.joints for n in j.nodes]
    used += [(f"drive {d.name!r}", n) for d in s.drives for n in (d.node, d.against)]
    for signal in (*s.inputs, *s.outputs):
        label = f"{type(signal).__name__} {signal.name!r}"
        used += [(label, n) for n in _signal_nodes(signal)]
        _check_part(s, signal, label)
    for who, node in used:
        if node is not None:
            try:
                s.number(node)
            except StructureError as error:
                raise StructureError(f"{who}: {error}") from None


def _signal_nodes(signal: Input | Output) -> tuple[Node | None, ...]:
    if isinstance(signal, Force | Torque | FollowerForce | FollowerTorque):
        return signal.at
    if isinstance(signal, Position | Velocity | Rotation | AngularVelocity):
        return (signal.at, signal.minus)
    return (signal.top, signal.load) if isinstance(signal, SwayAngle) else ()


def _check_part(s: Structure, signal: Input | Output, who: str) -> None:
    if isinstance(signal, MotorTorque | DriveAngle | DriveSpeed):
        known, wanted = tuple(d.name for d in s.drives), signal.drive
    elif isinstance(signal, Tension):
        lines = (p for p in (*s.elements, *s.drives) if isinstance(p, Rope | Spring | Winch))
        known, wanted = tuple(p.name for p in lines), signal.line
    else:
        return
    if wanted not in known:
        raise StructureError(f"{who}: there is no {wanted!r}{did_you_mean(wanted, known)}")


def _check_table(s: Structure) -> None:
    """A table in place of joints must fit the parts and drives."""
    if not isinstance(s.joints, JoinTable):
        return
    rows, drives = s.joints.rows, s.joints.drives
    if len(rows) != len(s.nodes) or len(drives) != len(s.drives):
        raise StructureError(
            f"Structure {s.name!r}: the join table has {len(rows)} nodes and {len(drives)} drives, "
            f"the parts have {len(s.nodes)} and {len(s.drives)}"
        )
    for i, (node, row) in enumerate(zip(s.nodes, rows, strict=True), 1):
        lacking = [FREEDOMS[f] for f in range(6) if row[f] and f not in node.freedoms]
        if lacking:
            raise StructureError(
                f"Structure {s.name!r}: row {i} of the join table numbers {lacking[0]} of {node}, "
                "which has displacements only; put 0 there"
            )
    for drive, row in zip(s.drives, drives, strict=True):
        if row != drive_row(drive, max(row)):
            raise StructureError(
                f"drive {drive.name!r}: the join table has its source angle in {row}; expected "
                f"{drive_row(drive, max(row))}, the column of the driven freedom"
            )


def _check_trolleys(s: Structure) -> None:
    trolleys = [p for p in s.elements if isinstance(p, Trolley)]
    if trolleys and isinstance(s.joints, JoinTable):
        raise StructureError(
            f"Structure {s.name!r}: Trolley {trolleys[0].name!r} needs joints beside it, not a table of numbers: what "
            "travels is no row of one"
        )
    if not isinstance(s.joints, JoinTable):
        check_rails(s.elements, s.joints, f"Structure {s.name!r}")
        check_travels(s.joints, s.drives, (*s.inputs, *s.outputs))


def _check_coincidence(s: Structure) -> None:
    joints = () if isinstance(s.joints, JoinTable) else s.joints
    tied: set[frozenset[int]] = set()
    for joint in joints:
        if isinstance(joint, Support):
            continue
        a, b = joint.nodes
        pair = frozenset((s.number(a), s.number(b)))
        if pair in tied:
            raise StructureError(f"{joint}: the two are joined already; keep one of the joints")
        tied.add(pair)
        gap = math.dist(a.position, b.position)
        if gap > _COINCIDE * s.size:
            raise StructureError(
                f"{joint}: the nodes are {gap:.6g} m apart, at {a.position} and {b.position}; joined nodes coincide. "
                "Move a part, or put a RigidBody with two points or a Beam between them"
            )
        poor = [n for n in (a, b) if len(n.freedoms) < 6]
        if poor and (isinstance(joint, Slide) or (isinstance(joint, Weld) and len(poor) == 1)):
            raise StructureError(f"{joint}: {poor[0]} has no rotations to share; use Pin")


def _check_drives(s: Structure) -> None:
    for drive in s.drives:
        gap = 0.0 if drive.against is None else math.dist(drive.node.position, drive.against.position)
        if isinstance(drive, RotaryDrive) and gap > _COINCIDE * s.size:
            raise StructureError(
                f"drive {drive.name!r}: {drive.node} and {drive.against} are {gap:.6g} m apart; a rotary drive sits "
                "in a joint, between two nodes that coincide"
            )
        if _held(s, drive):
            rotary = isinstance(drive, RotaryDrive)
            against = "the ground" if drive.against is None else str(drive.against)
            raise StructureError(
                f"drive {drive.name!r}: its joint holds the {'rotation' if rotary else 'displacement'} along "
                f"{drive.direction}, or part of it, between {drive.node} and {against}; free it with a "
                f"{'Hinge' if rotary else 'Slide'} along that axis, or correct the axis"
            )


def _held(s: Structure, drive: Drive) -> bool:
    """Tell whether the two sides of a drive cannot move against each other along its whole axis."""
    ground: Row = (0, 0, 0, 0, 0, 0)
    table, columns = s.join_table, range(drive.column, drive.column + 3)
    mine = table.rows[s.number(drive.node)]
    other = ground if drive.against is None else table.rows[s.number(drive.against)]
    for joint in () if isinstance(s.joints, JoinTable) else s.joints:
        if isinstance(joint, Hinge if drive.column else Slide):
            sides = [tuple(table.rows[s.number(n)][c] for c in columns) for n in joint.nodes]
            if sorted(sides) == sorted(tuple(row[c] for c in columns) for row in (mine, other)):
                axis = joint.axis if isinstance(joint, Hinge) else joint.along
                return abs(sum(a * b for a, b in zip(axis, drive.direction, strict=True))) < 1.0 - 1e-9
    apart = drive.against is None or drive.node.part != drive.against.part
    told = _told(s, drive, columns) if apart else columns
    held = [mine[c] == other[c] for c in told if abs(drive.direction[c % 3]) > 1e-9]
    return all([*held, len(told) == 3]) if isinstance(drive, Winch) else any(held)


def _told(s: Structure, drive: Drive, columns: Iterable[int]) -> list[int]:
    """The columns in which equal numbers say it all: neither side rides on a lever."""
    rows = [s.number(n) for n in (drive.node, drive.against) if n is not None]
    return [c for c in columns if not any((row, c) in s.join_table.relative for row in rows)]


def _check_pieces(s: Structure) -> None:
    """Every part must hang together with the others, through joints, drives or the ground."""
    ground = "the ground"
    linked: dict[str, set[str]] = {name: set() for name in (*(p.name for p in s.elements), ground)}

    def link(names: Iterable[str]) -> None:
        first, *rest = names
        for name in rest:
            linked[first].add(name)
            linked[name].add(first)

    if isinstance(s.joints, JoinTable):
        owners: dict[int, list[str]] = {}
        for node, row in zip(s.nodes, s.joints.rows, strict=True):
            for number in (row[f] for f in node.freedoms):
                owners.setdefault(number, [ground] if number == 0 else []).append(node.part)
        for names in owners.values():
            link(names)
    else:
        for joint in s.joints:
            link([n.part for n in joint.nodes] + ([ground] if isinstance(joint, Support) else []))
    for trolley in (p for p in s.elements if isinstance(p, Trolley)):
        link([trolley.name, *trolley.rail])
    for drive in s.drives:
        link([drive.node.part, ground if drive.against is None else drive.against.part])
    pieces = _pieces(linked)
    if len(pieces) > 1:
        loose, kept = sorted(pieces, key=lambda p: (ground in p, len(p)))[:: len(pieces) - 1]
        raise StructureError(
            f"structure {s.name!r} is in {len(pieces)} separate pieces: {', '.join(sorted(loose))} "
            f"{'is' if len(loose) == 1 else 'are'} not joined to {min(kept - {ground})}; "
            "add a Weld, Pin, Hinge, Slide or Support"
        )


def _pieces(linked: dict[str, set[str]]) -> list[set[str]]:
    pieces: list[set[str]] = []
    left = {name: None for name in linked if linked[name] or name != "the ground"}
    while left:
        todo, piece = [next(iter(left))], set()
        while todo:
            name = todo.pop()
            if name not in piece:
                piece.add(name)
                todo += linked[name]
        pieces.append(piece)
        left = {name: None for name in left if name not in piece}
    return pieces


__all__ = ["Structure", "planar"]
