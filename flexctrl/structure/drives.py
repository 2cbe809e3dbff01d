"""Drive elements: a motor behind a reduction, and an elastic shaft or a rope on a drum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import Vector, check_finite, check_name, parse_direction
from flexctrl.structure.nodes import Node, check_length, check_node


@frozen
class RotaryDrive:
    """A motor that turns ``node`` against ``against``, or against the ground.

    V = ½ k_θ (R θ_rel − θ_d)², with θ_rel the rotation of ``node`` about ``axis`` less that of
    ``against``: its Hessian is eq. 4 of the paper (eq. 5 to ground), sign for sign. The drive source
    angle θ_d is a freedom of the drive; the motor torque acts on it.

    Parameters
    ----------
    name : str
    node : Node
        The driven side.
    against : Node, optional
        The side that carries the motor; default: the ground.
    axis : str or sequence of 3 floats
        Axis of rotation at rest, global axes.
    stiffness : float
        Drive shaft stiffness k_θ [N m/rad], on the motor side of the reduction, > 0.
    ratio : float
        Reduction ratio R (motor turns per turn of the joint), not zero.
    inertia : float
        Inertia of motor and gear on the motor side [kg m²], ≥ 0.
    damping : float
        Damping of the shaft [N m s/rad], ≥ 0, on R θ̇_rel − θ̇_d.

    Raises
    ------
    StructureError
        For a value out of range.
    """

    name: str
    node: Node
    against: Node | None
    direction: Vector
    stiffness: float
    ratio: float
    inertia: float
    damping: float

    def __init__(
        self,
        name: str,
        node: Node,
        against: Node | None = None,
        *,
        axis: str | Sequence[float] = "z",
        stiffness: float,
        ratio: float = 1.0,
        inertia: float = 0.0,
        damping: float = 0.0,
    ) -> None:
        owner = f"RotaryDrive {check_name(name, 'RotaryDrive')!r}"
        object.__setattr__(self, "direction", parse_direction(axis, owner))
        _set_drive(self, name, node, against, stiffness, ratio, inertia, damping, owner)

    @property
    def effective_ratio(self) -> float:
        """Motor angle per joint angle [1]."""
        return self.ratio

    @property
    def column(self) -> int:
        """First join-table column of the driven motion: 3, the rotations."""
        return 3


@frozen
class LinearDrive:
    """A motor that moves ``node`` along a direction through a wheel, rack or drum.

    V = ½ k_θ (R s/r − θ_d)², with s the displacement of ``node`` along ``direction`` less that of
    ``against``: a `RotaryDrive` with the wheel radius r between.

    Parameters
    ----------
    name : str
    node : Node
        The driven side.
    against : Node, optional
        The side that carries the rail; default: the ground.
    direction : str or sequence of 3 floats
        Direction of travel at rest, global axes.
    radius : float
        Wheel radius r [m], > 0.
    stiffness : float
        Drive shaft stiffness k_θ [N m/rad], on the motor side of the reduction, > 0.
    ratio : float
        Reduction ratio R (motor turns per wheel turn), not zero.
    inertia : float
        Inertia of motor and gear on the motor side [kg m²], ≥ 0.
    damping : float
        Damping of the shaft [N m s/rad], ≥ 0.

    Raises
    ------
    StructureError
        For a value out of range.
    """

    name: str
    node: Node
    against: Node | None
    direction: Vector
    radius: float
    stiffness: float
    ratio: float
    inertia: float
    damping: float

    def __init__(
        self,
        name: str,
        node: Node,
        against: Node | None = None,
        *,
        direction: str | Sequence[float] = "x",
        radius: float,
        stiffness: float,
        ratio: float = 1.0,
        inertia: float = 0.0,
        damping: float = 0.0,
    ) -> None:
        owner = f"LinearDrive {check_name(name, 'LinearDrive')!r}"
        object.__setattr__(self, "direction", parse_direction(direction, owner))
        object.__setattr__(self, "radius", check_finite(radius, "radius", owner, above=0.0))
        _set_drive(self, name, node, against, stiffness, ratio, inertia, damping, owner)

    @property
    def effective_ratio(self) -> float:
        """Motor angle per metre of travel [rad/m]."""
        return self.ratio / self.radius

    @property
    def column(self) -> int:
        """First join-table column of the driven motion: 0, the translations."""
        return 0


@frozen
class Winch:
    """A motor with a drum on ``against`` that pays out and hauls in the massless rope from which ``node`` hangs.

    V = ½ EA (d − ℓ)₊²/ℓ, with d the distance of the nodes and ℓ = ℓ₀ + θ_d r/R the unstretched length that is paid
    out: ℓ₀, their distance at rest, for a motor angle θ_d of zero; positive angles pay out. The motor torque acts on
    θ_d against r/R times the tension T (and T²/2EA, as the drum takes in rope without strain), so work and energy
    balance exactly. `RopeStretch` lets the rope stretch and go slack; without it d = ℓ and the motor's inertia is
    reflected. A run stops, and says so, where the rope that is out, or the way from ``node`` to the sheave, comes down
    to ``shortest``.

    Parameters
    ----------
    name : str
    node : Node
        What hangs on the rope: a node of any part.
    against : Node
        Where the rope leaves the drum or its last sheave; not where ``node`` is.
    EA : float
        Axial stiffness of the rope, all falls together [N], > 0.
    radius : float
        Drum radius r [m], > 0.
    ratio : float
        Motor turns per drum turn, times the falls of the rope: R, not zero.
    inertia : float
        Inertia of motor, gear and drum on the motor side [kg m²], ≥ 0.
    damping : float
        Axial damping of the rope [N s/m], ≥ 0, on ḋ − ℓ̇ while it is taut.
    shortest : float, optional
        Shortest length that can be out [m], > 0; default: ℓ₀/10000.

    Raises
    ------
    StructureError
        For a value out of range, or nodes that coincide.

    Examples
    --------
    >>> import flexctrl as fc
    >>> trolley = fc.PointMass("trolley", (0, 0, 40), mass=50e3)
    >>> load = fc.PointMass("load", (0, 0, 10), mass=30e3)
    >>> fc.Winch("hoist", load.node, trolley.node, EA=5e7, radius=0.75, ratio=30.0, inertia=30.0).length
    30.0
    """

    name: str
    node: Node
    against: Node
    EA: float
    radius: float
    ratio: float
    inertia: float
    damping: float
    shortest: float

    def __init__(
        self,
        name: str,
        node: Node,
        against: Node,
        *,
        EA: float,
        radius: float,
        ratio: float = 1.0,
        inertia: float = 0.0,
        damping: float = 0.0,
        shortest: float | None = None,
    ) -> None:
        owner = f"Winch {check_name(name, 'Winch')!r}"
        for side in (node, against):
            check_node(side, owner)
        check_length(against.position, node.position, owner)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "node", node)
        object.__setattr__(self, "against", against)
        object.__setattr__(self, "EA", check_finite(EA, "EA", owner, above=0.0))
        object.__setattr__(self, "radius", check_finite(radius, "radius", owner, above=0.0))
        object.__setattr__(self, "ratio", _ratio(ratio, owner))
        object.__setattr__(self, "inertia", check_finite(inertia, "inertia", owner, least=0.0))
        object.__setattr__(self, "damping", check_finite(damping, "damping", owner, least=0.0))
        least = 1e-4 * self.length if shortest is None else check_finite(shortest, "shortest", owner, above=0.0)
        if least >= self.length:
            raise StructureError(f"{owner}: shortest = {least:g} m, but only {self.length:g} m are out at rest")
        object.__setattr__(self, "shortest", least)

    @property
    def length(self) -> float:
        """Length ℓ₀ that is out at a motor angle of zero [m]."""
        return math.dist(self.node.position, self.against.position)

    @property
    def direction(self) -> Vector:
        """Direction of the rope at rest, from the drum to what hangs."""
        x, y, z = ((a - b) / self.length for a, b in zip(self.node.position, self.against.position, strict=True))
        return (x, y, z)

    @property
    def effective_ratio(self) -> float:
        """Motor angle per metre of rope [rad/m]."""
        return self.ratio / self.radius

    @property
    def stiffness(self) -> float:
        """The rope's stiffness as the motor feels it at rest, EA/ℓ₀ (r/R)² [N m/rad]."""
        return self.EA / self.length / self.effective_ratio**2

    @property
    def column(self) -> int:
        """First join-table column of the driven motion: 0, the translations."""
        return 0


