"""The effects in a scene file: what is named is simulated, nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexctrl.effects.automatic import Automatic
from flexctrl.effects.backlash import Backlash
from flexctrl.effects.component_modes import ComponentModes
from flexctrl.effects.coulomb_friction import Coulomb, CoulombFriction
from flexctrl.effects.damping import ModalDamping, RayleighDamping
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import BeamFlexibility, Flexible, RopeStretch, ShaftElasticity
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.gravity import Gravity
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.effects.lugre_friction import LuGre, LuGreFriction
from flexctrl.effects.motor_lag import MotorLag
from flexctrl.effects.rope_mass import RopeMass
from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.effects.viscous_friction import ViscousFriction
from flexctrl.effects.wind import Wind
from flexctrl.errors import did_you_mean
from flexctrl.frozen import frozen
from flexctrl.model.assemble import checked_effects
from flexctrl.scene.reading import (
    Kind,
    Place,
    checked,
    mapping,
    number,
    one_or_several,
    positive,
    several,
    table,
    text,
    vector,
    whole,
)
from flexctrl.structure.structure import Structure


@frozen
class Placed(Kind):
    """An effect told by a table of places: the table is its only parameter."""

    def required(self) -> tuple[str, ...]:
        """It is nothing without places."""
        return ("place",)

    def read(self, value: Mapping[str, Any], place: Place, **given: Any) -> Any:
        """Read the table of places."""
        [(parameter, reader)] = self.readers.items()
        found = reader(value, place)
        return checked(lambda: self.make(**{parameter: found}), place)


_COULOMB = Kind(Coulomb, dict.fromkeys(("kinetic", "static", "stribeck"), number))
_LUGRE = Kind(LuGre, dict.fromkeys(("stiffness", "kinetic", "static", "stribeck", "damping", "viscous"), number))


def _dry(value: Any, place: Place) -> Coulomb | float:
    return _COULOMB.read(value, place) if isinstance(value, Mapping) else number(value, place)


_REST = {"hold": mapping(number), "inputs": mapping(number)}

EFFECTS: dict[str, Kind] = {
    "automatic": Kind(Automatic, {"tolerance": positive}),
    "gravity": Kind(Gravity, {"g": vector}),
    "flexible": Kind(Flexible),
    "beam_flexibility": Kind(BeamFlexibility, {"of": several(text)}),
    "component_modes": Kind(ComponentModes, {"count": whole, "of": several(text), "along": whole}),
    "shaft_elasticity": Kind(ShaftElasticity, {"of": several(text)}),
    "rope_stretch": Kind(RopeStretch, {"of": several(text)}),
    "rope_mass": Kind(RopeMass, {"of": several(text)}),
    "large_rotation": Kind(LargeRotation),
    "geometric_stiffness": Kind(GeometricStiffness, _REST),
    "rotating_frame": Kind(RotatingFrame, {"rate": vector, "center": vector}),
    "rayleigh_damping": Kind(RayleighDamping, {"alpha": number, "beta": number}),
    "modal_damping": Kind(ModalDamping, {"ratios": one_or_several(number), **_REST}),
    "viscous_friction": Placed(ViscousFriction, {"coefficients": mapping(number)}),
    "coulomb_friction": Placed(CoulombFriction, {"laws": mapping(_dry)}),
    "lugre_friction": Placed(LuGreFriction, {"laws": mapping(_LUGRE.read)}),
    "backlash": Placed(Backlash, {"gaps": mapping(number)}),
    "wind": Kind(Wind, {"areas": mapping(number), "speed": vector, "density": number}),
    "motor_lag": Placed(MotorLag, {"time_constants": mapping(number)}),
}
"""Effects by the name they have in a scene file."""

_ANSWERS = ("outputs", "poles", "margins")
_WITHIN = Kind(Automatic.within, dict.fromkeys(_ANSWERS, positive))
_THROUGH = Kind(RayleighDamping.through, dict.fromkeys(("zeta", "omega1", "omega2"), positive))


def effects(value: Any, place: Place, machine: Structure) -> tuple[Effect, ...]:
    """Read the table of effects: ``gravity = true``, or a table of an effect's parameters.

    Parameters
    ----------
    value : object
    place : Place
    machine : Structure
        What they are to act on.

    Returns
    -------
    tuple of Effect

    Raises
    ------
    SceneError
        For an unknown effect or parameter.
    """
    for name in table(value, place):
        if name not in EFFECTS:
            raise place.refuse(f"there is no effect {name!r}{did_you_mean(name, EFFECTS)}")
    found = tuple(_effect(name, item, place.at(name)) for name, item in value.items() if item is not False)
    checked(lambda: checked_effects(machine, found), place)
    return found


def _effect(name: str, value: Any, place: Place) -> Effect:
    if value is True:
        missing = EFFECTS[name].required()
        if missing:
            raise place.refuse(f"give its parameters, {name} = {{ {missing[0]} = … }}")
        return checked(EFFECTS[name].make, place)
    if not isinstance(value, Mapping):
        raise place.expected("true, false or a table of its parameters", value)
    return _kind(name, value).read(value, place)


def _kind(name: str, value: Mapping[str, Any]) -> Kind:
    """How the parameters of an effect are told, where there is more than one way."""
    if name == "automatic" and any(key in value for key in _ANSWERS):
        return _WITHIN
    return _THROUGH if name == "rayleigh_damping" and "zeta" in value else EFFECTS[name]


__all__ = ["EFFECTS", "effects"]
