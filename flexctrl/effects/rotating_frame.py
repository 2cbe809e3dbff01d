"""A frame that turns: centrifugal and Coriolis forces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.gravity import Gravity
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.structure.freedoms import Vector, parse_point


@frozen
class RotatingFrame(Effect):
    """The machine is described in axes that turn at a constant rate Ω about a fixed axis.

    Positions, velocities, supports, loads and outputs are those in the turning axes. Inertia is felt as from
    outside: at x − c off the axis a node moves at v + Ω × (x − c) and accelerates by
    a + 2Ω × v + Ω × (Ω × (x − c)); its spin is ω + Ω, the rate of that α + Ω × ω (Goldstein 1980, §4-10). So
    `equilibrium` finds the shape stretched by its spin, and a linear model about it has centrifugal stiffening
    and spin softening in K and the Coriolis terms in C, which is skew. Rotors of drives count with their speed
    relative to what carries them.

    The stored energy includes the potential −½∫|Ω × (x − c)|² dm: what is conserved is the Jacobi integral.
    Drag on velocities (α of `RayleighDamping`) is that of air which turns with the frame; the air of `Wind` does not.

    Parameters
    ----------
    rate : sequence of 3 floats
        Angular velocity Ω of the frame [rad/s].
    center : sequence of 3 floats
        A point c on its axis [m], default the origin.

    Raises
    ------
    StructureError
        If a vector is not three finite numbers; by `assemble`, without `LargeRotation` or `GeometricStiffness`
        (the pull that stiffens what spins would be left out), or with gravity across the axis (it would turn).
    """

    rate: Vector
    center: Vector = (0.0, 0.0, 0.0)

    def __init__(self, rate: Sequence[float], center: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        object.__setattr__(self, "rate", parse_point(rate, "RotatingFrame: rate"))
        object.__setattr__(self, "center", parse_point(center, "RotatingFrame: center"))

    def inertial(self, node: NodeMotion) -> NodeMotion:
        """Motion as seen from outside, resolved in the turning axes."""
        import casadi as ca

        if not any(self.rate):
            return node
        spin = ca.DM(self.rate)
        carried = ca.cross(spin, node.x - ca.DM(self.center))
        return NodeMotion(
            node.x,
            node.R,
            node.v + carried,
            node.w + spin,
            node.a + 2.0 * ca.cross(spin, node.v) + ca.cross(spin, carried),
            node.b + ca.cross(spin, node.w),
        )

    def turns(self, vector: Vector) -> bool:
        """Tell whether a vector that is fixed outside turns in the frame: it is not along the axis.

        Parameters
        ----------
        vector : tuple of 3 floats

        Returns
        -------
        bool
        """
        across = np.linalg.norm(np.cross(self.rate, vector))
        return bool(across > 1e-9 * np.linalg.norm(self.rate) * np.linalg.norm(vector))

    def check_beside(self, others: Sequence[Effect]) -> None:
        """Refuse what cannot be steady in a turning frame, and a linear model that would lack the stiffening."""
        if not any(self.rate):
            return
        if not any(isinstance(e, LargeRotation | GeometricStiffness) for e in others):
            raise StructureError(
                "RotatingFrame: needs LargeRotation() or GeometricStiffness(), without which the pull that stiffens "
                "spinning parts is left out"
            )
        for g in (e.g for e in others if isinstance(e, Gravity)):
            if self.turns(g):
                raise StructureError(
                    f"RotatingFrame: gravity {g} would turn in a frame that turns about {self.rate}; "
                    "let gravity point along the axis, or leave one of both out"
                )
