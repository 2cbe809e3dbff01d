"""What may deform: beams, drive shafts, ropes. What no effect bends is rigid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.mechanics.beam import BeamForce, elastic_force
from flexctrl.mechanics.corotation import BeamMotion
from flexctrl.mechanics.pieces import DriveMotion, LineMotion, rope_energy, shaft_energy, shaft_force, spring_tension
from flexctrl.mechanics.strains import strain_energy, stresses
from flexctrl.structure.beams import Beam
from flexctrl.structure.drives import Drive, LinearDrive, RotaryDrive, Winch
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import listed
from flexctrl.structure.lines import Rope

if TYPE_CHECKING:
    import casadi as ca


@frozen
class Deforming(Effect, ABC):
    """Some parts deform; the others, and all parts without it, are rigid.

    Parameters
    ----------
    of : sequence of str
        Names of the parts that may deform; default: every part of the effect's kind.

    Raises
    ------
    StructureError
        For names that are no names; by `assemble`, for one that the structure has no such part of.
    """

    of: tuple[str, ...] = ()

    def __init__(self, of: Sequence[str] = ()) -> None:
        names = (of,) if isinstance(of, str) else listed(of, f"{type(self).__name__}: of")
        if wrong := [n for n in names if not isinstance(n, str)]:
            raise StructureError(f"{type(self).__name__}: of holds {wrong[0]!r}; expected names of parts")
        object.__setattr__(self, "of", tuple(names))

    @abstractmethod
    def acts_on(self, part: Part | Drive) -> bool:
        """Whether a part is of the kind that the effect lets deform."""

    def bends(self, part: Part | Drive) -> bool:
        """The parts that were named, or all of the kind."""
        return self.acts_on(part) and (not self.of or part.name in self.of)

    def everywhere(self) -> Effect:
        """The effect on every part of its kind: its kernels do not know names."""
        return type(self)()


@dataclass(frozen=True, init=False)
class BeamFlexibility(Deforming):
    """Beams stretch, twist and bend: V = ½ dᵀ K_e d on the corotated frame, with the bowing of the axis.

    Parameters
    ----------
    of : sequence of str
        Names of the beams that deform; default: all.
    """

    def beam(self, m: BeamMotion) -> BeamForce:
        """Internal force."""
        return elastic_force(m)

    def beam_stress(self, m: BeamMotion) -> ca.SX:
        """Axial force, torque and end moments."""
        return stresses(m)

    def beam_energy(self, m: BeamMotion, middle: ca.SX) -> ca.SX:
        """Strain energy."""
        return strain_energy(m)

    def acts_on(self, part: Part | Drive) -> bool:
        """Beams."""
        return isinstance(part, Beam)


@dataclass(frozen=True, init=False)
class ShaftElasticity(Deforming):
    """Drive shafts twist: V = ½ k_θ (R θ_rel − θ_d)²; without it θ_d = R θ_rel and the motor's inertia is reflected.

    Parameters
    ----------
    of : sequence of str
        Names of the drives whose shafts twist; default: all.
    """

    def drive(self, m: DriveMotion) -> ca.SX:
        """Shaft torque on all three freedoms."""
        return shaft_force(m)

    def drive_energy(self, m: DriveMotion) -> ca.SX:
        """Energy in the shaft."""
        return shaft_energy(m)

    def acts_on(self, part: Part | Drive) -> bool:
        """Drives."""
        return isinstance(part, RotaryDrive | LinearDrive)


@dataclass(frozen=True, init=False)
class RopeStretch(Deforming):
    """Ropes stretch, and go slack: tension (EA/ℓ₀)(ℓ − ℓ₀)₊; without it a rope is a rigid, massless link.

    Parameters
    ----------
    of : sequence of str
        Names of the ropes and winches that stretch; default: all.
    """

    def rope(self, m: LineMotion) -> ca.SX:
        """Tension of the stretched rope."""
        return spring_tension(m)

    def rope_energy(self, m: LineMotion) -> ca.SX:
        """½ k (ℓ − ℓ₀)₊²."""
        return rope_energy(m)

    def acts_on(self, part: Part | Drive) -> bool:
        """Ropes, those of winches too."""
        return isinstance(part, Rope | Winch)


@frozen
class Flexible(Effect):
    """All flexibility at once: `BeamFlexibility`, `ShaftElasticity` and `RopeStretch`.

    What it is made of may be given one by one instead, for some parts only; `rigid` takes all of it away.
    """

    def parts(self) -> tuple[Effect, ...]:
        """The three."""
        return (BeamFlexibility(), ShaftElasticity(), RopeStretch())
