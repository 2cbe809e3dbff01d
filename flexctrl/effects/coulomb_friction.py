"""Dry friction that sticks and slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from flexctrl.effects.effect import Effect, Inner
from flexctrl.effects.places import by_place, check_large, check_static
from flexctrl.frozen import frozen
from flexctrl.structure.contacts import contact_of
from flexctrl.structure.freedoms import check_finite
from flexctrl.structure.structure import Structure


@frozen
class Coulomb:
    """Dry friction: what it takes to break loose, and what holds against sliding.

    Sliding at speed v it is F_k + (F_s − F_k) exp(−(v/v_s)²) against the motion (Stribeck), F_k where v_s = 0.

    Parameters
    ----------
    kinetic : float
        F_k ≥ 0, against sliding [N, or N m].
    static : float, optional
        F_s ≥ F_k, up to which it sticks; default: F_k.
    stribeck : float
        Stribeck speed v_s ≥ 0 [m/s or rad/s]; 0: the friction drops to F_k as soon as it slides.

    Raises
    ------
    StructureError
        For a value out of range.
    """

    kinetic: float
    static: float
    stribeck: float

    def __init__(self, kinetic: float, static: float | None = None, stribeck: float = 0.0) -> None:
        kinetic = check_finite(kinetic, "kinetic", "Coulomb", least=0.0)
        stick = kinetic if static is None else check_finite(static, "static", "Coulomb", least=0.0)
        check_static(stick, kinetic, "Coulomb")
        object.__setattr__(self, "kinetic", kinetic)
        object.__setattr__(self, "static", stick)
        object.__setattr__(self, "stribeck", check_finite(stribeck, "stribeck", "Coulomb", least=0.0))


@frozen
class CoulombFriction(Effect):
    """Dry friction in drives, hinges and slides: it sticks exactly, and slides against a constant force.

    What sticks does not move at all: while the force that holds it stays below F_s, its equation of motion is
    replaced by v̇ = 0. Where sticking begins and ends is located within the step; a slip, or a stick, that is over
    within less than a step is left out (and not among the events), where steps are chosen only if it is within
    tolerance: those of `ExplicitRungeKutta` are long, a tenth of a period and more. It needs `LargeRotation`
    (without it a model is linear), and mass on what slides. Linear models and equilibria do not contain it: they
    are those of the machine that is shaken loose, `Model.notes` says so.

    Parameters
    ----------
    laws : mapping of str to Coulomb or float
        Place (see `ViscousFriction`) → law; a number is F_k = F_s, in N m of the motor for a drive. F_s = 0: no
        friction, as if the place were not named.

    Raises
    ------
    StructureError
        For what is no friction law; when the model is assembled, for a place that there is not.

    Examples
    --------
    >>> import flexctrl as fc
    >>> fc.CoulombFriction({"trolley.u": fc.Coulomb(5.0, static=7.5)}).laws[0][1].static
    7.5
    """

    apart: ClassVar[bool] = True
    laws: tuple[tuple[str, Coulomb], ...]

    def __init__(self, laws: Mapping[str, Coulomb | float]) -> None:
        object.__setattr__(self, "laws", by_place(laws, "CoulombFriction", "friction", _law))

    def check_on(self, structure: Structure) -> None:
        """Look for every place."""
        for where, _ in self.laws:
            contact_of(structure, where, "CoulombFriction")

    def check_beside(self, others: Sequence[Effect]) -> None:
        """A linear model has no stick."""
        if self.acting:
            check_large(others, "CoulombFriction")

    @property
    def acting(self) -> tuple[tuple[str, Coulomb], ...]:
        """The laws that hold against anything at all."""
        return tuple((where, law) for where, law in self.laws if law.static)

    def inner(self, structure: Structure) -> tuple[Inner, ...]:
        """A phase each."""
        return (Inner(""),) * len(self.acting)

    def left_out(self, structure: Structure, beside: Sequence[Effect]) -> tuple[str, ...]:
        """What equilibria and linear models leave out."""
        places = ", ".join(where for where, _ in self.acting)
        note = f"dry friction at {places} acts in simulations only, not in equilibria and linear models"
        return (note,) if places else ()


def _law(value: object, what: str, owner: str) -> Coulomb:
    if isinstance(value, Coulomb):
        return value
    return Coulomb(check_finite(value, what, owner, least=0.0))  # type: ignore[arg-type]
