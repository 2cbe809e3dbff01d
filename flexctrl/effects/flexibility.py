"""What may deform: beams, drive shafts, ropes. What no effect bends is rigid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.mechanics.beam import BeamForce, BeamMotion, elastic_force, strain_energy, stresses
from flexctrl.mechanics.pieces import DriveMotion, LineMotion, rope_energy, shaft_energy, shaft_force, spring_tension
from flexctrl.structure.drives import Drive, LinearDrive, RotaryDrive
from flexctrl.structure.elements import Beam, Part, Rope

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class BeamFlexibility(Effect):
    """Beams stretch, twist and bend: V = ½ dᵀ K_e d on the corotated frame, with the bowing of the axis."""

    def beam(self, m: BeamMotion) -> BeamForce:
        """Internal force."""
        return elastic_force(m)

    def beam_stress(self, m: BeamMotion) -> ca.SX:
        """Axial force, torque and end moments."""
        return stresses(m)

    def beam_energy(self, m: BeamMotion, middle: ca.SX) -> ca.SX:
        """Strain energy."""
        return strain_energy(m)

    def bends(self, part: Part | Drive) -> bool:
        """Beams."""
        return isinstance(part, Beam)


@dataclass(frozen=True)
class ShaftElasticity(Effect):
    """Drive shafts twist: V = ½ k_θ (R θ_rel − θ_d)²; without it θ_d = R θ_rel and the motor's inertia is reflected."""

    def drive(self, m: DriveMotion) -> ca.SX:
        """Shaft torque on all three freedoms."""
        return shaft_force(m)

    def drive_energy(self, m: DriveMotion) -> ca.SX:
        """Energy in the shaft."""
        return shaft_energy(m)

    def bends(self, part: Part | Drive) -> bool:
        """Drives."""
        return isinstance(part, RotaryDrive | LinearDrive)


@dataclass(frozen=True)
class RopeStretch(Effect):
    """Ropes stretch, and go slack: tension (EA/ℓ₀)(ℓ − ℓ₀)₊; without it a rope is a rigid, massless link."""

    def rope(self, m: LineMotion) -> ca.SX:
        """Tension of the stretched rope."""
        return spring_tension(m)

    def rope_energy(self, m: LineMotion) -> ca.SX:
        """½ k (ℓ − ℓ₀)₊²."""
        return rope_energy(m)

    def bends(self, part: Part | Drive) -> bool:
        """Ropes."""
        return isinstance(part, Rope)


@dataclass(frozen=True)
class Flexible(Effect):
    """All flexibility at once: `BeamFlexibility`, `ShaftElasticity` and `RopeStretch`."""

    def parts(self) -> tuple[Effect, ...]:
        """The three."""
        return (BeamFlexibility(), ShaftElasticity(), RopeStretch())
