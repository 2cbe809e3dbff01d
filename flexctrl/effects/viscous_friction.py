"""Friction in proportion to speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from flexctrl.effects.effect import Effect
from flexctrl.effects.places import by_place, not_negative
from flexctrl.frozen import frozen
from flexctrl.structure.contacts import contact_of
from flexctrl.structure.structure import Structure


@frozen
class ViscousFriction(Effect):
    """Viscous friction in drives, hinges and slides: −c times the speed of one side against the other.

    It dissipates c·speed²; a linear model holds all of it in C.

    Parameters
    ----------
    coefficients : mapping of str to float
        Place → c ≥ 0. A place is a drive (its motor's speed, N m s/rad of the motor), a node in a `Hinge`
        (N m s/rad) or `Slide` (N s/m) such as ``"arm.start"``, or the part alone if only one of its joints can
        move, or a node's freedom against the ground, ``"trolley.u"``.

    Raises
    ------
    StructureError
        For a coefficient below zero; when the model is assembled, for a place that there is not.

    Examples
    --------
    >>> import flexctrl as fc
    >>> fc.ViscousFriction({"slew": 0.02, "trolley.u": 80.0})
    ViscousFriction(coefficients=(('slew', 0.02), ('trolley.u', 80.0)))
    """

    apart: ClassVar[bool] = True
    coefficients: tuple[tuple[str, float], ...]

    def __init__(self, coefficients: Mapping[str, float]) -> None:
        object.__setattr__(self, "coefficients", by_place(coefficients, "ViscousFriction", "coefficient", not_negative))

    def check_on(self, structure: Structure) -> None:
        """Look for every place."""
        for where, _ in self.coefficients:
            contact_of(structure, where, "ViscousFriction")
