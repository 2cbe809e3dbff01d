"""How a beam element is strained: what its stresses work on, how fast, and what they store."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.mechanics import component_modes
from flexctrl.mechanics.corotation import SHEARING, BeamMotion, components
from flexctrl.mechanics.rotation import inverse_tangent

if TYPE_CHECKING:
    import casadi as ca


def bowing(m: BeamMotion) -> ca.SX:
    """Return the strain from bending of the axis between the nodes, ∫½(v'² + w'²)/L for the cubic shape."""
    (_, y1, z1), (_, y2, z2) = (components(t) for t in m.theta)
    cubic = (2.0 * (y1 * y1 + y2 * y2 + z1 * z1 + z2 * z2) - y1 * y2 - z1 * z2) / 30.0
    return cubic + component_modes.bowing(m) if m.modal else cubic


def deformations(m: BeamMotion) -> ca.SX:
    """Return what `stresses` work on: stretch, twist, and end rotations against the chord about y (two), z (two).

    To second order in the end rotations: what bends in both planes twists, and what is twisted as well is bent in the
    other plane, so that a slender beam turns over sideways, or coils under a torque, where it should.
    """
    import casadi as ca

    if SHEARING[0] in m.p:
        return _sheared(m)
    (x1, y1, z1), (x2, y2, z2) = (components(t) for t in m.theta)
    twist, (far_y, far_z) = x2 - x1, farther(m)
    t = twist / 12.0
    ends = (y1 - t * far_z[0], y2 + t * far_z[1], z1 + t * far_y[0], z2 - t * far_y[1])
    return ca.vertcat(m.stretch + m.p["L"] * bowing(m), twist + 0.5 * (y1 * z2 - y2 * z1), *ends)


def farther(m: BeamMotion) -> tuple[tuple[ca.SX, ca.SX], tuple[ca.SX, ca.SX]]:
    """Return the end rotations about y, and about z, each with twice that of the other end added."""
    (_, y1, z1), (_, y2, z2) = (components(t) for t in m.theta)
    return (y1 + 2.0 * y2, y2 + 2.0 * y1), (z1 + 2.0 * z2, z2 + 2.0 * z1)


def _sheared(m: BeamMotion) -> ca.SX:
    """Return the `deformations` of a beam that shears: its sections are turned against the chord however short it is.

    Their strains are measured in the sections' own axes (Reissner 1981), averaged over the element with Timoshenko's
    shapes: to second order in what bends, to third in the turn ψ of the sections by shear, so that short elements have
    Γ = (1 + ε) exp(−ψ) e₁ − e₁ and the curvature T(ψ)ᵀ θ'.
    """
    import casadi as ca

    mean, half, L = 0.5 * (m.theta[0] + m.theta[1]), 0.5 * (m.theta[1] - m.theta[0]), m.p["L"]
    bent = ca.vertcat(0, m.p["r_y"] * mean[1], m.p["r_z"] * mean[2])
    y, z = mean[1] - bent[1], mean[2] - bent[2]
    turn = ca.vertcat(0, y, z)  # the frame takes all twist along
    square, across = y * y + z * z, ca.vertcat(0, z, -y)
    axis = 0.5 * ca.cross(turn, across) - (1.0 - square / 6.0) * across  # exp(−ψ) e₁ − e₁
    turned = half - 0.5 * ca.cross(turn - bent, half) + ca.cross(turn, ca.cross(turn, half)) / 6.0
    gamma = (1.0 + m.stretch / L) * axis
    drawn = 0.1 * ca.dot(bent, bent) + (half[1] * half[1] + half[2] * half[2]) / 6.0
    # what is twisted while it bends shears its middle
    middle_y = bent[1] + gamma[2] - half[0] * half[2] / 6.0
    middle_z = bent[2] - gamma[1] + half[0] * half[1] / 6.0
    ends = (middle_y - turned[1], middle_y + turned[1], middle_z - turned[2], middle_z + turned[2])
    return ca.vertcat(m.stretch + L * (gamma[0] + drawn), 2.0 * turned[0], *ends)


def stresses(m: BeamMotion) -> ca.SX:
    """Return what the `deformations` call forth: axial force, torque, end moments about y (two) and z (two)."""
    return stiffened(m, deformations(m))


def stiffened(m: BeamMotion, d: ca.SX) -> ca.SX:
    """Return the stiffness of the element on some deformations."""
    import casadi as ca

    p = m.p
    plain = ca.vertcat(
        p["EA"] * (d[0] / p["L"]),
        p["GJ"] / p["L"] * d[1],
        p["a_y"] * d[2] + p["b_y"] * d[3],
        p["b_y"] * d[2] + p["a_y"] * d[3],
        p["a_z"] * d[4] + p["b_z"] * d[5],
        p["b_z"] * d[4] + p["a_z"] * d[5],
    )
    if SHEARING[0] not in p:
        return plain
    C = ca.SX(6, 6)
    for i in range(6):
        for j in range(i, 6):
            C[i, j] = C[j, i] = p[f"c{i}{j}"]
    return plain + C @ d


def seen_deformed(m: BeamMotion) -> tuple[ca.SX, BeamMotion]:
    """Return symbols of stretch, end rotations and modal amplitudes, and the motion that has them."""
    import casadi as ca

    seen = ca.SX.sym("seen", 7 + sum(eta.numel() for eta in m.modal[:1]))
    modal = m.modal._replace(amplitudes=seen[7:]) if m.modal else ()
    return seen, replace(m, stretch=seen[0], theta=(seen[1:4], seen[4:7]), modal=modal)


def strain_energy(m: BeamMotion) -> ca.SX:
    """Return half of `stresses` on `deformations` [J]."""
    import casadi as ca

    d = deformations(m)
    cubic = 0.5 * ca.dot(d, stiffened(m, d))
    return cubic + 0.5 * ca.dot(component_modes.stiffness(m), m.modal[0] ** 2) if m.modal else cubic


def deformation_rates(m: BeamMotion) -> ca.SX:
    """Return the rates of stretch, θ₁ and θ₂."""
    import casadi as ca

    # the rate of a rotation vector is T⁻¹ times the relative spin; T⁻¹(θ) = T⁻ᵀ(−θ)
    turning = [inverse_tangent(-t, w - m.spin) for t, w in zip(m.theta, m.rates[::2], strict=True)]
    return ca.vertcat(m.lean * m.rates[1][0], *turning)


def strain_rates(m: BeamMotion) -> ca.SX:
    """Return the rates of `deformations`: an axis that bends as it shortens its chord is not stretched."""
    import casadi as ca

    seen, local = seen_deformed(m)
    rates = ca.jtimes(deformations(local), seen, ca.vertcat(deformation_rates(m), *m.modal[1:2]))
    return ca.substitute(rates, seen, ca.vertcat(m.stretch, *m.theta, *m.modal[:1]))
