"""Linear equations integrated exactly: by the exponential of their modal form.

Inputs that are held (constant, or from a sampled controller) and linear continuous controllers on a linear model
leave no error but round-off. Other continuous controllers are interpolated over a step at Lobatto's four points,
which is exact for commands that are cubic in time; a step over which that does not hold is refused, and halved by
the run. One that damps freedoms without mass or damping itself is solved for commands and their rates together, to
third order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexctrl.design.controller import LinearController
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.linear_motion.modal_equations import ModalEquations, closed, feels_at_once, opened
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.dynamics.linear_motion.propagator import NODES, Propagator
from flexctrl.dynamics.linear_motion.quadratic import Turnover
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Counts, Fixed, Point, StepError, Stepper, check_step
from flexctrl.dynamics.swift.at_once import Instant, holding
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Exact", "ExactStepper", "ModalPoint"]

_SWEEPS = 30
_SETTLED = 1e-13
_NOISE = 10.0 * float(np.finfo(float).eps)
_SMALL = 1e-6
_HALF = 0.5
_ROUND_OFF = 1e-9
_POLYNOMIAL = np.linalg.inv(np.vander(NODES, increasing=True))
"""Powers of the share of a step from values at the nodes."""

_INTEGRALS = np.array([[s ** (k + 1) / (k + 1) for k in range(4)] for s in NODES]) @ _POLYNOMIAL
"""Integrals from the start to each node, from values at the nodes (Lobatto IIIA)."""


@frozen
class Exact:
    """The exact motion of linear equations: a `LinearModel`, or a model without `LargeRotation`.

    Parameters
    ----------
    step : float
        Spacing of the states computed [s]; with held inputs it has no bearing on their accuracy.
    modes : int, optional
        Vibrations that move, the slowest ones (beside motion that is free or grows); the others stay where constant
        loads hold them. Default: all.

    Raises
    ------
    StructureError
        For a step that is not positive, or modes that are no whole number ≥ 0.
    """

    step: float
    modes: int | None = None

    def __post_init__(self) -> None:
        check_step(self.step, "Exact")
        if self.modes is not None and (not isinstance(self.modes, int) or self.modes < 0):
            raise StructureError(f"Exact: modes = {self.modes!r}; expected a whole number ≥ 0, or none for all")

    @property
    def order(self) -> int:
        return 6

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def damping(self) -> str:
        return "exact for held inputs"

    @property
    def pace(self) -> Fixed:
        return Fixed(self.step)

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> Stepper[Any]:
        if model.large:
            raise StructureError(
                "Exact: this model moves far (LargeRotation), its equations are not linear; give linearize(model), a "
                "model without LargeRotation, or another method"
            )
        if not model.n:
            raise StructureError(
                "Exact: the machine has no degrees of freedom, so nothing of it vibrates; give another method"
            )
        from flexctrl.dynamics.march.leaps import LeapingStepper
        from flexctrl.dynamics.march.marching import can_march

        plain = ExactStepper(model, feed, tolerance, self.modes, self.step)
        marched: Any = LeapingStepper(plain)
        return marched if can_march(model) and not feed.continuous else plain


def _modal(model: Plant, modes: int | None) -> tuple[ModalEquations, Propagator]:
    """The modal form of a model and its exponentials, worked out once."""
    kept: dict[int | None, tuple[ModalEquations, Propagator]] = model.__dict__.setdefault("_modal", {})
    if modes not in kept:
        equations = opened(model, modes)
        kept[modes] = equations, Propagator(equations.first)
    return kept[modes]


@frozen
class ModalPoint(Point):
    """A point with its modal state, and the inputs over the step that led to it: powers of the share done."""

    modal: np.ndarray
    course: np.ndarray


class Slope(NamedTuple):
    """How what a continuous controller leaves open changes with its commands at the nodes of a step."""

    matrix: np.ndarray
    h: float


@dataclass
class ExactStepper:
    """Steps of a modal form."""

    model: Plant
    feed: Feed
    tolerance: Tolerance
    modes: int | None = None
    step_length: float = 0.0
    counts: Counts = field(default_factory=Counts)
    memory: Slope | None = None

    def __post_init__(self) -> None:
        self.yard = yardsticks(self.model)
        (self.equations, self.propagator), self.closed = _modal(self.model, self.modes), False
        if isinstance(self.model, LinearPlant) and isinstance(self.feed.controller, LinearController):
            self.closed = self.feed.continuous and not feels_at_once(self.equations, self.model, self.feed)
            if self.closed:
                self.equations = closed(self.equations, self.model, self.feed)
                self.propagator = Propagator(self.equations.first)
        self.turnover = Turnover(self.model, self.equations)

    def recall(self, memory: Slope | None) -> None:
        """Go on with the slope that the commands of another stepper were found with."""
        self.memory = memory

    def nominal(self, h: float) -> float:
        """Return the step asked for, or that between samples, where h is that but for round-off of times."""
        period, asked = self.feed.sample_time, self.step_length
        steps = (asked, period / max(1, math.ceil(period / asked - 1e-6))) if asked else ()
        return next((step for step in steps if abs(step - h) <= _ROUND_OFF * step), h)

    def start(self, state: State, supply: Supply, step: float) -> ModalPoint:
        """Return the point of a state; what no mass holds goes where its forces balance."""
        e, z = self.equations, supply.x if self.closed else np.zeros(0)
        known = np.append(state.q, state.v) - e.first.D @ self.forcing(supply.u) - e.first.C[:, e.modes :] @ z
        modal, n = np.append(e.read @ known, z), self.model.n
        if not self._open:
            return self.point(state, modal, supply, state.t)
        place = state.q - e.first.C[:n] @ modal - e.first.D[:n, -1]
        return self._asked(state, modal, supply, holding(self.model, e.first.D[:n, :-1], place), step)

    def renew(self, point: ModalPoint, supply: Supply, step: float) -> ModalPoint:
        """Return the point under other inputs."""
        if self._open:
            return self._asked(point.state, point.modal, supply, point.supply.u, step)
        return self.point(point.state, point.modal, supply, point.state.t)

    @property
    def _open(self) -> bool:
        """Whether commands follow from what they do at once."""
        at_once = self.equations.first.D[:, :-1].any() or (
            isinstance(self.model, LinearPlant) and self.model.linear.D.any()
        )
        return self.feed.continuous and not self.closed and bool(at_once)

    def _asked(self, state: State, modal: np.ndarray, supply: Supply, kept: np.ndarray, step: float) -> ModalPoint:
        """The point of a modal state under a continuous controller that feels at once what it commands."""
        supply, slide = Instant(self.equations, self.feed, self.shown, step).answered(state, modal, supply, kept)
        return self.point(state, modal, supply, state.t, None, slide)

    def step(self, point: ModalPoint, h: float) -> ModalPoint:
        """Return the point a step later."""
        t = later(point.state.t, h)
        if self.feed.continuous and not self.closed:
            return self._collocated(point, h)
        course = np.zeros((4, len(self.equations.first.B[0])))
        course[0] = self.forcing(point.supply.u)
        return self.point(point.state, self._modal(point, course, h, h), point.supply, t, course)

    def _modal(self, point: ModalPoint, course: np.ndarray, t: float, h: float) -> np.ndarray:
        """The modal state a time t after a point, under inputs that are a polynomial over h."""
        transition, powers = self.propagator.over(t, h)
        return transition @ point.modal + np.einsum("kij,kj->i", powers, course)

    def forcing(self, u: np.ndarray) -> np.ndarray:
        return np.append(self.feed.base if self.closed else u, 1.0)

    def point(
        self,
        before: State,
        modal: np.ndarray,
        supply: Supply,
        t: float,
        course: np.ndarray | None = None,
        slide: np.ndarray | None = None,
    ) -> ModalPoint:
        """The point of a modal state under inputs that may change; in a closed loop these follow from it."""
        e, w = self.equations, self.forcing(supply.u)
        state = self.shown(before, modal, w, t, slide)
        if self.closed:
            supply = replace(self.feed.evaluate(state, modal[e.modes :]), u=state.driven)
        rate = e.first.C[self.model.n :] @ (e.first.A @ modal + e.first.B @ w)
        return ModalPoint(state, rate, supply, modal, np.zeros((4, len(w))) if course is None else course)

    def shown(self, before: State, modal: np.ndarray, w: np.ndarray, t: float, slide: np.ndarray | None) -> State:
        """The state of a modal state under inputs w that change by ``slide`` [1/s]; None: they are held."""
        n, e = self.model.n, self.equations
        both = e.first.C @ modal + e.first.D @ w
        if slide is not None:
            both[n:] += e.first.D[:n, : len(slide)] @ slide
        state = self.model.advance(before, both[:n] - before.q, both[n:], t)
        return replace(state, driven=e.gain @ modal + e.direct @ w) if isinstance(self.model, LinearPlant) else state

    def _collocated(self, point: ModalPoint, h: float) -> ModalPoint:
        """A step under a continuous controller: its commands at the nodes and the motion there are found together."""
        t, before, m = point.state.t, point.supply, len(point.supply.u)
        found = np.tile(np.append(before.u, before.rate), (3, 1))
        last = np.inf
        for sweep in range(_SWEEPS):
            gap = self._gap(point, h, found)
            if self.memory is None or self.memory.h != h or (sweep and self._large(gap) > 0.1 * last):
                self.memory = Slope(self._derivative(point, h, found, gap), h)
            found = found - np.linalg.solve(self.memory.matrix, gap.ravel()).reshape(found.shape)
            self.counts.newton += 1
            last = self._large(gap)
            least = max(_SETTLED, _NOISE * float(np.abs(self.memory.matrix).sum(axis=1).max(initial=0.0)))
            if last <= least * max(1.0, float(np.abs(found).max(initial=0.0))):
                break
        else:
            raise StepError(0, f"commands did not settle over a step of {h:.3g} s at t = {t:.6g} s")
        course, f, x = self._courses(before, h, found)
        self._check(point, h, course, f)
        supply = Supply(found[-1, :m], x[-1], found[-1, m:])
        return self.point(
            point.state, self._modal(point, course, h, h), supply, later(t, h), course, _slide(course, 1.0, h)
        )

    def _courses(self, before: Supply, h: float, found: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inputs over a step as a polynomial, rates and states of the controller at the nodes, from those found."""
        m = len(before.u)
        whole = np.vstack([np.append(before.u, before.rate), found])
        polynomial = _POLYNOMIAL @ np.column_stack([whole[:, :m], np.ones(4)])
        return polynomial, whole[:, m:], before.x + h * (_INTEGRALS @ whole[:, m:])

    def _gap(self, point: ModalPoint, h: float, found: np.ndarray) -> np.ndarray:
        """Inputs and rates at the nodes less what the controller answers there."""
        course, _, x = self._courses(point.supply, h, found)
        answers = [self._answer(point, course, share, h, z) for share, z in zip(NODES[1:], x[1:], strict=True)]
        return found - np.array([np.append(answer.u, answer.rate) for answer in answers])

    def _derivative(self, point: ModalPoint, h: float, found: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """The slope of the gap over what is found, by differences."""
        columns = np.empty((found.size, found.size))
        for i in range(found.size):
            moved = found.copy()
            moved.flat[i] += (step := _SMALL * max(1.0, abs(found.flat[i])))
            columns[:, i] = ((self._gap(point, h, moved) - gap) / step).ravel()
        self.counts.factorisations += 1
        return columns

    @staticmethod
    def _large(gap: np.ndarray) -> float:
        return float(np.abs(gap).max(initial=0.0))

    def at(self, point: ModalPoint, course: np.ndarray, share: float, h: float) -> State:
        """Return the state at a share of a step whose inputs are a polynomial."""
        modal, w = self._modal(point, course, share * h, h), share ** np.arange(4) @ course
        return self.shown(point.state, modal, w, point.state.t + share * h, _slide(course, share, h))

    def _answer(self, point: ModalPoint, course: np.ndarray, share: float, h: float, z: np.ndarray) -> Supply:
        """What the controller answers there."""
        return self.feed.within(self.at(point, course, share, h), z)

    def _check(self, point: ModalPoint, h: float, course: np.ndarray, f: np.ndarray) -> None:
        """Refuse a step over which the commands are not the polynomial through the nodes."""
        powers = _HALF ** np.arange(1, 5) / np.arange(1, 5)
        z = point.supply.x + h * (powers @ (_POLYNOMIAL @ f))
        answer = self._answer(point, course, _HALF, h, z)
        off = np.append(answer.u - (_HALF ** np.arange(4) @ course)[:-1], 0.0)
        first = self.equations.first
        moved = first.C @ (self.propagator.over(h, h)[1][0] @ off) + first.D @ off
        worst = float(np.abs(moved[: self.model.n] / self.yard).max(initial=0.0))
        if not worst <= self.tolerance.absolute:
            raise StepError(0, f"commands change too fast for a step of {h:.3g} s at t = {point.state.t:.6g} s")

    def error(self, before: ModalPoint, after: ModalPoint, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Steps are of one length; what is not exact is refused."""
        return 0.0

    def curve(self, before: ModalPoint, after: ModalPoint) -> _Curve:
        """Return the motion over a step."""
        return _Curve(self, before, after)


def _slide(course: np.ndarray, share: float, h: float) -> np.ndarray | None:
    """How fast inputs change that are a polynomial over a step; None if they do not."""
    if not course[1:].any():
        return None
    return np.arange(1, 4) * share ** np.arange(3) @ course[1:] / h


@frozen(eq=False)
class _Curve:
    """The motion from a point."""

    stepper: ExactStepper
    before: ModalPoint
    after: ModalPoint
    seen: ClassVar[float] = math.inf

    def at(self, t: float) -> State:
        """Return the state at a time of the step."""
        h = self.after.state.t - self.before.state.t
        return self.stepper.at(self.before, self.after.course, (t - self.before.state.t) / h, h)

    def turned_over(self) -> tuple[float, float]:
        """Return work of the inputs and losses over the step."""
        h = self.after.state.t - self.before.state.t
        return self.stepper.turnover.over(self.before.modal, self.after.course, h)
