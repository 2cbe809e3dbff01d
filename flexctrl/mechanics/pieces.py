"""The pieces that are not beams: lines (ropes, springs), points and bodies with mass, drives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexctrl.frozen import frozen
from flexctrl.mechanics.corotation import NodeMotion, reach

if TYPE_CHECKING:
    import casadi as ca

SLIGHT = 1e-14
"""Share of a rope's length that it may lack and still count as taut."""
LINE_PARAMETERS = ("stiffness", "length", "damping")
BODY_PARAMETERS = ("mass", "xx", "yy", "zz", "xy", "xz", "yz")
DRIVE_PARAMETERS = (
    "stiffness",
    "damping",
    "inertia",
    "ratio",
    "axis_x",
    "axis_y",
    "axis_z",
    "rest_x",
    "rest_y",
    "rest_z",
)


@frozen
class LineMotion:
    """A straight line between two nodes: its length, how fast that grows, and its direction in space."""

    p: dict[str, ca.SX]
    length: ca.SX
    rate: ca.SX
    direction: ca.SX


@frozen
class DriveMotion:
    """A drive: the driven coordinate s (angle or travel), the source angle and their rates.

    ``gradient`` is ∂s/∂(increments of both nodes), 12: the driven node, then the one that carries the motor.
    """

    p: dict[str, ca.SX]
    driven: ca.SX
    driven_rate: ca.SX
    source: ca.SX
    source_rate: ca.SX
    source_acceleration: ca.SX
    gradient: ca.SX


def named(names: tuple[str, ...], values: ca.SX) -> dict[str, ca.SX]:
    """Return parameters by name."""
    return {name: values[i] for i, name in enumerate(names)}


def line_motion(first: NodeMotion, second: NodeMotion, parameters: ca.SX) -> LineMotion:
    """Return the motion of a line from that of its ends."""
    import casadi as ca

    length = reach(first, second)[1]
    direction = (second.x - first.x) / length
    return LineMotion(named(LINE_PARAMETERS, parameters), length, ca.dot(direction, second.v - first.v), direction)


def spring_tension(m: LineMotion) -> ca.SX:
    """Return k (ℓ − ℓ₀) + c ℓ̇ [N]."""
    return m.p["stiffness"] * (m.length - m.p["length"]) + m.p["damping"] * m.rate


def spring_energy(m: LineMotion) -> ca.SX:
    """Return ½ k (ℓ − ℓ₀)² [J]."""
    return 0.5 * m.p["stiffness"] * (m.length - m.p["length"]) ** 2


def unilateral(m: LineMotion, pull: ca.SX) -> ca.SX:
    """Return what a rope makes of a pull [N]: the pull while taut and not negative, else zero.

    A rope drawn just taut counts as taut, round-off or not, so that its tangent at rest is its stiffness.
    """
    import casadi as ca

    slight = SLIGHT * m.p["length"]
    return ca.if_else(m.length > m.p["length"] - slight, ca.fmax(pull, -slight * m.p["stiffness"]), 0.0)


def rope_energy(m: LineMotion) -> ca.SX:
    """Return ½ k (ℓ − ℓ₀)₊² [J]."""
    import casadi as ca

    return 0.5 * m.p["stiffness"] * ca.fmax(m.length - m.p["length"], 0.0) ** 2


def line_force(m: LineMotion, tension: ca.SX) -> ca.SX:
    """Return the forces of a tension on both ends (6): towards each other."""
    import casadi as ca

    return ca.vertcat(m.direction * tension, -m.direction * tension)


def rope_share(first: ca.SX, second: ca.SX, mass: ca.SX) -> ca.SX:
    """Return forces on both ends of a rope's element (6) from those on a unit mass at either end (6 each).

    What is linear in the motion, as inertia is, gets the mass matrix whose entries 11, 12 and 22 are given.
    """
    import casadi as ca

    a, b = first[:3], second[:3]
    return ca.vertcat(mass[0] * a + mass[1] * b, mass[1] * a + mass[2] * b)


