"""Frozen values are what `dataclasses` would have made of them; it is its answers that theirs are held against."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, astuple, dataclass, field, fields, replace
from typing import Any, ClassVar

import pytest

import flexctrl as fc
from flexctrl.frozen import frozen


@frozen
class Point:
    """Two numbers."""

    scale: ClassVar[float] = 2.0

    x: float
    y: float = 1.0
    told: str = field(default="", compare=False)
    hidden: list[int] = field(default_factory=list, repr=False, compare=False)
    size: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", self.scale * (self.x + self.y))


@frozen(eq=False)
class Thing:
    """One of a kind."""

    x: float


@frozen
class One:
    """Compared by one field."""

    x: float


@frozen
class Named:
    """With methods of its own."""

    x: float

    def __repr__(self) -> str:
        return "named"

    def __eq__(self, other: object) -> bool:
        return type(other).__name__ == "Named"


@frozen
class Empty:
    """Nothing to compare."""


def _standard(cls: type, eq: bool = True) -> Any:
    """The same class as `dataclasses` makes it."""
    shared = {"__dataclass_fields__", "__dataclass_params__", "__match_args__", "__init__", "__dict__"}
    own = {name: value for name, value in vars(cls).items() if name not in shared | {"__weakref__"}}
    defaults = cls.__dataclass_fields__.items()
    own = {n: v for n, v in own.items() if getattr(v, "__module__", None) != "flexctrl.frozen"}
    own |= {n: copy.copy(f) for n, f in defaults if n in cls.__annotations__ and f._field_type.name == "_FIELD"}
    return dataclass(frozen=True, eq=eq)(type(cls.__name__, (), own))


@pytest.mark.parametrize(
    ("cls", "eq", "values"),
    [
        (Point, True, [(1.0,), (1.0, 1.0, "a"), (1.0, 2.0), (2.0,)]),
        (Thing, False, [(1.0,), (1.0,), (2.0,)]),
        (One, True, [(1.0,), (1.0,), (2.0,)]),
        (Named, True, [(1.0,), (2.0,)]),
        (Empty, True, [(), ()]),
    ],
)
def test_values_are_told_compared_and_hashed_as_dataclasses_are(cls, eq, values):
    standard = _standard(cls, eq)
    ours, theirs = [cls(*v) for v in values], [standard(*v) for v in values]
    assert [repr(a) for a in ours] == [repr(a) for a in theirs]
    assert [[a == b for b in ours] for a in ours] == [[a == b for b in theirs] for a in theirs]
    assert [[hash(a) == hash(b) for b in ours] for a in ours] == [[hash(a) == hash(b) for b in theirs] for a in theirs]
    assert all(a != b for a, b in zip(ours, theirs, strict=True)) or cls is Named
    assert [f.name for f in fields(cls)] == [f.name for f in fields(standard)]
    assert [astuple(a) for a in ours] == [astuple(a) for a in theirs]


def _message(act: Callable[[], object]) -> str:
    with pytest.raises(FrozenInstanceError) as caught:
        act()
    return str(caught.value)


@pytest.mark.parametrize("name", ["x", "size", "scale", "new"])
def test_nothing_of_a_value_can_be_changed(name):
    ours, theirs = Point(1.0), _standard(Point)(1.0)
    for act in (lambda value: setattr(value, name, 3.0), lambda value: delattr(value, name)):
        assert _message(lambda act=act: act(ours)) == _message(lambda act=act: act(theirs))
    assert ours == Point(1.0)
    assert ours.size == 4.0


@pytest.mark.parametrize("base", [Point, _standard(Point)], ids=["ours", "theirs"])
def test_a_subclass_may_add_to_a_value_but_not_change_it(base):
    class More(base):
        pass

    value = More(1.0)
    value.new = 3.0
    assert (value.new, value.scale) == (3.0, 2.0)
    del value.new
    for act in (lambda: setattr(value, "x", 3.0), lambda: delattr(value, "x"), lambda: delattr(value, "size")):
        with pytest.raises(FrozenInstanceError):
            act()
    assert value.x == 1.0


def test_copies_are_equal():
    value = Point(1.0, 3.0, "a", [1])
    assert pickle.loads(pickle.dumps(value)) == copy.copy(value) == copy.deepcopy(value) == value
    assert replace(value, y=4.0).size == Point(1.0, 4.0).size == 10.0


def test_a_value_that_holds_itself_can_be_told():
    value = Point(1.0)
    object.__setattr__(value, "told", value)
    assert repr(value) == "Point(x=1.0, y=1.0, told=..., size=4.0)"


@pytest.mark.parametrize("decorator", [dataclass(frozen=True), frozen])
def test_dataclasses_may_inherit_from_public_types(decorator):
    @decorator
    class Hook(fc.PointMass):
        safe: bool = True

    hook = Hook("hook", (0.0, 0.0, 0.0), mass=5.0)
    assert hook == Hook("hook", (0.0, 0.0, 0.0), 5.0)
    assert hook != Hook("hook", (0.0, 0.0, 0.0), 5.0, safe=False)
    assert "safe=True" in repr(hook)
    with pytest.raises(FrozenInstanceError):
        hook.mass = 6.0


def test_one_that_is_not_frozen_may_not_inherit_from_a_frozen_one():
    with pytest.raises(TypeError, match="non-frozen"):
        dataclass(type("Loose", (Point,), {}))
