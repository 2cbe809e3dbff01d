"""In how many directions a machine leaves a state at rest by itself, whether its loads have a potential or not."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.effects.wind import Wind
from flexctrl.linear.growth import growing
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pattern import asymmetry, symmetric
from flexctrl.linear.undamped import ROUND_OFF
from flexctrl.model.balance import Balance
from flexctrl.model.downhill import downhill
from flexctrl.model.eased import told
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.model.tangents import tangents
from flexctrl.structure.inputs import FollowerForce, FollowerTorque, Torque

__all__ = ["leaving", "without_energy"]


def leaving(balance: Balance, state: State) -> int:
    """Return in how many directions the free coordinates leave an equilibrium by themselves.

    Loads with a potential: those of negative stiffness. Others make it unsymmetric, and no count of pivots
    tells flutter from divergence or either from rest: there the growing motions of M q̈ + C q̇ + K q = 0.

    Parameters
    ----------
    balance : Balance
    state : State

    Returns
    -------
    int

    Raises
    ------
    LinearizationError, MechanismError
        Under loads without a potential, if the motions cannot be told; see `growing`.
    """
    balance, state = told(balance, state)
    if without_energy(balance.model, balance.u):
        M, C, K = tangents(balance.model, state, balance.u)
        if (held := balance.turning(state, balance.whole_force(state))).nnz:
            K = K - held
        M, C, K = (balance.seen(state, A).tocsc() for A in (M, C, K))
        if K.shape[0] and asymmetry(K, symmetric(K)[0]) > ROUND_OFF:
            return growing(_unseen(balance, M, C, K))
    return downhill(balance, state)


def without_energy(model: Model, u: np.ndarray) -> tuple[str, ...]:
    """Return the loads at work that have no potential: they may make K unsymmetric.

    Parameters
    ----------
    model : Model
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    tuple of str
    """
    kinds = (FollowerForce, FollowerTorque, Torque)
    signals = model.structure.inputs if model.large else ()
    turning = any(isinstance(e, RotatingFrame) and any(e.rate) for e in model.effects)
    drag = tuple("Wind" for e in model.effects if turning and isinstance(e, Wind) and e.acts(model.structure))
    return tuple(s.name for s, value in zip(signals, u, strict=False) if value and isinstance(s, kinds)) + drag


def _unseen(balance: Balance, M: sp.csc_matrix, C: sp.csc_matrix, K: sp.csc_matrix) -> LinearModel:
    """The linear model of the free coordinates, without signals."""
    n, names = len(balance.free), balance.model.coordinates
    none = np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, 0))
    return LinearModel(M, C, K, *none, tuple(names[i] for i in balance.free), (), ())