def _set_drive(
    drive: RotaryDrive | LinearDrive,
    name: str,
    node: Node,
    against: Node | None,
    stiffness: float,
    ratio: float,
    inertia: float,
    damping: float,
    owner: str,
) -> None:
    for side in (node,) if against is None else (node, against):
        check_node(side, owner)
        if drive.column not in side.freedoms:
            raise StructureError(f"{owner}: {side} has no rotations to drive; drive a beam or a rigid body")
    object.__setattr__(drive, "name", name)
    object.__setattr__(drive, "node", node)
    object.__setattr__(drive, "against", against)
    object.__setattr__(drive, "stiffness", check_finite(stiffness, "stiffness", owner, above=0.0))
    object.__setattr__(drive, "ratio", _ratio(ratio, owner))
    object.__setattr__(drive, "inertia", check_finite(inertia, "inertia", owner, least=0.0))
    object.__setattr__(drive, "damping", check_finite(damping, "damping", owner, least=0.0))


def _ratio(ratio: float, owner: str) -> float:
    ratio = check_finite(ratio, "ratio", owner)
    if ratio == 0.0:
        raise StructureError(f"{owner}: ratio = 0; a reduction ratio is not zero (1 for a direct drive)")
    return ratio


Drive: TypeAlias = RotaryDrive | LinearDrive | Winch
"""Any drive element."""

__all__ = ["Drive", "LinearDrive", "RotaryDrive", "Winch"]
