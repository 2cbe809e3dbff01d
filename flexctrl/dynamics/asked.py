"""What a run may be asked for: arguments of another kind are refused before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from flexctrl.dynamics.checkpoint import Autosave, Checkpoint
from flexctrl.dynamics.events.event import Event
from flexctrl.dynamics.records.record import Record
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Integrator
from flexctrl.errors import StructureError, shortened
from flexctrl.linear.model import LinearModel
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_seconds, listed

__all__ = ["check_arguments", "check_rows", "check_times", "events_of"]

_NUMBERS = 1e9

_KINDS: dict[str, tuple[Any, str]] = {
    "model": ((Model, LinearModel), "a Model (from assemble) or a LinearModel (from linearize)"),
    "start": ((State, Rest, Checkpoint), "a State (model.rest, run.final), a Rest (from equilibrium) or a Checkpoint"),
    "method": (Integrator, "a method with its parameters, as GeneralizedAlpha(1e-3) or AdaptiveAlpha()"),
    "tolerance": (Tolerance, "a Tolerance, as Tolerance(relative=1e-5)"),
    "record": (Record, "InMemory() or CsvStream('run.csv')"),
    "autosave": (Autosave, "an Autosave, as Autosave('run.checkpoint')"),
    "progress": (Callable, "a function of the share that is done"),
}
_known: set[tuple[type, str]] = set()
"""Types that have been looked at: what they offer takes long to find out."""


def check_arguments(given: Mapping[str, object]) -> None:
    """Raise unless each argument of `simulate` that was given is of its kind.

    Parameters
    ----------
    given : mapping of str to object
        By name; None where nothing was given.

    Raises
    ------
    StructureError
        Names the argument, its value and what was expected.
    """
    for name, value in given.items():
        kinds, expected = _KINDS[name]
        if (value is None and name != "model") or (type(value), name) in _known:
            continue
        if isinstance(value, type) or not isinstance(value, kinds):
            raise StructureError(f"simulate: {name} = {shortened(value)}; expected {expected}")
        _known.add((type(value), name))
    _check_of(given.get("model"), given.get("start"))


def _check_of(model: object, start: object) -> None:
    """A linear model begins at its own equilibrium; whether a machine can be in another's is seen with all states."""
    if isinstance(start, Rest) and isinstance(model, LinearModel):
        raise StructureError(
            "simulate: start = a Rest; a linear model's state counts from where it was made and is zero there: leave "
            "start out to begin there, or give a State of what it is off from there, as model.displace makes it"
        )


def check_times(until: float, every: float | None, start: object) -> None:
    """Raise unless a run has an end that it can come to, and rows a spacing.

    Parameters
    ----------
    until : float
    every : float or None
    start : State, Rest, Checkpoint or None

    Raises
    ------
    StructureError
        For what is no time above zero, or an end before the start.
    """
    check_seconds(until, "until", "simulate")
    if every is not None:
        check_seconds(every, "every", "simulate", endless=True)
    if isinstance(start, Checkpoint) and until < start.t * (1.0 - 1e-9):
        raise StructureError(
            f"simulate: until = {until} s is before the checkpoint, which is at {start.t:.9g} s; give a later end"
        )


def check_rows(until: float, spacing: float | None, signals: int) -> None:
    """Raise where rows at even spacing would be more than any memory or file is for.

    Parameters
    ----------
    until : float
    spacing : float or None
    signals : int
        In each row, beside the time.

    Raises
    ------
    StructureError
        For more than 1e9 numbers.
    """
    if spacing is not None and (1 + signals) * until > _NUMBERS * spacing:
        rows = until / spacing
        raise StructureError(
            f"simulate: every = {spacing:g} s makes {rows:.3g} rows of {1 + signals} numbers until {until:g} s, "
            f"{8e-9 * rows * (1 + signals):.3g} GB; expected {_NUMBERS:g} numbers at most: give every = "
            f"{(1 + signals) * until / _NUMBERS:.1g} s or more, or leave it out for a row at every step"
        )


def events_of(given: Sequence[Event]) -> tuple[Event, ...]:
    """Return a list of events.

    Parameters
    ----------
    given : sequence of Event

    Returns
    -------
    tuple of Event

    Raises
    ------
    StructureError
        For what is no list of them, and for two of one name.
    """
    if isinstance(given, Event):
        raise StructureError(f"simulate: events = {given}; expected a list: events=[Event(…)]")
    found = listed(given, "simulate: events")
    for event in found:
        if not isinstance(event, Event):
            raise StructureError(f"simulate: events holds {shortened(event)}; expected Event('name', 'signal', at=…)")
    names = [event.name for event in found]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise StructureError(f"simulate: two events are named {twice!r}; what happens is told by name: name them apart")
    return tuple(found)
