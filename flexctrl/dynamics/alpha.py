"""One step of the generalised-alpha method on the rotation group.

Chung & Hulbert (1993) in the Lie group form of Brüls, Cardona & Arnold (2012): increments of rotation
are rotation vectors in space axes. Stiffly accurate enough for structures: second order, unconditionally
stable, with the high frequencies damped down to the spectral radius ρ.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics import steps
from flexctrl.dynamics.coning import coning_of
from flexctrl.dynamics.easing import eased_change, eased_rate, unresolved
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.massless import Massless, massless
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest, largest, turning, yardsticks
from flexctrl.dynamics.settling import settled
from flexctrl.dynamics.spectrum import told_damping
from flexctrl.dynamics.steps import MOST_STEPS, Controlled, Counts, Fixed, Integrator, Point, StepError, check_step
from flexctrl.dynamics.stiff_lines import STIFF, SURE, Caution, firmest
from flexctrl.errors import SingularMatrixError, StructureError
from flexctrl.model.flows import flow_rates, flowing, without
from flexctrl.model.model import Model
from flexctrl.model.solve import Plan, Solve, factorise, plan
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_number, check_seconds

_TURNED = 0.02
_SHARE = 1e-3
_SIGHT = 2.1
_POOR = 0.25
_ASTRAY = 1.5
_ITERATIONS = 12
_LAST, _ROUND_OFF = 1e-15, 1e-13
_LEFTOVER = 1e-11  # stiff parts that steps do not resolve make accelerations of it


@dataclass(frozen=True)
class Coefficients:
    """Constants of the method for a spectral radius at infinity."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of(cls, rho: float) -> Coefficients:
        """Return the optimal set for 0 ≤ ρ ≤ 1."""
        alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma)

    @property
    def damping(self) -> bool:
        """Whether the highest frequencies lose energy: ρ < 1."""
        return self.gamma > 0.5

    def blend(self, rate: np.ndarray, before: np.ndarray, algorithmic: np.ndarray) -> np.ndarray:
        """Return the method's own acceleration after a step, from the true ones at both ends and its own before."""
        return ((1.0 - self.alpha_f) * rate + self.alpha_f * before - self.alpha_m * algorithmic) / (1.0 - self.alpha_m)


@dataclass(frozen=True)
class AlphaPoint(Point):
    """A point of the method: its own accelerations beside the true ones, and how these grow.

    ``trend`` is the change of the true accelerations over the last step, ``lean`` the share of the one before that
    best foretold it: the next one is expected to be that share of it.
    """

    algorithmic: np.ndarray
    trend: np.ndarray
    lean: float = 1.0


class Tangent(NamedTuple):
    """What the factorised tangent was made from."""

    state: State
    v: np.ndarray
    rate: np.ndarray
    seeds: tuple[float, float, float]
    supply: Supply
    h: float


