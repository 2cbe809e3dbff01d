"""The implicit midpoint rule in momenta: for long runs.

What is carried on are momenta, not rates: p₁ − p₀ = h F(middle), (p₀ + p₁)/2 = M(middle) Δ/h, where the middle is
half the step Δ from the start. Symmetric in time; on flat spaces it is Gauss's method of order 2, symplectic. Where
nothing pushes along a direction in which the machine may move as a whole, the momentum is constant to round-off:
linear momentum, and angular momentum too, as p₁ x₁ − p₀ x₀ = (p₁ − p₀) x̄ + p̄ (x₁ − x₀) exactly (Simo, Tarnow & Wong
1992). Lines between nodes - springs, ropes, chords of beams - pull as their lengths at both ends of the step ask for,
not that in its middle, where what turns is shorter: masses on springs and taut ropes keep their energy exactly, and
links as stiff as one likes their length, at steps of many of their periods. Elsewhere the energy oscillates with h²
without drift. Motors behind rigid shafts and ropes have momenta of their own: see `reflected`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from flexctrl.dynamics.alpha.newton import POOR
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.methods.masses import Masses
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import largest, turning, yardsticks
from flexctrl.dynamics.steps import Counts, Fixed, Point, StepError, check_step, singular_tangent, unsolved
from flexctrl.dynamics.swift.massless import massless
from flexctrl.dynamics.swift.reflected import Motors
from flexctrl.dynamics.swift.settling import settled, steadied
from flexctrl.dynamics.swift.stiff_lines import STIFF, Caution, firmest, firmest_freedom, firmest_shaft
from flexctrl.errors import SingularMatrixError, StructureError
from flexctrl.frozen import frozen
from flexctrl.model.momenta import momenta_of
from flexctrl.model.plant import Plant
from flexctrl.model.solve import Plan, Solve, factorise, plan
from flexctrl.model.state import State

__all__ = ["ConservingMidpoint"]

_NEWTON = 1e-12
_ITERATIONS = 15
_TURNED = 0.02
_BLURRED = 1e3
"""Radians of a single freedom in a step from where on the last digits of places make more of momenta than steps do."""


@frozen
class ConservingMidpoint:
    """The implicit midpoint rule in momenta: second order, no damping, for long runs without losses of its own.

    Linear and angular momentum of what floats freely are constant to round-off. The energy of masses on springs and
    taut ropes is constant too, whatever the step (Simo & Tarnow 1992); elsewhere it oscillates without drift.
    Frequencies that the step does not resolve are kept, not damped: start from rest or from an equilibrium, or use
    generalised alpha where they are not wanted. A step is taken in Python and costs about 300 times one of generalised
    alpha: 100,000 of a double pendulum 51 s against 0.17 s. Winches on rigid ropes are second order too, however heavy
    the motor is beside the load (see `flexctrl.dynamics.swift.reflected`).

    Parameters
    ----------
    step : float
        Step [s]; shortened a little so that a whole number of steps ends at each sample instant.

    Raises
    ------
    StructureError
        For a step that is not positive.
    """

    step: float

    def __post_init__(self) -> None:
        check_step(self.step, "ConservingMidpoint")

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def damping(self) -> str:
        return "no numerical damping"

    @property
    def pace(self) -> Fixed:
        return Fixed(self.step)

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> _Stepper:
        if model.motion.flows.size or model.switches.names:
            raise StructureError(
                "ConservingMidpoint: has no rule for dry friction and motor lag; use AdaptiveAlpha, or leave them out"
            )
        return _Stepper(model, feed)


@frozen
class _Point(Point):
    """A point with its momenta, and those of its motors behind rigid shafts and ropes."""

    momenta: np.ndarray
    motors: np.ndarray


@frozen
class _Tangent:
    """What the factors in use were made from: a middle with its accelerations, inputs there, and the step."""

    middle: State
    rate: np.ndarray
    supply: Supply
    h: float


@frozen
class _Memory:
    """What the next steps go on from."""

    tangent: _Tangent | None
    masses: State | None


@dataclass
class _Stepper:
    """Steps of one model; keeps factors while they are good."""

    model: Plant
    feed: Feed
    counts: Counts = field(default_factory=Counts)
    tangent: _Tangent | None = None
    _solve: Solve | None = None
    _plan: Plan | None = None

    def __post_init__(self) -> None:
        self.motors = Motors(self.model)
        self.momenta = momenta_of(self.motors.others)
        self.weight = 1.0 / yardsticks(self.model)
        self.turning = turning(self.model)
        self.masses = Masses(self.model, self.counts)
        self.massless = False
        self.light = massless(self.feed)
        lines = max(firmest(self.model), firmest_shaft(self.model))
        self.careful = min(STIFF / max(lines, 1e-300), _BLURRED / max(firmest_freedom(self.model), 1e-300))

    @property
    def memory(self) -> _Memory:
        return _Memory(self.tangent, self.masses.made_at)

    @memory.setter
    def memory(self, memory: _Memory) -> None:
        self.recall(memory)

    def recall(self, memory: _Memory) -> None:
        """Make the factors that were in use."""
        self.massless = memory.masses is None
        self.masses = Masses(self.model, self.counts, memory.masses)
        self.tangent = None
        if memory.tangent is not None:
            self._factor(memory.tangent)

    def start(self, state: State, supply: Supply, step: float) -> _Point:
        """Return the point of a state; what has no mass moves as its forces say.

        Raises
        ------
        SingularMatrixError
            If a freedom has neither mass nor stiffness.
        """
        still = np.zeros(self.model.n)
        state, supply = self._settled(state, supply, step)
        try:
            rate = self.masses.accelerations(state, supply.u, still)
        except SingularMatrixError:
            self.massless, rate = True, still
            state, supply = self._set_out(state, still, supply, step)
            self._check_held(state, supply, step)
        return _Point(state, rate, supply, self.momenta.at(state, supply.u)[0], self.motors.momenta(state))

    def _settled(self, state: State, supply: Supply, step: float) -> tuple[State, Supply]:
        """Return a state with what has stiffness alone where it balances; what the controller damps stays."""
        steady = steadied(self.feed, state, supply, step, np.inf)
        self.light = massless(self.feed, steady)
        return settled(self.model, state, self.feed, supply, steady)

    def _set_out(self, state: State, rate: np.ndarray, supply: Supply, step: float) -> tuple[State, Supply]:
        """Return a state in which what has no mass moves as its forces say, and the inputs there."""
        if not self.light.seen(state, supply, step, np.inf):
            return state, supply
        state, supply = self.light.pushed(state, supply)
        state = self.light.moving(state, rate, supply, step)[0]
        return state, self.feed.restart(state, supply)

    def _check_held(self, state: State, supply: Supply, step: float) -> None:
        """Raise SingularMatrixError where nothing holds a freedom over a step, neither mass nor stiffness."""
        try:
            self._factor(_Tangent(state, np.zeros(self.model.n), supply, step))
        except StepError as error:
            raise SingularMatrixError(error.worst) from error

    def renew(self, point: _Point, supply: Supply, step: float) -> _Point:
        """Return the point under other inputs: momenta do not jump."""
        state, supply = self._settled(point.state, supply, step)
        if self.massless:
            state, supply = self._set_out(state, point.rate, supply, step)
        rate = point.rate if self.massless else self.masses.accelerations(state, supply.u, point.rate)
        return replace(point, state=state, rate=rate, supply=supply)

    def step(self, point: _Point, h: float) -> _Point:
        """Return the point a step later."""
        if h > self.careful:
            return self._carefully(point, h)
        try:
            return self._attempt(point, h, fresh=False)
        except StepError:
            return self._attempt(point, h, fresh=True)

    def _attempt(self, point: _Point, h: float, fresh: bool) -> _Point:
        now, t = point.state, point.state.t
        step, last, poor = h * (now.v + 0.5 * h * point.rate), np.inf, False
        for iteration in range(_ITERATIONS):
            middle, supply, momenta, change = self._middle(point, step, h)
            start = point.momenta - self._wound(point, step, h)
            gap = momenta - start - 0.5 * h * change
            if fresh or poor or (iteration == 0 and self._stale(middle, h)):
                self._factor(_Tangent(middle, 2.0 * (step / h - now.v) / h, supply, h))
                last = np.inf
            assert self._solve is not None
            correction = -self._solve(gap)
            size, worst = largest(correction * self.weight)
            self.counts.newton += 1
            step = step + correction
            contraction = size / last if 0.0 < last < np.inf else 0.0
            poor = contraction > POOR and size > 100.0 * _NEWTON
            settled = 0.0 < contraction < 1.0 and size * contraction <= 0.5 * _NEWTON
            if size <= _NEWTON or settled or (contraction > 0.5 and size < 1e3 * _NEWTON):
                self.counts.worst = worst
                if size > 10.0 * _NEWTON:
                    change = self._middle(point, step, h)[3]
                return self._end(point, h, step, point.momenta - self._wound(point, step, h) + h * change)
            if not np.isfinite(size) or (contraction > 2.0 and iteration > 3) or (contraction > 1.0 and not fresh):
                break
            last = size
        raise self._astray(worst, gap, t + h, h)

    def _carefully(self, point: _Point, h: float) -> _Point:
        """Take a step over what is stiff in it, with a tangent of its own in every iteration.

        Their force hangs on the last digits of places: it is not summed up, momenta follow from where the step ends.
        """
        now, t, caution = point.state, point.state.t, Caution(_NEWTON)
        step, last, worst = h * (now.v + 0.5 * h * point.rate), np.inf, 0
        for iteration in range(_ITERATIONS):
            middle, supply, momenta, change = self._middle(point, step, h)
            self._factor(_Tangent(middle, 2.0 * (step / h - now.v) / h, supply, h))
            assert self._solve is not None
            gap = momenta - (point.momenta - self._wound(point, step, h)) - 0.5 * h * change
            correction = (caution.short - 1.0) * self._solve(gap)
            size, worst = largest(correction * self.weight)
            self.counts.newton += 1
            step = step + correction
            if not np.isfinite(size):
                break
            if caution.over(size, size / last if last > 0.0 else 0.0, iteration):
                self.counts.worst = worst
                momenta, change = self._middle(point, step, h)[2:]
                start = point.momenta - self._wound(point, step, h)
                start = start + self.motors.along(now, momenta - start - 0.5 * h * change)
                return self._end(point, h, step, 2.0 * momenta - start)
            last = size
        raise self._astray(worst, gap, t + h, h)

    def _astray(self, worst: int, gap: np.ndarray, t: float, h: float) -> StepError:
        """The failure of a step that leaves so much of its momenta."""
        return unsolved(self.model.coordinates[worst], worst, 2.0 * float(gap[worst]) / h, t, h)

    def _middle(self, point: _Point, step: np.ndarray, h: float) -> tuple[State, Supply, np.ndarray, np.ndarray]:
        """The middle of a step, inputs there, momenta there, and how they change."""
        middle = self.model.advance(point.state, 0.5 * step, step / h, point.state.t + 0.5 * h)
        supply = self.feed.at(middle, point.supply, 0.5 * h)
        return middle, supply, *self.momenta.at(middle, supply.u, h)

    def _wound(self, point: _Point, step: np.ndarray, h: float) -> np.ndarray | float:
        """What motors behind rigid shafts and ropes gain of momentum over a step, as its start feels it."""
        if not point.motors.size:
            return 0.0
        now = point.state
        gain = self.motors.between(now, self.model.advance(now, step, now.v, now.t), h) - point.motors
        return self.motors.levers(now).T @ gain

    def _end(self, point: _Point, h: float, step: np.ndarray, momenta: np.ndarray) -> _Point:
        """The point at the end of a step, its rates from the momenta."""
        now, mean = point.state, step / h
        state = self.model.advance(now, step, 2.0 * mean - now.v, later(now.t, h))
        motors = self.motors.between(now, state, h)
        if self.model.motion.dead_point(now, state):
            raise StepError(
                self.counts.worst, f"a loop of rigid parts is at a dead point at t = {state.t:.6g} s; let a part bend"
            )
        if self.massless:
            supply = self.feed.at(state, point.supply, h)
            state = self._set_out(state, 2.0 * (state.v - mean) / h, supply, h)[0]
        else:
            state = state.with_(v=self._rates(state, momenta, motors))
        return _Point(state, 2.0 * (state.v - mean) / h, self.feed.at(state, point.supply, h), momenta, motors)

    def missed(self, before: _Point, after: _Point) -> np.ndarray:
        """Return the local error of a step, h²/12 Δa."""
        h = after.state.t - before.state.t
        return h * h / 12.0 * (after.rate - before.rate)

    def remains(self, share: np.ndarray) -> np.ndarray:
        """Return what a run is off by: as much as its errors add up to."""
        return share

    def _rates(self, state: State, momenta: np.ndarray, motors: np.ndarray) -> np.ndarray:
        """The rates of some momenta."""
        if not motors.size:
            return self._moving(lambda v: self.momenta.of(state, v), momenta, state)
        levers = self.motors.levers(state)

        def of(v: np.ndarray) -> np.ndarray:
            return self.momenta.of(state, v) + levers.T @ (self.motors.inertias * (levers @ v))

        return self._moving(of, momenta + levers.T @ motors, state)

    def _moving(self, of: Callable[[np.ndarray], np.ndarray], momenta: np.ndarray, state: State) -> np.ndarray:
        """The rates with some momenta, which rates have as told."""
        return self.masses.solve(lambda v: of(v) - momenta, of, state, state.v)

    def _stale(self, middle: State, h: float) -> bool:
        made = self.tangent
        if made is None or abs(h - made.h) > 1e-6 * h:
            return True
        turned = np.abs(middle.q - made.middle.q)[self.turning]
        return bool(turned.size) and float(turned.max()) > _TURNED

    def _factor(self, at: _Tangent) -> None:
        """Factorise ∂(momenta − h/2 change)/∂step, but for what rates add to the slope of inertia."""
        h, u = at.h, at.supply.u
        seeds = (0.5, 1.0 / h, 2.0 / (h * h))
        excess = self.momenta.excess(at.middle, h)
        slope = self.motors.others.slope(at.middle, at.middle.v, at.rate, seeds, u, excess)
        if self.motors.numbers.size:
            slope = slope - self.motors.slope(at.middle, h) * (2.0 / h)
        if self.feed.continuous:
            slope = slope + self.feed.slope(at.middle, at.supply, 0.5 * h, seeds)
        if self._plan is None or not self._plan.fits(slope):
            self._plan = plan(slope)
        try:
            solve = factorise(slope, self._plan)
        except SingularMatrixError as error:
            raise singular_tangent(error, at.middle.t + 0.5 * h, h) from error
        self._solve = lambda gap: solve(gap * (-2.0 / h))
        self.counts.factorisations += 1
        self.tangent = at

    def error(self, before: _Point, after: _Point, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Steps are of one length; nothing is estimated."""
        return 0.0
