"""A method whose runs tell how far they are off, also where small differences grow of themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Controlled, Integrator, Pace, Stepper
from flexctrl.errors import StructureError
from flexctrl.model.plant import Plant

__all__ = ["Checked", "Coarser", "Unchecked", "bare", "checked"]

_LOOSER = 27.0
"""Under such a tolerance steps of a method of second order are three times as long, and errors nine times as large."""


@dataclass(frozen=True)
class Coarser:
    """How a run beside another one is made.

    Attributes
    ----------
    method : Integrator
    tolerance : Tolerance
    longer : float
        By how much its steps are longer, where nothing else keeps them short.
    """

    method: Integrator
    tolerance: Tolerance
    longer: float


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
    """A method without the coarser run that tells how far it is off: see `Checked`.

    For runs by the hundred, as in a search for parameters, and for races.

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
    What would be noted is asked of a second run first, half as far away (in powers): its word counts.

    Nothing is run again for linear models and small motion, where samples keep nearly all steps short, and from a
    `Checkpoint`. A sampled law in Python is asked again as a copy of what it was before the run.

    Parameters
    ----------
    method : Integrator
        All are checked by themselves where differences may grow, unless they are `Unchecked`; this asks for it always.

    Raises
    ------
    StructureError
        For what is no method, or is wrapped already.
    """

    def coarser(self, tolerance: Tolerance, share: float = 1.0) -> Coarser:
        """Return how the run beside is to be made.

        Parameters
        ----------
        tolerance : Tolerance
            Of the run that is checked.
        share : float
            Of 1 it is as far from that as said above; less is nearer to it, in powers.

        Returns
        -------
        Coarser
        """
        if isinstance(self.pace, Controlled):
            looser = _LOOSER**share
            easier = Tolerance(looser * tolerance.relative, looser * tolerance.absolute)
            return Coarser(self.method, easier, looser ** (1.0 / self.pace.steepness))
        longer = 2.0**share
        return Coarser(_lengthened(self.method, longer), tolerance, longer)


def _lengthened(method: Any, longer: float) -> Any:
    """The method in longer steps, also where it is that of another one."""
    if hasattr(method, "method"):
        return replace(method, method=_lengthened(method.method, longer))
    return replace(method, step=longer * method.step)


def checked(method: Integrator) -> tuple[Integrator, Checked | None]:
    """Return a method by itself, and as it is checked; None where that is not wanted.

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
    return method, Checked(method)


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
