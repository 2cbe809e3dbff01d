"""Forces of the beam element on its corotated frame. At rest their tangents are the textbook matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.frozen import frozen
from flexctrl.mechanics import component_modes
from flexctrl.mechanics.corotation import SHEARING, BeamMotion, components
from flexctrl.mechanics.rotation import inverse_tangent
from flexctrl.mechanics.strains import deformations, farther, seen_deformed, stiffened, strain_rates, stresses

if TYPE_CHECKING:
    import casadi as ca


@frozen
class BeamForce:
    """A force on an element by what it works on; shares add, and reach the nodes by `whole_force` once.

    Attributes
    ----------
    deformation : casadi.SX, 7
        Works on stretch, θ₁ and θ₂.
    torque : casadi.SX, 3
        Works on the spin of the frame, in the frame.
    beside : casadi.SX, 9
        Works on ω₁, v₂ − v₁ and ω₂, in the frame.
    modal : casadi.SX or float
        Forces on the element's own modes; 0 where it has none.
    stress : casadi.SX, 6, or float
        `stresses`, which resist `deformations`; 0 where there are none.
    mean : casadi.SX, 3, or float
        Works on the mean of the axis (`flexctrl.mechanics.beam_inertia.offset`), in the frame.
    """

    deformation: ca.SX
    torque: ca.SX
    beside: ca.SX
    modal: ca.SX | float = 0.0
    stress: ca.SX | float = 0.0
    mean: ca.SX | float = 0.0

    def __add__(self, other: BeamForce) -> BeamForce:
        sums = (self.deformation + other.deformation, self.torque + other.torque, self.beside + other.beside)
        return BeamForce(*sums, self.modal + other.modal, self.stress + other.stress, self.mean + other.mean)

    def __mul__(self, factor: float) -> BeamForce:
        works = (self.deformation * factor, self.torque * factor, self.beside * factor)
        return BeamForce(*works, self.modal * factor, self.stress * factor, self.mean * factor)


def no_force() -> BeamForce:
    """Return the force that is not there."""
    import casadi as ca

    return BeamForce(ca.SX(7, 1), ca.SX(3, 1), ca.SX(9, 1))


def framed_force(m: BeamMotion, force: BeamForce) -> ca.SX:
    """Return the force that works on the middle of the chord, ω₁, v₂ − v₁, ω₂ (12) and on own modes, in the frame.

    Bᵀ n + Gᵀ t + f.
    """
    import casadi as ca

    middle = ca.SX(3, 1) + force.mean
    force = _resolved(m, force)
    n = force.deformation
    t1, t2 = inverse_tangent(m.theta[0], n[1:4]), inverse_tangent(m.theta[1], n[4:7])
    torque = force.torque - (t1 + t2)
    lever = torque[0] / m.lever[0]
    about_y, about_z = torque[1] - lever * m.lever[1], torque[2] - lever * m.lever[2]
    pull = ca.vertcat(m.lean * n[0], about_z / m.chord, -about_y / m.chord)
    turn = [t + 0.5 * lever * arm for t, arm in zip((t1, t2), m.arms, strict=True)]
    f = force.beside
    blocks = (middle, f[0:3] + turn[0], f[3:6] + pull, f[6:9] + turn[1])
    return ca.vertcat(*blocks, ca.SX(m.modal[0].numel(), 1) + force.modal) if m.modal else ca.vertcat(*blocks)


def _resolved(m: BeamMotion, force: BeamForce) -> BeamForce:
    """The force by what stresses and forces on the mean work on."""
    plain = replace(force, stress=0.0, mean=0.0)
    if not isinstance(force.stress, float):
        plain = plain + stress_force(m, force.stress)
    return plain if isinstance(force.mean, float) else plain + _mean_force(m, force.mean)


def whole_force(m: BeamMotion, force: BeamForce) -> ca.SX:
    """Return a force on the nodes of an element, in space axes, and then on its own modes."""
    import casadi as ca

    framed = framed_force(m, force)
    middle, first, apart, second = (m.frame @ block for block in ca.vertsplit(framed[:12], 3))
    return ca.vertcat(0.5 * middle - apart, first, 0.5 * middle + apart, second, framed[12:])


def stress_force(m: BeamMotion, stress: ca.SX) -> BeamForce:
    """Return the force of given `stresses`: minus them times the gradients of their `deformations`."""
    import casadi as ca

    if SHEARING[0] in m.p or m.modal:
        return work_of(m, lambda local: ca.dot(deformations(local), stress)) * -1.0
    (x1, y1, z1), (x2, y2, z2) = (components(t) for t in m.theta)
    N, torque, about_y1, about_y2, about_z1, about_z2 = ca.vertsplit(stress)
    far_y, far_z = farther(m)
    s, t, half = N * m.p["L"] / 30.0, (x2 - x1) / 12.0, 0.5 * torque
    turning = about_y2 * far_z[1] - about_y1 * far_z[0] + about_z1 * far_y[0] - about_z2 * far_y[1]
    twisting = torque + turning / 12.0
    m1 = ca.vertcat(
        -twisting,
        about_y1 + s * (4.0 * y1 - y2) + half * z2 + t * (about_z1 - 2.0 * about_z2),
        about_z1 + s * (4.0 * z1 - z2) - half * y2 - t * (about_y1 - 2.0 * about_y2),
    )
    m2 = ca.vertcat(
        twisting,
        about_y2 + s * (4.0 * y2 - y1) - half * z1 + t * (2.0 * about_z1 - about_z2),
        about_z2 + s * (4.0 * z2 - z1) + half * y1 - t * (2.0 * about_y1 - about_y2),
    )
    return replace(no_force(), deformation=-ca.vertcat(N, m1, m2))


def _mean_force(m: BeamMotion, force: ca.SX) -> BeamForce:
    """What a force on the mean of the axis does."""
    import casadi as ca

    (t1, t2), t, L = m.axes, m.axes[0] - m.axes[1], m.p["L"]
    on_slant = L * (force / 12.0 - ca.vertcat(force[0] / 20.0, 0, 0))
    on_chord = -L / 20.0 * (force[0] * t + t[0] * force)
    none = ca.SX(3, 1)
    beside = ca.vertcat(ca.cross(t1, on_slant), none, -ca.cross(t2, on_slant))
    torque = ca.vertcat(0, -on_chord[2], on_chord[1])
    if not m.modal:
        return BeamForce(ca.SX(7, 1), torque, beside)
    moments, turn, modal = component_modes.offset_force(m, force)
    return BeamForce(ca.SX(7, 1), torque + turn, beside + ca.vertcat(moments[:3], none, moments[3:]), modal)


def work_of(m: BeamMotion, of: Callable[[BeamMotion], ca.SX]) -> BeamForce:
    """Return the gradient of a function of what deforms: stretch, end rotations, modes."""
    import casadi as ca

    seen, local = seen_deformed(m)
    now = ca.vertcat(m.stretch, *m.theta, *m.modal[:1])
    gradient = ca.substitute(ca.gradient(of(local), seen), seen, now)
    return replace(no_force(), deformation=gradient[:7], modal=gradient[7:] if m.modal else 0.0)


def elastic_force(m: BeamMotion) -> BeamForce:
    """Return minus the gradient of `strain_energy`."""
    force = replace(no_force(), stress=stresses(m))
    return force + _modal(-component_modes.stiffness(m) * m.modal[0]) if m.modal else force


def _modal(force: ca.SX) -> BeamForce:
    """Return a force on the element's own modes."""
    return replace(no_force(), modal=force)


def viscous_force(m: BeamMotion) -> BeamForce:
    """Return the force of a damping equal to the stiffness, on the rates of `deformations`."""
    force = replace(no_force(), stress=stiffened(m, strain_rates(m)))
    return force + _modal(-component_modes.stiffness(m) * m.modal[1]) if m.modal else force
