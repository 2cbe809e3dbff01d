"""What compiled loops know of types: numbers, vectors, records, lists of runs."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, NamedTuple, TypeAlias

from flexctrl.errors import KernelError

SCALARS = {"int": "i64", "float": "double", "bool": "i1"}
EIGHT, SHORT = "<8 x double>", "<8 x float>"
VECTORS = {"Reals": "float", "Singles": "single", "Wholes": "int"}
RUNS = "Runs"
_TYPES: dict[Any, str] = {**SCALARS, "single": "float", "Eight": EIGHT, None: "void"}
INTRINSICS = ("sqrt", "fabs", "floor", "ceil", "copysign")
LIBRARY = ("sin", "cos", "tan", "atan", "atan2", "exp", "log", "pow", "asin", "acos", "hypot")


Absent: TypeAlias = frozenset[tuple[type, str]]
"""Fields of records, ints, that are 0 for good: no code is made for what they count."""
Callee: TypeAlias = tuple[Callable[..., Any], frozenset[str]]
"""A function, and which of its parameters are `Singles` where it says `Reals`: it is compiled for these as well."""


class Value(NamedTuple):
    """A type (a name in `SCALARS` or `VECTORS`, `RUNS`, or a record's class) and an operand."""

    type: Any
    text: str


@cache
def record_fields(record: type) -> dict[str, Any]:
    """Return the fields of a record and their types, in order."""
    names = vars(sys.modules[record.__module__])
    return {f.name: _resolved(f.type, names) for f in fields(record)}


def signature(function: Callable[..., Any]) -> tuple[list[tuple[str, Any]], str | None]:
    """Return the parameters of a function with their types, and the type it returns."""
    notes = inspect.get_annotations(function)
    names = function.__globals__
    types = {name: _resolved(note, names) for name, note in notes.items()}
    result = types.pop("return", None)
    return list(types.items()), result


def symbol(callee: Callee) -> str:
    """Return the name of a function in machine code."""
    function, singles = callee
    return ".".join([function.__name__, *sorted(singles)])


def _resolved(note: Any, names: dict[str, Any]) -> Any:
    if note in SCALARS or note in VECTORS or note in (RUNS, "Eight"):
        return note
    if note == "None":
        return None
    found = names.get(note)
    if isinstance(found, type) and is_dataclass(found):
        return found
    raise KernelError(f"{note} is no type that can be compiled")


def llvm_type(kind: Any) -> str:
    """Return a type in LLVM's words."""
    return _TYPES.get(kind, "ptr") if kind is None or isinstance(kind, str) else "ptr"


ZERO = {"i64": "0", "double": "0.0", "i1": "false", "void": "", "ptr": "null", EIGHT: "zeroinitializer"}
DECLARATIONS = (
    *(f"declare double @llvm.{n}.f64({'double, double' if n == 'copysign' else 'double'})" for n in INTRINSICS),
    f"declare {EIGHT} @llvm.fabs.v8f64({EIGHT})",
    f"declare {EIGHT} @llvm.fma.v8f64({EIGHT}, {EIGHT}, {EIGHT})",
    "declare void @llvm.prefetch.p0(ptr, i32, i32, i32)",
    f"declare double @llvm.vector.reduce.fmax.v8f64({EIGHT})",
    f"declare double @llvm.vector.reduce.fadd.v8f64(double, {EIGHT})",
)
"""Functions LLVM knows."""
