"""Steps of generalised alpha by compiled loops, with the plain ones behind them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha import steps as alpha_steps
from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.march.calling import Remembered
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher, can_march
from flexctrl.dynamics.march.record import DONE
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Counts, StepError
from flexctrl.frozen import frozen
from flexctrl.model.state import State

__all__ = ["MarchingStepper", "Memory", "plain_of"]


@frozen(eq=False)
class Memory:
    """The tangents in use: of the plain steps and of the march."""

    plain: alpha_steps.Tangent | None
    march: Remembered


def plain_of(stepper: Any) -> Any:
    """Return the plain steps of what may be marched.

    Parameters
    ----------
    stepper : Stepper

    Returns
    -------
    Stepper
    """
    return stepper.plain if isinstance(stepper, MarchingStepper) else stepper


@dataclass
class MarchingStepper:
    """A stepper whose steps are marched; what fails there is tried plainly.

    For models that `can_march`, without a continuous controller.

    Attributes
    ----------
    plain : Stepper
    """

    plain: alpha_steps.Stepper
    _here: AlphaPoint | None = None
    _made: int = 0

    @property
    def counts(self) -> Counts:
        """What the steps have cost so far."""
        return self.plain.counts

    @cached_property
    def marcher(self) -> Marcher:
        """The model on a march."""
        p = self.plain
        assert can_march(p.model)
        return Marcher.of(p.model, Method(p.coefficients, p.tolerance, p.weight, p.turning))

    def done(self) -> None:
        """Leave what steps need to another run; this one takes no more."""
        if "marcher" in self.__dict__:
            self.__dict__.pop("marcher").done()
            self._here = None

    def again(self) -> MarchingStepper:
        """Return another stepper of the same kind."""
        return type(self)(self.plain)

    @property
    def memory(self) -> Memory:
        """The tangents in use."""
        return Memory(self.plain.memory, self.marcher.remembered())

    def recall(self, memory: Memory) -> None:
        """Make the tangents of another stepper's memory again."""
        self.plain.recall(memory.plain)
        self.marcher.recall(memory.march)
        self._here = None

    def start(self, state: State, supply: Supply, step: float) -> AlphaPoint:
        """Return a state with the accelerations it has under its inputs.

        Raises
        ------
        SingularMatrixError
            If a freedom has neither mass nor stiffness.
        """
        zero = np.zeros(self.plain.model.n)
        self.enter(AlphaPoint(state, zero, supply, zero, zero))
        self.marcher.about_to(step)
        status = self.marcher.start(supply.u)
        if status != DONE:
            self._here = None
            return self.plain.start(state, supply, step)
        return self.leave(supply)

    def renew(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
        """Return a point under other inputs: the true accelerations jump; the method's own keep their lead on them.

        The point's rates are those of its state under its inputs: what changes them beside the inputs starts anew.
        """
        may_switch = self.marcher.contacts.count > 0
        self.enter(replace(point, trend=np.zeros_like(point.trend), lean=1.0) if may_switch else point)
        self.marcher.about_to(step)
        self.marcher.march.unsure = int(may_switch)
        status = self.marcher.jump(supply.u)
        self.marcher.march.unsure = 0
        if status == DONE:
            return self.leave(supply)
        self._here = None
        return self.plain.renew(point, supply, step)

    def leap(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint | None:
        """Return a point under other inputs as a ride does, whose contacts hold; None where one does not.

        Contacts that share what they bear are looked at where a single one could not bear it all.
        """
        contacts, switches = self.marcher.contacts, self.plain.model.switches
        for watched in (1, 0):
            self.enter(point)
            self.marcher.about_to(step)
            contacts.watched = watched * int(contacts.count > 0)
            status = self.marcher.jump(supply.u)
            contacts.watched = 0
            if status == DONE:
                return self.leave(supply)
            self._here = None
            if switches.phases(switches.under(point.state, supply.u)).tolist() != switches.phases(point.state).tolist():
                return None
        return None

    def exactly(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later, solved to the last digits.

        Raises
        ------
        StepError
            If Newton's method does not converge.
        """
        march = self.marcher.march
        march.exact = 1
        try:
            return self.step(point, h)
        finally:
            march.exact = 0

    def briefly(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later, solved to the last digits by the march alone.

        Raises
        ------
        StepError
            If that does not converge.
        """
        march = self.marcher.march
        march.exact = 1
        try:
            after = self._marched(point, h)
        finally:
            march.exact = 0
        if after is None:
            raise StepError(self.counts.worst, f"the march ends nowhere {h:.3g} s after t = {point.state.t:.6g} s")
        return after

    def step(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later.

        Raises
        ------
        StepError
            If Newton's method does not converge, even with a fresh tangent.
        """
        return self._marched(point, h) or self.plain.step(point, h)

    def _marched(self, point: AlphaPoint, h: float) -> AlphaPoint | None:
        """The point a step later; None where the march does not end there."""
        self.enter(point)
        done = self.marcher.fixed(h, 1) == DONE
        self.count()
        return self.leave(self._supplied(point)) if done else None

    def _supplied(self, point: AlphaPoint) -> Supply:
        """What is fed where the march stands."""
        return point.supply

    def error(self, before: AlphaPoint, after: AlphaPoint, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the local error of the step just taken over what is allowed."""
        return self.plain.error(before, after, h, moved, tolerance)

    def within(self, point: AlphaPoint, h: float) -> np.ndarray:
        """Return how far outputs may go to and fro within steps of a length beside what their ends show."""
        return np.zeros(len(self.plain.model.outputs))

    def enter(self, point: AlphaPoint) -> None:
        """Put the march at a point, unless it is there."""
        if point is not self._here:
            self.marcher.entered(point)
            self._here = point

    def leave(self, supply: Supply) -> AlphaPoint:
        """Return where the march stands."""
        self._here = point = self.marcher.point(supply)
        return point

    def count(self) -> None:
        """Take over what the march has counted."""
        m, counts = self.marcher.march, self.counts
        counts.newton += m.newton
        counts.factorisations += m.factorisations - self._made
        counts.worst = self.marcher.worst()
        m.newton, self._made = 0, m.factorisations
