"""Where friction acts: two sides that turn or slide against each other, told by a readable name."""

from __future__ import annotations

from typing import TypeAlias

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS, Vector
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import Hinge, Slide
from flexctrl.structure.naming import node_of
from flexctrl.structure.nodes import Node
from flexctrl.structure.structure import Structure

__all__ = ["Contact", "MotorSide", "Sliding", "Spinning", "Turning", "contact_of"]

_UNIT: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@frozen
class MotorSide:
    """The motor of a drive against its frame: the speed is that of the source angle [rad/s]."""

    drive: str

    @property
    def part(self) -> str:
        """What the friction belongs to."""
        return self.drive


@frozen
class Turning:
    """``node`` turns about ``axis`` against ``base``, which carries the axis [rad/s]."""

    node: Node
    base: Node
    axis: Vector

    @property
    def part(self) -> str:
        """What the friction belongs to."""
        return self.node.part


@frozen
class Sliding:
    """``node`` slides along ``axis`` on ``base``, which carries the axis; on the ground without one [m/s]."""

    node: Node
    base: Node | None
    axis: Vector

    @property
    def part(self) -> str:
        """What the friction belongs to."""
        return self.node.part


@frozen
class Spinning:
    """``node`` spins about a fixed axis; it may tilt as well [rad/s]."""

    node: Node
    axis: Vector
    base: None = None

    @property
    def part(self) -> str:
        """What the friction belongs to."""
        return self.node.part


Contact: TypeAlias = MotorSide | Turning | Spinning | Sliding
"""Any place of friction; each has ``part``."""


def contact_of(structure: Structure, where: str, owner: str) -> Contact:
    """Return the contact of a name.

    Parameters
    ----------
    structure : Structure
    where : str
        A drive (the motor's own bearing), a node in a `Hinge` or `Slide` (``"arm.start"``, or the part alone
        if only one of its joints can move), or a freedom of a node against the ground (``"trolley.u"``).
    owner : str
        Who asks, for messages.

    Returns
    -------
    Contact

    Raises
    ------
    StructureError
        If there is no such place, or it does not say which joint is meant.
    """
    if where in {d.name for d in structure.drives}:
        return MotorSide(where)
    node, _, freedom = where.rpartition(".")
    if node and freedom in (*FREEDOMS, *IDENTIFIERS):
        return _against_ground(structure, where, node, freedom, owner)
    return _in_joint(structure, where, owner)


def _against_ground(s: Structure, where: str, name: str, freedom: str, owner: str) -> Contact:
    node = _node(s, name, owner)
    number = (FREEDOMS if freedom in FREEDOMS else IDENTIFIERS).index(freedom)
    if number not in node.freedoms or not s.join_table.rows[s.number(node)][number]:
        raise StructureError(f"{owner}: {where!r} cannot move: {FREEDOMS[number]} of {node} is held, or it has none")
    axis = _UNIT[number % 3]
    return Sliding(node, None, axis) if number < 3 else Spinning(node, axis)


def _in_joint(s: Structure, where: str, owner: str) -> Contact:
    joints = [] if isinstance(s.joints, JoinTable) else [j for j in s.joints if isinstance(j, Hinge | Slide)]
    parts = {p.name: p for p in s.elements}
    if where in parts:
        nodes = set(parts[where].nodes)
    elif where.partition(".")[0] in parts:
        nodes = {_node(s, where, owner)}
    else:
        known = (*(d.name for d in s.drives), *parts)
        raise StructureError(f"{owner}: there is no drive or part {where!r}{did_you_mean(where, known)}")
    found = [j for j in joints if nodes & set(j.nodes)]
    if len(found) != 1:
        several = f"{len(found)} joints of {where!r} turn or slide" if found else f"no Hinge or Slide at {where!r}"
        raise StructureError(
            f"{owner}: {several}; name a node in one of them ('part.start'), a drive, or a freedom against the "
            "ground ('part.start.u')"
        )
    joint = found[0]
    if isinstance(joint, Hinge):
        return Turning(joint.second, joint.first, joint.axis)
    return Sliding(joint.second, joint.first, joint.along)


def _node(s: Structure, name: str, owner: str) -> Node:
    try:
        return node_of(s.elements, name)
    except StructureError as error:
        raise StructureError(f"{owner}: {error}") from None
