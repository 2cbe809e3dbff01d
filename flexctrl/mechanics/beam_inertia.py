"""What mass does to a beam element: inertia, drag, and weight on its deflected axis."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.mechanics import component_modes
from flexctrl.mechanics.beam import BeamForce, no_force
from flexctrl.mechanics.corotation import BeamMotion, components, turning
from flexctrl.mechanics.matrices import PlaneMass

if TYPE_CHECKING:
    import casadi as ca


def _relative(m: BeamMotion, rates: tuple[ca.SX, ...]) -> tuple[ca.SX, ...]:
    """Momenta of the consistent mass less that of the mean motion it knows, three blocks."""
    import casadi as ca

    (wx1, wy1, wz1), (vx, vy, vz), (wx2, wy2, wz2) = (components(r) for r in rates)
    polar = m.p["polar"] / 6.0
    py, lz1, lz2 = _in_plane(m, vy, wz1, wz2, "z")
    pz, ly1, ly2 = _in_plane(m, vz, -wy1, -wy2, "y")
    return (
        ca.vertcat(polar * (2.0 * wx1 + wx2), -ly1, lz1),
        ca.vertcat(m.p["mass"] / 12.0 * vx, py, pz),
        ca.vertcat(polar * (wx1 + 2.0 * wx2), -ly2, lz2),
    )


def _in_plane(m: BeamMotion, v: ca.SX, w1: ca.SX, w2: ca.SX, about: str) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The consistent mass in one plane less that of ½(v₁ + v₂) + L/12 (ω₁ − ω₂), on v = v₂ − v₁ and the spins."""
    mass, L = m.p["mass"], m.p["L"]
    vv, tv, tt, _, _, other_tt = (m.p[f"{about}_{entry}"] for entry in PlaneMass._fields)
    vv, tv, shared = vv - mass / 4.0, tv - mass * L / 24.0, mass * L * L / 144.0
    tt, other_tt = tt - shared, other_tt + shared
    return vv * v - tv * (w1 + w2), tt * w1 + other_tt * w2 - tv * v, other_tt * w1 + tt * w2 - tv * v


def inertial_force(m: BeamMotion) -> BeamForce:
    """Return the force of inertia.

    Lagrange's equations of T = ½ Vᵀ M V + ½ m |Ẋ|², V = (ω₁, v₂ − v₁, ω₂) in the frame, M the consistent mass
    relative to its mean, X the mean of the axis (`offset`): d/dt(R_E p) − (ω × on the rotations) − ∂T/∂q, with R_E
    changing by the spin of the frame, and −m Ẍ on X.
    """
    import casadi as ca

    p, _ = _momenta(m, m.rates, 1)
    seen = tuple(a - ca.cross(m.spin, v) for a, v in zip(m.accelerations, m.rates, strict=True))
    rate, modal = _momenta(m, seen, 2)
    frame_torque = sum((ca.cross(v, q) for v, q in zip(m.rates, p, strict=True)), ca.SX.zeros(3))
    blocks = [r + ca.cross(m.spin, q) for r, q in zip(rate, p, strict=True)]
    for i in (0, 2):
        blocks[i] = blocks[i] - ca.cross(m.rates[i], p[i])
    beside = BeamForce(ca.SX(7, 1), -frame_torque, -ca.vertcat(*blocks), -modal)
    return replace(beside, mean=-m.p["mass"] * _mean_acceleration(m))


def _momenta(m: BeamMotion, rates: tuple[ca.SX, ...], order: int) -> tuple[tuple[ca.SX, ...], ca.SX | float]:
    """Momenta but of the mean: of V and of the element's own modes, by rates (order 1) or accelerations (2)."""
    blocks = _relative(m, rates)
    if not m.modal:
        return blocks, 0.0
    more, modal = component_modes.momenta(m, rates, m.modal[:3][order])
    return tuple(a + b for a, b in zip(blocks, more, strict=True)), modal


def kinetic_energy(m: BeamMotion) -> ca.SX:
    """Return ½ Vᵀ M V + ½ m |Ẋ|² [J]."""
    import casadi as ca

    p, modal = _momenta(m, m.rates, 1)
    velocity = _mean_velocity(m)
    mean = 0.5 * m.p["mass"] * ca.dot(velocity, velocity)
    beside = 0.5 * ca.dot(ca.vertcat(*m.rates), ca.vertcat(*p))
    return mean + beside + 0.5 * ca.dot(m.modal[1], modal) if m.modal else mean + beside


