"""What is dissipated as a step sets out, where it does not see how freedoms of first order settle."""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.swift.easing import felt_rate, unresolved
from flexctrl.model.flows import flow_rates, flowing
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["felt_power", "felt_rates", "settled_power"]

_TRAPEZOID = 0.25, 0.5


def felt_rates(model: Plant, v: np.ndarray, changes: np.ndarray, step: float, beta: float, gamma: float) -> np.ndarray:
    """Return the rates that push all others from the outset: means, of what settles and is over within the step.

    Parameters
    ----------
    model : Plant
    v : numpy.ndarray, shape (n,)
        Rates that freedoms of first order have under their inputs.
    changes : numpy.ndarray, shape (inner freedoms of first order,)
        How fast these change.
    step : float
        About to be taken [s].
    beta, gamma : float
        Of Newmark's formulas.

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    felt = v.copy()
    for i, change in _over(model, v, changes, step):
        felt[i] = felt_rate(float(v[i]), change, step, beta, gamma)
    return felt


def felt_power(model: Plant, state: State, rate: np.ndarray, u: np.ndarray, step: float) -> float:
    """Return the power whose mean with the one at the end is dissipated over a step [W].

    It is the present one, but for what is over within the step: inputs that hold lose there in proportion to its rate.

    Parameters
    ----------
    model : Plant
    state : State
        As steps set out from it.
    rate : numpy.ndarray, shape (n,)
        Accelerations as steps set out; none of what sets out with its mean rate.
    u : numpy.ndarray, shape (inputs,)
    step : float
        About to be taken [s].

    Returns
    -------
    float
    """
    if not model.motion.settling.size:
        return model.energy(state)[2]
    v = flowing(model, state, u).v
    over = _over(model, v, flow_rates(model, state.with_(v=v), u, step), step)
    calm = state.v.copy()
    calm[[i for i, _ in over]] = 0.0
    lost = left = model.energy(state.with_(v=calm))[2]
    for i, change in over:
        felt, alone = float(state.v[i]), calm.copy()
        felt = felt_rate(float(v[i]), change, step, *_TRAPEZOID) if rate[i] else felt
        alone[i] = v[i]
        lost += felt / v[i] * (model.energy(state.with_(v=alone))[2] - left)
    return lost


def settled_power(model: Plant, state: State, u: np.ndarray) -> float:
    """Return the power dissipated in motion drawn over a step that may not see how freedoms settle [W].

    What these lose is quadratic in their rates. It is taken as what inputs that hold lose, in proportion to the rate:
    the same along the true course, where the rate is the one that the inputs ask for.

    Parameters
    ----------
    model : Plant
    state : State
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    float
    """
    settling = model.motion.settling
    if not settling.size:
        return model.energy(state)[2]
    asked, calm = flowing(model, state, u).v, state.v.copy()
    calm[settling] = 0.0
    lost = left = model.energy(state.with_(v=calm))[2]
    for i in settling.tolist():
        rate, scale = float(state.v[i]), max(abs(state.v[i]), abs(asked[i]))
        if rate:
            up, down = (_lost_alone(model, state, calm, i, side * scale) - left for side in (1.0, -1.0))
            lost += rate / scale * (0.5 * (up - down) + 0.5 * (up + down) * asked[i] / scale)
    return lost


def _lost_alone(model: Plant, state: State, calm: np.ndarray, i: int, rate: float) -> float:
    """The power dissipated where only one of them has a rate."""
    v = calm.copy()
    v[i] = rate
    return model.energy(state.with_(v=v))[2]


def _over(model: Plant, v: np.ndarray, changes: np.ndarray, step: float) -> list[tuple[int, float]]:
    """What settles and is over within a step, and how fast its rate changes."""
    found = zip(model.motion.flows.tolist(), changes.tolist(), strict=True)
    return [(i, w) for i, w in found if i in model.motion.settling and unresolved(float(v[i]), w, step)]
