"""One step of the generalised-alpha method on the rotation group.

Chung & Hulbert (1993) in the Lie group form of Brüls, Cardona & Arnold (2012): increments of rotation
are rotation vectors in space axes. Stiffly accurate enough for structures: second order, unconditionally
stable, with the high frequencies damped down to the spectral radius ρ.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.alpha.coning import coning_of
from flexctrl.dynamics.alpha.newton import ASTRAY, ITERATIONS, POOR, circling, small_enough, wanted
from flexctrl.dynamics.alpha.outset import join, lengthen, renew, start
from flexctrl.dynamics.alpha.point import AlphaPoint, Coefficients
from flexctrl.dynamics.alpha.sliding import jumps, slide
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.march.lagging import CHANGED, lag_share, lagged, lags_of
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest, largest, turning, yardsticks
from flexctrl.dynamics.steps import Counts, StepError, singular_tangent, unsolved
from flexctrl.dynamics.swift.stiff_lines import STIFF, SURE, Caution, firmest
from flexctrl.dynamics.swift.thrown import AT_HAND, BLURRED, THROWN, holding_inputs, may_throw
from flexctrl.errors import SingularMatrixError
from flexctrl.model.plant import Plant
from flexctrl.model.solve import Plan, Solve, factorise, plan
from flexctrl.model.state import State

__all__ = ["Stepper", "Tangent"]

_TURNED = 0.02
_SIGHT = 2.1


class Tangent(NamedTuple):
    """What the factorised tangent was made from."""

    state: State
    v: np.ndarray
    rate: np.ndarray
    seeds: tuple[float, float, float]
    supply: Supply
    h: float


class _Last(NamedTuple):
    """The last correction of Newton's method: its worst freedom, the inputs that it is for, itself."""

    worst: int
    used: np.ndarray
    correction: np.ndarray


