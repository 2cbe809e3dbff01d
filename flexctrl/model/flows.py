"""Inner freedoms of first order at the start of a run or after a jump: how fast they must change."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["flow_rates", "flowing", "without"]

_SHARE = 1e-3


def flowing(model: Plant, state: State, u: np.ndarray) -> State:
    """Return a state with the rates that inner freedoms of first order have under its inputs.

    Parameters
    ----------
    model : Plant
    state : State
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    State
    """
    inner = model.motion.flows
    if not inner.size:
        return state
    v, still = state.v.copy(), np.zeros(model.n)
    v[inner] = 0.0
    state = state.with_(v=v)
    drag = -model.slope(state, v, still, (0.0, 1.0, 0.0), u).diagonal()[inner]
    push = (model.balance(state, v, still) + model.loads(state, u))[inner]
    v[inner] = np.divide(push, drag, out=np.zeros_like(push), where=drag > 0.0)
    return state.with_(v=v)


def flow_rates(model: Plant, state: State, u: np.ndarray, step: float) -> np.ndarray:
    """Return how fast these rates change while nothing else accelerates.

    Parameters
    ----------
    model : Plant
    state : State
        A `flowing` one.
    u : numpy.ndarray, shape (inputs,)
    step : float
        A time in which they change little [s].

    Returns
    -------
    numpy.ndarray, shape (inner freedoms of first order,)
    """
    inner, t = model.motion.flows, _SHARE * step
    later = flowing(model, model.advance(state, t * state.v, state.v, state.t + t), u)
    return (later.v[inner] - state.v[inner]) / t


def without(matrix: sp.csr_matrix, places: np.ndarray) -> sp.csr_matrix:
    """Return a matrix of all degrees of freedom with the identity in place of some."""
    left_out = np.zeros(matrix.shape[0])
    left_out[places] = 1.0
    kept = sp.diags(1.0 - left_out)
    return sp.csr_matrix(kept @ matrix @ kept + sp.diags(left_out))
