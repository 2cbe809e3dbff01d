"""A model through time, open or closed loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha import AdaptiveAlpha
from flexctrl.dynamics.books import Books
from flexctrl.dynamics.feed import Feed, feed_of
from flexctrl.dynamics.run import Report, Run, Status, Tolerance
from flexctrl.dynamics.steps import Controlled, Fixed, Integrator, Marching, Point, StepError
from flexctrl.errors import MechanismError, SingularMatrixError, StructureError
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.model.motion import State

_FRAMES = 120
_SMALLEST = 1e-12
_BLOCK = 1000


def simulate(
    model: Model,
    controller: Any = None,
    *,
    until: float,
    start: State | Rest | None = None,
    inputs: Mapping[str, float] | None = None,
    method: Integrator | None = None,
    tolerance: Tolerance | None = None,
    every: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run a model through time.

    Parameters
    ----------
    model : Model
    controller : Controller, control.StateSpace or control.TransferFunction, optional
        Connected by signal names; sampled ones are held between their instants.
    until : float
        End [s].
    start : State or Rest, optional
        Where to begin; default: the shape as drawn, at rest. A `Rest` brings its constant inputs along.
    inputs : mapping of str to float, optional
        Constant inputs, applied as a step at the start; a controller's commands add to them.
    method : GeneralizedAlpha or AdaptiveAlpha, optional
        Default: `AdaptiveAlpha`, steps chosen to meet ``tolerance``.
    tolerance : Tolerance, optional
        For error-controlled methods.
    every : float, optional
        Spacing of the output [s]; default: every step.
    progress : callable, optional
        Called now and then with the fraction done.

    Returns
    -------
    Run
        Whatever happens: a step that fails and Ctrl-C end the run with their status, and all that
        was computed until then.

    Raises
    ------
    StructureError
        For an end that is not positive or an unknown input.
    ControllerError
        If the controller's names are not the model's.
    MechanismError
        If a freedom has neither mass nor stiffness.
    """
    if not (math.isfinite(until) and until > 0.0):
        raise StructureError(f"simulate: until = {until}; expected seconds > 0")
    if every is not None and not every > 0.0:
        raise StructureError(f"simulate: every = {every}; expected seconds > 0")
    state = start.state if isinstance(start, Rest) else start or model.rest
    base = start.inputs if isinstance(start, Rest) and inputs is None else model.input_vector(inputs or {})
    feed = feed_of(model, controller, base)
    journey = _Journey(model, feed, method or AdaptiveAlpha(), tolerance or Tolerance(), until, every, progress)
    return journey.travel(state.with_(t=0.0))


