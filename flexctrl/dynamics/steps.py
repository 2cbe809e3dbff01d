"""What a run asks of a method of integration: a value that makes steps, one after another.

A `Integrator` is a frozen value (`GeneralizedAlpha`, …). It makes a `Stepper` for a model and what feeds it;
the stepper goes from `Point` to `Point`. How long steps are is the method's `pace`; rejecting, halving and
stopping at samples, breaks and events is the run's business, the same for all methods.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.run import Tolerance
from flexctrl.errors import FlexctrlError, SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.model.state import State
from flexctrl.model.units import force_unit
from flexctrl.structure.freedoms import check_seconds

__all__ = [
    "MOST_STEPS",
    "Brief",
    "Controlled",
    "Counts",
    "Exact",
    "Fixed",
    "Integrator",
    "Joining",
    "Judging",
    "Mark",
    "Pace",
    "Parting",
    "Point",
    "Reusable",
    "StepError",
    "Stepper",
    "Twofold",
    "check_step",
    "failed_step",
    "singular_tangent",
    "unsolved",
]


@frozen
class Point:
    """A state, its accelerations, and what feeds it; methods that remember more extend it."""

    state: State
    rate: np.ndarray
    supply: Supply

    @property
    def firm(self) -> Point:
        """Where a run sets out anew from: nothing here is extrapolated."""
        return self


@dataclass
class Counts:
    """What the steps cost; ``worst`` is the degree of freedom that converged last."""

    newton: int = 0
    factorisations: int = 0
    worst: int = 0

    def take(self, other: Counts) -> None:
        """Go on counting from others."""
        self.newton, self.factorisations, self.worst = other.newton, other.factorisations, other.worst


@dataclass
class Mark:
    """Where a run stands among its steps.

    Attributes
    ----------
    size : float
        Next step [s].
    left : int
        Steps of that size left to the next stop; 0: none planned; −1: no stop ahead.
    steps, rejected : int
        So far.
    stuck : int
        Switches in a row that came at once.
    follow : int
        Steps still to be taken no longer than ``cap`` [s]: an impact is followed.
    led : float
        The step [s] that the method's own accelerations were made for at a corner; 0 once it has been taken.
    taken : float
        Of steps of one length, the last [s], or the one that accelerations were made for since; 0 before the first.
    doubts, plain : int
        How often in a row a law in Python has left no step to compiled loops; how many steps there are to be in all
        before they try again.
    swings : tuple of float
        By how much a law has changed with time alone within a step, at most, and its states' rates; empty if not asked.
    """

    size: float
    left: int = 0
    steps: int = 0
    rejected: int = 0
    stuck: int = 0
    follow: int = 0
    cap: float = 0.0
    led: float = 0.0
    taken: float = 0.0
    doubts: int = 0
    plain: int = 0
    swings: tuple[float, ...] = ()


class StepError(ArithmeticError):
    """A step that did not converge; ``worst`` is its worst degree of freedom."""

    def __init__(self, worst: int, reason: str) -> None:
        super().__init__(reason)
        self.worst = worst


def failed_step(error: Exception, worst: int, t: float) -> StepError:
    """Return the failure of a step that an error of arithmetic is: motion that diverges breaks any solver.

    Parameters
    ----------
    error : ArithmeticError or ValueError
        As it was raised; what is no error of arithmetic (a controller's, an event's) is raised again.
    worst : int
        The degree of freedom to name, unless the error knows better.
    t : float
        Where the run stands [s].

    Returns
    -------
    StepError
    """
    if isinstance(error, StepError):
        return error
    if isinstance(error, FlexctrlError) and not isinstance(error, ArithmeticError):
        raise error
    if isinstance(error, SingularMatrixError):
        why = "nothing holds a freedom there, or its numbers are beyond all bounds"
        return StepError(error.where, f"{error} at t = {t:.6g} s: {why}")
    return StepError(worst, f"the numbers fail at t = {t:.6g} s ({type(error).__name__}: {error})")


def singular_tangent(error: SingularMatrixError, t: float, h: float) -> StepError:
    """Return the failure of an implicit step to a time whose tangent is singular [s]."""
    remedy = "look at the loads and commands there, and whether the tolerance is one that numbers can meet"
    return StepError(error.where, f"the tangent is singular at t = {t:.6g} s with a step of {h:.3g} s; {remedy}")


def unsolved(name: str, worst: int, left: float, t: float, h: float) -> StepError:
    """Return the failure of an implicit step that Newton's method did not solve.

    Parameters
    ----------
    name : str
        Of the worst freedom.
    worst : int
        Its number.
    left : float
        What is left of the balance of forces on it [N or N m].
    t, h : float
        Where the step was to end, and its length [s].

    Returns
    -------
    StepError
    """
    off = f"{abs(left):.3g}{force_unit(name)}" if math.isfinite(left) else "more than all numbers"
    why = f"Newton's method did not converge at t = {t:.6g} s with a step of {h:.3g} s"
    return StepError(worst, f"{why}: forces on {name} are out of balance by {off}")


@frozen
class Fixed:
    """Steps of one length [s], shortened a little so that a whole number of them ends at a sample or break."""

    step: float

    def between(self, sample: float) -> float:
        """Return how long steps are between samples, or until the next stop.

        Parameters
        ----------
        sample : float
            Time between two, or until then [s]; 0 where there are none.

        Returns
        -------
        float
            [s]
        """
        return sample / max(1, math.ceil(sample / self.step - 1e-6)) if sample > 0.0 else self.step


@frozen
class Controlled:
    """Steps chosen from the estimated error.

    Attributes
    ----------
    first : float or None
        Length of the first step [s]; None: told by how the machine sets out.
    largest : float
        Length of the largest step [s].
    steepness : int
        Power of the step with which the estimated error grows.
    most : float
        Steps that a run may take; one that is seen to need more ends.
    """

    first: float | None
    largest: float
    steepness: int
    most: float = math.inf


MOST_STEPS = 1e8
"""Hours of steps: what needs more is more likely a mistake than meant."""

Pace = Fixed | Controlled
P = TypeVar("P", bound=Point)


class Stepper(Protocol[P]):
    """Steps of one model under one feed.

    Attributes
    ----------
    counts : Counts
        What the steps have cost so far; the run reports them.
    memory : object
        What later steps depend on beside the point they start from (which tangent is in use, not its values): a
        frozen dataclass, tuple, array or number. After ``recall(memory)`` another stepper of the same method
        goes on with the same bits.
    """

    counts: Counts
    memory: Any

    def recall(self, memory: Any) -> None:
        """Go on as the stepper whose memory this is."""

    def start(self, state: State, supply: Supply, step: float) -> P:
        """Return a state with the accelerations it has under its inputs; ``step`` is about to be taken.

        Raises
        ------
        SingularMatrixError
            If a freedom has neither mass nor stiffness.
        """

    def renew(self, point: P, supply: Supply, step: float) -> P:
        """Return the point under other inputs, which jump here; ``step`` is about to be taken."""

    def step(self, point: P, h: float) -> P:
        """Return the point a step later.

        Raises
        ------
        StepError
            If it does not converge.
        """

    def error(self, before: P, after: P, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the local error of the step just taken over what is allowed.

        ``h`` is its length, which times differ by but for round-off; ``moved`` is the reach so far (n,).
        """


