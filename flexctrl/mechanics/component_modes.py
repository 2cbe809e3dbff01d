"""What component modes add to a beam element: shares of its axis, stiffness and momentum.

Beside the cubics of its ends the axis of the element bends in its clamped modes, v = Σ φᵢ(s) ηᵢ in each plane, and it
stretches and twists in shapes that are 0 at its ends, u = Σ χᵢ(s) ηᵢ beside what makes its strain uniform. Amplitudes
stand one after the other: along y, along z of the element frame, of stretch, of twist.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.mechanics.clamped_modes import ClampedModes, HeldShapes, clamped_modes, held_shapes
from flexctrl.mechanics.corotation import turning
from flexctrl.mechanics.matrices import PlaneMass

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.mechanics.corotation import BeamMotion, OwnMotion

_PLANES = ((2, 1.0, "z"), (1, -1.0, "y"))
"""Of deflection along y and along z: the end rotation that goes with it, its sign, and the axis of bending."""
_ACROSS = (1, 2)


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
    import casadi as ca

    modes, ends = modes_of(m), [sign * ca.vertcat(*(t[axis] for t in m.theta)) for axis, sign, _ in _PLANES]
    return _slopes(m, ends, motion_of(m).amplitudes, modes.bow, modes.slope)


def _slopes(m: BeamMotion, ends: list[ca.SX], amplitudes: ca.SX, with_ends: np.ndarray, own: np.ndarray) -> ca.SX:
    """An integral of ½v′² in both planes, v′ of slopes of the ends and of modes."""
    import casadi as ca

    total = ca.SX(1, 1)
    for eta, slopes in zip(planes(m, amplitudes / m.p["L"]), ends, strict=True):
        total += ca.dot(slopes, ca.DM(with_ends) @ eta) + 0.5 * ca.dot(eta, ca.DM(own) @ eta)
    return total


def offset(m: BeamMotion, axes: tuple[ca.SX, ...], amplitudes: ca.SX) -> ca.SX:
    """Return what modes add to the mean of the axis off the middle of the chord, in the frame [m].

    Across, their mean deflection; along, how far they draw it in, ∫½v′² (s − ½), beside the slopes of the ends' axes.
    """
    import casadi as ca

    modes, ends = modes_of(m), [ca.vertcat(*(t[k] for t in axes)) for k in _ACROSS]
    drawn = _slopes(m, ends, amplitudes, modes.drawn_ends, modes.drawn)
    return deflection(m, amplitudes) + ca.vertcat(m.p["L"] * drawn, 0, 0)


def offset_rates(m: BeamMotion) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return `offset`, its rate and the rate of that, as seen by who turns with the frame."""
    import casadi as ca

    own, spins = motion_of(m), [w - m.spin for w in m.rates[::2]]
    rates = [b - ca.cross(m.spin, w) - turning(m) for b, w in zip(m.accelerations[::2], m.rates[::2], strict=True)]
    first = [ca.cross(w, t) for w, t in zip(spins, m.axes, strict=True)]
    second = [ca.cross(b, t) + ca.cross(w, u) for b, w, t, u in zip(rates, spins, m.axes, first, strict=True)]
    now = ca.vertcat(*m.axes, own.amplitudes)
    z, rate = ca.SX.sym("z", now.numel()), ca.SX.sym("rate", now.numel())
    y = offset(m, (z[:3], z[3:6]), z[6:])
    once = ca.jtimes(y, z, rate)
    twice = ca.jtimes(once, z, rate) + ca.jtimes(once, rate, ca.vertcat(*second, own.accelerations))
    values = ca.vertcat(now, *first, own.rates)
    return tuple(ca.substitute(of, ca.vertcat(z, rate), values) for of in (y, once, twice))  # type: ignore[return-value]