def space_inertia(node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
    """Return R J Rᵀ, the inertia in space axes."""
    import casadi as ca

    xx, yy, zz, xy, xz, yz = (p[k] for k in BODY_PARAMETERS[1:])
    J = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return node.R @ J @ node.R.T


def body_inertia(node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
    """Return the force of inertia of a rigid body at its centre of mass (6): −m a, −(J ω̇ + ω × J ω)."""
    import casadi as ca

    J = space_inertia(node, p)
    return -ca.vertcat(p["mass"] * node.a, J @ node.b + ca.cross(node.w, J @ node.w))


def body_energy(node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
    """Return ½ m v² + ½ ωᵀ J ω [J]."""
    import casadi as ca

    return 0.5 * (p["mass"] * ca.dot(node.v, node.v) + ca.dot(node.w, space_inertia(node, p) @ node.w))


def rotary_motion(node: NodeMotion, base: NodeMotion, source: ca.SX, turns: ca.SX, parameters: ca.SX) -> DriveMotion:
    """Return the motion of a rotary drive.

    The angle is the twist about the axis that is left of the relative rotation when the tilt of the
    axis, from a as the base carries it to b as the node does, is undone; its rate is
    (a + b)/(1 + a·b) · (ω − ω_base), which is a · (ω − ω_base) across a hinge.

    Parameters
    ----------
    node, base : NodeMotion
        The driven node and the one that carries the motor.
    source : casadi.SX, 3
        θ_d, its rate and its acceleration.
    turns : casadi.SX
        Whole turns to add to the angle between -π and π.
    parameters : casadi.SX
        In the order of `DRIVE_PARAMETERS`.
    """
    import casadi as ca

    p = named(DRIVE_PARAMETERS, parameters)
    rest = ca.vertcat(p["axis_x"], p["axis_y"], p["axis_z"])
    a, b = base.R @ rest, node.R @ rest
    Q = base.R.T @ node.R
    sine = 0.5 * ca.dot(ca.vertcat(Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]), rest)
    tilt = ca.dot(a, b)
    angle = ca.atan2(sine, 0.5 * (Q[0, 0] + Q[1, 1] + Q[2, 2] - tilt)) + 2.0 * ca.pi * turns
    along = (a + b) / (1.0 + tilt)
    gradient = ca.vertcat(ca.SX(3, 1), along, ca.SX(3, 1), -along)
    return DriveMotion(p, angle, ca.dot(along, node.w - base.w), source[0], source[1], source[2], gradient)


def linear_motion(node: NodeMotion, base: NodeMotion, source: ca.SX, parameters: ca.SX) -> DriveMotion:
    """Return the motion of a linear drive; parameters as in `rotary_motion`."""
    import casadi as ca

    p = named(DRIVE_PARAMETERS, parameters)
    rest = ca.vertcat(p["axis_x"], p["axis_y"], p["axis_z"])
    axis = base.R @ rest
    arm = node.x - base.x
    travel = ca.dot(axis, arm) - ca.dot(rest, ca.vertcat(p["rest_x"], p["rest_y"], p["rest_z"]))
    turning = ca.cross(axis, arm)
    gradient = ca.vertcat(axis, ca.SX(3, 1), -axis, turning)
    rate = ca.dot(axis, node.v - base.v) + ca.dot(turning, base.w)
    return DriveMotion(p, travel, rate, source[0], source[1], source[2], gradient)


def hoist_motion(node: NodeMotion, base: NodeMotion, source: ca.SX, parameters: ca.SX) -> DriveMotion:
    """Return the motion of a winch: s is the distance of its nodes less that at rest; parameters as `rotary_motion`."""
    import casadi as ca

    p = named(DRIVE_PARAMETERS, parameters)
    rest = ca.vertcat(p["rest_x"], p["rest_y"], p["rest_z"])
    arm = node.x - base.x
    length = ca.sqrt(ca.dot(arm, arm))
    along = arm / length
    gradient = ca.vertcat(along, ca.SX(3, 1), -along, ca.SX(3, 1))
    travel, rate = length - ca.sqrt(ca.dot(rest, rest)), ca.dot(along, node.v - base.v)
    return DriveMotion(p, travel, rate, source[0], source[1], source[2], gradient)


def shaft_torque(m: DriveMotion) -> ca.SX:
    """Return the torque in the shaft on the motor side [N m]: k_θ (R s − θ_d) and the damping on its rate."""
    twist = m.p["ratio"] * m.driven - m.source
    rate = m.p["ratio"] * m.driven_rate - m.source_rate
    return m.p["stiffness"] * twist + m.p["damping"] * rate


def shaft_force(m: DriveMotion) -> ca.SX:
    """Return the force of the shaft on both nodes and the source (13): minus the gradient of `shaft_energy`."""
    import casadi as ca

    torque = shaft_torque(m)
    return ca.vertcat(-m.p["ratio"] * torque * m.gradient, torque)


def shaft_energy(m: DriveMotion) -> ca.SX:
    """Return V = ½ k_θ (R s − θ_d)² [J] (the paper's drive element)."""
    return 0.5 * m.p["stiffness"] * (m.p["ratio"] * m.driven - m.source) ** 2
