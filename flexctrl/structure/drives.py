"""Drive elements: a motor behind a reduction and an elastic shaft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.structure.elements import Node, check_node
from flexctrl.structure.freedoms import Vector, check_finite, check_name, parse_direction


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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
    ratio = check_finite(ratio, "ratio", owner)
    if ratio == 0.0:
        raise StructureError(f"{owner}: ratio = 0; a reduction ratio is not zero (1 for a direct drive)")
    object.__setattr__(drive, "name", name)
    object.__setattr__(drive, "node", node)
    object.__setattr__(drive, "against", against)
    object.__setattr__(drive, "stiffness", check_finite(stiffness, "stiffness", owner, above=0.0))
    object.__setattr__(drive, "ratio", ratio)
    object.__setattr__(drive, "inertia", check_finite(inertia, "inertia", owner, least=0.0))
    object.__setattr__(drive, "damping", check_finite(damping, "damping", owner, least=0.0))


Drive: TypeAlias = RotaryDrive | LinearDrive
"""Any drive element."""

__all__ = ["Drive", "LinearDrive", "RotaryDrive"]
