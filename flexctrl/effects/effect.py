"""What an effect is: a share of force on each kind of piece, nothing where it does not act."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from flexctrl.frozen import frozen
from flexctrl.mechanics.beam import BeamForce, no_force
from flexctrl.mechanics.corotation import BeamMotion, NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, LineMotion
from flexctrl.structure.drives import Drive
from flexctrl.structure.elements import Part
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca


@frozen
class Inner:
    """A freedom of an effect that no node has: a bristle's bend, a motor's torque.

    Attributes
    ----------
    name : str
        Of its coordinate; empty for one that has only a phase (it sticks or slides), or is held.
    scale : float
        What an error of 1 is in it; infinite where the motion that it brings about is judged instead.
    frozen : bool
        Whether it stays as it is in equilibria and linear models.
    order : int
        Of its equation: 1 for one without inertia, 2 for one that has it.
    unit : float
        What one of it is in the units of the machine, where no error of it is judged.
    """

    name: str
    scale: float = math.inf
    frozen: bool = False
    order: int = 1
    unit: float = 1.0


class Effect:
    """One piece of physics. Effects are frozen values; a model is the sum of their shares.

    A subclass overrides only what it acts on. Each method returns casadi expressions of the motion
    it is given: forces with the sign in which they act, energies whose gradient they are minus of.

    Attributes
    ----------
    apart : bool
        Whether it acts through pieces of its own and leaves the kernels of parts and drives as they are.
    """

    apart: ClassVar[bool] = False

    def beam(self, m: BeamMotion) -> BeamForce:
        """Force on a beam element."""
        return no_force()

    def beam_energy(self, m: BeamMotion, middle: ca.SX) -> ca.SX:
        """Energy stored in a beam element; ``middle`` is the mean of its nodes' positions."""
        return _nothing()

    def beam_stress(self, m: BeamMotion) -> ca.SX:
        """Stresses of a beam element that follow its strains by a linear law, in the order of `strains.stresses`."""
        return _nothing(6)

    def spring(self, m: LineMotion) -> ca.SX:
        """Tension in a spring beside its own [N]."""
        return _nothing()

    def rope(self, m: LineMotion) -> ca.SX:
        """Tension in a rope [N], before the rope's own limit: it never pushes."""
        return _nothing()

    def rope_energy(self, m: LineMotion) -> ca.SX:
        """Energy stored in a rope."""
        return _nothing()

    def body(self, node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
        """Force and moment on a point mass or rigid body (6)."""
        return _nothing(6)

    def body_energy(self, node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
        """Energy stored in a point mass or rigid body."""
        return _nothing()

    def drive(self, m: DriveMotion) -> ca.SX:
        """Force on the driven node, the node that carries the motor, and the source angle (13)."""
        return _nothing(13)

    def drive_energy(self, m: DriveMotion) -> ca.SX:
        """Energy stored in a drive."""
        return _nothing()

    def check_on(self, structure: Structure) -> None:
        """Raise StructureError if the effect names what the structure does not have."""
        return

    def inner(self, structure: Structure) -> tuple[Inner, ...]:
        """Freedoms of its own that no node has."""
        return ()

    def left_out(self, structure: Structure, beside: Sequence[Effect]) -> tuple[str, ...]:
        """Return what a model under the effect and those beside it leaves out, in words."""
        return ()

    def bends(self, part: Part | Drive) -> bool:
        """Whether the effect gives a part freedom to deform."""
        return False

    def inertial(self, node: NodeMotion) -> NodeMotion:
        """Motion of a node as its inertia feels it: seen from an inertial frame."""
        return node

    def parts(self) -> tuple[Effect, ...]:
        """The effects it is composed of: itself, unless it stands for several."""
        return (self,)

    def everywhere(self) -> Effect:
        """The effect with all parts it can act on: what kernels are made for."""
        return self

    def check_beside(self, others: Sequence[Effect]) -> None:
        """Raise StructureError if the effect makes no sense together with the others of a model."""
        return


def _nothing(rows: int = 1) -> ca.SX:
    import casadi as ca

    return ca.SX(rows, 1)
