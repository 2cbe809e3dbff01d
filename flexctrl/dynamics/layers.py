"""Speeds that damping brings about within less than a step: where a run begins in such a layer.

A blade of next to no mass is as fast as the wind lets it be at once. A step that does not see that swings about that
speed for long, and what the drag takes from the swing is none. So the first of fixed steps is taken in parts, each as
long as all before it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.steps import Point
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

__all__ = ["haste", "overleaps"]

_SEEN, _SPENT = 0.5, 1e-2


def haste(model: Plant, point: Point) -> float:
    """Return how fast damping ends accelerations, a·C a / a·M a [1/s]; 0 where it does not, or they move no mass.

    Parameters
    ----------
    model : Plant
    point : Point

    Returns
    -------
    float
    """
    if not isinstance(model, Model):  # steps of a linear one may be exact
        return 0.0
    still, a = np.zeros(model.n), point.rate
    damped, moved = _damped(model, point, a), -float(a @ (_slope(model, point, still, (0.0, 0.0, 1.0)) @ a))
    return damped / moved if moved > 0.0 else 0.0


def overleaps(model: Plant, point: Point, h: float) -> bool:
    """Tell whether a step does not see how what is damped comes to its speed, a good share of which it has yet to gain.

    Parameters
    ----------
    model : Plant
    point : Point
    h : float
        [s]

    Returns
    -------
    bool
    """
    fast = haste(model, point)
    if not (isinstance(model, Model) and fast * h > _SEEN):
        return False
    return _damped(model, point, point.rate / fast) > _SPENT * _damped(model, point, point.state.v)


def _damped(model: Model, point: Point, v: np.ndarray) -> float:
    return -float(v @ (_slope(model, point, point.state.v, (0.0, 1.0, 0.0)) @ v))


def _slope(model: Model, point: Point, v: np.ndarray, seeds: tuple[float, float, float]) -> sp.csr_matrix:
    return model.slope(point.state, v, np.zeros(model.n), seeds, point.supply.u)
