"""Torques of motors that lag, as they are at rest: built up to what is commanded, or to what holds the motor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexctrl.effects.motor_lag import MotorLag
from flexctrl.model.balance import Balance
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.inputs import MotorTorque

__all__ = ["borne_by_motors", "built_up"]


def built_up(balance: Balance, state: State) -> State:
    """Return a state in which the torque of each motor that lags is the one commanded, which is all it is at rest.

    A search that goes by masses or by a reach would have to build it up by and by: its unit is a turn of the shaft.

    Parameters
    ----------
    balance : Balance
    state : State

    Returns
    -------
    State
    """
    model, still = balance.model, balance.still
    at = np.array([i for i in _lags(model).values() if i not in balance.held], dtype=int)
    if not at.size:
        return state
    stiffness = -model.slope(state, still, still, (1.0, 0.0, 0.0), balance.u).diagonal()[at]
    return _moved(model, state, at, balance.whole_force(state)[at] / stiffness)


def borne_by_motors(model: Model, state: State, holding: Mapping[str, float]) -> State:
    """Return a state in which motors that are held have built up the torques that hold them, where they lag.

    Commanded as much they then hold what they held, without a fall while it builds up.

    Parameters
    ----------
    model : Model
    state : State
        With the torques of `built_up`.
    holding : mapping of str to float
        What holds freedoms beside, by their names [N or N m].

    Returns
    -------
    State
    """
    commanded = {signal.drive for signal in model.structure.inputs if isinstance(signal, MotorTorque)}
    lags = {name: i for name, i in _lags(model).items() if name in commanded and f"{name}_lag" not in holding}
    more = {i: holding.get(f"{name}_source", 0.0) for name, i in lags.items()}
    return _moved(model, state, np.array(list(more), dtype=int), np.array(list(more.values())))


def _lags(model: Model) -> dict[str, int]:
    """Coordinates of torques that lag, by their drives."""
    lags = [effect for effect in model.effects if isinstance(effect, MotorLag)]
    return {name: model.coordinate(f"{name}_lag") for effect in lags for name, _ in effect.acting}


def _moved(model: Model, state: State, at: np.ndarray, by: np.ndarray) -> State:
    if not by.any():
        return state
    step = np.zeros(model.n)
    step[at] = by
    return model.advance(state, step, state.v, state.t)