def drag(m: BeamMotion) -> BeamForce:
    """Return the force of a damping equal to the mass: minus the momenta."""
    import casadi as ca

    blocks, modal = _momenta(m, m.rates, 1)
    beside = BeamForce(ca.SX(7, 1), ca.SX(3, 1), -ca.vertcat(*blocks), -modal)
    return replace(beside, mean=-m.p["mass"] * _mean_velocity(m))


def weight(m: BeamMotion, g: np.ndarray) -> BeamForce:
    """Return the force of gravity g [m/s²], minus the gradient of `height_energy`."""
    local = m.p["mass"] * (m.frame.T @ g)
    return replace(no_force(), mean=local)


def height_energy(m: BeamMotion, g: np.ndarray, middle: ca.SX) -> ca.SX:
    """Return −∫ρA g·x ds [J], with ``middle`` the mean of the nodal positions in space."""
    import casadi as ca

    return -m.p["mass"] * ca.dot(ca.DM(g), middle + m.frame @ offset(m))


def offset(m: BeamMotion) -> ca.SX:
    """Return how far the mean of the axis lies off the middle of the chord, in the frame.

    That of the cubic with unit slopes t₁ and t₂ is L/12 (t₁ − t₂). Along the chord it is two fifths of that: what the
    bending of the more bent half draws in, ∫½(v'² + w'²)(ξ − ½).
    """
    import casadi as ca

    slant = m.axes[0] - m.axes[1]
    cubic = m.p["L"] * (slant / 12.0 - ca.vertcat(slant[0] / 20.0, 0, 0))
    return cubic + component_modes.offset(m, m.axes, m.modal.amplitudes) if m.modal else cubic


def _mean_velocity(m: BeamMotion) -> ca.SX:
    """Ẋ of X = ½(x₁ + x₂) + L/12 t − L/20 (t·e) e, t = t₁ − t₂, e along the chord, and of what modes add to it."""
    import casadi as ca

    w1, _, w2 = m.rates
    (t1, t2), (t, turn) = m.axes, _chord(m)
    rate = ca.cross(w1, t1) - ca.cross(w2, t2)
    along = ca.vertcat(rate[0] + ca.dot(t, turn), 0, 0) + t[0] * turn
    cubic = m.middle[0] + m.p["L"] * (rate / 12.0 - along / 20.0)
    if not m.modal:
        return cubic
    y, seen, _ = component_modes.offset_rates(m)
    return cubic + seen + ca.cross(m.spin, y)


def _chord(m: BeamMotion) -> tuple[ca.SX, ca.SX]:
    """t, and the rate of the chord's direction ė."""
    import casadi as ca

    return m.axes[0] - m.axes[1], ca.vertcat(0, m.spin[2], -m.spin[1])


def _mean_acceleration(m: BeamMotion) -> ca.SX:
    """Ẍ of the same."""
    import casadi as ca

    (t1, t2), (t, turn) = m.axes, _chord(m)
    (w1, v, w2), (b1, a, b2) = m.rates, m.accelerations
    u1, u2 = ca.cross(w1, t1), ca.cross(w2, t2)
    rate = u1 - u2
    second = ca.cross(b1, t1) + ca.cross(w1, u1) - ca.cross(b2, t2) - ca.cross(w2, u2)
    apart = (a - 2.0 * v[0] * turn) / m.chord
    turned = ca.vertcat(-ca.dot(turn, turn), apart[1], apart[2])
    along = second[0] + 2.0 * ca.dot(rate, turn) + ca.dot(t, turned)
    twice = ca.vertcat(along, 0, 0) + 2.0 * (rate[0] + ca.dot(t, turn)) * turn + t[0] * turned
    cubic = m.middle[1] + m.p["L"] * (second / 12.0 - twice / 20.0)
    if not m.modal:
        return cubic
    y, seen, again = component_modes.offset_rates(m)
    return cubic + again + ca.cross(turning(m), y) + ca.cross(m.spin, 2.0 * seen + ca.cross(m.spin, y))
