"""Friction between two sides, and the torque of a motor that builds up: forces as casadi expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexctrl.mechanics.corotation import NodeMotion

if TYPE_CHECKING:
    import casadi as ca


def turning_gradient(base: NodeMotion, rest: ca.SX) -> ca.SX:
    """Return ∂(angle)/∂(increments of both nodes), 12: about an axis that ``base`` carries."""
    import casadi as ca

    axis = base.R @ rest
    return ca.vertcat(ca.SX(3, 1), axis, ca.SX(3, 1), -axis)


def turned(node: NodeMotion, base: NodeMotion, rest: ca.SX) -> ca.SX:
    """Return the angle between −π and π by which a node has turned about an axis that ``base`` carries."""
    import casadi as ca

    Q = base.R.T @ node.R
    sine = 0.5 * ca.dot(ca.vertcat(Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]), rest)
    return ca.atan2(sine, 0.5 * (Q[0, 0] + Q[1, 1] + Q[2, 2] - 1.0))


def slid(node: NodeMotion, base: NodeMotion, rest: ca.SX) -> ca.SX:
    """Return how far a node stands out along an axis that ``base`` carries."""
    import casadi as ca

    return ca.dot(base.R @ rest, node.x - base.x)


def sliding_gradient(node: NodeMotion, base: NodeMotion, rest: ca.SX) -> ca.SX:
    """Return ∂(travel)/∂(increments of both nodes), 12: along an axis that ``base`` carries, see `linear_motion`."""
    import casadi as ca

    axis = base.R @ rest
    return ca.vertcat(axis, ca.SX(3, 1), -axis, ca.cross(axis, node.x - base.x))


def speed(node: NodeMotion, base: NodeMotion, gradient: ca.SX) -> ca.SX:
    """Return how fast two sides move against each other."""
    import casadi as ca

    return ca.dot(gradient, ca.vertcat(node.v, node.w, base.v, base.w))


def dry(speed: ca.SX, kinetic: ca.SX, static: ca.SX, stribeck: ca.SX) -> ca.SX:
    """Return the size of dry friction at a speed (Stribeck): F_k + (F_s − F_k) exp(−(v/v_s)²); F_k where v_s = 0."""
    import casadi as ca

    ratio = speed / ca.if_else(stribeck > 0.0, stribeck, 1.0)
    return kinetic + (static - kinetic) * ca.if_else(stribeck > 0.0, ca.exp(-ratio * ratio), 0.0)


def bristle_rate(z: ca.SX, speed: ca.SX, stiffness: ca.SX, level: ca.SX) -> ca.SX:
    """Return ż = v − σ₀ |v| z / g(v), how fast LuGre's bristles bend; ``level`` is g(v)."""
    import casadi as ca

    return speed - stiffness * ca.fabs(speed) * z / level
