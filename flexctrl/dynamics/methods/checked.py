"""A method whose runs tell how far they are off, also where small differences grow of themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Controlled, Integrator, Pace, Stepper
from flexctrl.errors import StructureError
from flexctrl.model.plant import Plant

__all__ = ["Checked", "Unchecked", "bare", "checked"]

_LOOSER = 27.0
"""Under such a tolerance steps of a method of second order are three times as long, and errors nine times as large."""


@dataclass(frozen=True)
class _Wrapped:
    """A method by another name: its steps are those of the one inside."""

    method: Integrator

    def __post_init__(self) -> None:
        if not isinstance(self.method, Integrator) or isinstance(self.method, _Wrapped | type):
            what = type(self).__name__
            raise StructureError(f"{what}: {self.method!r}; give a method by itself, as {what}(AdaptiveAlpha())")

    @property
    def order(self) -> int:
        return self.method.order

    @property
    def symmetric(self) -> bool:
        return self.method.symmetric

    @property
    def damping(self) -> str:
        return self.method.damping

    @property
    def pace(self) -> Pace:
        return self.method.pace

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> Stepper[Any]:
        """Return the steps of the method inside."""
        return self.method.stepper(model, feed, tolerance)


@dataclass(frozen=True)
class Unchecked(_Wrapped):
    """A method that chooses its steps, without the coarser run that tells how far it is off: see `Checked`.

    For runs by the hundred, as in a search for parameters.

    Parameters
    ----------
    method : Integrator

    Raises
    ------
    StructureError
        For what is no method, or is wrapped already.
    """


@dataclass(frozen=True)
class Checked(_Wrapped):
    """A method whose runs are laid beside coarser ones, which tell how far they are off.

    What errors of steps add up to (the report's ``drift``) says nothing of what grows of itself, as in a double
    pendulum that goes over. Where a machine has swung by more than a quarter of a radian, gone farther than a
    fiftieth of its size, met corners of its laws of force or followed a continuous law, and wherever this is asked
    for, it is therefore run once more, under 27 times the tolerance (a third of the steps for `AdaptiveAlpha`) or
    in steps of twice the length. Of what the two are apart, a method of order p leaves 1/(rᵖ − 1) where steps are r
    times as long. It stands in ``report.error``; above 3 % a note says so, and until when the run is right to that.

    Nothing is run again where a sampled law is asked in Python (it may remember what it was asked), for linear
    models and small motion, and from a `Checkpoint`.

    Parameters
    ----------
    method : Integrator
        Of fixed steps; methods that choose their steps are checked by themselves, unless they are `Unchecked`.

    Raises
    ------
    StructureError
        For what is no method, or is wrapped already.
    """

    @property
    def longer(self) -> float:
        """By how much steps of the coarser run are longer, where nothing else keeps them short."""
        return _LOOSER ** (1.0 / self.pace.steepness) if isinstance(self.pace, Controlled) else 2.0

    def coarser(self, tolerance: Tolerance) -> tuple[Integrator, Tolerance]:
        """Return the method and the tolerance of the run beside.

        Parameters
        ----------
        tolerance : Tolerance
            Of the run that is checked.

        Returns
        -------
        Integrator, Tolerance
        """
        if isinstance(self.pace, Controlled):
            return self.method, Tolerance(_LOOSER * tolerance.relative, _LOOSER * tolerance.absolute)
        return _doubled(self.method), tolerance


def _doubled(method: Any) -> Any:
    """The method in steps of twice the length, also where it is that of another one."""
    if hasattr(method, "method"):
        return replace(method, method=_doubled(method.method))
    return replace(method, step=2.0 * method.step)


def checked(method: Integrator) -> tuple[Integrator, Checked | None]:
    """Return a method by itself, and as it is checked; None where it is not.

    Parameters
    ----------
    method : Integrator

    Returns
    -------
    Integrator, Checked or None
    """
    if isinstance(method, Checked):
        return method.method, method
    if isinstance(method, Unchecked):
        return method.method, None
    return method, Checked(method) if isinstance(method.pace, Controlled) else None


def bare(method: Integrator) -> Integrator:
    """Return a method by itself: studies have references of their own.

    Parameters
    ----------
    method : Integrator

    Returns
    -------
    Integrator
    """
    return checked(method)[0]