@dataclass
class Stepper:
    """Steps of one model; keeps a factorised tangent while it is good.

    Attributes
    ----------
    model : Plant
    feed : Feed
        Where the inputs come from.
    coefficients : Coefficients
    tolerance : float
        Size of the last Newton correction [rad, and m over the size of the machine].
    sight : float
        Time constants of what has damping but no mass up to which a step sees how it sets out.
    """

    model: Plant
    feed: Feed
    coefficients: Coefficients
    tolerance: float
    sight: float = _SIGHT
    counts: Counts = field(default_factory=Counts)
    memory: Tangent | None = None
    _solve: Solve | None = None
    _plan: Plan | None = None
    _gains: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    _exact: bool = False
    _sides: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self.turning = turning(self.model)
        self.weight = 1.0 / yardsticks(self.model)
        self.coning = coning_of(self.model)
        self.firmest = firmest(self.model)
        self.throws = may_throw(self.model)
        self.kinks = self.model.kinks.met
        self.lags = lags_of(self.model, np.arange(self.model.n), self.model.n)

    def recall(self, memory: Tangent | None) -> None:
        """Make the tangent of another stepper's memory again."""
        self.memory = None
        if memory is not None:
            self._factor(memory)

    def start(self, state: State, supply: Supply, step: float) -> AlphaPoint:
        """Return a state with the accelerations it has under its inputs; see `outset.start`."""
        return start(self, state, supply, step)

    def renew(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
        """Return a point under other inputs; see `outset.renew`."""
        return renew(self, point, supply, step)

    def join(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
        """Return the point beyond a corner of a law of force; see `outset.join`."""
        return join(self, point, supply, step)

    def lengthen(self, point: AlphaPoint, step: float) -> AlphaPoint:
        """Return the point before a step many times longer than the last; see `outset.lengthen`."""
        return lengthen(self, point, step)

    def may_throw(self, h: float) -> bool:
        """Tell whether forces that jump may throw parts over a step."""
        return self.throws and h * self.firmest < BLURRED

    def inputs_may_throw(self, h: float) -> bool:
        """Tell whether inputs that jump may; they are not those of a continuous law that reads what moves."""
        if self.feed.reacting or not self.may_throw(h):
            return False
        damping, stiffness = holding_inputs(self.model)
        return h * (self.coefficients.gamma * damping + self.coefficients.beta * h * stiffness) > THROWN

    def at_hand(self, h: float) -> bool:
        """Tell whether the tangent is of about such a step."""
        return self.memory is not None and self.memory.h <= h * AT_HAND and h <= self.memory.h * AT_HAND

    def held(self, force: np.ndarray) -> np.ndarray:
        """Solve with the forces that answer accelerations over a step, as told by the tangent at hand."""
        assert self.memory is not None
        assert self._solve is not None
        return self.memory.seeds[2] * self._solve(force)

    def step(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later.

        Raises
        ------
        StepError
            If Newton's method does not converge, even with a fresh tangent.
        """
        slides = self.feed.reacting
        if slides and point.supply.slid:
            with suppress(StepError):
                return slide(self, point, h)
        try:
            return self._attempt(point, h, fresh=False)
        except StepError:
            try:
                return self._attempt(point, h, fresh=True)
            except StepError as failure:
                if not slides or point.supply.slid:
                    raise
                return _slid(self, point, h, failure)

    def exactly(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later, solved to the last digits.

        Raises
        ------
        StepError
            If Newton's method does not converge.
        """
        self._exact = True
        try:
            return self.step(point, h)
        finally:
            self._exact = False

    def _attempt(self, point: AlphaPoint, h: float, fresh: bool) -> AlphaPoint:
        point = self._hastened(point, h)
        c, now = self.coefficients, point.state
        to_v = c.gamma / (h * c.beta)
        to_rate = (1.0 - c.alpha_m) / (h * h * c.beta * (1.0 - c.alpha_f))
        step, v, rate = self._foreseen(point, h)
        foreseen, last, contraction, end = step, np.inf, 0.0, later(now.t, h)
        wary = h * self.firmest > STIFF
        caution, across, sizes = Caution(min(self.tolerance, SURE), self._exact), False, list[float]()
        for iteration in range(ITERATIONS):
            state = self.model.advance(now, step, v, end)
            supply = self.feed.at(state, point.supply, h)
            force = self.model.balance(state, v, rate) + self.model.loads(state, supply.u)
            if fresh or wary or across or contraction > POOR or (iteration == 0 and self._stale(state, h)):
                self._factor(Tangent(state, v, rate, (1.0, to_v, to_rate), supply, h))
                last = last if wary else np.inf
            assert self._solve is not None
            correction = (1.0 - caution.short) * self._solve(force)
            size, worst = largest(correction * self.weight)
            self.counts.newton += 1
            step = step + correction + self.coning(h, now.v, to_v * correction)
            v, rate = v + to_v * correction, rate + to_rate * correction
            contraction = size / last if 0.0 < last < np.inf else 0.0
            sizes.append(size)
            hopeless = not wary and ((contraction > 2.0 and iteration > 3) or circling(sizes))
            if not np.isfinite(size) or hopeless or self._astray(step - foreseen):
                break
            if caution.over(size, contraction, iteration) if wary else self._solved(size, contraction):
                across = self._across(now, step, v)
                if not across:
                    return self._finish(point, h, step, v, rate, _Last(worst, supply.u, correction))
            last = size
        raise unsolved(self.model.coordinates[worst], worst, float(force[worst]), now.t + h, h)

    def _hastened(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """A point that a step of another length than the last one sets out from along stiff lines."""
        before, state, c = point.came, point.state, self.coefficients
        if not (self.lags.count and before > 0.0 and abs(h - before) > CHANGED * before):
            return point
        pose = np.pad(state.x, ((0, 0), (0, 9))).ravel()
        if not lagged(self.lags, pose, state.driven, state.v, point.rate, min(h, before)):
            return point
        v = state.v + lag_share(c.beta, c.gamma) * (h * h - before * before) * self.lags.change
        own = point.algorithmic + (c.alpha_m - c.alpha_f) * (h - before) * self.lags.change
        return replace(point, state=state.with_(v=v), algorithmic=own)

    def _foreseen(self, point: AlphaPoint, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The end of a step whose accelerations change as those of the last one did."""
        c, before, own = self.coefficients, point.state.v, point.algorithmic
        rate = point.rate + point.lean * point.trend
        algorithmic = c.blend(rate, point.rate, own)
        step = h * before + h * h * ((0.5 - c.beta) * own + c.beta * algorithmic)
        v = before + h * ((1.0 - c.gamma) * own + c.gamma * algorithmic)
        return step + self.coning(h, before, v), v, rate

    def _finish(
        self, point: AlphaPoint, h: float, step: np.ndarray, v: np.ndarray, rate: np.ndarray, last: _Last
    ) -> AlphaPoint:
        c, (worst, used, correction) = self.coefficients, last
        self.counts.worst = worst
        state = self.model.advance(point.state, step, v, later(point.state.t, h))
        if self.model.motion.dead_point(point.state, state):
            raise StepError(
                worst, f"a loop of rigid parts is at a dead point at t = {state.t:.6g} s; let a part of it bend"
            )
        algorithmic = c.blend(rate, point.rate, point.algorithmic)
        change = rate - point.rate
        lean = _lean(change * self.weight, point.trend * self.weight)
        supply = self.feed.at(state, point.supply, h)
        if self.feed.reacting and jumps(point.supply.u, used, supply.u, self._gains @ correction):
            raise StepError(worst, f"the law jumps at t = {state.t:.6g} s")
        return AlphaPoint(state, rate, supply, algorithmic, change, lean, h)

    def _solved(self, size: float, contraction: float) -> bool:
        """Tell whether a correction was the last that is needed, or the next is foretold to be none."""
        tolerance = wanted(self.tolerance, self._exact)
        foretold = 0.0 < contraction < 1.0 and size * contraction <= 0.5 * tolerance
        return foretold or small_enough(size, contraction, self.tolerance, self._exact)

    def _across(self, now: State, step: np.ndarray, v: np.ndarray) -> bool:
        """Tell whether forces jump between where the tangent was made and where the step ends.

        What a correction by a stiff flank's tangent leaves in the gap beside it is small, and says nothing.
        """
        if not self._sides.size:
            return False
        return bool((self._sides * self.kinks.sides(self.model.advance(now, step, v, now.t)) < 0.0).any())

    def _astray(self, unforeseen: np.ndarray) -> bool:
        """Tell whether Newton's method heads for a turn that the motion did not announce: another root."""
        return bool(np.abs(unforeseen[self.turning]).max(initial=0.0) > ASTRAY)

    def _stale(self, state: State, h: float) -> bool:
        made = self.memory
        if made is None or abs(h - made.h) > 1e-6 * h or made.state.dry.phase.tolist() != state.dry.phase.tolist():
            return True
        turned = np.abs(state.q - made.state.q)[self.turning]
        return bool(turned.size) and float(turned.max()) > _TURNED

    def _factor(self, at: Tangent) -> None:
        slope = self.model.slope(at.state, at.v, at.rate, at.seeds, at.supply.u)
        if self.feed.continuous:
            self._gains = self.feed.gains(at.state, at.supply, at.h, at.seeds)
            slope = slope + self.feed.felt(at.state, at.supply, self._gains)
        try:
            solve = self.factorised(slope)
            self._solve = lambda force: solve(-force)
        except SingularMatrixError as error:
            raise singular_tangent(error, at.state.t, at.h) from error
        self.counts.factorisations += 1
        self.memory, self._sides = at, self.kinks.sides(at.state)

    def factorised(self, matrix: sp.csr_matrix) -> Solve:
        """Return what solves with a matrix, whose pattern is gone through once."""
        if self._plan is None or not self._plan.fits(matrix):
            self._plan = plan(matrix)
        return factorise(matrix, self._plan)

    def error(self, before: AlphaPoint, after: AlphaPoint, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the local error of a step over what is allowed: |β − 1/6| h² |Δa| (Zienkiewicz & Xie 1991).

        In the order of the compiled loops: whether a step is one of them must make no difference to the next one.
        """
        change = np.abs(after.algorithmic - before.algorithmic) * self.weight
        allowed = tolerance.of(farthest(self.model, moved))
        places = abs(self.coefficients.beta - 1.0 / 6.0) * h * h * float((change / allowed).max(initial=0.0))
        return max(places, self.feed.law_error(before.supply, after.supply, after.state, h, tolerance))

    def missed(self, before: AlphaPoint, after: AlphaPoint) -> np.ndarray:
        """Return the local error of a step, (β − 1/6) h² Δa."""
        h = after.state.t - before.state.t
        return (self.coefficients.beta - 1.0 / 6.0) * h * h * (after.algorithmic - before.algorithmic)

    def remains(self, share: np.ndarray) -> np.ndarray:
        """Return what a run is off by: as much as its errors add up to."""
        return share


def _slid(stepper: Stepper, point: AlphaPoint, h: float, failure: StepError) -> AlphaPoint:
    """The end of a step that lies where the law jumps; what has failed otherwise."""
    try:
        return slide(stepper, point, h)
    except StepError:
        raise failure from None


def _lean(change: np.ndarray, before: np.ndarray) -> float:
    """Return the share of the change before that is nearest to a change, within ±1."""
    square = float(before @ before)
    return min(1.0, max(-1.0, float(change @ before) / square)) if square > 0.0 else 1.0
