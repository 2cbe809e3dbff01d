"""What can go wrong, by name, each with its remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

__all__ = [
    "ChartError",
    "ControllerError",
    "DesignError",
    "EquilibriumError",
    "FlexctrlError",
    "KernelError",
    "LinearizationError",
    "MechanismError",
    "MissingExtraError",
    "ReductionError",
    "SceneError",
    "SingularMatrixError",
    "StructureError",
    "check_kind",
    "did_you_mean",
    "shortened",
]

_MOST_NAMES = 20


class FlexctrlError(Exception):
    """Base of every error flexctrl raises on purpose."""


class StructureError(FlexctrlError, ValueError):
    """A part, joint, drive or signal that cannot be: names the part, the value and the remedy."""


class SceneError(FlexctrlError, ValueError):
    """A scene file that cannot be read: names the table and key, and what was expected there."""


class MechanismError(FlexctrlError):
    """A freedom with neither mass nor stiffness, by node and freedom name."""


class EquilibriumError(FlexctrlError, RuntimeError):
    """No equilibrium was found: residual, worst freedom by name, what to try.

    Attributes
    ----------
    state : object
        The best state reached, so that nothing computed is lost (``None`` if the search never started).
    residual : float
        Relative residual of that state.
    """

    def __init__(self, message: str, state: object = None, residual: float = float("inf")) -> None:
        super().__init__(message)
        self.state = state
        self.residual = residual


class LinearizationError(FlexctrlError, RuntimeError):
    """A linear model that fails its own certificate is refused with the reason."""


class ReductionError(FlexctrlError, ValueError):
    """A reduction that was asked for more than it can give."""


class ControllerError(FlexctrlError, ValueError):
    """A controller, wrapper or signal that cannot be: names it, what was expected and the remedy.

    Attributes
    ----------
    asked : float or None
        When a run had asked it what it said then [s].
    """

    asked: float | None = None


class DesignError(FlexctrlError, RuntimeError):
    """A design that fails its own check: says which mode or equation, and what to change."""


class KernelError(FlexctrlError, ValueError):
    """A kernel, index table or vector of the wrong shape, type or range; says which and what was expected."""


class ChartError(FlexctrlError, ArithmeticError):
    """A shape too far from the reference for coordinates that start there."""


class SingularMatrixError(FlexctrlError, ArithmeticError):
    """A matrix that cannot be factorised.

    Attributes
    ----------
    where : int
        The row of its zero pivot.
    """

    def __init__(self, where: int) -> None:
        super().__init__(f"the matrix is singular at row {where}")
        self.where = where


class MissingExtraError(FlexctrlError, ImportError):
    """A feature whose optional dependency is not installed; says which extra brings it."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the closest known name, or a list of known ones.

    Parameters
    ----------
    name : str
        The name that was not found.
    known : iterable of str
        The names that exist.

    Returns
    -------
    str
        A phrase to append to an error message; empty if nothing is known.
    """
    names = [str(k) for k in known]
    word, lowered = str(name).lower(), {k.lower(): k for k in reversed(names)}
    close = difflib.get_close_matches(word, lowered, n=1)
    within = [k for k in lowered if word in k]
    if close or len(within) == 1:
        return f"; did you mean {lowered[(close or within)[0]]!r}?"
    more = f" … ({len(names)} in all)" if len(names) > _MOST_NAMES else ""
    return f"; known: {', '.join(names[:_MOST_NAMES])}{more}" if names else ""


def check_kind(
    value: object, kinds: Any, what: str, expected: str, error: type[FlexctrlError] = StructureError
) -> None:
    """Raise unless a value is of a kind.

    Parameters
    ----------
    value : object
    kinds : type, tuple or union of types
    what : str
        Whose value it is, as ``"lqr: plant"``.
    expected : str
        What is to be given instead.
    error : type
        What is raised.

    Raises
    ------
    FlexctrlError
        Of the type given.
    """
    if not isinstance(value, kinds):
        raise error(f"{what} = {shortened(value)}; expected {expected}")


def shortened(value: object) -> str:
    """Return how a value is written, cut off where that grows long, to be shown in an error message.

    Parameters
    ----------
    value : object

    Returns
    -------
    str
        At most 80 characters, on one line.
    """
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}…"
