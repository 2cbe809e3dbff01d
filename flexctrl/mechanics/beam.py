"""The beam element on its corotated frame: motion, forces and element matrices.

The element frame R_e has its x axis through both nodes and its twist from the mean of the nodal
rotations. Deformations are measured in it: the stretch of the chord and the rotation vectors
θ₁, θ₂ of the nodes. Velocities of the nodes seen in the frame carry the constant consistent mass
matrix (Crisfield, Galvanetto & Jelenić 1997). At rest the tangents are the textbook matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from flexctrl.mechanics import component_modes
from flexctrl.mechanics.matrices import PlaneMass
from flexctrl.mechanics.rotation import inverse_tangent, rotation_vector

if TYPE_CHECKING:
    import casadi as ca

PARAMETERS = (
    *("axes00", "axes01", "axes02", "axes10", "axes11", "axes12", "axes20", "axes21", "axes22"),
    *("L", "EA", "GJ", "a_y", "b_y", "a_z", "b_z", "mass", "polar"),
    *(f"{plane}_{entry}" for plane in ("z", "y") for entry in PlaneMass._fields),
)
"""Per element: axes at rest (row by row), length, EA, GJ, bending coefficients, mass, and that in bending by plane."""


SHEARING = ("r_y", "r_z", *(f"c{i}{j}" for i in range(6) for j in range(i, 6)))
"""Per element that shears, after these: 1/(1 + Φ) of bending about y and z; what couplings add to the stiffness."""


@dataclass(frozen=True)
class NodeMotion:
    """Symbols of a node: position x, rotation R since rest, velocity v, spin w, and their rates a, b.

    ``span`` is the duration of the step whose middle this is, v being its mean velocity; 0 for an instant.
    """

    x: ca.SX
    R: ca.SX
    v: ca.SX
    w: ca.SX
    a: ca.SX
    b: ca.SX
    span: ca.SX | float = 0.0


def reach(first: NodeMotion, second: NodeMotion) -> tuple[ca.SX, ca.SX]:
    """Return the distance of two nodes as it is in the middle of a step, and as it is at its ends in the mean.

    A force along the line between nodes that hangs on the second and works on the middle's vector over it does exactly
    the work that a quadratic potential changes by: (V₁ − V₀)/(ℓ₁ − ℓ₀) at (ℓ₀ + ℓ₁)/2 (Simo & Tarnow 1992). In the
    middle of a step a line that turns is shorter than at its ends.
    """
    import casadi as ca

    d = second.x - first.x
    length = ca.sqrt(ca.dot(d, d))
    if isinstance(first.span, float):
        return length, length
    half = 0.5 * first.span * (second.v - first.v)
    before, after = d - half, d + half
    return length, 0.5 * (ca.sqrt(ca.dot(before, before)) + ca.sqrt(ca.dot(after, after)))


@dataclass(frozen=True)
class BeamForce:
    """A force on an element by what it works on; shares add, and reach the nodes by `nodal_force` once.

    Attributes
    ----------
    deformation : casadi.SX, 7
        Works on stretch, θ₁ and θ₂.
    torque : casadi.SX, 3
        Works on the spin of the frame, in the frame.
    nodal : casadi.SX, 12
        Forces and moments on the nodes, in the frame.
    modal : casadi.SX or float
        Forces on the element's own modes; 0 where it has none.
    stress : casadi.SX, 6, or float
        `stresses`, which resist `deformations`; 0 where there are none.
    """

    deformation: ca.SX
    torque: ca.SX
    nodal: ca.SX
    modal: ca.SX | float = 0.0
    stress: ca.SX | float = 0.0

    def __add__(self, other: BeamForce) -> BeamForce:
        sums = (self.deformation + other.deformation, self.torque + other.torque, self.nodal + other.nodal)
        return BeamForce(*sums, self.modal + other.modal, self.stress + other.stress)

    def __mul__(self, factor: float) -> BeamForce:
        works = (self.deformation * factor, self.torque * factor, self.nodal * factor)
        return BeamForce(*works, self.modal * factor, self.stress * factor)


def no_force() -> BeamForce:
    """Return the force that is not there."""
    import casadi as ca

    return BeamForce(ca.SX(7, 1), ca.SX(3, 1), ca.SX(12, 1))


class OwnMotion(NamedTuple):
    """Amplitudes of an element's own modes, their rates and accelerations, in the order of `component_modes`.

    The last ``2 along`` of each are those of stretch and of twist.
    """

    amplitudes: ca.SX
    rates: ca.SX
    accelerations: ca.SX
    along: int = 0


_UPRIGHT, _TURNED = 1e-3, -0.84
"""What sides have in common across the chord, squared. The trace of a turn of 2.74 rad from end to end: the frame turns
over at half a turn."""


@dataclass(frozen=True)
class BeamMotion:
    """What the effects may use of a moving beam element; vectors in the element frame unless said.

    Attributes
    ----------
    p : dict of str to casadi.SX
        Parameters by name.
    frame : casadi.SX, 3 × 3
        R_e, columns in space axes.
    middle : casadi.SX
        Mean of the nodes' positions, in space axes.
    chord : casadi.SX
        Distance of the nodes [m].
    normal, arms : tuple
        How the twist of the frame hangs on the nodal rotations.
    stretch : casadi.SX
        Length of the chord less L [m].
    theta : tuple of two casadi.SX
        Rotation vectors of the nodes against the frame [rad].
    spin : casadi.SX
        Spin of the frame.
    rates, accelerations : tuple of four casadi.SX
        v₁, ω₁, v₂, ω₂ and their rates, absolute, resolved in the frame.
    modal : OwnMotion, or empty
        That of the element's own modes.
    lean : casadi.SX or float
        The chord over the length of which ``stretch`` tells; 1 but over the middle of a step (see `reach`).
    """

    p: dict[str, ca.SX]
    frame: ca.SX
    middle: ca.SX
    chord: ca.SX
    normal: tuple[ca.SX, ca.SX]
    arms: tuple[ca.SX, ca.SX]
    stretch: ca.SX
    theta: tuple[ca.SX, ca.SX]
    spin: ca.SX
    rates: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    accelerations: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    modal: OwnMotion | tuple[()] = ()
    lean: ca.SX | float = 1.0


def nodal_force(m: BeamMotion, force: BeamForce) -> ca.SX:
    """Return the force on the nodes in space axes (12): Bᵀ n + Gᵀ t + f, turned out of the frame."""
    import casadi as ca

    force = _resolved(m, force)
    n = force.deformation
    t1, t2 = inverse_tangent(m.theta[0], n[1:4]), inverse_tangent(m.theta[1], n[4:7])
    torque = force.torque - (t1 + t2)
    along, across = m.normal
    lever = torque[0] / across
    pull = ca.vertcat(m.lean * n[0], torque[2] / m.chord, -(torque[1] + lever * along) / m.chord)
    turn = [t + 0.5 * lever * arm for t, arm in zip((t1, t2), m.arms, strict=True)]
    f = force.nodal
    blocks = (f[0:3] - pull, f[3:6] + turn[0], f[6:9] + pull, f[9:12] + turn[1])
    return ca.vertcat(*[m.frame @ block for block in blocks])


def _resolved(m: BeamMotion, force: BeamForce) -> BeamForce:
    """The force without stresses, but what these work on."""
    if isinstance(force.stress, float):
        return force
    return replace(force, stress=0.0) + stress_force(m, force.stress)


def whole_force(m: BeamMotion, force: BeamForce) -> ca.SX:
    """Return a force on the nodes of an element, in space axes, and then on its own modes."""
    import casadi as ca

    force = _resolved(m, force)
    nodal = nodal_force(m, force)
    return ca.vertcat(nodal, ca.SX(m.modal[0].numel(), 1) + force.modal) if m.modal else nodal


def beam_motion(
    first: NodeMotion, second: NodeMotion, parameters: ca.SX, modal: OwnMotion | tuple[()] = ()
) -> BeamMotion:
    """Return the motion of an element from that of its nodes.

    Parameters
    ----------
    first, second : NodeMotion
    parameters : casadi.SX
        In the order of `PARAMETERS`.
    modal : OwnMotion, or empty
        That of the element's own modes, where it has any.

    Returns
    -------
    BeamMotion
    """
    import casadi as ca

    names = (*PARAMETERS, *SHEARING) if parameters.numel() > len(PARAMETERS) else PARAMETERS
    p = {name: parameters[i] for i, name in enumerate(names)}
    rest = ca.reshape(parameters[:9], 3, 3).T
    chord, length = reach(first, second)
    e1 = (second.x - first.x) / chord
    sides = [node.R @ rest[:, 1] for node in (first, second)]
    mean = 0.5 * (sides[0] + sides[1])
    e3 = ca.cross(e1, mean)
    upright, turn = ca.dot(e3, e3), ca.dot(first.R, second.R)
    sound = ca.logic_and(upright > _UPRIGHT, turn > _TURNED)
    e3 = e3 / ca.sqrt(ca.if_else(sound, upright, float("nan")))
    e2 = ca.cross(e3, e1)
    frame = ca.horzcat(e1, e2, e3)
    rates, accelerations = (first.v, first.w, second.v, second.w), (first.a, first.b, second.a, second.b)
    m = framed_motion(
        p,
        frame,
        0.5 * (first.x + second.x),
        chord,
        tuple(frame.T @ side for side in sides),
        tuple(rotation_vector(frame.T @ (node.R @ rest)) for node in (first, second)),
        tuple(frame.T @ v for v in rates),
        tuple(frame.T @ a for a in accelerations),
        modal,
    )
    return m if length is chord else replace(m, stretch=length - p["L"], lean=chord / length)


def framed_motion(
    p: dict[str, ca.SX],
    frame: ca.SX,
    middle: ca.SX,
    chord: ca.SX,
    sides: tuple[ca.SX, ...],
    theta: tuple[ca.SX, ...],
    rates: tuple[ca.SX, ...],
    accelerations: tuple[ca.SX, ...],
    modal: OwnMotion | tuple[()] = (),
) -> BeamMotion:
    """Return the motion of an element from what is seen in its frame; ``sides`` are the nodes' second axes."""
    import casadi as ca

    normal = tuple(0.5 * (sides[0][i] + sides[1][i]) for i in range(2))
    # q×e3 for the lever arms of the twist, q = (q1, q2, q3)
    arms = tuple(ca.vertcat(q[1], -q[0], 0) for q in sides)
    dv = rates[2] - rates[0]
    spin_y, spin_z = -dv[2] / chord, dv[1] / chord
    twist = 0.5 * (ca.dot(rates[1], arms[0]) + ca.dot(rates[3], arms[1]))
    return BeamMotion(
        p=p,
        frame=frame,
        middle=middle,
        chord=chord,
        normal=normal,  # type: ignore[arg-type]
        arms=arms,  # type: ignore[arg-type]
        stretch=chord - p["L"],
        theta=theta,  # type: ignore[arg-type]
        spin=ca.vertcat((twist + spin_y * normal[0]) / normal[1], spin_y, spin_z),
        rates=rates,  # type: ignore[arg-type]
        accelerations=accelerations,  # type: ignore[arg-type]
        modal=modal,
    )


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
    twist, (far_y, far_z) = x2 - x1, _farther(m)
    t = twist / 12.0
    ends = (y1 - t * far_z[0], y2 + t * far_z[1], z1 + t * far_y[0], z2 - t * far_y[1])
    return ca.vertcat(m.stretch + m.p["L"] * bowing(m), twist + 0.5 * (y1 * z2 - y2 * z1), *ends)


