"""Whether what hangs on a winch has come through its sheave over a step."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

__all__ = ["closest"]

_ENDS = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
"""Coefficients of the cubics for what is at the start, its change, what is at the end, its change."""


def closest(was: np.ndarray, leaving: np.ndarray, now: np.ndarray, arriving: np.ndarray) -> float:
    """Return how near to zero a cubic between two places comes.

    Parameters
    ----------
    was, now : numpy.ndarray, shape (3,)
        Where it begins and ends [m].
    leaving, arriving : numpy.ndarray, shape (3,)
        Its rates there, in metres per step.

    Returns
    -------
    float
        [m]
    """
    way = np.array([was, leaving, now, arriving]).T @ _ENDS
    squares = sum((Polynomial(row) ** 2 for row in way), Polynomial([0.0]))
    turns = squares.deriv().roots().real
    at = np.concatenate([[0.0, 1.0], turns[(turns > 0.0) & (turns < 1.0)]])
    return float(np.linalg.norm(way @ at ** np.arange(4)[:, None], axis=0).min())
