"""Where steps of generalised alpha set out: at the start, under inputs that have jumped, beyond corners of forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.scales import largest
from flexctrl.dynamics.swift.easing import eased_change, eased_rate, unresolved
from flexctrl.dynamics.swift.fleeting import felt_rates
from flexctrl.dynamics.swift.massless import Massless, massless
from flexctrl.dynamics.swift.settling import settled, steadied
from flexctrl.dynamics.swift.thrown import CORRECTIONS, THROWN
from flexctrl.errors import SingularMatrixError
from flexctrl.model.flows import flow_rates, flowing, without
from flexctrl.model.solve import Solve
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.alpha.steps import Stepper

__all__ = ["join", "lengthen", "renew", "start"]

_SHARE = 1e-3

_Holding = Callable[["Stepper", State, Supply, float], Solve]


def start(stepper: Stepper, state: State, supply: Supply, step: float) -> AlphaPoint:
    """Return a state with the accelerations it has under its inputs; what has no mass where it balances.

    Raises
    ------
    SingularMatrixError
        If a freedom has neither mass nor stiffness.
    """
    fresh = _fresh(stepper, state, supply, step)
    if stepper.may_throw(step):
        fresh = _tempered(stepper, fresh, np.zeros(stepper.model.n), step, _held)
    return _eased(stepper, fresh, step)


def _fresh(stepper: Stepper, state: State, supply: Supply, step: float) -> AlphaPoint:
    steady = steadied(stepper.feed, state, supply, step, stepper.sight)
    state, supply = settled(stepper.model, state, stepper.feed, supply, steady)
    light = _light(stepper, state, supply, step)
    state, supply, rate = _set_out(stepper, state, supply, step, light)
    if light.loose.size:
        later = _set_out(stepper, *_later(stepper, state, supply, rate, step), step, light)[0]
        rate[light.loose] = (later.v - state.v)[light.loose] / (_SHARE * step)
    return AlphaPoint(state, rate, supply, rate, np.zeros(stepper.model.n))


def _light(stepper: Stepper, state: State, supply: Supply, step: float) -> Massless:
    """What moves no mass and sets out as its forces say: nothing, where a step would not see how it begins."""
    light = massless(stepper.feed, steadied(stepper.feed, state, supply, step, stepper.sight))
    return light if light.all.size and light.seen(state, supply, step, stepper.sight) else light.none


def _later(stepper: Stepper, state: State, supply: Supply, rate: np.ndarray, step: float) -> tuple[State, Supply]:
    """Return a state that soon follows, and the inputs there."""
    t = _SHARE * step
    state = stepper.model.advance(state, t * state.v, state.v + t * rate, state.t + t)
    return state, stepper.feed.restart(state, replace(supply, x=supply.x + t * supply.rate))


def _set_out(
    stepper: Stepper, state: State, supply: Supply, step: float, light: Massless
) -> tuple[State, Supply, np.ndarray]:
    """Return a state with the rates of what has no mass, the inputs there, and the accelerations of all others."""
    flows = stepper.model.motion.flows
    state, supply = light.pushed(flowing(stepper.model, state, supply.u), supply)
    felt, changes = _felt(stepper, state, supply, step) if flows.size else (state, np.zeros(0))
    force = stepper.model.balance(felt, felt.v, np.zeros(stepper.model.n)) + stepper.model.loads(felt, supply.u)
    force[flows] = changes
    rate = _mass(stepper, state, supply, step, light)(force)
    if light.all.size:
        state, rate = light.moving(state, rate, supply, step)
        supply = stepper.feed.restart(state, supply)
    return state, supply, rate


def _felt(stepper: Stepper, state: State, supply: Supply, step: float) -> tuple[State, np.ndarray]:
    """Return a state as others feel freedoms of first order from the outset, and how fast the rates of these change."""
    c, changes = stepper.coefficients, flow_rates(stepper.model, state, supply.u, step)
    return state.with_(v=felt_rates(stepper.model, state.v, changes, step, c.beta, c.gamma)), changes


def renew(stepper: Stepper, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
    """Return a point under other inputs: the true accelerations jump; the method's own keep their lead on them.

    Without the lead every jump would cost an error of first order in the step.
    """
    fresh = _fresh(stepper, point.state, supply, step)
    if stepper.inputs_may_throw(step):
        fresh = _tempered(stepper, fresh, point.rate, step, _held_at_hand)
    lead = stepper.model.switches.still(point.state, point.algorithmic - point.rate)
    return _eased(stepper, replace(fresh, algorithmic=fresh.rate + lead, came=point.came), step)


def join(stepper: Stepper, point: AlphaPoint, supply: Supply, step: float) -> AlphaPoint:
    """Return the point beyond a corner of a law of force, with the lead that the motion there will have.

    The lead is (α_m − α_f) h times the rate of the accelerations, and h and that rate may be others by orders.
    What the step does not resolve is held by its own tangent: over the mass alone, a trace of speed in a stiff part
    makes a lead that throws it.
    """
    c, fresh = stepper.coefficients, _fresh(stepper, point.state, supply, step)
    if stepper.may_throw(step):
        fresh = _tempered(stepper, fresh, np.zeros(stepper.model.n), step, _held)
    state, rate = (eased := _eased(stepper, fresh, step)).state, eased.rate
    change = stepper.model.slope(state, state.v, rate, (1.0, 0.0, 0.0), supply.u) @ state.v
    change += stepper.model.slope(state, state.v, rate, (0.0, 1.0, 0.0), supply.u) @ rate
    lead = (c.alpha_m - c.alpha_f) * step * _held(stepper, state, supply, step)(change)
    lead[stepper.model.motion.flows] = 0.0
    return _eased(stepper, replace(fresh, algorithmic=fresh.rate + lead), step)


def lengthen(stepper: Stepper, point: AlphaPoint, step: float) -> AlphaPoint:
    """Return a point before a step many times longer than the last, which may have resolved parts that this one throws.

    With their accelerations the true ones start anew, the method's own with them; elsewhere nothing changes.
    """
    if not stepper.may_throw(step):
        return point
    zero = np.zeros(stepper.model.n)
    fresh = _tempered(stepper, point, zero, step, _held)
    return point if fresh is point else replace(fresh, trend=zero, lean=1.0)


def _tempered(stepper: Stepper, fresh: AlphaPoint, before: np.ndarray, step: float, held: _Holding) -> AlphaPoint:
    """Return a point whose accelerations have jumped from those before, by less where parts would be thrown.

    See `flexctrl.dynamics.swift.thrown`.
    """
    change = fresh.rate - before
    if stepper.coefficients.beta * step**2 * largest(change * stepper.weight)[0] <= stepper.tolerance:
        return fresh
    try:
        solve = held(stepper, fresh.state, fresh.supply, step)
    except SingularMatrixError:
        return fresh
    force = _forces(stepper, fresh, before)
    answer = solve(force)
    if not 0.0 < THROWN * float(force @ answer) < float(force @ change):
        return fresh
    rate = before + answer
    for _ in range(1, CORRECTIONS):
        rate = rate + solve(_forces(stepper, fresh, rate))
    return replace(fresh, rate=rate, algorithmic=rate)


def _forces(stepper: Stepper, point: AlphaPoint, rate: np.ndarray) -> np.ndarray:
    """The forces that accelerations leave."""
    state = point.state
    return stepper.model.balance(state, state.v, rate) + stepper.model.loads(state, point.supply.u)


def _eased(stepper: Stepper, point: AlphaPoint, step: float) -> AlphaPoint:
    """Return a point whose freedoms of first order set out so that a step that sees nothing of them ends well."""
    c, v, rate, own = stepper.coefficients, point.state.v.copy(), point.rate.copy(), point.algorithmic.copy()
    eased = [(i, x, w) for i, x, w in _hurrying(stepper, point, step) if unresolved(x, w, step)]
    for i, x, w in eased:
        v[i] += eased_rate(x, w, step, c.beta, c.gamma) - x
        rate[i] += eased_change(x, w, step, c.beta, c.gamma) - w
        own[i] = rate[i]
    return replace(point, state=point.state.with_(v=v), rate=rate, algorithmic=own) if eased else point


def _hurrying(stepper: Stepper, point: AlphaPoint, step: float) -> list[tuple[int, float, float]]:
    """What may be over within a step: freedoms of first order, those that follow them; their rates and changes."""
    (state, rate), inner = (point.state, point.rate), stepper.model.motion.settling
    found = [(int(i), float(state.v[i]), float(rate[i])) for i in inner]
    light = _light(stepper, state, point.supply, step) if found else massless(stepper.feed).none
    if not light.loose.size:
        return found
    later, supply, after = _set_out(stepper, *_later(stepper, state, point.supply, rate, step), step, light)
    now, then = (light.hurried(*at) for at in ((state, rate, point.supply), (later, after, supply)))
    rates = zip(light.loose.tolist(), now.tolist(), ((then - now) / (_SHARE * step)).tolist(), strict=True)
    return [*found, *rates]


def _mass(stepper: Stepper, state: State, supply: Supply, step: float, light: Massless) -> Solve:
    """The mass matrix; where it is singular, the forces that hold massless freedoms over a step stand in."""
    M = _massive(stepper, -stepper.model.slope(state, state.v, np.zeros(stepper.model.n), (0.0, 0.0, 1.0), supply.u))
    if light.all.size:
        M = without(M, light.all)
    if (M.diagonal() > stepper.model.dust).all():
        try:
            return stepper.factorised(M)
        except SingularMatrixError:
            pass
    return _held(stepper, state, supply, step)


def _held(stepper: Stepper, state: State, supply: Supply, step: float) -> Solve:
    """The mass matrix and the forces that answer accelerations over a step."""
    c, zero = stepper.coefficients, np.zeros(stepper.model.n)
    seeds = (c.beta * step**2, c.gamma * step, 1.0)
    return stepper.factorised(_massive(stepper, -stepper.model.slope(state, state.v, zero, seeds, supply.u)))


def _held_at_hand(stepper: Stepper, state: State, supply: Supply, step: float) -> Solve:
    """The same by the tangent at hand, where it is of about that step."""
    return stepper.held if stepper.at_hand(step) else _held(stepper, state, supply, step)


def _massive(stepper: Stepper, matrix: sp.csr_matrix) -> sp.csr_matrix:
    flows = stepper.model.motion.flows
    return without(matrix, flows) if flows.size else matrix
