"""Kinds of pieces that rub, and of motors whose torque builds up; families of them in a structure."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cache
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.frozen import frozen
from flexctrl.mechanics import friction
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.model.laws.kinds import DRIVE_SLOT, Kind, Shares
from flexctrl.structure.contacts import MotorSide, Sliding, Spinning, Turning

if TYPE_CHECKING:
    import casadi as ca

Slip = Callable[[Sequence[NodeMotion], "ca.SX", "ca.SX"], "Slipping"]
"""(nodes, slots, parameters that begin with the axis) → how the sides of a contact move against each other."""

STUCK = 2.0
"""Phase of a dry contact that sticks; ±1 while it slides, 0 where there is to be no friction."""

_AXIS = 3


@frozen
class Slipping:
    """How the sides of a contact move against each other.

    ``place`` is the angle or travel whose rate the speed is (0 where there is none), ``gradient`` the slope of the
    speed on the raw rates of both sides.
    """

    place: ca.SX
    speed: ca.SX
    gradient: ca.SX


def _motor(nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Slipping:
    import casadi as ca

    return Slipping(slot[0], slot[1], ca.SX(1))


def _turning(nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Slipping:
    gradient = friction.turning_gradient(nodes[1], p[:_AXIS])
    place = friction.turned(nodes[0], nodes[1], p[:_AXIS])
    return Slipping(place, friction.speed(nodes[0], nodes[1], gradient), gradient)


def _spinning(nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Slipping:
    import casadi as ca

    gradient = friction.turning_gradient(nodes[1], p[:_AXIS])
    return Slipping(ca.SX(1, 1), friction.speed(nodes[0], nodes[1], gradient), gradient)


def _sliding(nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Slipping:
    gradient = friction.sliding_gradient(nodes[0], nodes[1], p[:_AXIS])
    place = friction.slid(nodes[0], nodes[1], p[:_AXIS])
    return Slipping(place, friction.speed(nodes[0], nodes[1], gradient), gradient)


SLIPS: dict[Hashable, tuple[str, int, int, Slip]] = {
    MotorSide: ("motor", 0, 1, _motor),
    Turning: ("turning", 2, 0, _turning),
    Spinning: ("spinning", 2, 0, _spinning),
    Sliding: ("sliding", 2, 0, _sliding),
}
"""Name, nodes, drives and motion of each type of contact."""


def _viscous(slip: Slip) -> Callable[..., Shares]:
    def physics(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
        import casadi as ca

        sides = slip(nodes, slot, p)
        speed, gradient = sides.speed, sides.gradient
        drag = p[_AXIS] * speed
        return Shares(0.0 * gradient, -drag * gradient, ca.SX(1, 1), ca.SX(1, 1), drag * speed)

    return physics


def _dry(slip: Slip) -> Callable[..., Shares]:
    def physics(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
        import casadi as ca

        sides = slip(nodes, slot, p)
        speed, gradient = sides.speed, sides.gradient
        side = ca.if_else(ca.fabs(slot[-1]) < STUCK, slot[-1], 0.0)
        drag = side * friction.dry(speed, *(p[_AXIS + k] for k in range(3)))
        force = ca.vertcat(-drag * gradient, 0.0)
        return Shares(0.0 * force, force, ca.SX(1, 1), ca.SX(1, 1), drag * speed)

    return physics


def _lugre(slip: Slip) -> Callable[..., Shares]:
    def physics(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
        import casadi as ca

        sides = slip(nodes, slot, p)
        speed, gradient = sides.speed, sides.gradient
        stiffness, kinetic, static, stribeck, damping, viscous = (p[_AXIS + k] for k in range(6))
        z, rate = slot[-DRIVE_SLOT], slot[-DRIVE_SLOT + 1]
        spring = stiffness * z
        drag = spring + damping * rate + viscous * speed
        bending = friction.bristle_rate(z, speed, stiffness, friction.dry(speed, kinetic, static, stribeck)) - rate
        force = ca.vertcat(-drag * gradient, stiffness * bending)
        stored = 0.5 * stiffness * z * z
        return Shares(0.0 * force, force, ca.SX(1, 1), stored, drag * speed - spring * rate)

    return physics


def _lag(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
    """τ = M_d − T τ̇ on the motor; T τ̇ + τ = M_d times a compliance, so that its share in the books counts little."""
    import casadi as ca

    torque, rate = slot[DRIVE_SLOT], slot[DRIVE_SLOT + 1]
    behind = p[0] * rate
    follows = p[1] * (behind + torque)
    force = -ca.vertcat(behind, follows)
    return Shares(0.0 * force, force, ca.SX(1, 1), ca.SX(1, 1), behind * slot[1] + follows * rate)


LAG = Kind("motor_lag", 0, 6, 2, 2, _lag)


def slip_of(kind: Kind) -> Slip:
    """Return the slip of a kind that rubs."""
    contact = kind.name.partition("_")[2]
    return next(slip for name, _, _, slip in SLIPS.values() if name == contact)


@cache
def friction_kind(law: str, contact: type) -> Kind:
    """Return the kind of a law at a type of contact."""
    name, nodes, drives, slip = SLIPS[contact]
    make, count, inner = {"viscous": (_viscous, 1, 0), "dry": (_dry, 3, 1), "lugre": (_lugre, 6, 1)}[law]
    return Kind(f"{law}_{name}", nodes, 6, drives + inner, _AXIS + count, make(slip))
