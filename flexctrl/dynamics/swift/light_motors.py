"""Motors without inertia behind shafts so stiff that their torque hangs on the last digits: such shafts give way.

A motor that moves no mass bears on its shaft what it is given, however stiff the shaft is. But the shaft's torque is
k (θ_d − R s): at k R² = 1e16 N m/rad the last digit of s is 1 N m, and what is driven would be pushed by such digits
at each step. A shaft that keeps 2²³ times the stiffness that it drives has the same motion, and θ_d is ahead by the
twist that such a shaft has, T/k'. A motor with inertia needs nothing of this: what is wrong of its shaft's torque it
takes up itself.
"""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.scales import yardsticks
from flexctrl.model.balance import Balance
from flexctrl.model.eased import shares_left
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.softened import shafts_of, softened
from flexctrl.model.state import State

__all__ = ["giving_way", "seated"]

_KEPT, _MOTORS = "_giving_way", "_motors_eased"
_TWIST = 1e-6


def giving_way(model: Plant) -> Plant:
    """Return a model whose shafts behind motors without inertia give way as far as doubles need: as a rule, the same.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    Plant
    """
    if not isinstance(model, Model) or not _light(model):
        return model
    if _KEPT not in model.__dict__:
        model.__dict__[_KEPT] = _eased(model)
    return model.__dict__[_KEPT] or model


def seated(model: Plant, state: State, u: np.ndarray) -> State:
    """Return a state in which shafts that give way bear what their motors push.

    Parameters
    ----------
    model : Plant
    state : State
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    State
        The same where a motor would have to turn further than such a shaft twists.
    """
    motors, still = model.__dict__.get(_MOTORS, ()), np.zeros(model.n)
    if not len(motors):
        return state
    force = (model.balance(state, state.v, still) + model.loads(state, u))[motors]
    stiffness = model.slope(state, state.v, still, (1.0, 0.0, 0.0), u).diagonal()[motors]
    with np.errstate(divide="ignore", invalid="ignore"):
        by = -force / stiffness
    by[~(np.abs(by) <= _TWIST * yardsticks(model)[motors])] = 0.0
    step = still.copy()
    step[motors] = by
    return model.advance(state, step, state.v, state.t)


def _light(model: Model) -> dict[int, str]:
    """Motors without inertia behind shafts, by their coordinates."""
    heavy = {drive.name for drive in model.structure.drives if drive.inertia > 0.0}
    return {i: name for i, name in shafts_of(model).items() if name not in heavy}


def _eased(model: Model) -> Model | None:
    light = _light(model)
    shares = shares_left(Balance(model, np.zeros(len(model.inputs))), model.rest)
    shares = {i: share for i, share in shares.items() if i in light}
    if not shares:
        return None
    soft = softened(model, {light[i]: share for i, share in shares.items()})
    soft.__dict__[_MOTORS] = np.array(list(shares))
    return soft