def offset_force(m: BeamMotion, force: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return what a force on `offset` does: moments on the nodes (6), a torque on the frame, forces on the modes."""
    import casadi as ca

    now = ca.vertcat(*m.axes, motion_of(m).amplitudes)
    z = ca.SX.sym("z", now.numel())
    y = offset(m, (z[:3], z[3:6]), z[6:])
    pull = ca.substitute(ca.gradient(ca.dot(y, force), z), z, now)
    moments = [ca.cross(t, pull[3 * i : 3 * i + 3]) for i, t in enumerate(m.axes)]
    return ca.vertcat(*moments), ca.cross(ca.substitute(y, z, now), force) - sum(moments), pull[6:]


def deflection(m: BeamMotion, values: ca.SX) -> ca.SX:
    """Return the mean of the axis as modal values bend and stretch it, in the frame."""
    import casadi as ca

    mean = ca.DM(modes_of(m).mean)
    stretch = ca.dot(ca.DM(held_of(m).mean), lines(m, values)[0])
    return ca.vertcat(stretch, *[ca.dot(mean, eta) for eta in planes(m, values)])


def stiffness(m: BeamMotion) -> ca.SX:
    """Return the stiffness of each mode, EI β⁴/L³ [N/m], EA/L [N/m], GJ/L [N m/rad]."""
    import casadi as ca

    fourth, each = ca.DM(modes_of(m).stiffness), ca.DM.ones(motion_of(m).along)
    bending = [m.p[f"a_{about}"] / (4.0 * m.p["L"] ** 2) * fourth for _, _, about in _PLANES]
    return ca.vertcat(*bending, *(m.p[law] / m.p["L"] * each for law in ("EA", "GJ")))


def momenta(m: BeamMotion, rates: tuple[ca.SX, ...], modal: ca.SX) -> tuple[tuple[ca.SX, ...], ca.SX]:
    """Return what modal rates add to the momenta that go with ``rates`` (three blocks), and the momenta of the modes.

    All less those of the mean motion, ½(v₁ + v₂) + L/12 (ω₁ − ω₂) × e₁ and the modes' `deflection`.

    Parameters
    ----------
    m : BeamMotion
    rates : tuple of three casadi.SX
        ω₁, v₂ − v₁, ω₂ in the frame, or accelerations.
    modal : casadi.SX
        Rates of the modes, or accelerations.
    """
    import casadi as ca

    modes, L, mass = modes_of(m), m.p["L"], m.p["mass"]
    first, apart, second = (ca.SX(3, 1) for _ in range(3))
    half = 0.5 * rates[1]
    pushed_modes: list[ca.SX] = []
    for eta, across, (axis, sign, about) in zip(planes(m, modal), _ACROSS, _PLANES, strict=True):
        rotary = _rotary(m, about) / L
        ends = ca.vertcat(-half[across], sign * L * rates[0][axis], half[across], sign * L * rates[2][axis])
        coupling = mass * ca.DM(modes.mass) + rotary * ca.DM(modes.rotary)
        pushed = coupling @ eta
        first[axis] += sign * L * pushed[1]
        apart[across] += 0.5 * (pushed[2] - pushed[0])
        second[axis] += sign * L * pushed[3]
        pushed_modes.append(coupling.T @ ends + mass * eta + rotary * (ca.DM(modes.slope) @ eta))
    held = held_of(m)
    stretched, twisted = (ca.DM(held.ends) @ eta for eta in lines(m, modal))
    apart[0] += 0.5 * mass * (stretched[1] - stretched[0])
    first[0] += m.p["polar"] * twisted[0]
    second[0] += m.p["polar"] * twisted[1]
    along = (ca.vertcat(-half[0], half[0]), ca.vertcat(rates[0][0], rates[2][0]))
    for eta, ends, inertia in zip(lines(m, modal), along, (mass, m.p["polar"]), strict=True):
        pushed_modes.append(inertia * (ca.DM(held.ends).T @ ends + ca.DM(held.mass) @ eta))
    turn, shared = _shared(m, rates, modal)
    return (first - turn, apart, second + turn), ca.vertcat(*pushed_modes) - shared


def _shared(m: BeamMotion, rates: tuple[ca.SX, ...], modal: ca.SX) -> tuple[ca.SX, ca.SX]:
    """What the mean motion has of these momenta: that of modal rates on ω₁ (and −ω₂), and all of it on the modes."""
    import casadi as ca

    mass, arm = m.p["mass"], ca.vertcat(m.p["L"] / 12.0, 0, 0)
    values = ca.SX.sym("values", modal.numel())
    own = deflection(m, modal)
    mean = ca.cross(rates[0] - rates[2], arm) + own
    return ca.cross(arm, mass * own), ca.gradient(ca.dot(deflection(m, values), mass * mean), values)


def _rotary(m: BeamMotion, about: str) -> ca.SX:
    """ρI of bending about an axis [kg m], out of the consistent mass m 13/35 + ρI 6/(5 L)."""
    return (m.p[f"{about}_{PlaneMass._fields[0]}"] - 13.0 / 35.0 * m.p["mass"]) * (5.0 / 6.0) * m.p["L"]