def _farther(m: BeamMotion) -> tuple[tuple[ca.SX, ca.SX], tuple[ca.SX, ca.SX]]:
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
    turn = ca.vertcat(-0.5 * y * z, y, z)  # no twist: the sections' second axes stay across the frame's third
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


def stress_force(m: BeamMotion, stress: ca.SX) -> BeamForce:
    """Return the force of given `stresses`: minus them times the gradients of their `deformations`."""
    import casadi as ca

    if SHEARING[0] in m.p or m.modal:
        return work_of(m, lambda local: ca.dot(deformations(local), stress)) * -1.0
    (x1, y1, z1), (x2, y2, z2) = (components(t) for t in m.theta)
    N, torque, about_y1, about_y2, about_z1, about_z2 = ca.vertsplit(stress)
    far_y, far_z = _farther(m)
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
    return BeamForce(-ca.vertcat(N, m1, m2), ca.SX(3, 1), ca.SX(12, 1))


def work_of(m: BeamMotion, of: Callable[[BeamMotion], ca.SX]) -> BeamForce:
    """Return the gradient of a function of what deforms: stretch, end rotations, modes."""
    import casadi as ca

    seen, local = seen_deformed(m)
    now = ca.vertcat(m.stretch, *m.theta, *m.modal[:1])
    gradient = ca.substitute(ca.gradient(of(local), seen), seen, now)
    return BeamForce(gradient[:7], ca.SX(3, 1), ca.SX(12, 1), gradient[7:] if m.modal else 0.0)


