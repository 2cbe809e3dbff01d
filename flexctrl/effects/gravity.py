"""Weight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.frozen import frozen
from flexctrl.mechanics.beam import BeamForce
from flexctrl.mechanics.beam_inertia import height_energy, weight
from flexctrl.mechanics.corotation import BeamMotion, NodeMotion
from flexctrl.structure.freedoms import Vector, parse_point

if TYPE_CHECKING:
    import casadi as ca


@frozen
class Gravity(Effect):
    """The weight of beams, bodies and point masses: V = −∫ g·x dm.

    Parameters
    ----------
    g : sequence of 3 floats
        Acceleration of gravity [m/s²], default (0, 0, −9.81).

    Raises
    ------
    StructureError
        If ``g`` is not three finite numbers.
    """

    g: Vector = (0.0, 0.0, -9.81)

    def __init__(self, g: Sequence[float] = (0.0, 0.0, -9.81)) -> None:
        object.__setattr__(self, "g", parse_point(g, "Gravity"))

    def beam(self, m: BeamMotion) -> BeamForce:
        """Weight of an element, consistent with its deflected axis."""
        return weight(m, np.array(self.g))

    def beam_energy(self, m: BeamMotion, middle: ca.SX) -> ca.SX:
        """−∫ρA g·x ds."""
        return height_energy(m, np.array(self.g), middle)

    def body(self, node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
        """m g at the centre of mass."""
        import casadi as ca

        return ca.vertcat(p["mass"] * ca.DM(self.g), ca.SX(3, 1))

    def body_energy(self, node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
        """−m g·x."""
        import casadi as ca

        return -p["mass"] * ca.dot(ca.DM(self.g), node.x)
