"""Loops as machine code: functions in a small part of Python, compiled once and called on a record.

A record is a dataclass of numbers, vectors (float64, float32 or int64 arrays) and compiled runs. `compiled` turns a
function of one record into machine code; a `Packed` record is what that code reads and writes. The same
function runs on the plain record without being compiled: slower, for tests. What may be written is told in
`native_ir`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, TypeAlias, TypeVar

import numpy as np

from flexctrl.errors import KernelError
from flexctrl.kernels.kernel import FLOAT, Run
from flexctrl.kernels.native_ir import Translation
from flexctrl.kernels.native_types import DECLARATIONS, RUNS, SCALARS, Absent, Callee, record_fields

__all__ = ["Packed", "Reals", "Runs", "Singles", "Wholes", "assembly", "compiled", "lasting_zeros", "seldom"]

Reals: TypeAlias = np.ndarray
"""A vector of floats."""
Singles: TypeAlias = np.ndarray
"""A vector of floats of single precision, read and written eight at a time."""
Wholes: TypeAlias = np.ndarray
"""A vector of ints."""
Runs: TypeAlias = Sequence[Run]
"""Compiled kernels bound to their tables, called as ``runs[i](z, r)``."""

_Function = TypeVar("_Function", bound=Callable[..., Any])
_WHOLE = np.dtype(np.int64)
_ENTRIES = {"Reals": FLOAT, "Singles": np.dtype(np.float32)}
_libraries: list[object] = []  # owners of the memory of what `compiled` returns, which keeps it for good
_ENTRY = """\
define i64 @entry(ptr %record) {{
  %status = call i64 @{name}(ptr %record)
  ret i64 %status
}}
!0 = !{{}}
"""


class Packed:
    """A record as machine code sees it: one word a field; numbers are read and written as attributes.

    Parameters
    ----------
    record : dataclass
        Its arrays are shared, not copied: they must be contiguous. Records in it may be packed already.

    Raises
    ------
    KernelError
        If an array is not contiguous or of another type.
    """

    def __init__(self, record: Any) -> None:
        places, others = _layout(type(record))  # type: ignore[arg-type]
        words = np.zeros(len(places) + len(others), dtype=_WHOLE)
        reals = words.view(FLOAT)
        self.__dict__.update(_record=record, _words=words, _reals=reals, _kept=[], _lent={}, _places=places)
        for name, (i, kind) in places.items():
            (reals if kind == "float" else words)[i] = getattr(record, name)
        for name, (i, kind) in others.items():
            words[i] = self._address(name, kind, getattr(record, name))
        self.__dict__["_first"] = words.copy()

    def reset(self) -> None:
        """Set all numbers to what they were first, and give back what was lent."""
        self._words[:] = self._first
        self._lent.clear()

    def lend(self, name: str, record: Any) -> Packed:
        """Put another record in the place of one until the numbers are set back; return it as machine code sees it.

        One that is packed already is used as it is.
        """
        known = record_fields(type(self._record))  # type: ignore[arg-type]
        inner = self._lent[name] = record if isinstance(record, Packed) else Packed(record)
        self._words[list(known).index(name)] = _start(inner._words)
        return inner

    def _address(self, name: str, kind: Any, value: Any) -> int:
        if isinstance(kind, type):
            inner = value if isinstance(value, Packed) else Packed(value)
            self._kept.append(inner)
            return _start(inner._words)
        if kind == RUNS:
            value = np.array([word for run in value for word in (run.address, run.arguments)], dtype=_WHOLE)
        wanted = _ENTRIES.get(kind, _WHOLE)
        if not (isinstance(value, np.ndarray) and value.dtype == wanted and value.flags.c_contiguous):
            raise KernelError(f"record field {name!r} is no contiguous vector of {wanted}")
        self._kept.append(value)
        return _start(value)

    def __getattr__(self, name: str) -> Any:
        if name not in self._places:
            return getattr(self._record, name)
        i, kind = self._places[name]
        return float(self._reals[i]) if kind == "float" else int(self._words[i])

    def __setattr__(self, name: str, value: Any) -> None:
        i, kind = self._places[name]
        (self._reals if kind == "float" else self._words)[i] = value

    def cell(self, name: str) -> Any:
        """Return the place of a number, a memoryview of length one: quick where it is read or written often."""
        i, kind = self._places[name]
        return memoryview(self._reals if kind == "float" else self._words)[i : i + 1]

    def bound(self, function: Callable[[Any], int], without: tuple[str, ...] = ()) -> Callable[[], int]:
        """Return a function of such records, compiled, on this one, which it keeps alive.

        Parameters
        ----------
        function : callable
        without : tuple of str
            Numbers of the record that are 0 whenever it is called, besides the lasting ones of all records in it.
        """
        absent = frozenset((type(self._record), name) for name in without) | lasting_zeros(self._record)
        bound = _Bound(compiled(function, absent), ctypes.c_void_p(_start(self._words)))
        bound.owner = self
        return bound


def lasting_zeros(record: Any) -> Absent:
    """Return the fields that are 0 for good, in a record and those in it: of the ones that its type calls lasting.

    A type does so with ``LASTING``, names of ints that say how much there is of something.
    """
    zero: set[tuple[type, str]] = set()
    other: set[tuple[type, str]] = set()
    waiting = [record]
    while waiting:
        record = waiting.pop()
        record = record._record if isinstance(record, Packed) else record
        for name in getattr(record, "LASTING", ()):
            (other if getattr(record, name) else zero).add((type(record), name))
        known = record_fields(type(record))  # type: ignore[arg-type]
        waiting += [getattr(record, name) for name, kind in known.items() if isinstance(kind, type)]
    return frozenset(zero - other)


def _start(a: np.ndarray) -> int:
    return int(a.__array_interface__["data"][0])  # quicker than a.ctypes


@cache
def _layout(record: type) -> tuple[dict[str, tuple[int, Any]], dict[str, tuple[int, Any]]]:
    """Places and types of the numbers of a record, and those of all else."""
    known = {name: (i, kind) for i, (name, kind) in enumerate(record_fields(record).items())}
    numbers = {name: place for name, place in known.items() if place[1] in SCALARS}
    return numbers, {name: place for name, place in known.items() if name not in numbers}


class _Bound(partial):
    """A call on the raw address of a record, and who owns the memory there."""

    owner: Packed


def seldom(function: _Function) -> _Function:
    """Mark a function in which little time is spent: it is compiled in a hurry, without optimisation."""
    vars(function)["seldom"] = True
    return function


def assembly(function: Callable[..., int], absent: Absent = frozenset()) -> str:
    """Return the LLVM assembly of a function of one record and of all that it calls.

    Parameters
    ----------
    function : callable
    absent : frozenset of (type, str)
        Fields that are 0 whenever it is called.

    Raises
    ------
    KernelError
        If a function uses what cannot be compiled, says what and where; if two of them have one name.
    """
    known, parts, libraries = {function.__name__: function}, [], set()
    waiting: list[Callee] = [(function, frozenset())]
    found = set(waiting)
    while waiting:
        translation = Translation(waiting.pop(), absent)
        parts.append(translation.assembly())
        libraries |= translation.libraries
        waiting += [callee for callee in translation.callees if callee not in found]
        found |= set(translation.callees)
        for callee, _ in translation.callees:
            _check_name(known.setdefault(callee.__name__, callee), callee)
    return "\n".join([*parts, *DECLARATIONS, *sorted(libraries), _ENTRY.format(name=function.__name__)])


def _check_name(known: Callable[..., Any], callee: Callable[..., Any]) -> None:
    """Raise KernelError for two functions of one name: machine code has no modules."""
    if callee is not known:
        one, other = (f"{f.__module__}.{f.__name__}" for f in (known, callee))
        raise KernelError(f"{one} and {other} cannot be compiled together: they have one name; rename one of them")


@cache
def compiled(function: Callable[[Any], int], absent: Absent = frozenset()) -> Callable[[ctypes.c_void_p], int]:
    """Return the machine code of a function that takes a record and returns an int; called on a record's address."""
    from flexctrl.kernels.llvm import link

    library = link(assembly(function, absent), 2, ("entry",), passes=True)
    code = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)(library["entry"])
    _libraries.append(library)
    return code
