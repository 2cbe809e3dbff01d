"""What component modes add to a beam element: shares of its axis, stiffness and momentum.

Beside the cubics of its ends the axis of the element bends in its clamped modes, v = Σ φᵢ(s) ηᵢ in each plane, and it
stretches and twists in shapes that are 0 at its ends, u = Σ χᵢ(s) ηᵢ beside what makes its strain uniform. Amplitudes
stand one after the other: along y, along z of the element frame, of stretch, of twist.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.mechanics.clamped_modes import ClampedModes, HeldShapes, clamped_modes, held_shapes
from flexctrl.mechanics.matrices import PlaneMass

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.mechanics.corotation import BeamMotion, OwnMotion

_PLANES = ((2, 1.0, "z"), (1, -1.0, "y"))
"""Of deflection along y and along z: the end rotation that goes with it, its sign, and the axis of bending."""


def motion_of(m: BeamMotion) -> OwnMotion:
    """Return the motion of the modes of an element that has any."""
    assert m.modal
    return m.modal


def modes_of(m: BeamMotion) -> ClampedModes:
    """Return the integrals of an element's modes of bending."""
    return clamped_modes(planes(m, motion_of(m).amplitudes)[0].numel())


def held_of(m: BeamMotion) -> HeldShapes:
    """Return the integrals of an element's shapes of stretch, and of twist."""
    return held_shapes(motion_of(m).along)


def planes(m: BeamMotion, values: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return modal values of bending: along y, along z."""
    count = values.numel() // 2 - motion_of(m).along
    return values[:count], values[count : 2 * count]


def lines(m: BeamMotion, values: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return modal values of stretch and of twist."""
    along = motion_of(m).along
    first = values.numel() - 2 * along
    return values[first : first + along], values[first + along :]


def bowing(m: BeamMotion) -> ca.SX:
    """Return what modes add to the strain from bending of the axis, ∫½v′²/L."""
    modes = modes_of(m)
    return _slopes(m, modes.bow, modes.slope)


def drawn(m: BeamMotion) -> ca.SX:
    """Return what modes add to how far the mean of the axis is drawn along the chord, ∫½v′² (s − ½)."""
    modes = modes_of(m)
    return _slopes(m, modes.drawn_ends, modes.drawn)


def _slopes(m: BeamMotion, with_ends: np.ndarray, own: np.ndarray) -> ca.SX:
    import casadi as ca

    total = ca.SX(1, 1)
    for eta, (axis, sign, _) in zip(planes(m, motion_of(m).amplitudes / m.p["L"]), _PLANES, strict=True):
        ends = sign * ca.vertcat(m.theta[0][axis], m.theta[1][axis])
        total += ca.dot(ends, ca.DM(with_ends) @ eta) + 0.5 * ca.dot(eta, ca.DM(own) @ eta)
    return total


def deflection(m: BeamMotion) -> ca.SX:
    """Return what modes add to the mean of the axis off the middle of the chord, in the frame [m]."""
    import casadi as ca

    mean, values = ca.DM(modes_of(m).mean), motion_of(m).amplitudes
    stretch = ca.dot(ca.DM(held_of(m).mean), lines(m, values)[0])
    return ca.vertcat(stretch, *[ca.dot(mean, eta) for eta in planes(m, values)])


def stiffness(m: BeamMotion) -> ca.SX:
    """Return the stiffness of each mode, EI β⁴/L³ [N/m], EA/L [N/m], GJ/L [N m/rad]."""
    import casadi as ca

    fourth, each = ca.DM(modes_of(m).stiffness), ca.DM.ones(motion_of(m).along)
    bending = [m.p[f"a_{about}"] / (4.0 * m.p["L"] ** 2) * fourth for _, _, about in _PLANES]
    return ca.vertcat(*bending, *(m.p[law] / m.p["L"] * each for law in ("EA", "GJ")))


def momenta(m: BeamMotion, rates: tuple[ca.SX, ...], modal: ca.SX) -> tuple[tuple[ca.SX, ...], ca.SX]:
    """Return what modal rates add to the momenta of the nodes (four blocks), and the momenta of the modes.

    Parameters
    ----------
    m : BeamMotion
    rates : tuple of four casadi.SX
        v₁, ω₁, v₂, ω₂ in the frame, or accelerations.
    modal : casadi.SX
        Rates of the modes, or accelerations.
    """
    import casadi as ca

    modes, L, mass = modes_of(m), m.p["L"], m.p["mass"]
    blocks = [ca.SX(3, 1) for _ in range(4)]
    pushed_modes: list[ca.SX] = []
    for eta, across, (axis, sign, about) in zip(planes(m, modal), (1, 2), _PLANES, strict=True):
        turning = _rotary(m, about) / L
        ends = ca.vertcat(rates[0][across], sign * L * rates[1][axis], rates[2][across], sign * L * rates[3][axis])
        coupling = mass * ca.DM(modes.mass) + turning * ca.DM(modes.rotary)
        pushed = coupling @ eta
        for i in (0, 2):
            blocks[i][across] += pushed[i]
            blocks[i + 1][axis] += sign * L * pushed[i + 1]
        pushed_modes.append(coupling.T @ ends + mass * eta + turning * (ca.DM(modes.slope) @ eta))
    held = held_of(m)
    for eta, first, inertia in zip(lines(m, modal), (0, 1), (mass, m.p["polar"]), strict=True):
        pushed = inertia * (ca.DM(held.ends) @ eta)
        for i, push in zip((first, first + 2), (pushed[0], pushed[1]), strict=True):
            blocks[i][0] += push
        ends = ca.vertcat(rates[first][0], rates[first + 2][0])
        pushed_modes.append(inertia * (ca.DM(held.ends).T @ ends + ca.DM(held.mass) @ eta))
    return tuple(blocks), ca.vertcat(*pushed_modes)


def _rotary(m: BeamMotion, about: str) -> ca.SX:
    """ρI of bending about an axis [kg m], out of the consistent mass m 13/35 + ρI 6/(5 L)."""
    return (m.p[f"{about}_{PlaneMass._fields[0]}"] - 13.0 / 35.0 * m.p["mass"]) * (5.0 / 6.0) * m.p["L"]
