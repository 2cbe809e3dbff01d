"""How much of a damping matrix is proportional to mass and stiffness."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen

__all__ = ["Proportional", "proportional"]

AGREED = 1e-10
PARALLEL = 1e-3
ROUNDING = 1e-13
NOTHING = 1e-15
EPS, CAUTION = float(np.finfo(float).eps), 10.0


@frozen(eq=False)
class Proportional:
    """C = alpha M + beta K + rest.

    Attributes
    ----------
    alpha, beta : float
    rest : numpy.ndarray
        Entries of the rest on the common pattern; 0 where they are only rounding.
    """

    alpha: float
    beta: float
    rest: np.ndarray


def proportional(M: sp.csc_matrix, C: sp.csc_matrix, K: sp.csc_matrix) -> Proportional:
    """Find α and β that leave most entries of C − α M − β K without a rest.

    Parameters
    ----------
    M, C, K : scipy.sparse.csc_matrix, shape (n, n)
        On one pattern, scaled.

    Returns
    -------
    Proportional
    """
    terms, c = np.stack([M.data, K.data], axis=1), C.data
    most = float(np.abs(c).max(initial=0.0))
    if most == 0.0:
        return Proportional(0.0, 0.0, np.zeros_like(c))
    found = _in_most_columns(terms, c, C.indptr)
    near = np.abs(c - terms @ found) <= AGREED * most
    found = _fitted(terms[near], c[near], most)
    rest = c - terms @ found
    rest[np.abs(rest) <= ROUNDING * most] = 0.0
    return Proportional(float(found[0]), float(found[1]), rest)


def _in_most_columns(terms: np.ndarray, c: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(α, β): each column has its own; the middle ones are those of most columns."""
    (m, k), filled = terms.T, starts[:-1][np.diff(starts) > 0]
    mm, mk, kk, mc, kc = np.add.reduceat(np.stack([m * m, m * k, k * k, m * c, k * c]), filled, axis=1)
    below = mm * kk - mk * mk
    clear = below > PARALLEL * mm * kk
    if not clear.any():
        return _fitted(terms, c, float(np.abs(c).max()))
    each = np.stack([kk * mc - mk * kc, mm * kc - mk * mc])[:, clear] / below[clear]
    return np.asarray(np.sort(each, axis=1)[:, each.shape[1] // 2])


def _fitted(terms: np.ndarray, c: np.ndarray, most: float) -> np.ndarray:
    """Least squares; a term that is no more than the rounding of the entries makes of it is left out."""
    size = np.abs(terms).max(axis=0, initial=0.0)
    size[size == 0.0] = 1.0
    even = terms / size
    found = np.linalg.lstsq(even, c, rcond=None)[0]
    unsure = np.abs(np.linalg.pinv(even)) @ (EPS * np.abs(c) + np.abs(c - even @ found))
    idle = np.abs(found) <= np.maximum(NOTHING * most, CAUTION * unsure)
    if idle.any() and not idle.all():
        found[~idle] = np.linalg.lstsq(even[:, ~idle], c, rcond=None)[0]
    return np.asarray(np.where(idle, 0.0, found / size))