@runtime_checkable
class Judging(Stepper[P], Protocol[P]):
    """A stepper that tells the local error of its steps by degrees of freedom."""

    def missed(self, before: P, after: P) -> np.ndarray:
        """Return by how much a step is beyond where it should be, shape (n,)."""

    def remains(self, share: np.ndarray) -> np.ndarray:
        """Return what a run is off by whose local errors add up to such shares of the motion."""


@runtime_checkable
class Parting(Protocol):
    """A stepper of two runs side by side.

    Attributes
    ----------
    parted : numpy.ndarray, shape (n,)
        How far they have been apart at most, where that was looked at.
    """

    parted: np.ndarray


@runtime_checkable
class Joining(Stepper[P], Protocol[P]):
    """A stepper that sets out anew at corners of laws of force, and where steps grow by far."""

    def join(self, point: P, supply: Supply, step: float) -> P:
        """Return the point with all runs in its state, under other inputs; ``step`` is about to be taken."""

    def lengthen(self, point: P, step: float) -> P:
        """Return the point before a step many times longer than the last."""


@runtime_checkable
class Exact(Stepper[P], Protocol[P]):
    """A stepper that can solve its steps more exactly than errors of the method ask for."""

    def exactly(self, point: P, h: float) -> P:
        """Return the point a step later, solved to the last digits.

        Raises
        ------
        StepError
            If it does not converge.
        """


@runtime_checkable
class Brief(Exact[P], Protocol[P]):
    """A stepper whose steps a march takes where it can."""

    def briefly(self, point: P, h: float) -> P:
        """Return the point a step later, solved to the last digits by the march alone.

        Raises
        ------
        StepError
            If that does not converge.
        """


@runtime_checkable
class Twofold(Protocol[P]):
    """A stepper whose points hold those of several runs."""

    def fed(self, point: P, supply: Supply) -> P:
        """Return the point with other states or rates of its law, in all runs; its inputs do not jump."""


@runtime_checkable
class Reusable(Protocol):
    """A stepper whose workspace another run can use."""

    def done(self) -> None:
        """Leave it; no more steps are taken."""


@runtime_checkable
class Integrator(Protocol):
    """A method of integration, as a frozen value.

    Attributes
    ----------
    order : int
        Of the global error of places and rates.
    symmetric : bool
        Whether the same steps lead back in time: errors then go with even powers of the step.
    damping : str
        What the method itself damps, in words for the report.
    pace : Fixed or Controlled
    """

    @property
    def order(self) -> int: ...

    @property
    def symmetric(self) -> bool: ...

    @property
    def damping(self) -> str: ...

    @property
    def pace(self) -> Pace: ...

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> Stepper[Any]:
        """Return the steps of a model under a feed.

        Parameters
        ----------
        model : Plant
        feed : Feed
            Where the inputs come from.
        tolerance : Tolerance
            For methods that control their error, and for how well implicit ones solve their steps.

        Returns
        -------
        Stepper
        """


def check_step(step: float, owner: str) -> None:
    """Raise StructureError for a step that is no number of seconds above zero."""
    check_seconds(step, "step", owner)
