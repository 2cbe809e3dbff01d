"""A method whose runs tell how far they are off, also where small differences grow of themselves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import is_dataclass, replace
from typing import Any

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Controlled, Fixed, Integrator, Pace, Stepper
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant

__all__ = ["Beside", "Checked", "Unchecked", "bare", "checked"]

_FINER = "in steps {share:g} times as long"
_LOOSER = 27.0
"""Under such a tolerance steps of a method of second order are three times as long, and errors nine times as large."""


@frozen
class Beside:
    """How a run beside another one is made.

    Attributes
    ----------
    method : Integrator
    tolerance : Tolerance
    longer : float
        By how much its steps are longer, where nothing else keeps them short.
    said : str
        In which steps it is made.
    """

    method: Integrator
    tolerance: Tolerance
    longer: float
    said: str


@frozen
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


@frozen
class Unchecked(_Wrapped):
    """A method without the coarser run that tells how far it is off: see `Checked`.

    For runs by the hundred, as in a search for parameters, and for races. Nor is it told whether a sampled loop grows
    as its steps do not see.

    Parameters
    ----------
    method : Integrator

    Raises
    ------
    StructureError
        For what is no method, or is wrapped already.
    """


@frozen
class Checked(_Wrapped):
    """A method whose runs are laid beside coarser ones, which tell how far they are off.

    What errors of steps add up to (the report's ``drift``) says nothing of what grows of itself, as in a double
    pendulum that goes over. Where a machine has swung by more than a quarter of a radian, gone farther than a
    fiftieth of its size, met corners of its laws of force or followed a continuous law, where forces or rates are
    among its outputs, of which errors of steps tell nothing, and wherever this is asked for, it is therefore run once
    more, under 27 times the tolerance (a third of the steps for `AdaptiveAlpha`) or in steps of twice the length, or
    of half of it past corners and where knots of commands or the end of the run would cut steps of twice the length to
    more than 0.6 of their number. Of what the two are apart, a method of order p leaves
    1/(rᵖ − 1) where steps are r times as long. It stands in ``report.error``; above 3 % a note says so, and
    until when the run is right to that. What would be noted is asked of a second run first, half as far away (in
    powers): its word counts. Where they tell little, a note says whether a third one, under 243 times the
    tolerance, goes elsewhere: two may be off alike, and one in half the steps tells by how much. Where two runs beside
    stand, p is the order that they show, at most that of the method: what rattles goes by no power of its steps. A run
    that has met four corners and more, and of which 0.1 % or more is told, is laid beside a finer one too, in half the
    steps; so is one under a continuous law that jumps, or to which the second run is nearer than a power of its steps
    would have it, if nothing is noted. What that tells counts if it is more. Where the first takes more than 0.7 of the
    steps (half of them under a sampled law, 0.4 where knots keep steps short), a finer one is all that follows; of
    machines with bristles it is all there is.

    Where nothing of that is told, and dry contacts stick or break loose that slide with less than it takes to break
    them loose, it is run in the same steps with contacts that bear 5 % more (if one has broken loose), and 5 % less: a
    note says which contact it hangs on if such a run is a fifth of the motion away, of the machine's or of an output's
    own. All runs in other steps may be wrong alike there. So may those of a drive that meets its play eight times and
    more by a shaft whose vibration steps do not see: it is run once more by a method that damps that (ρ = 0). What this
    tells of outputs counts if it is more, and a note says by what they bounce.

    Steps of one length are checked where it has gone so far twelve times, to and fro. Where forces or rates are
    then a hundredth of their range apart, one in half the steps tells of these; what has met four corners is
    confirmed by one in a quarter of the steps, as what is told past corners comes from one in half. Where samples
    keep nearly all steps short the other run is a finer one, in half the steps, for what has turned so, for
    corners, for forces and rates, and for laws that meet limits; in a quarter of the steps for laws that jump by
    half a percent of what they say, and twice more under a law that misreads by as much as it is off, if nothing is
    told. Of linear models, and of what `Exact` takes steps of, a run in half the steps is made under continuous
    laws that are not linear, which `Exact` interpolates; of others nothing is run again. A sampled law in Python is
    asked again as a copy of what it was before the run; what goes on from a `Checkpoint` is laid beside what goes
    on from where the run beside stood.

    Parameters
    ----------
    method : Integrator
        All are checked by themselves where differences may grow, unless they are `Unchecked`; this asks for it always.

    Raises
    ------
    StructureError
        For what is no method, or is wrapped already; for one of fixed steps of your own that has no field ``step``.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.pace, Fixed) and not _changeable(self.method):
            raise StructureError(f"Checked: {self.method!r} has no field `step` to be changed: take Unchecked of it")

    def coarser(self, tolerance: Tolerance, share: float = 1.0) -> Beside:
        """Return how the run beside is to be made.

        Parameters
        ----------
        tolerance : Tolerance
            Of the run that is checked.
        share : float
            Of 1 it is as far from that as said above; less is nearer to it, in powers.

        Returns
        -------
        Beside
        """
        if isinstance(self.pace, Controlled):
            looser = _LOOSER**share
            easier = Tolerance(looser * tolerance.relative, looser * tolerance.absolute)
            said = f"under {looser:.3g} times the tolerance"
            return Beside(self.method, easier, looser ** (1.0 / self.pace.steepness), said)
        longer, said = 2.0**share, f"in steps {2.0**share:.2g} times as long"
        return Beside(_stepping(self.method, lambda step: longer * step), tolerance, longer, said)

    def finer(self, tolerance: Tolerance, usual: float, share: float) -> Beside:
        """Return how a run is made whose steps are shorter, also those that something keeps short.

        Parameters
        ----------
        tolerance : Tolerance
        usual : float
            How long steps are that are kept short [s]; 0 where none are.
        share : float
            How long they are, of what they were.

        Returns
        -------
        Beside
        """
        if not _changeable(self.method):
            return self.coarser(tolerance)
        if isinstance(self.pace, Fixed):
            less = share * (usual or self.pace.step) / self.pace.step
            return Beside(
                _stepping(self.method, lambda step: less * step), tolerance, share, _FINER.format(share=share)
            )
        shortened = _stepping(self.method, lambda step: share * min(step, usual or math.inf))
        tight = share**self.pace.steepness if isinstance(self.pace, Controlled) else 1.0
        asked = Tolerance(tight * tolerance.relative, tight * tolerance.absolute)
        return Beside(shortened, asked, share, _FINER.format(share=share))


def _changeable(method: Any) -> bool:
    """Whether the length of a method's steps, or of its longest, can be changed: one's own may not say it."""
    inner = getattr(method, "method", method)
    return is_dataclass(inner) and hasattr(inner, _named(inner))


def _named(method: Any) -> str:
    return "step" if isinstance(method.pace, Fixed) else "largest_step"


def _stepping(method: Any, change: Callable[[float], float]) -> Any:
    """The method in steps of another length, also where it is that of another one."""
    if hasattr(method, "method"):
        return replace(method, method=_stepping(method.method, change))
    return replace(method, **{_named(method): change(getattr(method, _named(method)))})


def checked(method: Integrator) -> tuple[Integrator, Checked | None]:
    """Return a method by itself, and as it is checked; None where that is not wanted, or cannot be.

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
    known = isinstance(method.pace, Controlled) or _changeable(method)
    return method, Checked(method) if known else None


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
