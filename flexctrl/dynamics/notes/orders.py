"""By which power of their steps errors go, as runs laid beside one show it."""

from __future__ import annotations

import numpy as np

__all__ = ["MARGIN", "least_order", "orders_seen"]

MARGIN = 1.25
"""What a gap leaves is told with a factor of safety, that of Roache (1994) for orders that have been looked at."""

_HALVINGS = 40


def least_order(longer: float, most: float) -> float:
    """Return the order of which all of a gap is left, or that of the method if it is less.

    Parameters
    ----------
    longer : float
        By how much steps of the nearer run are longer.
    most : float
        The method's order.

    Returns
    -------
    float
    """
    return min(float(np.log(2.0) / np.log(longer)), most)


def orders_seen(
    near: np.ndarray, far: np.ndarray, longer: tuple[float, float], between: tuple[np.ndarray, float]
) -> np.ndarray:
    """Return the orders p by which gaps go as rᵖ − 1.

    With errors that grow as rᵖ the gaps are as rᵖ − 1; what does not grow so, as where corners come one after another,
    has a lower order than its method.

    Parameters
    ----------
    near, far : numpy.ndarray, shape (k,)
        How far two runs are apart from one.
    longer : tuple of float
        By how much their steps are longer.
    between : tuple of (numpy.ndarray, float)
        The least orders there may be, and the most.

    Returns
    -------
    numpy.ndarray, shape (k,)
    """

    def above(order: np.ndarray) -> np.ndarray:
        return np.asarray(far * (longer[0] ** order - 1.0) > near * (longer[1] ** order - 1.0))

    low, high = between[0].copy(), np.full(near.shape, between[1])
    most = np.where(above(high), high, -np.inf)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = np.where(above(middle), middle, low), np.where(above(middle), high, middle)
    return np.maximum(low, most)
