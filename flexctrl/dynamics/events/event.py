"""Events: instants at which a function of the signals crosses zero, found between the steps."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from enum import Enum

import numpy as np

from flexctrl.dynamics.said import FAULTS
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_finite

__all__ = ["CLOCK", "NO_CLOCK", "Direction", "Event", "EventError", "Occurrence"]


_WRITTEN = 'lambda y: y["angle"] - 0.5'


CLOCK = ("t", "time", "clock")
NO_CLOCK = "; the time is no signal: until=… ends a run at one, and run.at(t) tells what is there"
"""Names by which the time is asked for, and what to do instead."""


class EventError(StructureError):
    """The function of an event raises, or gives what is no finite number."""


class Direction(Enum):
    """Which way a value must go through zero to count."""

    RISING = 1
    FALLING = -1
    EITHER = 0


@frozen
class Event:
    """Something to look for during a run: a signal, or a function of signals, reaches a value.

    Parameters
    ----------
    name : str
        What to call it in ``run.events``.
    of : str or callable
        An output or input of the model, or a function of a mapping of all of them (name → value) to a number that is
        continuous in time. The time is none of them: ``until`` ends a run.
    at : float
        The value to be reached.
    direction : Direction
        Which way.
    terminal : bool
        Whether the run ends there, with `Status.STOPPED`.

    Raises
    ------
    StructureError
        For a value that is no finite number, and what is no direction, signal or function of one argument.

    Notes
    -----
    Within a step the motion is known at all times (the method's own polynomial, or a cubic). It is looked at closely
    wherever something may happen: in four places of a step at least (eight for `ExplicitRungeKutta` and `Exact`), so
    densely that no node turns by more than half a radian between two, at all rows that ``every`` asks for, and where
    the parabola through three such values bends to zero. What a run's rows show to have crossed is found so, and what
    crosses and comes back where it shows in such a parabola. Steps in which signals stay clear of their values, by
    twice what they bend (and, of `Exact`, by twice what vibrations move them that turn by more than half a radian in a
    step), are not looked at closely. What crosses twice between two places and bends otherwise goes
    unseen (a function with a kink or a narrow peak); take shorter steps for that. What only touches the value counts
    where it does so just as an input jumps (a speed that comes to zero at the end of a braking torque). What is at its
    value when a run begins has not reached it: that is not told.
    """

    name: str
    of: str | Callable[[Mapping[str, float]], float]
    at: float = 0.0
    direction: Direction = Direction.EITHER
    terminal: bool = False

    def __post_init__(self) -> None:
        owner = f"event {self.name!r}"
        if not isinstance(self.name, str) or not self.name.strip():
            raise StructureError(f"{owner}: expected a name, a text that is not empty: what happens is told by it")
        if not isinstance(self.of, str) and not callable(self.of):
            raise StructureError(f"{owner}: of = {self.of!r}; expected the name of a signal or a function of signals")
        if not isinstance(self.of, str) and not _takes_one(self.of):
            raise StructureError(
                f"{owner}: its function is called with one argument, a mapping of all signals by name; write {_WRITTEN}"
            )
        check_finite(self.at, "at", owner)
        if not isinstance(self.direction, Direction):
            choices = ", ".join(f"Direction.{d.name}" for d in Direction)
            raise StructureError(f"{owner}: direction = {self.direction!r}; expected one of {choices}")

    @property
    def told(self) -> str:
        """What is looked for, in words: of a function, that it is one; not whether the run ends there."""
        of = self.of if isinstance(self.of, str) else "a function"
        way = "" if self.direction is Direction.EITHER else f" {self.direction.name.lower()}"
        return f"{self.name!r}: {of}{way} through {float(self.at)!r}"

    def value(self, signals: Mapping[str, float]) -> float:
        """Return how far it is from happening.

        Parameters
        ----------
        signals : mapping of str to float
            All outputs and inputs.

        Returns
        -------
        float

        Raises
        ------
        EventError
            If its function raises, or gives no finite number: none is a truth value, or a text.
        """
        if isinstance(self.of, str):
            return signals[self.of] - self.at
        try:
            given = self.of(signals)
            found = math.nan if _is_answer(given) else float(given)
        except FAULTS as error:
            hint = NO_CLOCK if isinstance(error, KeyError) and str(error).strip("'") in CLOCK else ""
            raise EventError(
                f"event {self.name!r}: its function raised {type(error).__name__}: {error}{hint}"
            ) from error
        if _is_answer(given):
            raise EventError(
                f"event {self.name!r}: its function gives {given!r}; expected a number that goes through {self.at:g} "
                f"where it happens: write {_WRITTEN}"
            )
        if not math.isfinite(found):
            raise EventError(f"event {self.name!r}: its function gives {found}; expected a finite number at all times")
        return found - self.at


@frozen
class Occurrence:
    """An event that happened.

    Attributes
    ----------
    name : str
    t : float
        When [s].
    rising : bool
        Which way the value went. Of dry friction: True where a contact slides from then on (it breaks loose, or its
        slip turns back at once), False where it sticks.
    signals : mapping of str to float
        Outputs and inputs at that instant.
    """

    name: str
    t: float
    rising: bool
    signals: Mapping[str, float]


def _takes_one(function: Callable[..., object]) -> bool:
    """Whether a function can be called with one argument, as far as Python tells."""
    try:
        inspect.signature(function, follow_wrapped=False).bind(None)
    except TypeError:
        return False
    except ValueError:  # it has no signature: what was compiled need not have one
        return True
    return True


def _is_answer(given: object) -> bool:
    """Whether something is a truth value or a text, which Python would take for a number."""
    return np.asarray(given).dtype.kind in "bSU"
