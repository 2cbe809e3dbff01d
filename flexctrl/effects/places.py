"""Numbers by place: how effects that act here and there are told where."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from flexctrl.effects.effect import Effect
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.structure.freedoms import check_finite
from flexctrl.structure.structure import Structure

__all__ = ["by_place", "check_drives", "check_large", "check_static", "finite", "identifier", "not_negative"]

T = TypeVar("T")


def by_place(
    given: Mapping[str, object], owner: str, what: str, read: Callable[[object, str, str], T]
) -> tuple[tuple[str, T], ...]:
    """Return (place, value) pairs of a mapping.

    Parameters
    ----------
    given : mapping of str to object
    owner : str
        The effect, for messages.
    what : str
        What the values are, for messages.
    read : callable
        (value, what it is, owner) → value, checked.

    Returns
    -------
    tuple of (str, value)
    """
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise StructureError(f"{owner}: {shortened(given)}; expected a mapping of names to values, {{'name': …}}")
    return tuple((name, read(value, f"{what} of {name!r}", owner)) for name, value in given.items())


def not_negative(value: object, what: str, owner: str) -> float:
    """Return a number ≥ 0."""
    return check_finite(value, what, owner, least=0.0)  # type: ignore[arg-type]


def finite(value: object, what: str, owner: str) -> float:
    """Return a number."""
    return check_finite(value, what, owner)  # type: ignore[arg-type]


def check_static(static: float, kinetic: float, owner: str) -> None:
    """Raise StructureError if it takes less to break loose than to slide."""
    if static < kinetic:
        raise StructureError(f"{owner}: static = {static:g} below kinetic = {kinetic:g}; it takes more to break loose")


def check_large(effects: Sequence[Effect], owner: str) -> None:
    """Raise StructureError for an effect that is not linear in a model that is."""
    if not any(isinstance(e, LargeRotation) for e in effects):
        raise StructureError(f"{owner} is not linear, but a model without LargeRotation is; add LargeRotation()")


def check_drives(structure: Structure, names: tuple[str, ...], owner: str) -> None:
    """Raise StructureError for a name that is no drive."""
    known = tuple(d.name for d in structure.drives)
    for name in names:
        if name not in known:
            raise StructureError(f"{owner}: there is no drive {name!r}{did_you_mean(name, known)}")


def identifier(place: str) -> str:
    """Return the name of a place as an identifier."""
    return re.sub(r"\W", "_", place)
