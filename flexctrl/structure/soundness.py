"""What makes a machine sound: names used once, nodes that it has, joints that fit, and one piece."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.structure.drives import Drive, RotaryDrive, Winch
from flexctrl.structure.freedoms import FREEDOMS
from flexctrl.structure.inputs import FollowerForce, FollowerTorque, Force, Input, MotorTorque, Torque
from flexctrl.structure.join_table import JoinTable, Row, drive_row
from flexctrl.structure.joints import Hinge, Slide, Support, Weld
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.nodes import Node
from flexctrl.structure.outputs import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    Output,
    Position,
    Rotation,
    SwayAngle,
    Tension,
    Velocity,
)
from flexctrl.structure.trolleys import Trolley, check_rails, check_travels

if TYPE_CHECKING:
    from flexctrl.structure.structure import Structure

__all__ = ["COINCIDE", "check_sound"]

COINCIDE = 1e-6
"""Distance of nodes that coincide, over the size of the structure."""

_GROUND = "the ground"


def check_sound(s: Structure) -> None:
    """Raise StructureError for what cannot be a machine.

    Parameters
    ----------
    s : Structure

    Raises
    ------
    StructureError
        For names used twice or unknown, nodes that are not of this structure, joints between nodes that do not
        coincide, a drive about an axis its joint holds, or a structure in separate pieces.
    """
    _check_names(s)
    _check_nodes(s)
    _check_table(s)
    _check_trolleys(s)
    _check_coincidence(s)
    _check_drives(s)
    _check_pieces(s)


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
        known, wanted, kinds = tuple(d.name for d in s.drives), signal.drive, "drive"
    elif isinstance(signal, Tension):
        lines = (p for p in (*s.elements, *s.drives) if isinstance(p, Rope | Spring | Winch))
        known, wanted, kinds = tuple(p.name for p in lines), signal.line, "rope, spring or winch"
    else:
        return
    if wanted not in known:
        hint = did_you_mean(wanted, known) or f": the structure has no {kinds}"
        raise StructureError(f"{who}: there is no {kinds} {wanted!r}{hint}")


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
        if gap > COINCIDE * s.size:
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
        if isinstance(drive, RotaryDrive) and gap > COINCIDE * s.size:
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
    """Tell whether the two sides of a drive cannot move against each other along its whole axis, or a rope at all."""
    ground: Row = (0, 0, 0, 0, 0, 0)
    table, columns = s.join_table, range(drive.column, drive.column + 3)
    mine = table.rows[s.number(drive.node)]
    other = ground if drive.against is None else table.rows[s.number(drive.against)]
    for joint in () if isinstance(s.joints, JoinTable) or isinstance(drive, Winch) else s.joints:
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
    linked: dict[str, set[str]] = {name: set() for name in (*(p.name for p in s.elements), _GROUND)}
    for first, *rest in _ties(s):
        for name in rest:
            linked[first].add(name)
            linked[name].add(first)
    pieces = _pieces(linked)
    if len(pieces) > 1:
        loose, kept = sorted(pieces, key=lambda p: (_GROUND in p, len(p)))[:: len(pieces) - 1]
        raise StructureError(
            f"structure {s.name!r} is in {len(pieces)} separate pieces: {', '.join(sorted(loose))} "
            f"{'is' if len(loose) == 1 else 'are'} not joined to {min(kept - {_GROUND})}; "
            "add a Weld, Pin, Hinge, Slide or Support"
        )


def _ties(s: Structure) -> Iterator[list[str]]:
    """Names of what hangs together: by joints or numbers of a table, by rails, by drives."""
    if isinstance(s.joints, JoinTable):
        yield from _tied_by_numbers(s, s.joints)
    else:
        for joint in s.joints:
            yield [*(n.part for n in joint.nodes), *([_GROUND] if isinstance(joint, Support) else [])]
    for trolley in (p for p in s.elements if isinstance(p, Trolley)):
        yield [trolley.name, *trolley.rail]
    for drive in s.drives:
        yield [drive.node.part, _GROUND if drive.against is None else drive.against.part]


def _tied_by_numbers(s: Structure, table: JoinTable) -> Iterable[list[str]]:
    owners: dict[int, list[str]] = {}
    for node, row in zip(s.nodes, table.rows, strict=True):
        for number in (row[f] for f in node.freedoms):
            owners.setdefault(number, [_GROUND] if number == 0 else []).append(node.part)
    return owners.values()


def _pieces(linked: dict[str, set[str]]) -> list[set[str]]:
    pieces: list[set[str]] = []
    left = {name: None for name in linked if linked[name] or name != _GROUND}
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
