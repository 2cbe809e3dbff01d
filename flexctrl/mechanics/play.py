"""Free play: shafts and springs that bear nothing until a gap is closed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.mechanics.pieces import DriveMotion, LineMotion, shaft_torque

if TYPE_CHECKING:
    import casadi as ca


def within(strain: ca.SX, gap: ca.SX) -> ca.SX:
    """Return the part of a strain that lies within a gap of some width > 0, centred."""
    import casadi as ca

    half = 0.5 * gap
    return ca.fmin(ca.fmax(strain, -half), half)


def touching(strain: ca.SX, gap: ca.SX) -> ca.SX:
    """Return 1 where a gap is closed, else 0."""
    import casadi as ca

    return ca.if_else(ca.fabs(strain) > 0.5 * gap, 1.0, 0.0)


def pressing(force: ca.SX, strain: ca.SX) -> ca.SX:
    """Return a force of contact, which does not pull the sides of a gap towards each other."""
    import casadi as ca

    return ca.if_else(strain > 0.0, ca.fmax(force, 0.0), ca.fmin(force, 0.0))


def loose_line(m: LineMotion, gap: ca.SX) -> LineMotion:
    """Return a line whose length changes by what goes beyond the gap, and which is soft within it."""
    strain = m.length - m.p["length"]
    bears = touching(strain, gap)
    p = m.p | {name: bears * m.p[name] for name in ("stiffness", "damping")}
    return replace(m, p=p, length=m.length - within(strain, gap))


def loose_drive(m: DriveMotion, gap: ca.SX) -> DriveMotion:
    """Return a drive whose source angle is taken to where the gap's flank is, and whose shaft is soft within it."""
    twist = m.p["ratio"] * m.driven - m.source
    bears = touching(twist, gap)
    p = m.p | {name: bears * m.p[name] for name in ("stiffness", "damping")}
    return replace(m, p=p, source=m.source + within(twist, gap))


def loose_shaft_force(m: DriveMotion) -> ca.SX:
    """Return the force of a shaft with play on both nodes and the source (13); ``m`` is a `loose_drive`."""
    import casadi as ca

    torque = pressing(shaft_torque(m), m.p["ratio"] * m.driven - m.source)
    return ca.vertcat(-m.p["ratio"] * torque * m.gradient, torque)
