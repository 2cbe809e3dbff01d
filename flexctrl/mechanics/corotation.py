"""The motion of a beam element seen from its corotated frame.

The element frame R_e has its x axis through both nodes and is turned about it so as to be as near to both nodes'
axes as it gets, however these lie in the section. Deformations are measured in it: the stretch of the chord and the
rotation vectors θ₁, θ₂ of the nodes. Velocities of the nodes seen in the frame carry the constant consistent mass
matrix (Crisfield, Galvanetto & Jelenić 1997). They are told by that of the middle of the chord, which only the mean
motion of the element has to do with, and those beside it: ω₁, v₂ − v₁, ω₂.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from flexctrl.frozen import frozen
from flexctrl.mechanics.matrices import PlaneMass
from flexctrl.mechanics.rotation import bend_vector

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

_UPRIGHT, _TURNED = 4e-3, -0.84
"""What sides and thirds have in common across the chord, squared. The trace of a turn of 2.74 rad from end to end: the
frame turns over at half a turn."""


@frozen
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


@frozen
class BeamMotion:
    """What the effects may use of a moving beam element; vectors in the element frame unless said.

    Attributes
    ----------
    p : dict of str to casadi.SX
        Parameters by name.
    frame : casadi.SX, 3 × 3
        R_e, columns in space axes.
    chord : casadi.SX
        Distance of the nodes [m].
    axes, sides : tuple of two casadi.SX
        First axes of the nodes, along the beam's axis, and second ones.
    stretch : casadi.SX
        Length of the chord less L [m].
    theta : tuple of two casadi.SX
        Rotation vectors of the nodes against the frame [rad].
    spin : casadi.SX
        Spin of the frame.
    middle : tuple of two casadi.SX
        Velocity and acceleration of the middle of the chord, absolute, resolved in the frame.
    rates, accelerations : tuple of three casadi.SX
        ω₁, v₂ − v₁, ω₂ and their rates, absolute, resolved in the frame.
    modal : OwnMotion, or empty
        That of the element's own modes.
    lean : casadi.SX or float
        The chord over the length of which ``stretch`` tells; 1 but over the middle of a step (see `reach`).
    """

    p: dict[str, ca.SX]
    frame: ca.SX
    chord: ca.SX
    axes: tuple[ca.SX, ca.SX]
    sides: tuple[ca.SX, ca.SX]
    stretch: ca.SX
    theta: tuple[ca.SX, ca.SX]
    spin: ca.SX
    middle: tuple[ca.SX, ca.SX]
    rates: tuple[ca.SX, ca.SX, ca.SX]
    accelerations: tuple[ca.SX, ca.SX, ca.SX]
    modal: OwnMotion | tuple[()] = ()
    lean: ca.SX | float = 1.0

    @property
    def thirds(self) -> tuple[ca.SX, ca.SX]:
        """Third axes of the nodes."""
        import casadi as ca

        return tuple(ca.cross(t, q) for t, q in zip(self.axes, self.sides, strict=True))  # type: ignore[return-value]

    @property
    def arms(self) -> tuple[ca.SX, ca.SX]:
        """On which the twist of the frame hangs with the nodal rotations: q × e₃ − r × e₂, q a side, r a third axis."""
        return tuple(_arm(q, r) for q, r in zip(self.sides, self.thirds, strict=True))  # type: ignore[return-value]

    @property
    def lever(self) -> ca.SX:
        """The mean of the arms: the first component is what they turn the frame over, the others are of its spin."""
        first, second = self.arms
        return 0.5 * (first + second)


def _arm(side: ca.SX, third: ca.SX) -> ca.SX:
    import casadi as ca

    return ca.vertcat(side[1] + third[2], -side[0], -third[0])


def turning(m: BeamMotion) -> ca.SX:
    """Return the rate of the frame's spin, resolved in the frame."""
    import casadi as ca

    v = m.rates[1]
    apart = m.accelerations[1] - ca.cross(m.spin, v) - v * v[0] / m.chord
    about_y, about_z = -apart[2] / m.chord, apart[1] / m.chord
    twist = -(about_y * m.lever[1] + about_z * m.lever[2])
    for w, b, arm, q, r in zip(m.rates[::2], m.accelerations[::2], m.arms, m.sides, m.thirds, strict=True):
        relative = w - m.spin
        turned = _arm(ca.cross(relative, q), ca.cross(relative, r))
        twist += 0.5 * (ca.dot(b - ca.cross(m.spin, w), arm) + ca.dot(relative, turned))
    return ca.vertcat(twist / m.lever[0], about_y, about_z)


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
    axes, sides = ([node.R @ rest[:, i] for node in (first, second)] for i in range(2))
    third = 0.5 * (ca.cross(axes[0], sides[0]) + ca.cross(axes[1], sides[1]))
    # the mean of the thirds, and of the sides turned to them: what of both is turned about the chord counts alike
    e2 = ca.cross(third + ca.cross(e1, 0.5 * (sides[0] + sides[1])), e1)
    upright, turn = ca.dot(e2, e2), ca.dot(first.R, second.R)
    sound = ca.logic_and(upright > _UPRIGHT, turn > _TURNED)
    e2 = e2 / ca.sqrt(ca.if_else(sound, upright, float("nan")))
    frame = ca.horzcat(e1, e2, ca.cross(e1, e2))
    axes, sides = ([frame.T @ axis for axis in both] for both in (axes, sides))
    middle = (0.5 * (first.v + second.v), 0.5 * (first.a + second.a))
    rates, accelerations = (first.w, second.v - first.v, second.w), (first.b, second.a - first.a, second.b)
    m = framed_motion(
        p,
        frame,
        chord,
        tuple(axes),
        tuple(sides),
        tuple(bend_vector(ca.horzcat(x, y, ca.cross(x, y))) for x, y in zip(axes, sides, strict=True)),
        tuple(frame.T @ v for v in middle),
        tuple(frame.T @ v for v in rates),
        tuple(frame.T @ a for a in accelerations),
        modal,
    )
    return m if length is chord else replace(m, stretch=length - p["L"], lean=chord / length)


def framed_motion(
    p: dict[str, ca.SX],
    frame: ca.SX,
    chord: ca.SX,
    axes: tuple[ca.SX, ...],
    sides: tuple[ca.SX, ...],
    theta: tuple[ca.SX, ...],
    middle: tuple[ca.SX, ...],
    rates: tuple[ca.SX, ...],
    accelerations: tuple[ca.SX, ...],
    modal: OwnMotion | tuple[()] = (),
) -> BeamMotion:
    """Return the motion of an element from what is seen in its frame; ``axes``, ``sides``: first, second of nodes."""
    import casadi as ca

    spin_y, spin_z = -rates[1][2] / chord, rates[1][1] / chord
    m = BeamMotion(
        p=p,
        frame=frame,
        chord=chord,
        axes=axes,  # type: ignore[arg-type]
        sides=sides,  # type: ignore[arg-type]
        stretch=chord - p["L"],
        theta=theta,  # type: ignore[arg-type]
        spin=ca.vertcat(0, spin_y, spin_z),
        middle=middle,  # type: ignore[arg-type]
        rates=rates,  # type: ignore[arg-type]
        accelerations=accelerations,  # type: ignore[arg-type]
        modal=modal,
    )
    twist = 0.5 * (ca.dot(rates[0], m.arms[0]) + ca.dot(rates[2], m.arms[1]))
    twist -= spin_y * m.lever[1] + spin_z * m.lever[2]
    return replace(m, spin=ca.vertcat(twist / m.lever[0], spin_y, spin_z))


def components(v: ca.SX) -> tuple:
    return v[0], v[1], v[2]
