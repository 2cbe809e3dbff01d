"""Values of a scene file: each is read by a reader that says what it expected, and where."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any, TypeVar

from flexctrl.errors import FlexctrlError, SceneError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import LEGAL, check_name

T = TypeVar("T")


@frozen
class Place:
    """Where something stands in a scene file.

    Attributes
    ----------
    file : str
    keys : tuple of str
        From the outermost table inwards.
    """

    file: str
    keys: tuple[str, ...] = ()

    def at(self, key: str) -> Place:
        """Return the place of a key in this table."""
        return Place(self.file, (*self.keys, key))

    def __str__(self) -> str:
        if not self.keys:
            return self.file
        *tables, key = self.keys
        return f"{self.file}: [{'.'.join(tables)}] {key}" if tables else f"{self.file}: {key}"

    def expected(self, what: str, got: object) -> SceneError:
        """Return the error for a value that is not what was expected."""
        return SceneError(f"{self} = {shortened(got)}; expected {what}")

    def refuse(self, problem: str) -> SceneError:
        """Return the error for a table or key that cannot be used."""
        return SceneError(f"{self}: {problem}")


Reader = Callable[[Any, Place], Any]


def number(value: Any, place: Place) -> float:
    """Read a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise place.expected("a number", value)
    if not math.isfinite(value):
        raise place.expected("a finite number", value)
    return float(value)


def positive(value: Any, place: Place) -> float:
    """Read a number above zero."""
    if number(value, place) <= 0.0:
        raise place.expected("a number > 0", value)
    return float(value)


def whole(value: Any, place: Place) -> int:
    """Read a whole number."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise place.expected("a whole number", value)
    return value


def flag(value: Any, place: Place) -> bool:
    """Read true or false."""
    if not isinstance(value, bool):
        raise place.expected("true or false", value)
    return value


def text(value: Any, place: Place) -> str:
    """Read a string."""
    if not isinstance(value, str):
        raise place.expected("a text in quotes", value)
    return value


def legal_name(value: Any, place: Place) -> str:
    """Read a name that python-control accepts."""
    try:
        return check_name(value, "")
    except FlexctrlError:
        raise place.expected(LEGAL, value) from None


def table(value: Any, place: Place) -> Mapping[str, Any]:
    """Read a table."""
    if not isinstance(value, Mapping):
        raise place.expected("a table of keys", value)
    return value


def several(reader: Callable[[Any, Place], T]) -> Callable[[Any, Place], tuple[T, ...]]:
    """Return the reader of a list of what ``reader`` reads."""

    def read(value: Any, place: Place) -> tuple[T, ...]:
        if not isinstance(value, list):
            raise place.expected("a list [ … ]", value)
        return tuple(reader(item, place.at(str(i))) for i, item in enumerate(value, 1))

    return read


def one_or_several(reader: Callable[[Any, Place], T]) -> Callable[[Any, Place], T | tuple[T, ...]]:
    """Return the reader of one thing or a list of such things."""
    return lambda value, place: several(reader)(value, place) if isinstance(value, list) else reader(value, place)


def mapping(reader: Callable[[Any, Place], T]) -> Callable[[Any, Place], dict[str, T]]:
    """Return the reader of a table whose keys are free and whose values ``reader`` reads."""
    return lambda value, place: {k: reader(v, place.at(k)) for k, v in table(value, place).items()}


def one_of(known: Iterable[str]) -> Callable[[Any, Place], str]:
    """Return the reader of one of some words."""
    names = tuple(known)

    def read(value: Any, place: Place) -> str:
        if text(value, place) not in names:
            raise place.refuse(f"there is no {value!r}{did_you_mean(value, names)}")
        return value

    return read


def known(what: str, names: Iterable[str]) -> Callable[[Any, Place], str]:
    """Return the reader of the name of something that the machine has; ``what`` it is, for the message."""
    there = tuple(names)

    def read(value: Any, place: Place) -> str:
        if text(value, place) not in there:
            raise place.refuse(f"the machine has no {what} {value!r}{did_you_mean(value, there)}")
        return value

    return read


def by_name(
    name: Callable[[Any, Place], str], reader: Callable[[Any, Place], T]
) -> Callable[[Any, Place], dict[str, T]]:
    """Return the reader of a table whose keys ``name`` reads and whose values ``reader`` reads."""
    return lambda value, place: {name(k, place): reader(v, place.at(k)) for k, v in table(value, place).items()}


def vector(value: Any, place: Place) -> tuple[float, float, float]:
    """Read three numbers."""
    if not isinstance(value, list) or len(value) != 3:
        raise place.expected("three numbers [x, y, z]", value)
    x, y, z = (number(v, place) for v in value)
    return x, y, z


def direction(value: Any, place: Place) -> str | tuple[float, float, float]:
    """Read ``"x"``, ``"-z"`` or three numbers."""
    return value if isinstance(value, str) else vector(value, place)


def keys(value: Any, place: Place, readers: Mapping[str, Reader], required: Iterable[str] = ()) -> dict[str, Any]:
    """Read a table key by key.

    Parameters
    ----------
    value : object
        As it stands in the file.
    place : Place
    readers : mapping of str to reader
        The keys there may be.
    required : iterable of str
        Those that must be there.

    Returns
    -------
    dict
        What the readers made of the keys that are there.

    Raises
    ------
    SceneError
        For an unknown key, a missing one, or a value that its reader refuses.
    """
    given = table(value, place)
    for key in given:
        if key not in readers:
            raise place.at(key).refuse(f"unknown key{did_you_mean(key, readers)}")
    missing = [key for key in required if key not in given]
    if missing:
        raise place.refuse(f"the key {missing[0]!r} is missing")
    return {key: readers[key](item, place.at(key)) for key, item in given.items()}


def checked(make: Callable[[], T], place: Place) -> T:
    """Return what ``make`` makes; an error of the library's own is told with its place in the file."""
    try:
        return make()
    except FlexctrlError as error:
        if isinstance(error, SceneError) and str(error).startswith(place.file):
            raise
        raise place.refuse(str(error)) from error


