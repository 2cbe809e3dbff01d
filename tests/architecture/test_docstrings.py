"""Docstrings of public names are numpydoc and name exactly the parameters there are."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
from collections.abc import Callable, Iterator

import pytest

import flexctrl
from flexctrl.design.controller import Controller
from flexctrl.dynamics.records.record import Record
from flexctrl.dynamics.steps import Integrator
from flexctrl.kernels.kernel import Backend
from flexctrl.linear.reduction.selection import Selection

PROTOCOLS = (Backend, Controller, Integrator, Record, Selection)
PUBLIC = {name: getattr(flexctrl, name) for name in flexctrl.__all__}
SECTIONS = ("Parameters", "Attributes", "Returns", "Raises", "Yields", "Notes", "Examples", "See Also", "References")


def section(doc: str, title: str) -> list[str]:
    """The lines of a numpydoc section."""
    lines = inspect.cleandoc(doc).splitlines()
    starts = [i for i, line in enumerate(lines[:-1]) if line in SECTIONS and set(lines[i + 1]) == {"-"}]
    ends = dict(zip(starts, [*starts[1:], len(lines)], strict=False))
    return next((lines[i + 2 : end] for i, end in ends.items() if lines[i] == title), [])


def documented(doc: str, title: str) -> list[str]:
    """The names that head the entries of a section."""
    heads = [re.split(r"\s*:\s", line + " ")[0] for line in section(doc, title) if line and not line.startswith(" ")]
    return [name.strip(" *") for head in heads for name in head.split(",")]


def parameters(function: Callable) -> list[str]:
    return [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]


def methods(cls: type) -> Iterator[tuple[str, Callable]]:
    """Public methods that a class defines itself and that no base or protocol has documented before it."""
    for name, value in vars(cls).items():
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        inherited = any(hasattr(base, name) for base in (*cls.__mro__[1:], *PROTOCOLS))
        if not name.startswith("_") and inspect.isfunction(function) and not inherited:
            yield name, function


def points_elsewhere(function: Callable) -> bool:
    """Whether a docstring names the function that tells it all: ``see `other` ``."""
    return bool(re.search(r"\b(see|what) (:func:|:meth:)?`", function.__doc__ or ""))


CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}
FUNCTIONS = {name: value for name, value in PUBLIC.items() if inspect.isfunction(value)}
FUNCTIONS |= {f"{name}.{method}": f for name, cls in CLASSES.items() for method, f in methods(cls)}
FUNCTIONS.pop("Scene.start", None)  # its one line says which models it takes


@pytest.mark.parametrize("name", PUBLIC)
def test_public_names_are_where_they_are_said_to_be(name):
    home = importlib.import_module(flexctrl._HOME[name])
    assert getattr(home, name) is PUBLIC[name]


@pytest.mark.parametrize("name", CLASSES)
def test_classes_document_what_they_take_or_hold(name):
    """``Parameters`` of what a user makes, ``Attributes`` of what a user is given."""
    cls = CLASSES[name]
    assert cls.__doc__, name
    if section(cls.__doc__, "Parameters"):
        assert documented(cls.__doc__, "Parameters") == parameters(cls)
    elif section(cls.__doc__, "Attributes"):
        fields = [f.name for f in dataclasses.fields(cls)] if dataclasses.is_dataclass(cls) else []
        assert set(fields) <= set(documented(cls.__doc__, "Attributes"))
    else:
        assert issubclass(cls, Exception) or parameters(cls) in ([], ["args", "kwargs"]) or is_enum(cls)


def is_enum(cls: type) -> bool:
    return hasattr(cls, "__members__")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_document_exactly_their_parameters(name):
    function = FUNCTIONS[name]
    assert function.__doc__, name
    found = documented(function.__doc__, "Parameters")
    assert found == parameters(function) or (points_elsewhere(function) and not found)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_say_what_they_return(name):
    function = FUNCTIONS[name]
    returned = inspect.signature(function).return_annotation
    if returned not in ("None", None) and parameters(function) and not points_elsewhere(function):
        assert section(function.__doc__, "Returns")
