"""Frozen dataclasses that are quick to define: but for the constructor, all share their methods.

`dataclasses` compiles five or six functions for each class that is frozen and compared. A first run needs nearly 300
classes: half of what it takes to import the package (docs/design.md). What is shared here does the same.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass, field, fields
from operator import attrgetter
from typing import Any, TypeVar, dataclass_transform, overload

__all__ = ["ByFields", "frozen"]

_T = TypeVar("_T")


@overload
@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[_T], /) -> type[_T]: ...
@overload
def frozen(*, eq: bool = True) -> Callable[[type[_T]], type[_T]]: ...
def frozen(cls: type | None = None, /, *, eq: bool = True) -> Any:
    """Make a class a frozen dataclass, as ``dataclass(frozen=True)`` does; those that inherit from one are made by it.

    Parameters
    ----------
    cls : type
    eq : bool
        Whether objects are compared, and hashed, by their fields.

    Returns
    -------
    type
        The same.
    """
    return (lambda given: _made(given, eq)) if cls is None else _made(cls, eq)


class ByFields:
    """What is copied and pickled by its fields alone: what it has worked out from them is worked out anew."""

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]


def _made(cls: Any, eq: bool) -> Any:
    if any("__dataclass_fields__" in vars(base) for base in cls.__mro__[1:]):
        return dataclass(frozen=True, eq=eq)(cls)
    own = {name for name, value in vars(cls).items() if value is not None}
    made: Any = dataclass(eq=False, repr=False)(cls)
    made.__dataclass_params__.frozen = True  # for what inherits from it
    shared = {"__repr__": _told, **_guards(made), **(_comparisons(made) if eq else {})}
    for name in shared.keys() - own:
        setattr(made, name, shared[name])
    return made


def _guards(cls: Any) -> dict[str, Callable[..., Any]]:
    """What sets a field for the first time, as the constructor does, and nothing else but what subclasses add."""
    names = frozenset(f.name for f in fields(cls))

    def assign(self: Any, name: str, value: Any) -> None:
        own = self.__dict__
        if name in own if name in names else type(self) is cls:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        own[name] = value

    def delete(self: Any, name: str) -> None:
        if name in names or type(self) is cls:
            raise FrozenInstanceError(f"cannot delete field {name!r}")
        object.__delattr__(self, name)

    return {"__setattr__": assign, "__delattr__": delete}


def _comparisons(cls: Any) -> dict[str, Callable[..., Any]]:
    """Comparison and hash by the fields."""
    names = [f.name for f in fields(cls) if f.compare]
    contents: Callable[[Any], Any] = attrgetter(*names) if names else lambda _: ()

    def equal(self: Any, other: Any) -> Any:
        return contents(self) == contents(other) if type(other) is type(self) else NotImplemented

    return {"__eq__": equal, "__hash__": lambda self: hash(contents(self))}


@reprlib.recursive_repr()
def _told(self: Any) -> str:
    told = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
    return f"{type(self).__qualname__}({told})"
