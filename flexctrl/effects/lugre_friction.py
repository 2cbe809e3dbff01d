"""Dry friction through bristles that bend before they slide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from flexctrl.effects.effect import Effect, Inner
from flexctrl.effects.places import by_place, check_large, check_static, identifier
from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.contacts import contact_of
from flexctrl.structure.freedoms import check_finite
from flexctrl.structure.structure import Structure


@frozen
class LuGre:
    """The LuGre law (Canudas de Wit, Olsson, Åström & Lischinsky 1995).

    ż = v − σ₀ |v| z / g(v),  F = σ₀ z + σ₁ ż + σ₂ v,  g(v) = F_k + (F_s − F_k) exp(−(v/v_s)²).

    Parameters
    ----------
    stiffness : float
        σ₀ > 0 of the bristles [N/m, or N m/rad].
    kinetic : float
        F_k > 0 [N, or N m]; 0 with F_s = 0: no bristles, the viscous part alone.
    static : float, optional
        F_s ≥ F_k; default: F_k.
    stribeck : float
        v_s ≥ 0 [m/s or rad/s]; 0: g = F_k.
    damping : float
        σ₁ ≥ 0 of the bristles [N s/m, or N m s/rad].
    viscous : float
        σ₂ ≥ 0 [N s/m, or N m s/rad].

    Raises
    ------
    StructureError
        For a value out of range.
    """

    stiffness: float
    kinetic: float
    static: float
    stribeck: float
    damping: float
    viscous: float

    def __init__(
        self,
        stiffness: float,
        kinetic: float,
        static: float | None = None,
        stribeck: float = 0.0,
        damping: float = 0.0,
        viscous: float = 0.0,
    ) -> None:
        object.__setattr__(self, "stiffness", check_finite(stiffness, "stiffness", "LuGre", above=0.0))
        others = {"kinetic": kinetic, "stribeck": stribeck, "damping": damping, "viscous": viscous}
        for name, value in others.items():
            object.__setattr__(self, name, check_finite(value, name, "LuGre", least=0.0))
        stick = self.kinetic if static is None else check_finite(static, "static", "LuGre", least=0.0)
        check_static(stick, self.kinetic, "LuGre")
        if stick and not self.kinetic:
            raise StructureError(
                f"LuGre: kinetic = 0 below static = {stick:g}: bristles that bend by g(v)/σ₀ would have to follow "
                f"infinitely fast where g(v) falls to nothing; give a small kinetic > 0, as {1e-3 * stick:g}, or take "
                "Coulomb, which slides freely"
            )
        object.__setattr__(self, "static", stick)


@frozen
class LuGreFriction(Effect):
    """Dry friction with presliding in drives, hinges and slides; its bristle is an inner first-order freedom.

    Unlike `CoulombFriction` it creeps a little where it sticks, as real contacts do. It needs `LargeRotation`. A linear
    model holds σ₂ of it and no more (sliding, the bristles as they are); `Model.notes` says so.

    Parameters
    ----------
    laws : mapping of str to LuGre
        Place (see `ViscousFriction`) → law.

    Raises
    ------
    StructureError
        For what is no `LuGre` law; when the model is assembled, for a place that there is not.
    """

    apart: ClassVar[bool] = True
    laws: tuple[tuple[str, LuGre], ...]

    def __init__(self, laws: Mapping[str, LuGre]) -> None:
        object.__setattr__(self, "laws", by_place(laws, "LuGreFriction", "law", _law))

    def check_on(self, structure: Structure) -> None:
        """Look for every place."""
        for where, _ in self.laws:
            contact_of(structure, where, "LuGreFriction")

    def check_beside(self, others: Sequence[Effect]) -> None:
        """A linear model has no stick."""
        if self.acting:
            check_large(others, "LuGreFriction")

    def inner(self, structure: Structure) -> tuple[Inner, ...]:
        """A bristle each."""
        return tuple(Inner(f"{identifier(w)}_bristle", law.static / law.stiffness, True) for w, law in self.acting)

    @property
    def acting(self) -> tuple[tuple[str, LuGre], ...]:
        """The laws that have bristles."""
        return tuple((where, law) for where, law in self.laws if law.static)

    def left_out(self, structure: Structure, beside: Sequence[Effect]) -> tuple[str, ...]:
        """What linear models leave out."""
        places = ", ".join(where for where, _ in self.acting)
        note = f"of the friction at {places}, equilibria and linear models hold the viscous part only"
        return (note,) if places else ()


def _law(value: object, what: str, owner: str) -> LuGre:
    if not isinstance(value, LuGre):
        raise StructureError(f"{owner}: {what} = {shortened(value)}; expected a flexctrl.LuGre(…)")
    return value