def seen_deformed(m: BeamMotion) -> tuple[ca.SX, BeamMotion]:
    """Return symbols of stretch, end rotations and modal amplitudes, and the motion that has them."""
    import casadi as ca

    seen = ca.SX.sym("seen", 7 + sum(eta.numel() for eta in m.modal[:1]))
    modal = m.modal._replace(amplitudes=seen[7:]) if m.modal else ()
    return seen, replace(m, stretch=seen[0], theta=(seen[1:4], seen[4:7]), modal=modal)


def elastic_force(m: BeamMotion) -> BeamForce:
    """Return minus the gradient of `strain_energy`."""
    force = replace(no_force(), stress=stresses(m))
    return force + _modal(-component_modes.stiffness(m) * m.modal[0]) if m.modal else force


def _modal(force: ca.SX) -> BeamForce:
    """Return a force on the element's own modes."""
    return replace(no_force(), modal=force)


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
    turning = [inverse_tangent(-t, m.rates[k] - m.spin) for t, k in zip(m.theta, (1, 3), strict=True)]
    return ca.vertcat(m.lean * (m.rates[2] - m.rates[0])[0], *turning)


def strain_rates(m: BeamMotion) -> ca.SX:
    """Return the rates of `deformations`: an axis that bends as it shortens its chord is not stretched."""
    import casadi as ca

    seen, local = seen_deformed(m)
    rates = ca.jtimes(deformations(local), seen, ca.vertcat(deformation_rates(m), *m.modal[1:2]))
    return ca.substitute(rates, seen, ca.vertcat(m.stretch, *m.theta, *m.modal[:1]))


def viscous_force(m: BeamMotion) -> BeamForce:
    """Return the force of a damping equal to the stiffness, on the rates of `deformations`."""
    force = replace(no_force(), stress=stiffened(m, strain_rates(m)))
    return force + _modal(-component_modes.stiffness(m) * m.modal[1]) if m.modal else force


def components(v: ca.SX) -> tuple:
    return v[0], v[1], v[2]
