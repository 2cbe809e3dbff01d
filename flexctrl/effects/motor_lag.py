"""Motors whose torque takes time to build up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from flexctrl.effects.effect import Effect, Inner
from flexctrl.effects.places import by_place, check_drives, not_negative
from flexctrl.frozen import frozen
from flexctrl.structure.structure import Structure


@frozen
class MotorLag(Effect):
    """The torque of a motor follows its command as T τ̇ + τ = M_d, with the electrical time constant T = L/R.

    τ is an inner first-order freedom ``<drive>_lag``; a linear model holds it exactly. Limits of torque belong to
    the hardware round a controller, `Saturated`. Where T is below half a step h of a simulation, what the motor turns
    gets the impulse of its torque right and is off by about ΔM h T/(2 J) in angle after a change ΔM of the command: as
    T goes to zero, runs go to those without lag.

    Parameters
    ----------
    time_constants : mapping of str to float
        Drive → T ≥ 0 [s]. Zero: no lag, as if it were not named.

    Raises
    ------
    StructureError
        For a time below zero; when the model is assembled, for a drive that there is not.
    """

    apart: ClassVar[bool] = True
    time_constants: tuple[tuple[str, float], ...]

    def __init__(self, time_constants: Mapping[str, float]) -> None:
        object.__setattr__(self, "time_constants", by_place(time_constants, "MotorLag", "time constant", not_negative))

    def check_on(self, structure: Structure) -> None:
        """Look for every drive."""
        check_drives(structure, tuple(name for name, _ in self.time_constants), "MotorLag")

    @property
    def acting(self) -> tuple[tuple[str, float], ...]:
        """The motors whose torque takes any time."""
        return tuple((name, T) for name, T in self.time_constants if T)

    def inner(self, structure: Structure) -> tuple[Inner, ...]:
        """A torque each; one is what turns the motor's shaft by a radian."""
        stiffness = {drive.name: drive.stiffness for drive in structure.drives}
        return tuple(Inner(f"{name}_lag", unit=stiffness[name]) for name, _ in self.acting)