@dataclass
class _Journey:
    """One run under way."""

    model: Model
    feed: Feed
    method: Integrator
    tolerance: Tolerance
    until: float
    every: float | None
    progress: Callable[[float], None] | None
    t: list[float] = field(default_factory=list)
    y: list[np.ndarray] = field(default_factory=list)
    u: list[np.ndarray] = field(default_factory=list)
    frames: list[State] = field(default_factory=list)
    steps: int = 0
    rejected: int = 0
    message: str = ""
    status: Status = Status.FINISHED

    def travel(self, state: State) -> Run:
        began = time.perf_counter()
        pace = self.method.pace
        self.stepper = self.method.stepper(self.model, self.feed, self.tolerance)
        self.books = Books(self.model, state)
        self.size = pace.step if isinstance(pace, Fixed) else min(pace.first, pace.largest)
        self.point = self._start(state)
        self._record()
        try:
            self._through_breaks()
        except KeyboardInterrupt:
            self.status, self.message = Status.INTERRUPTED, f"interrupted at t = {self.point.state.t:.6g} s"
        except StepError as error:
            self.stepper.counts.worst = error.worst
            worst = self.model.coordinates[error.worst]
            self.status, self.message = Status.FAILED, f"{error}; worst freedom: {worst}"
        if self.t[-1] < self.point.state.t:
            self._record()
        self.books.close(self.point)
        return self._run(time.perf_counter() - began)

    def _start(self, state: State) -> Point:
        try:
            return self.stepper.start(state, self.feed.first(state), self.size)
        except SingularMatrixError as error:
            name = self.model.coordinates[error.where]
            raise MechanismError(
                f"simulate: {name} has neither mass nor stiffness; hold it with a Support, or give the part "
                "rotary inertia (rhoJ, rhoI) or mass"
            ) from None

    def _instants(self) -> list[tuple[float, bool, bool]]:
        """All instants at which a step must end: (time, is a sample or break, is an output)."""
        marks: dict[int, list[bool]] = {}
        tick = self.until * 1e-12

        def mark(t: float, which: int) -> None:
            marks.setdefault(round(t / tick), [False, False])[which] = True

        sample = self.feed.sample_time
        for k in range(1, int(self.until / sample + 1e-9) + 1) if sample else ():
            mark(k * sample, 0)
        for t in self.feed.breaks:
            if 0.0 < t < self.until:
                mark(t, 0)
        every = self.every or self.until
        for k in range(1, int(self.until / every + 1e-9) + 1):
            mark(k * every, 1)
        mark(self.until, 1)
        return [(min(key * tick, self.until), *flags) for key, flags in sorted(marks.items())]  # type: ignore[misc]

    def _through_breaks(self) -> None:
        told = time.perf_counter()
        for t, breaks, output in self._instants():
            self._advance_to(t)
            if breaks and t < self.until * (1 - 1e-12):
                self._renew()
            if output and self.every is not None:
                self._record()
            if self.progress and time.perf_counter() - told > 0.1:
                told = time.perf_counter()
                self.progress(t / self.until)

    def _renew(self) -> None:
        """New inputs at a sample instant or break; accelerations jump with them."""
        before = self.point.supply
        state = self.point.state
        fresh = self.feed.restart(state, before) if self.feed.continuous else self.feed.sample(state, before)
        if np.array_equal(fresh.u, before.u):
            self.point = replace(self.point, supply=fresh)
        else:
            self.point = self.stepper.renew(self.point, fresh, self.size)

    def _advance_to(self, t: float) -> None:
        pace = self.method.pace
        while (left := t - self.point.state.t) > 1e-12 * self.until:
            if isinstance(pace, Fixed):
                count = max(1, math.ceil(left / pace.step - 1e-6))
                self._take_many(left / count, count)
            else:
                self._try(left, pace)

    def _take_many(self, h: float, count: int) -> None:
        """Steps of fixed length: a block of them at once where the stepper can."""
        if not isinstance(self.stepper, Marching) or self.feed.continuous:
            return self._one(h)
        before = self.point
        block = self.stepper.march(before, h, min(count, _BLOCK))
        self.books.enter_block(before, block)
        self.point = block.last
        self.steps += len(block.states)
        if self.every is None:
            for state in block.states:
                self._record_state(state)
        if len(block.states) < min(count, _BLOCK):
            self._one(h)

    def _one(self, h: float) -> None:
        self._take(h)
        if self.every is None:
            self._record()

    def _take(self, h: float) -> None:
        """A step of fixed length; where it does not converge, in halves."""
        try:
            after = self.stepper.step(self.point, h)
        except StepError:
            self.rejected += 1
            if h < 2e-3 * self.size or h < _SMALLEST:
                raise
            self._take(0.5 * h)
            self._take(0.5 * h)
            return
        self._accept(after)

    def _try(self, left: float, pace: Controlled) -> None:
        """A step whose error is controlled."""
        h = min(self.size, pace.largest)
        h = left if h > 0.99 * left else 0.5 * left if h > 0.5 * left else h
        while True:
            if h < _SMALLEST * max(1.0, self.until):
                raise StepError(
                    self.stepper.counts.worst, f"the step fell to {h:.1e} s at t = {self.point.state.t:.6g} s"
                )
            try:
                after = self.stepper.step(self.point, h)
            except StepError:
                self.rejected += 1
                self.size = h = 0.25 * h
                continue
            error = self.stepper.error(self.point, after, self.books.moved, self.tolerance)
            factor = 0.9 * max(error, 1e-6) ** (-1.0 / pace.steepness)
            if error > 1.0:
                self.rejected += 1
                self.size = h = h * max(0.2, factor)
                continue
            self._accept(after)
            if self.every is None:
                self._record()
            if factor > 1.3 and h > 0.5 * self.size:
                self.size = h * min(2.5, factor)
            elif factor < 1.0:
                self.size = h * factor
            return

    def _accept(self, after: Point) -> None:
        self.books.enter(self.point, after)
        self.point = after
        self.steps += 1

    def _record(self) -> None:
        self._record_state(self.point.state)

    def _record_state(self, state: State) -> None:
        self.t.append(state.t)
        self.y.append(self.model.measure(state))
        self.u.append(self.point.supply.u)
        if len(self.t) == 1 or state.t >= self.frames[-1].t + self.until / _FRAMES * (1 - 1e-9):
            self.frames.append(state)

    def _run(self, wall: float) -> Run:
        counts = self.stepper.counts
        report = Report(
            steps=self.steps,
            rejected_steps=self.rejected,
            newton_iterations=counts.newton,
            factorisations=counts.factorisations,
            wall_s=wall,
            dofs=self.model.n,
            energy_residual=self.books.residual,
            worst=self.model.coordinates[counts.worst] if self.model.n else "",
            closure_error=self.books.closure,
            message=self.message,
            notes=self.model.notes,
        )
        m = self.model
        return Run(
            np.array(self.t),
            m.outputs,
            m.inputs,
            np.array(self.y).reshape(len(self.t), -1),
            np.array(self.u).reshape(len(self.t), -1),
            self.point.state,
            tuple(self.frames),
            self.status,
            report,
            m.structure.name,
        )


__all__ = ["simulate"]