@dataclass
class Stepper:
    """Steps of one model; keeps a factorised tangent while it is good.

    Attributes
    ----------
    model : Model
    feed : Feed
        Where the inputs come from.
    coefficients : Coefficients
    tolerance : float
        Size of the last Newton correction [rad, and m over the size of the machine].
    sight : float
        Time constants of what has damping but no mass up to which a step sees how it sets out.
    """

    model: Model
    feed: Feed
    coefficients: Coefficients
    tolerance: float
    sight: float = _SIGHT
    counts: Counts = field(default_factory=Counts)
    memory: Tangent | None = None
    _solve: Solve | None = None
    _plan: Plan | None = None

    def __post_init__(self) -> None:
        self.turning = turning(self.model)
        self.weight = 1.0 / yardsticks(self.model)
        self.coning = coning_of(self.model)
        self.firmest = firmest(self.model)

    def recall(self, memory: Tangent | None) -> None:
        """Make the tangent of another stepper's memory again."""
        self.memory = None
        if memory is not None:
            self._factor(memory)

    def start(self, state: State, supply: Supply, step: float) -> AlphaPoint:
        """Return a state with the accelerations it has under its inputs; what has no mass where it balances.

        Raises
        ------
        SingularMatrixError
            If a freedom has neither mass nor stiffness.
        """
        return self._eased(self._fresh(state, supply, step), step)

    def _fresh(self, state: State, supply: Supply, step: float) -> AlphaPoint:
        state, supply = settled(self.model, state, self.feed, supply)
        light = self._light(state, supply, step)
        state, supply, rate = self._set_out(state, supply, step, light)
        if light.loose.size:
            later = self._set_out(*self._later(state, supply, rate, step), step, light)[0]
            rate[light.loose] = (later.v - state.v)[light.loose] / (_SHARE * step)
        return AlphaPoint(state, rate, supply, rate, np.zeros(self.model.n))

    def _light(self, state: State, supply: Supply, step: float) -> Massless:
        """What moves no mass and sets out as its forces say: nothing, where a step would not see how it begins."""
        light = massless(self.feed)
        return light if light.all.size and light.seen(state, supply, step, self.sight) else light.none

    def _later(self, state: State, supply: Supply, rate: np.ndarray, step: float) -> tuple[State, Supply]:
        """Return a state that soon follows, and the inputs there."""
        t = _SHARE * step
        state = self.model.advance(state, t * state.v, state.v + t * rate, state.t + t)
        return state, self.feed.restart(state, replace(supply, x=supply.x + t * supply.rate))

    def _set_out(self, state: State, supply: Supply, step: float, light: Massless) -> tuple[State, Supply, np.ndarray]:
        """Return a state with the rates of what has no mass, the inputs there, and the accelerations of all others."""
        flows = self.model.motion.flows
        state, supply = light.pushed(flowing(self.model, state, supply.u), supply)
        force = self.model.balance(state, state.v, np.zeros(self.model.n)) + self.model.loads(state, supply.u)
        if flows.size:
            force[flows] = flow_rates(self.model, state, supply.u, step)
        rate = self._mass(state, supply, step, light)(force)
        if light.all.size:
            state, rate = light.moving(state, rate, supply, step)
            supply = self.feed.restart(state, supply)
        return state, supply, rate

    def renew(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
        """Return a point under other inputs: the true accelerations jump; the method's own keep their lead on them.

        Without the lead every jump would cost an error of first order in the step.
        """
        fresh = self._fresh(point.state, supply, step)
        lead = self.model.switches.still(point.state, point.algorithmic - point.rate)
        return self._eased(replace(fresh, algorithmic=fresh.rate + lead), step)

    def join(self, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
        """Return the point beyond a corner of a law of force, with the lead that the motion there will have.

        The lead is (α_m − α_f) h times the rate of the accelerations, and h and that rate may be others by orders.
        What the step does not resolve is held by its own tangent: over the mass alone, a trace of speed in a stiff part
        makes a lead that throws it.
        """
        c, fresh = self.coefficients, self._fresh(point.state, supply, step)
        state, rate = fresh.state, fresh.rate
        change = self.model.slope(state, state.v, rate, (1.0, 0.0, 0.0), supply.u) @ state.v
        change += self.model.slope(state, state.v, rate, (0.0, 1.0, 0.0), supply.u) @ rate
        lead = (c.alpha_m - c.alpha_f) * step * self._held(state, supply, step)(change)
        lead[self.model.motion.flows] = 0.0
        return self._eased(replace(fresh, algorithmic=rate + lead), step)

    def _eased(self, point: AlphaPoint, step: float) -> AlphaPoint:
        """Return a point whose freedoms of first order set out so that a step that sees nothing of them ends well."""
        c, v, rate, own = self.coefficients, point.state.v.copy(), point.rate.copy(), point.algorithmic.copy()
        eased = [(i, x, w) for i, x, w in self._hurrying(point, step) if unresolved(x, w, step)]
        for i, x, w in eased:
            v[i] += eased_rate(x, w, step, c.beta, c.gamma) - x
            rate[i] += eased_change(x, w, step, c.beta, c.gamma) - w
            own[i] = rate[i]
        return replace(point, state=point.state.with_(v=v), rate=rate, algorithmic=own) if eased else point

    def _hurrying(self, point: AlphaPoint, step: float) -> list[tuple[int, float, float]]:
        """What may be over within a step: freedoms of first order, those that follow them; their rates and changes."""
        (state, rate), inner = (point.state, point.rate), self.model.motion.settling
        found = [(int(i), float(state.v[i]), float(rate[i])) for i in inner]
        light = self._light(state, point.supply, step) if found else massless(self.feed).none
        if not light.loose.size:
            return found
        later, supply, after = self._set_out(*self._later(state, point.supply, rate, step), step, light)
        now, then = (light.hurried(*at) for at in ((state, rate, point.supply), (later, after, supply)))
        rates = zip(light.loose.tolist(), now.tolist(), ((then - now) / (_SHARE * step)).tolist(), strict=True)
        return [*found, *rates]

    def _mass(self, state: State, supply: Supply, step: float, light: Massless) -> Solve:
        """The mass matrix; where it is singular, the forces that hold massless freedoms over a step stand in."""
        M = self._massive(-self.model.slope(state, state.v, np.zeros(self.model.n), (0.0, 0.0, 1.0), supply.u))
        if light.all.size:
            M = without(M, light.all)
        if (M.diagonal() > self.model.dust).all():
            try:
                return self._factorised(M)
            except SingularMatrixError:
                pass
        return self._held(state, supply, step)

    def _held(self, state: State, supply: Supply, step: float) -> Solve:
        """The mass matrix and the forces that answer accelerations over a step."""
        c, zero = self.coefficients, np.zeros(self.model.n)
        seeds = (c.beta * step**2, c.gamma * step, 1.0)
        return self._factorised(self._massive(-self.model.slope(state, state.v, zero, seeds, supply.u)))

    def _massive(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        flows = self.model.motion.flows
        return without(matrix, flows) if flows.size else matrix

    def step(self, point: AlphaPoint, h: float) -> AlphaPoint:
        """Return the point a step later.

        Raises
        ------
        StepError
            If Newton's method does not converge, even with a fresh tangent.
        """
        try:
            return self._attempt(point, h, fresh=False)
        except StepError:
            return self._attempt(point, h, fresh=True)

    def _attempt(self, point: AlphaPoint, h: float, fresh: bool) -> AlphaPoint:
        c, now = self.coefficients, point.state
        to_v = c.gamma / (h * c.beta)
        to_rate = (1.0 - c.alpha_m) / (h * h * c.beta * (1.0 - c.alpha_f))
        rate = point.rate + point.lean * point.trend
        algorithmic = c.blend(rate, point.rate, point.algorithmic)
        step = h * now.v + h * h * ((0.5 - c.beta) * point.algorithmic + c.beta * algorithmic)
        v = now.v + h * ((1.0 - c.gamma) * point.algorithmic + c.gamma * algorithmic)
        step = step + self.coning(h, now.v, v)
        foreseen, last, contraction, end = step, np.inf, 0.0, later(now.t, h)
        wary = h * self.firmest > STIFF
        caution = Caution(min(self.tolerance, SURE))
        for iteration in range(_ITERATIONS):
            state = self.model.advance(now, step, v, end)
            supply = self.feed.at(state, point.supply, h)
            force = self.model.balance(state, v, rate) + self.model.loads(state, supply.u)
            if fresh or wary or contraction > _POOR or (iteration == 0 and self._stale(state, h)):
                self._factor(Tangent(state, v, rate, (1.0, to_v, to_rate), supply, h))
                last = last if wary else np.inf
            assert self._solve is not None
            correction = (1.0 - caution.short) * self._solve(force)
            size, worst = largest(correction * self.weight)
            self.counts.newton += 1
            step = step + correction + self.coning(h, now.v, to_v * correction)
            v, rate = v + to_v * correction, rate + to_rate * correction
            contraction = size / last if np.isfinite(last) else 0.0
            worse = contraction > 2.0 and iteration > 3 and not wary
            if not np.isfinite(size) or worse or self._astray(step - foreseen):
                break
            if caution.over(size, contraction, iteration) if wary else self._solved(size, contraction):
                return self._finish(point, h, step, v, rate, worst)
            last = size
        raise StepError(worst, f"Newton's method did not converge at t = {now.t + h:.6g} s with a step of {h:.3g} s")

    def _finish(
        self, point: AlphaPoint, h: float, step: np.ndarray, v: np.ndarray, rate: np.ndarray, worst: int
    ) -> AlphaPoint:
        c = self.coefficients
        self.counts.worst = worst
        state = self.model.advance(point.state, step, v, later(point.state.t, h))
        motion = self.model.motion
        if motion.dead_point(state) or motion.turned_back(point.state, point.rate, state, rate):
            raise StepError(
                worst, f"a loop of rigid parts is at a dead point at t = {state.t:.6g} s; let a part of it bend"
            )
        algorithmic = c.blend(rate, point.rate, point.algorithmic)
        change = rate - point.rate
        lean = _lean(change * self.weight, point.trend * self.weight)
        return AlphaPoint(state, rate, self.feed.at(state, point.supply, h), algorithmic, change, lean)

    def _solved(self, size: float, contraction: float) -> bool:
        """Tell whether a correction was the last that is needed, or the next is foretold to be none."""
        foretold = 0.0 < contraction < 1.0 and size * contraction <= 0.5 * self.tolerance
        return size <= self.tolerance or foretold or (contraction > _POOR and size <= _ROUND_OFF)

    def _astray(self, unforeseen: np.ndarray) -> bool:
        """Tell whether Newton's method heads for a turn that the motion did not announce: another root."""
        return bool(np.abs(unforeseen[self.turning]).max(initial=0.0) > _ASTRAY)

    def _stale(self, state: State, h: float) -> bool:
        made = self.memory
        if made is None or abs(h - made.h) > 1e-6 * h or made.state.dry.phase.tolist() != state.dry.phase.tolist():
            return True
        turned = np.abs(state.q - made.state.q)[self.turning]
        return bool(turned.size) and float(turned.max()) > _TURNED

    def _factor(self, at: Tangent) -> None:
        slope = self.model.slope(at.state, at.v, at.rate, at.seeds, at.supply.u)
        if self.feed.continuous:
            slope = slope + self.feed.slope(at.state, at.supply, at.h, at.seeds)
        try:
            solve = self._factorised(slope)
            self._solve = lambda force: solve(-force)
        except SingularMatrixError as error:
            raise StepError(error.where, "the tangent is singular") from error
        self.counts.factorisations += 1
        self.memory = at

    def _factorised(self, matrix: sp.csr_matrix) -> Solve:
        if self._plan is None or not self._plan.fits(matrix):
            self._plan = plan(matrix)
        return factorise(matrix, self._plan)

    def error(self, before: AlphaPoint, after: AlphaPoint, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the local error of a step over what is allowed: |β − 1/6| h² |Δa| (Zienkiewicz & Xie 1991)."""
        h = after.state.t - before.state.t
        c = self.coefficients
        local = abs(c.beta - 1.0 / 6.0) * h * h * np.abs(after.algorithmic - before.algorithmic) * self.weight
        allowed = tolerance.of(farthest(self.model, moved))
        return float((local / allowed).max(initial=0.0))


def _lean(change: np.ndarray, before: np.ndarray) -> float:
    """Return the share of the change before that is nearest to a change, within ±1."""
    square = float(before @ before)
    return min(1.0, max(-1.0, float(change @ before) / square)) if square > 0.0 else 1.0


def _quickest(plain: Stepper) -> Any:
    """Return steps in compiled loops, where the model and its feed allow that."""
    from flexctrl.dynamics.march.marching import can_march
    from flexctrl.dynamics.march.stepper import MarchingStepper

    return MarchingStepper(plain) if can_march(plain.model) and not plain.feed.continuous else plain


class _Damped:
    """What the spectral radius at infinite frequency makes of generalised alpha."""

    rho: float

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return self.rho == 1.0

    @property
    def damping(self) -> str:
        return told_damping(self.rho)


@dataclass(frozen=True)
class GeneralizedAlpha(_Damped):
    """Generalised alpha with a fixed step; second order.

    Parameters
    ----------
    step : float
        Step [s]; shortened a little so that a whole number of steps ends at each sample instant.
    rho : float
        Spectral radius at infinite frequency, 0 … 1: 1 keeps all energy, 0 kills the highest frequencies at once.

    Raises
    ------
    StructureError
        For a step that is not positive or ρ outside 0 … 1.
    """

    step: float
    rho: float = 0.9

    def __post_init__(self) -> None:
        check_step(self.step, "GeneralizedAlpha")
        _check_rho(self.rho)

    @property
    def pace(self) -> Fixed:
        return Fixed(self.step)

    def stepper(self, model: Model, feed: Feed, tolerance: Tolerance) -> steps.Stepper[Any]:
        newton = min(1e-6, max(1e-3 * tolerance.absolute, _LAST))
        return _quickest(Stepper(model, feed, Coefficients.of(self.rho), newton))


@dataclass(frozen=True)
class AdaptiveAlpha(_Damped):
    """Generalised alpha with steps chosen from the estimated error, tried again where it is too large.

    Parameters
    ----------
    rho : float
        Spectral radius at infinite frequency, 0 … 1.
    first_step : float
        [s]
    largest_step : float
        [s]
    most_steps : float
        Of a run; one whose steps have become so short that it would take more ends, and says so.

    Raises
    ------
    StructureError
        For a value out of range.
    """

    rho: float = 0.8
    first_step: float = 1e-4
    largest_step: float = np.inf
    most_steps: float = field(default=MOST_STEPS, repr=False)

    def __post_init__(self) -> None:
        _check_rho(self.rho)
        check_seconds(self.first_step, "first_step", "AdaptiveAlpha")
        check_seconds(self.largest_step, "largest_step", "AdaptiveAlpha", endless=True)
        check_number(self.most_steps, "most_steps", "AdaptiveAlpha", above=0.0)

    @property
    def pace(self) -> Controlled:
        return Controlled(self.first_step, self.largest_step, 3, self.most_steps)

    def stepper(self, model: Model, feed: Feed, tolerance: Tolerance) -> steps.Stepper[Any]:
        newton = min(_LEFTOVER, max(1e-3 * tolerance.absolute, _LAST))
        # steps too long for what has damping but no mass are seen to be by their error, if it sets out as it does
        return _quickest(Stepper(model, feed, Coefficients.of(self.rho), newton, sight=np.inf))


def _check_rho(rho: float) -> None:
    if not 0.0 <= check_number(rho, "rho", "generalised alpha") <= 1.0:
        raise StructureError(f"generalised alpha: rho = {rho}; expected 0 … 1 (0.9 damps only the highest frequencies)")


__all__ = ["AdaptiveAlpha", "AlphaPoint", "Coefficients", "GeneralizedAlpha", "Integrator", "Stepper", "Tangent"]