@frozen
class Kind:
    """One kind of thing a table can stand for: how it is made and from which keys.

    Attributes
    ----------
    make : callable
        Called with what the readers give, by keyword; what has no default there is required.
    readers : mapping of str to reader
        Keys besides ``name``, which comes from the table's own name.
    """

    make: Callable[..., Any]
    readers: Mapping[str, Reader] = field(default_factory=dict)

    def required(self) -> tuple[str, ...]:
        """Keys without which it cannot be made."""
        parameters = inspect.signature(self.make).parameters.values()
        return tuple(p.name for p in parameters if p.default is p.empty and p.name in self.readers)

    def read(self, value: Mapping[str, Any], place: Place, **given: Any) -> Any:
        """Read a table of this kind; ``given`` are arguments that do not stand in it."""
        found = keys(value, place, self.readers, self.required())
        return checked(lambda: self.make(**given, **found), place)


def of_kind(value: Any, place: Place, kinds: Mapping[str, Kind], **given: Any) -> Any:
    """Read a table whose key ``kind`` says what it is.

    Parameters
    ----------
    value : object
    place : Place
    kinds : mapping of str to Kind
    **given
        Arguments that do not stand in the table.

    Returns
    -------
    object
        What the kind makes.
    """
    content = dict(table(value, place))
    if "kind" not in content:
        raise place.refuse(f"the key 'kind' is missing; one of {', '.join(kinds)}")
    kind = one_of(kinds)(content.pop("kind"), place.at("kind"))
    return kinds[kind].read(content, place, **given)


def named(value: Any, place: Place, kinds: Mapping[str, Kind]) -> tuple[Any, ...]:
    """Read a table of tables, each named by its key and told by its ``kind``."""
    return tuple(of_kind(item, place.at(key), kinds, name=key) for key, item in table(value, place).items())
