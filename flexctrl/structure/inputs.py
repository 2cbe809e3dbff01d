"""Inputs by name: what acts on the machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.drives import Drive
from flexctrl.structure.freedoms import Vector, check_signal, parse_direction
from flexctrl.structure.nodes import Node
from flexctrl.structure.references import DRIVES, name_of, signal_node

__all__ = ["FollowerForce", "FollowerTorque", "Force", "Input", "MotorTorque", "Torque", "WindSpeed"]


def _nodes(at: Node | Sequence[Node], owner: str, rotations: bool) -> tuple[Node, ...]:
    nodes = tuple(at) if isinstance(at, list | tuple) else (at,)
    if not nodes:
        raise StructureError(f"{owner}: names no node; give e.g. beam.end")
    twice = [node for i, node in enumerate(nodes) if node in nodes[:i]]
    if twice:
        raise StructureError(f"{owner}: {twice[0]} is given twice; a load acts once on each node")
    return tuple(signal_node(node, owner, rotations) for node in nodes)


@frozen
class Force:
    """Input: a force in a fixed direction, in N, on one node or on each of several.

    Parameters
    ----------
    name : str
    at : Node or sequence of Node
        Where it acts, in full on each.
    direction : str or sequence of 3 floats
        Global direction of positive values; it does not turn with the node (a dead load).

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node, and what is no direction.
    """

    name: str
    at: tuple[Node, ...]
    direction: Vector

    def __init__(self, name: str, at: Node | Sequence[Node], direction: str | Sequence[float]) -> None:
        owner = f"Force {check_signal(name, 'Force')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _nodes(at, owner, rotations=False))
        object.__setattr__(self, "direction", parse_direction(direction, owner))


@frozen
class Torque:
    """Input: a torque about a fixed global axis, in N m, on one node or on each of several.

    Parameters
    ----------
    name : str
    at : Node or sequence of Node
        Where it acts, in full on each.
    axis : str or sequence of 3 floats
        Global axis; positive values turn right-handed about it.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node or has no rotations, and what is no direction.
    """

    name: str
    at: tuple[Node, ...]
    direction: Vector

    def __init__(self, name: str, at: Node | Sequence[Node], axis: str | Sequence[float]) -> None:
        owner = f"Torque {check_signal(name, 'Torque')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _nodes(at, owner, rotations=True))
        object.__setattr__(self, "direction", parse_direction(axis, owner))


@frozen
class FollowerForce:
    """Input: a force that turns with its node, in N, on one node or on each of several.

    Such a load has no energy: the stiffness of a machine under it is not symmetric, and it may flutter
    (thrusters, jets, contact forces square to a surface).

    Parameters
    ----------
    name : str
    at : Node or sequence of Node
        Where it acts, in full on each.
    direction : str or sequence of 3 floats
        Direction of positive values in the machine as drawn; it turns with the node.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node or has no rotations, and what is no direction.
    """

    name: str
    at: tuple[Node, ...]
    direction: Vector

    def __init__(self, name: str, at: Node | Sequence[Node], direction: str | Sequence[float]) -> None:
        owner = f"FollowerForce {check_signal(name, 'FollowerForce')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _nodes(at, owner, rotations=True))
        object.__setattr__(self, "direction", parse_direction(direction, owner))


@frozen
class FollowerTorque:
    """Input: a torque about an axis that turns with its node, in N m, on one node or on each of several.

    Parameters
    ----------
    name : str
    at : Node or sequence of Node
        Where it acts, in full on each.
    axis : str or sequence of 3 floats
        Axis in the machine as drawn; it turns with the node. Positive values turn right-handed about it.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node or has no rotations, and what is no direction.
    """

    name: str
    at: tuple[Node, ...]
    direction: Vector

    def __init__(self, name: str, at: Node | Sequence[Node], axis: str | Sequence[float]) -> None:
        owner = f"FollowerTorque {check_signal(name, 'FollowerTorque')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _nodes(at, owner, rotations=True))
        object.__setattr__(self, "direction", parse_direction(axis, owner))


@frozen
class MotorTorque:
    """Input: the torque M_d of a drive's motor on its source angle θ_d, in N m.

    It acts on the motor's side of the reduction: at rest the joint of a `RotaryDrive` bears R M_d. Positive torque
    drives θ_d up.

    Parameters
    ----------
    name : str
    drive : RotaryDrive, LinearDrive, Winch or str
        The drive or its name.

    Raises
    ------
    StructureError
        For a name that python-control refuses, or what is no drive.
    """

    name: str
    drive: str

    def __init__(self, name: str, drive: Drive | str) -> None:
        object.__setattr__(self, "name", check_signal(name, "MotorTorque"))
        object.__setattr__(self, "drive", name_of(drive, DRIVES, f"MotorTorque {name!r}: drive"))


@frozen
class WindSpeed:
    """Input: a gust along a fixed direction, in m/s, on top of the mean wind of every `Wind` the model has.

    It blows on all drag areas at once. Where no effect asks for wind it acts on nothing.

    Parameters
    ----------
    name : str
    direction : str or sequence of 3 floats
        Where the air goes.

    Raises
    ------
    StructureError
        For a name that python-control refuses, and what is no direction.
    """

    name: str
    direction: Vector

    def __init__(self, name: str, direction: str | Sequence[float]) -> None:
        object.__setattr__(self, "name", check_signal(name, "WindSpeed"))
        object.__setattr__(self, "direction", parse_direction(direction, f"WindSpeed {name!r}"))


Input: TypeAlias = Force | Torque | FollowerForce | FollowerTorque | MotorTorque | WindSpeed
