"""The motion of a beam element seen from its corotated frame.

The element frame R_e has its x axis through both nodes and its twist from the mean of the nodal
rotations. Deformations are measured in it: the stretch of the chord and the rotation vectors
θ₁, θ₂ of the nodes. Velocities of the nodes seen in the frame carry the constant consistent mass
matrix (Crisfield, Galvanetto & Jelenić 1997).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from flexctrl.mechanics.matrices import PlaneMass
from flexctrl.mechanics.rotation import rotation_vector

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

_UPRIGHT, _TURNED = 1e-3, -0.84
"""What sides have in common across the chord, squared. The trace of a turn of 2.74 rad from end to end: the frame turns
over at half a turn."""


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


class OwnMotion(NamedTuple):
    """Amplitudes of an element's own modes, their rates and accelerations, in the order of `component_modes`.

    The last ``2 along`` of each are those of stretch and of twist.
    """

    amplitudes: ca.SX
    rates: ca.SX
    accelerations: ca.SX
    along: int = 0


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


def components(v: ca.SX) -> tuple:
    return v[0], v[1], v[2]
