"""What mass does to a beam element: inertia, drag, and weight on its deflected axis."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.mechanics import component_modes
from flexctrl.mechanics.beam import BeamForce, work_of
from flexctrl.mechanics.corotation import BeamMotion, components
from flexctrl.mechanics.matrices import PlaneMass

if TYPE_CHECKING:
    import casadi as ca


def momentum(m: BeamMotion, rates: tuple[ca.SX, ca.SX, ca.SX, ca.SX]) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return M_e applied to nodal velocities (or accelerations) in the frame: four blocks."""
    import casadi as ca

    (vx1, vy1, vz1), (wx1, wy1, wz1), (vx2, vy2, vz2), (wx2, wy2, wz2) = (components(r) for r in rates)
    mass, polar = m.p["mass"], m.p["polar"]
    py1, lz1, py2, lz2 = _bending_momentum(m, (vy1, wz1, vy2, wz2), "z")
    pz1, ly1, pz2, ly2 = _bending_momentum(m, (vz1, -wy1, vz2, -wy2), "y")
    return (
        ca.vertcat(mass / 6.0 * (2.0 * vx1 + vx2), py1, pz1),
        ca.vertcat(polar / 6.0 * (2.0 * wx1 + wx2), -ly1, lz1),
        ca.vertcat(mass / 6.0 * (vx1 + 2.0 * vx2), py2, pz2),
        ca.vertcat(polar / 6.0 * (wx1 + 2.0 * wx2), -ly2, lz2),
    )


def _bending_momentum(m: BeamMotion, rates: tuple, about: str) -> tuple:
    """Consistent mass in one plane on the rates of (v₁, θ₁, v₂, θ₂)."""
    v1, w1, v2, w2 = rates
    vv, tv, tt, other_vv, other_tv, other_tt = (m.p[f"{about}_{entry}"] for entry in PlaneMass._fields)
    return (
        vv * v1 + tv * w1 + other_vv * v2 - other_tv * w2,
        tv * v1 + tt * w1 + other_tv * v2 + other_tt * w2,
        other_vv * v1 + other_tv * w1 + vv * v2 - tv * w2,
        -other_tv * v1 + other_tt * w1 - tv * v2 + tt * w2,
    )


def inertial_force(m: BeamMotion) -> BeamForce:
    """Return the force of inertia.

    Lagrange's equations of T = ½ Vᵀ M_e V, V the nodal velocities in the frame:
    d/dt(R_E p) − (ω × on the rotations) − ∂T/∂q, with R_E changing by the frame's spin.
    """
    import casadi as ca

    p, _ = _momenta(m, m.rates, 1)
    seen = tuple(a - ca.cross(m.spin, v) for a, v in zip(m.accelerations, m.rates, strict=True))
    rate, modal = _momenta(m, seen, 2)
    frame_torque = sum((ca.cross(v, q) for v, q in zip(m.rates, p, strict=True)), ca.SX.zeros(3))
    blocks = [r + ca.cross(m.spin, q) for r, q in zip(rate, p, strict=True)]
    for i in (1, 3):
        blocks[i] = blocks[i] - ca.cross(m.rates[i], p[i])
    return BeamForce(ca.SX(7, 1), -frame_torque, -ca.vertcat(*blocks), -modal)


def _momenta(m: BeamMotion, rates: tuple[ca.SX, ...], order: int) -> tuple[tuple[ca.SX, ...], ca.SX | float]:
    """Return momenta of the nodes and of the element's own modes, by rates (order 1) or accelerations (2)."""
    blocks = momentum(m, rates)  # type: ignore[arg-type]
    if not m.modal:
        return blocks, 0.0
    more, modal = component_modes.momenta(m, rates, m.modal[:3][order])
    return tuple(a + b for a, b in zip(blocks, more, strict=True)), modal


def kinetic_energy(m: BeamMotion) -> ca.SX:
    """Return ½ Vᵀ M_e V [J]."""
    import casadi as ca

    p, modal = _momenta(m, m.rates, 1)
    nodal = 0.5 * ca.dot(ca.vertcat(*m.rates), ca.vertcat(*p))
    return nodal + 0.5 * ca.dot(m.modal[1], modal) if m.modal else nodal


def drag(m: BeamMotion) -> BeamForce:
    """Return −M_e V, the force of a damping equal to the mass on the nodal velocities."""
    import casadi as ca

    blocks, modal = _momenta(m, m.rates, 1)
    return BeamForce(ca.SX(7, 1), ca.SX(3, 1), -ca.vertcat(*blocks), -modal)


def weight(m: BeamMotion, g: np.ndarray) -> BeamForce:
    """Return the force of gravity g [m/s²], minus the gradient of `height_energy`."""
    import casadi as ca

    local = m.p["mass"] * (m.frame.T @ g)
    none = ca.SX(3, 1)
    halves = ca.vertcat(0.5 * local, none, 0.5 * local, none)
    return offset_force(m, local) + BeamForce(ca.SX(7, 1), none, halves)


def height_energy(m: BeamMotion, g: np.ndarray, middle: ca.SX) -> ca.SX:
    """Return −∫ρA g·x ds [J], with ``middle`` the mean of the nodal positions in space."""
    import casadi as ca

    return -m.p["mass"] * ca.dot(ca.DM(g), middle + m.frame @ offset(m))


def offset(m: BeamMotion) -> ca.SX:
    """Return how far the mean of the axis lies off the middle of the chord, in the frame.

    Across, the deflection of the cubic; along, what the bending of the more bent half draws in: ∫½(v'² + w'²)(ξ − ½).
    """
    import casadi as ca

    (_, y1, z1), (_, y2, z2) = (components(t) for t in m.theta)
    along = (y2 * y2 + z2 * z2 - y1 * y1 - z1 * z1) / 60.0
    cubic = m.p["L"] * ca.vertcat(along, (z1 - z2) / 12.0, (y2 - y1) / 12.0)
    if not m.modal:
        return cubic
    return cubic + component_modes.deflection(m) + ca.vertcat(m.p["L"] * component_modes.drawn(m), 0, 0)


def offset_force(m: BeamMotion, force: ca.SX) -> BeamForce:
    """Return a force that acts on the `offset`, given in the frame."""
    import casadi as ca

    if m.modal:
        return replace(work_of(m, lambda local: ca.dot(offset(local), force)), torque=ca.cross(offset(m), force))
    (_, y1, z1), (_, y2, z2) = (components(t) for t in m.theta)
    along, c = m.p["L"] * force[0] / 30.0, m.p["L"] / 12.0
    m1 = ca.vertcat(0, -c * force[2] - along * y1, c * force[1] - along * z1)
    m2 = ca.vertcat(0, c * force[2] + along * y2, along * z2 - c * force[1])
    return BeamForce(ca.vertcat(0, m1, m2), ca.cross(offset(m), force), ca.SX(12, 1))
