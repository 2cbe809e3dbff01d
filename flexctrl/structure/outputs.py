"""Outputs by name: what is measured of the machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.drives import Drive, Winch
from flexctrl.structure.freedoms import Vector, check_signal, parse_direction
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.nodes import Node, check_node
from flexctrl.structure.references import DRIVES, name_of, signal_node

__all__ = [
    "AngularVelocity",
    "DriveAngle",
    "DriveSpeed",
    "Output",
    "Position",
    "Rotation",
    "SwayAngle",
    "Tension",
    "Velocity",
]


def _set_measure(
    signal: Position | Velocity | Rotation | AngularVelocity,
    name: str,
    at: Node,
    direction: str | Sequence[float],
    minus: Node | None,
    rotations: bool,
) -> None:
    owner = f"{type(signal).__name__} {check_signal(name, type(signal).__name__)!r}"
    signal_node(at, owner, rotations)
    if minus is not None and signal_node(minus, owner, rotations) == at:
        raise StructureError(f"{owner}: {at} less itself is always zero; give another node as minus")
    object.__setattr__(signal, "name", name)
    object.__setattr__(signal, "at", at)
    object.__setattr__(signal, "direction", parse_direction(direction, owner))
    object.__setattr__(signal, "minus", minus)


@frozen
class Position:
    """Output: a node's position along a global direction [m], less that of ``minus`` if given.

    Parameters
    ----------
    name : str
    at : Node
        What is measured.
    direction : str or sequence of 3 floats
        Global direction of positive values.
    minus : Node, optional
        What it is measured against; default: the ground.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node, and what is no direction.
    """

    name: str
    at: Node
    direction: Vector
    minus: Node | None

    def __init__(self, name: str, at: Node, direction: str | Sequence[float], minus: Node | None = None) -> None:
        _set_measure(self, name, at, direction, minus, rotations=False)


@frozen
class Velocity:
    """Output: a node's velocity along a global direction [m/s], less that of ``minus`` if given.

    Parameters
    ----------
    name : str
    at : Node
        What is measured.
    direction : str or sequence of 3 floats
        Global direction of positive values.
    minus : Node, optional
        What it is measured against; default: the ground.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node, and what is no direction.
    """

    name: str
    at: Node
    direction: Vector
    minus: Node | None

    def __init__(self, name: str, at: Node, direction: str | Sequence[float], minus: Node | None = None) -> None:
        _set_measure(self, name, at, direction, minus, rotations=False)


@frozen
class Rotation:
    """Output: a node's angle about an axis [rad], less that of ``minus`` if given.

    Where the axis keeps its direction it is the plain angle of rotation, the integral of the angular
    velocity; it is followed from step to step and does not wrap after a turn. Where the axis tilts, it
    is the twist that is left when the tilt is undone; that is not defined where the axis has turned to its
    opposite, and goes by a turn where it passes near: a run notes if its errors decide on which side. Across a
    `Hinge` or drive it is measured about the axis as the ``minus`` side carries it.

    Parameters
    ----------
    name : str
    at : Node
        What is measured.
    axis : str or sequence of 3 floats
        Global axis; positive angles turn right-handed about it.
    minus : Node, optional
        What it is measured against; default: the ground.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node or has no rotations, and what is no direction.
    """

    name: str
    at: Node
    direction: Vector
    minus: Node | None

    def __init__(self, name: str, at: Node, axis: str | Sequence[float], minus: Node | None = None) -> None:
        _set_measure(self, name, at, axis, minus, rotations=True)


@frozen
class AngularVelocity:
    """Output: a node's angular velocity about a global axis [rad/s], less that of ``minus`` if given.

    Parameters
    ----------
    name : str
    at : Node
        What is measured.
    axis : str or sequence of 3 floats
        Global axis; positive angles turn right-handed about it.
    minus : Node, optional
        What it is measured against; default: the ground.

    Raises
    ------
    StructureError
        For a name that python-control refuses, what is no node or has no rotations, and what is no direction.
    """

    name: str
    at: Node
    direction: Vector
    minus: Node | None

    def __init__(self, name: str, at: Node, axis: str | Sequence[float], minus: Node | None = None) -> None:
        _set_measure(self, name, at, axis, minus, rotations=True)


@frozen
class DriveAngle:
    """Output: a drive's source angle θ_d [rad], as a motor encoder shows it; it does not wrap.

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
        object.__setattr__(self, "name", check_signal(name, "DriveAngle"))
        object.__setattr__(self, "drive", name_of(drive, DRIVES, f"DriveAngle {name!r}: drive"))


@frozen
class DriveSpeed:
    """Output: a motor's speed θ̇_d [rad/s].

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
        object.__setattr__(self, "name", check_signal(name, "DriveSpeed"))
        object.__setattr__(self, "drive", name_of(drive, DRIVES, f"DriveSpeed {name!r}: drive"))


@frozen
class SwayAngle:
    """Output: the angle of the line from ``top`` to ``load`` against straight down [rad].

    atan2(horizontal offset along ``direction``, drop): positive when the load is ahead of ``top``. In small motion its
    linear part.

    Parameters
    ----------
    name : str
    top, load : Node
        Suspension point and load.
    direction : str or sequence of 3 floats
        Horizontal direction of travel.
    down : str or sequence of 3 floats
        Default ``"-z"``.

    Raises
    ------
    StructureError
        For what is no node, nodes that are one, and a direction that is not level.
    """

    name: str
    top: Node
    load: Node
    direction: Vector
    down: Vector

    def __init__(
        self,
        name: str,
        top: Node,
        load: Node,
        direction: str | Sequence[float],
        down: str | Sequence[float] = "-z",
    ) -> None:
        owner = f"SwayAngle {check_signal(name, 'SwayAngle')!r}"
        if check_node(top, owner) == check_node(load, owner):
            raise StructureError(f"{owner}: top and load are both {top}; give the suspension point and the load")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "top", top)
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "direction", parse_direction(direction, owner))
        object.__setattr__(self, "down", parse_direction(down, owner))
        if abs(sum(a * b for a, b in zip(self.direction, self.down, strict=True))) > 1e-6:
            raise StructureError(f"{owner}: direction {direction!r} is not square to down {down!r}; give a level one")


@frozen
class Tension:
    """Output: the tensile force in a rope, the rope of a winch, or a spring [N].

    Parameters
    ----------
    name : str
    line : Rope, Spring, Winch or str
        What is under tension, or its name; a spring that is pressed has a negative one, and in small motion, whose
        forces are linear, a rope too. Of a rope of several elements that of the first, at its ``start``; with
        `RopeMass` what holds it there bears 11/24 of that element's weight besides.

    Raises
    ------
    StructureError
        For a name that python-control refuses, or what is no rope, winch or spring.
    """

    name: str
    line: str

    def __init__(self, name: str, line: Rope | Spring | Winch | str) -> None:
        object.__setattr__(self, "name", check_signal(name, "Tension"))
        object.__setattr__(self, "line", name_of(line, (Rope, Spring, Winch), f"Tension {name!r}: line"))


Output: TypeAlias = Position | Velocity | Rotation | AngularVelocity | DriveAngle | DriveSpeed | SwayAngle | Tension
