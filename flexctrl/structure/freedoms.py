"""The six freedoms of a node and the directions of space, as users write them."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from numbers import Integral, Real
from typing import TypeAlias

import numpy as np

from flexctrl.errors import StructureError, did_you_mean, shortened

Vector: TypeAlias = tuple[float, float, float]

FREEDOMS = ("u", "v", "w", "θx", "θy", "θz")
"""Nodal freedoms in the paper's order: displacements along x, y, z [m], rotations about them [rad]."""

IDENTIFIERS = ("u", "v", "w", "rx", "ry", "rz")
"""The same freedoms in names that python-control accepts."""

_INDEX = {name: i for i, name in enumerate(FREEDOMS)} | {name: i for i, name in enumerate(IDENTIFIERS)}
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_AXIS_HINT = "; u v w are displacements along x y z, rx ry rz rotations about them"
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
LEGAL = (
    "ASCII letters, digits and underscores, a letter or an underscore first (python-control allows no dots or blanks)"
)
"""What a name is, in words."""

HUGE = 1e50
"""Numbers from here on are refused: powers of them would overflow."""

ALL = frozenset(range(6))
TRANSLATIONS = frozenset(range(3))
ROTATIONS = frozenset(range(3, 6))
TRAVEL = frozenset({0})
"""Of a node that is nowhere in space: its u is how far something has travelled."""


def parse_freedoms(text: str | Iterable[str], owner: str) -> frozenset[int]:
    """Read freedoms such as ``"v w"``, ``"all"`` or ``["u", "rz"]`` into their indices 0…5."""
    words = text.replace(",", " ").split() if isinstance(text, str) else listed(text, f"{owner}: held")
    if words == ["all"]:
        return ALL
    unknown = [w for w in words if not isinstance(w, str) or w not in _INDEX]
    if unknown:
        known = (*FREEDOMS, *IDENTIFIERS[3:], "all")
        hint = _AXIS_HINT if unknown[0] in list(_AXES) else did_you_mean(unknown[0], known)
        raise StructureError(f"{owner}: no freedom {unknown[0]!r}{hint}")
    if not words:
        raise StructureError(f"{owner}: names no freedom; give some of {' '.join(FREEDOMS)} or 'all'")
    return frozenset(_INDEX[w] for w in words)


def parse_direction(direction: str | Sequence[float], owner: str) -> Vector:
    """Read a direction, ``"x"``, ``"-z"`` or three numbers, into a unit vector."""
    if isinstance(direction, str):
        sign = -1.0 if direction.startswith("-") else 1.0
        axis = _AXES.get(direction[1:] if direction[:1] in ("+", "-") else direction)
        if axis is None:
            raise StructureError(f"{owner}: no direction {direction!r}; give x, y, z, -x, -y, -z or three numbers")
        return (sign * axis[0] + 0.0, sign * axis[1] + 0.0, sign * axis[2] + 0.0)
    vector = parse_point(direction, owner)
    length = math.hypot(*vector)
    if length == 0.0:
        raise StructureError(f"{owner}: the direction {vector} has no length; give a vector that points somewhere")
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def parse_point(point: Sequence[float], owner: str) -> Vector:
    """Read three finite numbers."""
    values = numbers(point)
    if len(values) != 3 or not all(abs(p) < HUGE for p in values):
        raise StructureError(f"{owner}: expected three finite numbers (x, y, z), got {shortened(point)}")
    return (values[0], values[1], values[2])


def check_name(name: str, kind: str) -> str:
    """Return ``name`` if it is an identifier: signal names must be legal for python-control."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise StructureError(f"{kind}: name = {shortened(name)}; expected {LEGAL}")
    return name


def check_signal(name: str, kind: str) -> str:
    """Return ``name`` if it can name a signal: an identifier other than ``t``, which is the time in every table."""
    if name == "t":
        raise StructureError(f"{kind} 't': t is the time in every run and table; give the signal another name")
    return check_name(name, kind)


def listed(items: Iterable, owner: str) -> list:
    """Return the items of a list."""
    if not isinstance(items, str):
        with suppress(TypeError):
            return list(items)
    raise StructureError(f"{owner} = {shortened(items)}; expected a list")


def numbers(values: object) -> tuple[float, ...]:
    """Return a sequence's numbers, NaN for what is none; nothing for what is no sequence."""
    several = values.ndim > 0 if isinstance(values, np.ndarray) else isinstance(values, Sequence)
    return tuple(map(_number, values)) if several else ()  # type: ignore[call-overload]


def _number(value: object) -> float:
    """Return a real number as a float; NaN for what is none, strings and truth values among it."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def check_number(value: float, what: str, owner: str, *, least: float = -math.inf, above: float = -math.inf) -> float:
    """Return ``value`` as a float if it is a number ≥ ``least`` and > ``above``."""
    number = _number(value)
    if math.isnan(number) or number < least or number <= above:
        bound = f" > {above:g}" if above > -math.inf else f" ≥ {least:g}" if least > -math.inf else ""
        raise StructureError(f"{owner}: {what} = {shortened(value)}; expected a number{bound}")
    return number


def check_finite(value: float, what: str, owner: str, *, least: float = -math.inf, above: float = -math.inf) -> float:
    """Return ``value`` as a finite float within the bounds."""
    number = check_number(value, what, owner, least=least, above=above)
    if abs(number) >= HUGE:
        raise StructureError(f"{owner}: {what} = {shortened(value)}; expected a finite number below {HUGE:g}")
    return number


def check_seconds(value: float, what: str, owner: str, *, endless: bool = False) -> float:
    """Return ``value`` as a float if it is a time above zero, which may be endless (infinite) if ``endless``."""
    seconds = _number(value)
    if not seconds > 0.0 or (seconds >= HUGE and not endless):
        bound = f" below {HUGE:g}" if seconds > 0.0 else ""
        raise StructureError(f"{owner}: {what} = {shortened(value)}; expected seconds > 0{bound}")
    return seconds


def check_path(path: str | os.PathLike[str], owner: str) -> None:
    """Raise unless ``path`` names a file in a folder that is there."""
    if not isinstance(path, str | os.PathLike) or not str(path):
        raise StructureError(f"{owner}: path = {path!r}; expected the name of a file")
    folder = os.path.dirname(os.fspath(path)) or "."
    if not os.path.isdir(folder):
        raise StructureError(f"{owner}: path = {str(path)!r}: there is no folder {folder!r}; make it first")
    if os.path.isdir(path):
        raise StructureError(f"{owner}: path = {str(path)!r} is a folder; expected the name of a file")


@contextmanager
def written(path: str | os.PathLike[str], owner: str) -> Iterator[None]:
    """Tell what cannot be written where ``path`` says, and why, before and while it is."""
    check_path(path, owner)
    try:
        yield
    except OSError as error:
        raise StructureError(f"{owner}: {path} cannot be written: {error.strerror or error}") from error


def check_whole(value: int, what: str, owner: str, *, least: int, most: int = 2**31) -> int:
    """Return ``value`` as an int if it is a whole number from ``least`` to ``most``."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= value <= most:
        raise StructureError(f"{owner}: {what} = {shortened(value)}; expected a whole number from {least} to {most}")
    return int(value)
