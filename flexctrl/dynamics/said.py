"""What controllers say in a run, and what is said of them where that is nothing to go on from."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.errors import ControllerError, shortened
from flexctrl.kernels.kernel import FLOAT

__all__ = ["FAULTS", "CommandError", "blamed", "reals", "state_of"]

FAULTS = (Exception, SystemExit)
"""What a law, an event or ``progress`` may raise to end a run that keeps what it has: by `sys.exit`, too."""

_TEXTS = "SU"
"""Kinds of numpy's types that it would read numbers out of."""


class CommandError(ControllerError):
    """A controller says what is no finite number, or raises an exception: that is its cause."""


def blamed(error: Exception | SystemExit, t: float) -> ControllerError:
    """Return what a run says of an exception in a controller.

    Parameters
    ----------
    error : Exception or SystemExit
    t : float
        When the controller was asked [s].

    Returns
    -------
    ControllerError
    """
    found = error if isinstance(error, ControllerError) else None
    if found is None:
        found = CommandError(f"the controller raised {type(error).__name__}: {error}")
        found.__cause__ = error
    found.asked = t
    return found


def reals(values: Any, what: str) -> np.ndarray:
    """Return what a controller answers as real numbers.

    Parameters
    ----------
    values : array_like
    what : str
        What it is, as in "the controller's command".

    Returns
    -------
    numpy.ndarray

    Raises
    ------
    CommandError
        For complex ones, and for a text.
    """
    found = np.asarray(values)
    if found.dtype.kind in _TEXTS:
        raise CommandError(f"the controller's {what} is {shortened(values)}, a text; give real numbers")
    if found.dtype.kind == "c":
        raise CommandError(f"the controller's {what} is complex: {shortened(values)}; give real numbers, by numpy.real")
    return np.asarray(found, dtype=float)


def state_of(controller: Controller, values: Any, what: str, count: int | None = None) -> np.ndarray:
    """Return what a controller says of its state, as finite real numbers.

    Parameters
    ----------
    controller : Controller
    values : array_like
        What it said.
    what : str
        As what: "initial state", "update" or "rate".
    count : int, optional
        How many numbers its state has; as many as are given, at the start.

    Returns
    -------
    numpy.ndarray, shape (count,)

    Raises
    ------
    CommandError
        For anything else.
    """
    good = type(values) is np.ndarray and values.dtype is FLOAT and values.ndim == 1 and len(values) == count
    if good and math.isfinite(sum(values.tolist())):
        return values
    given = values.item() if isinstance(values, np.ndarray) and values.size == 1 else values
    if given is None:
        raise _unlike(controller, what, "None", count, " (a missing return?)")
    try:
        if np.asarray(values).dtype.kind in _TEXTS:
            raise TypeError("a text")
        found = reals(values, what).ravel()
    except (TypeError, ValueError) as error:
        if isinstance(error, CommandError):
            raise
        raise _unlike(controller, what, shortened(values), count, "") from error
    if count is not None and found.size != count:
        raise _unlike(controller, what, f"{shortened(values)}, {found.size} values", count, "")
    if not np.isfinite(found).all():
        raise _unlike(controller, what, shortened(values), count, ": look at what it divides by")
    return found


def _unlike(controller: Any, what: str, given: str, count: int | None, hint: str) -> CommandError:
    wanted = f"a finite number for each of the {count} that its initial state has"
    wanted = wanted if count is not None else "a list of finite numbers, an empty one for a law without states"
    return CommandError(f"controller {_called(controller)}: its {what} is {given}; expected {wanted}{hint}")


def _called(controller: Any) -> str:
    """Return what a controller is called: its class, and those of what it wraps."""
    own = getattr(controller, "inner", controller)
    inside = getattr(own, "controller", None)
    return f"{type(own).__name__} of {_called(inside)}" if inside is not None else type(own).__name__
