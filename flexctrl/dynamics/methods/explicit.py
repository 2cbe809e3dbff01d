"""An explicit Runge–Kutta method on the rotation group, for soft and rigid machines.

Munthe-Kaas (1999): each step is a step of an ordinary Runge–Kutta method in coordinates that start at the shape
before it. The table is that of Dormand & Prince, order 8 with an error estimate and dense output of order 7
(Hairer, Nørsett & Wanner 1993, DOP853).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.methods.local import Local
from flexctrl.dynamics.methods.masses import Masses
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.dynamics.steps import MOST_STEPS, Controlled, Counts, Fixed, Pace, Point, StepError, check_step
from flexctrl.errors import MechanismError, SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_number, check_seconds

__all__ = ["ExplicitRungeKutta"]

_STEEPNESS = 8


@frozen
class ExplicitRungeKutta:
    """An explicit method of order 8 (DOP853) on the rotation group.

    For machines without stiff parts: rigid bodies, pendulums, soft springs, where it is far more accurate for its
    cost than implicit methods. Its steps have to resolve every frequency of the machine (about ω h < 5), whether
    that matters or not, and every freedom needs mass.

    Parameters
    ----------
    step : float, optional
        Length of the steps [s]; left out: chosen to meet the tolerance.
    first_step : float, optional
        Where steps are chosen [s]; left out: told by how the machine sets out.
    largest_step : float
        Where steps are chosen [s].
    most_steps : float
        Of a run; one whose steps have become so short that it would take more ends, and says so.

    Raises
    ------
    StructureError
        For a length that is not positive.
    """

    step: float | None = None
    first_step: float | None = None
    largest_step: float = np.inf
    most_steps: float = field(default=MOST_STEPS, repr=False)

    def __post_init__(self) -> None:
        if self.step is not None:
            check_step(self.step, "ExplicitRungeKutta")
        if self.first_step is not None:
            check_seconds(self.first_step, "first_step", "ExplicitRungeKutta")
        check_seconds(self.largest_step, "largest_step", "ExplicitRungeKutta", endless=True)
        check_number(self.most_steps, "most_steps", "ExplicitRungeKutta", above=0.0)

    @property
    def order(self) -> int:
        return 8

    @property
    def symmetric(self) -> bool:
        return False

    @property
    def damping(self) -> str:
        return "no numerical damping to speak of where it is stable"

    @property
    def pace(self) -> Pace:
        if self.step is not None:
            return Fixed(self.step)
        return Controlled(self.first_step, self.largest_step, _STEEPNESS, self.most_steps)

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> _Stepper:
        return _Stepper(model, feed)


@frozen
class _Point(Point):
    """A point with the slopes of all stages of the step that led to it."""

    slopes: np.ndarray


@dataclass
class _Stepper:
    """The unknowns of a step are the coordinates, the rates, and the controller's state, in one vector."""

    model: Plant
    feed: Feed
    counts: Counts = field(default_factory=Counts)

    def __post_init__(self) -> None:
        from scipy.integrate import DOP853

        self.table = DOP853
        self.local = Local(self.model)
        self.weight = 1.0 / yardsticks(self.model)
        self.masses = Masses(self.model, self.counts)

    @property
    def memory(self) -> State | None:
        return self.masses.made_at

    @memory.setter
    def memory(self, made_at: State | None) -> None:
        self.recall(made_at)

    def recall(self, memory: State | None) -> None:
        """Factorise the mass matrix that was in use."""
        self.masses = Masses(self.model, self.counts, memory)

    def start(self, state: State, supply: Supply, step: float) -> _Point:
        """Return the point of a state."""
        try:
            held = self.model.switches.at_rest(state)
            rate = self.masses.accelerations(held, supply.u, np.zeros(self.model.n))
        except SingularMatrixError as error:
            raise MechanismError(self._refusal(error.where)) from None
        return _Point(state, rate, supply, np.zeros((0, 0)))

    def _refusal(self, where: int) -> str:
        name = self.model.coordinates[where]
        if where in self.model.motion.flows:
            why = f"{name} is no motion but a state of an effect (MotorLag, LuGreFriction); use"
        else:
            why = f"no mass moves with {name}; give it mass, or use"
        return f"ExplicitRungeKutta: {why} an implicit method (AdaptiveAlpha)"

    def renew(self, point: _Point, supply: Supply, step: float) -> _Point:
        """Return the point under other inputs; the motion of the step before stays known."""
        held = self.model.switches.at_rest(point.state)
        return replace(point, rate=self.masses.accelerations(held, supply.u, np.zeros(self.model.n)), supply=supply)

    def _slope(self, point: _Point, y: np.ndarray, t: float, guess: np.ndarray) -> np.ndarray:
        xi, v, x = self._split(y)
        state = self.model.switches.at_rest(self.local.place(point.state, xi, v, t))
        supply = self.feed.within(state, x) if self.feed.continuous else point.supply
        turned, swirl = self.local.rates(point.state, xi, state)
        rate = self.masses.accelerations(state, supply.u, guess)
        return np.concatenate([turned, rate + swirl, supply.rate[: x.size]])

    def _split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        c, n = self.local.count, self.model.n
        return y[:c], y[c : c + n], y[c + n :]

    def _begin(self, point: Point) -> tuple[np.ndarray, np.ndarray]:
        """The unknowns and their slope at the start of a step."""
        c, n, state = self.local.count, self.model.n, point.state
        x = point.supply.x if self.feed.continuous else np.zeros(0)
        slope = np.concatenate([state.v, np.zeros(c - n), point.rate, point.supply.rate[: x.size]])
        return np.concatenate([np.zeros(c), state.v, x]), slope

    def step(self, point: _Point, h: float) -> _Point:
        """Return the point a step later."""
        table, t = self.table, point.state.t
        y, first = self._begin(point)
        K = np.zeros((table.n_stages + 1, y.size))
        K[0] = first
        try:
            for i in range(1, table.n_stages):
                K[i] = self._slope(
                    point, y + h * (table.A[i, :i] @ K[:i]), t + table.C[i] * h, self._split(K[i - 1])[1]
                )
            end = y + h * (table.B @ K[:-1])
            K[-1] = self._slope(point, end, t + h, self._split(K[-2])[1])
        except SingularMatrixError as error:
            raise self._failure(error, K, t, h) from error
        if not np.isfinite(K).all():
            raise self._unstable(K, t, h)
        return self._end(point, end, K, later(t, h))

    def _failure(self, error: SingularMatrixError, K: np.ndarray, t: float, h: float) -> StepError:
        """The failure of a step that has come to a shape without a mass matrix: a wrong one, if it is far off."""
        if self._far(h * K):
            return self._unstable(K, t, h)
        return StepError(error.where, f"the masses do not move every freedom at t = {t:.6g} s")

    def _unstable(self, K: np.ndarray, t: float, h: float) -> StepError:
        ways = np.nan_to_num(np.abs(K[:, : self.model.n]), nan=np.inf).max(axis=0) * self.weight
        why = f"the step of {h:.3g} s from t = {t:.6g} s is unstable: too long for what is stiff"
        return StepError(int(np.argmax(ways)), why)

    def _far(self, ways: np.ndarray) -> bool:
        """Whether a step goes farther than a quarter of a radian or of the machine's size: that tells no masses."""
        return not bool((np.abs(ways[:, : self.model.n]) * self.weight <= 0.25).all())

    def _end(self, point: _Point, end: np.ndarray, K: np.ndarray, t: float) -> _Point:
        xi, v, x = self._split(end)
        state = self.model.switches.at_rest(self.local.place(point.state, xi, v, t))
        if self.model.motion.dead_point(point.state, state):
            raise StepError(0, f"a loop of rigid parts is at a dead point at t = {t:.6g} s; let a part of it bend")
        supply = self.feed.within(state, x) if self.feed.continuous else point.supply
        rate = self._split(K[-1])[1]
        if self.local.swirls:
            rate = rate - self.local.rates(point.state, xi, state)[1]
        return _Point(state, rate, supply, K)

    def error(self, before: _Point, after: _Point, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the local error over what is allowed; errors of rates count over the step."""
        weight = self.weight / tolerance.of(farthest(self.model, moved))
        high, fifth, share = self._compared(after.slopes, h, weight)
        self.counts.worst = int(np.argmax(np.abs(high * weight))) if high.size else 0
        return h * fifth * share

    def missed(self, before: _Point, after: _Point) -> np.ndarray:
        """Return the local error of a step."""
        h = after.state.t - before.state.t
        high, _, share = self._compared(after.slopes, h, self.weight)
        return h * share * high

    def remains(self, share: np.ndarray) -> np.ndarray:
        """Return what a run is off by: as much as its errors add up to."""
        return share

    def _compared(self, slopes: np.ndarray, h: float, weight: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Compare with the method of order 5: the difference over the step, its size, and what of it is our error."""
        n, c = self.model.n, self.local.count
        high, low = self.table.E5 @ slopes, self.table.E3 @ slopes
        scale = np.concatenate([weight, h * weight])
        places = np.concatenate([np.arange(n), np.arange(c, c + n)])
        fifth, third = (float(np.abs(e[places] * scale).max(initial=0.0)) for e in (high, low))
        return high[:n], fifth, fifth / float(np.hypot(fifth, 0.1 * third)) if fifth > 0.0 else 0.0

    def curve(self, before: _Point, after: _Point) -> _Curve:
        """Return the motion over a step."""
        return _Curve(self, before, after)


@frozen(eq=False)
class _Curve:
    """The dense output of the table: a polynomial of degree 7 in the coordinates from the start."""

    stepper: _Stepper
    before: _Point
    after: _Point
    seen: ClassVar[float] = 3.0

    @cached_property
    def _parts(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """The unknowns at the start, and the coefficients."""
        s, before, table = self.stepper, self.before, self.stepper.table
        h, t = self.after.state.t - before.state.t, before.state.t
        y, first = s._begin(before)
        K = np.vstack([self.after.slopes, np.zeros((len(table.C_EXTRA), y.size))])
        try:
            for i, (a, c) in enumerate(zip(table.A_EXTRA, table.C_EXTRA, strict=True), start=table.n_stages + 1):
                K[i] = s._slope(before, y + h * (a[:i] @ K[:i]), t + c * h, self.after.rate)
        except SingularMatrixError as error:
            failure = s._failure(error, K, t, h)
            remedy = "take far shorter ones from the start, or an implicit method (AdaptiveAlpha)"
            raise StepError(failure.worst, f"{failure}; {remedy}") from error
        step = h * (table.B @ K[: table.n_stages])
        last = K[table.n_stages]
        F = [step, h * first - step, 2.0 * step - h * (last + first), *(h * (table.D @ K))]
        return y, F

    def at(self, t: float) -> State:
        """Return the state at a time of the step."""
        y0, F = self._parts
        s = (t - self.before.state.t) / (self.after.state.t - self.before.state.t)
        y = np.zeros_like(y0)
        for i, part in enumerate(reversed(F)):
            y = (y + part) * (s if i % 2 == 0 else 1.0 - s)
        xi, v, _ = self.stepper._split(y0 + y)
        return self.stepper.local.place(self.before.state, xi, v, t)
