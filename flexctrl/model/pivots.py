"""Signs of pivots: whether a stiffness matrix holds, and in how many directions it does not."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from flexctrl.linear.pencil import stiffness_noise

ZERO_PIVOT = 1e-13
"""Pivots of a matrix scaled to a unit diagonal that count as zero."""


SKEW = 1e-9
"""A matrix is symmetric that differs from its transpose by a smaller share of its largest entry."""

CLEAR_PIVOT = 1e-9
"""Positive pivots below it are looked at more closely: rounding may have made them."""


def pivots(A: sp.spmatrix) -> np.ndarray:
    """Return the pivots of the symmetric part of a matrix, scaled to a diagonal of ones.

    Their signs are those of the eigenvalues (Sylvester's law of inertia).

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)

    Returns
    -------
    numpy.ndarray, shape (n,)
        NaN throughout if the matrix cannot be factorised without exchanging rows.
    """
    if not A.shape[0] or not np.isfinite(A.data).all():
        return np.full(A.shape[0], np.nan)
    scaled = _scaled(A) + 0.1 * ZERO_PIVOT * sp.identity(A.shape[0])
    try:
        lu = splu(scaled.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return np.full(A.shape[0], np.nan)
    return np.asarray(lu.U.diagonal())


def negative_pivots(A: sp.spmatrix) -> int:
    """Return in how many independent directions the quadratic form of a matrix is negative.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)

    Returns
    -------
    int
    """
    found = pivots(A)
    if np.isnan(found).any():
        values = np.linalg.eigvalsh((0.5 * (A + A.T)).toarray())
        return int((values < -1e-12 * np.abs(values).max()).sum())
    return int((found < -ZERO_PIVOT).sum())


def turned(A: sp.spmatrix) -> int:
    """Return a number that changes where a matrix that varies becomes singular.

    Of a symmetric matrix it is the number of negative pivots. Of another, as of stiffness under loads that follow, the
    quadratic form may turn negative in some direction and the matrix stay regular: there it is 1 if det A < 0, else 0.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)

    Returns
    -------
    int
    """
    A = sp.csc_matrix(A)
    if not A.nnz or abs(A - A.T).max() <= SKEW * np.abs(A.data).max():
        return negative_pivots(A)
    try:
        lu = splu(A)
    except RuntimeError:
        return 0
    exchanges = _exchanges(lu.perm_r) + _exchanges(lu.perm_c)
    return (exchanges + int(np.count_nonzero(lu.U.diagonal() < 0.0))) % 2


def _exchanges(order: np.ndarray) -> int:
    """How many exchanges of two make a permutation, but for an even number."""
    n = order.size
    cycles = connected_components(sp.csr_matrix((np.ones(n), (np.arange(n), order)), (n, n)), directed=False)[0]
    return n - int(cycles)


def holds(A: sp.spmatrix) -> bool:
    """Tell whether a stiffness matrix resists every displacement, by more than the rounding of its entries.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)

    Returns
    -------
    bool
    """
    found = pivots(A)
    if not (found > ZERO_PIVOT).all():
        return False
    return bool(found.size == 0 or found.min() > CLEAR_PIVOT or _resists(_scaled(A)))


def _resists(A: sp.csc_matrix) -> bool:
    """Whether the softest displacement of a positive matrix is stiffer than rounding alone could make it."""
    solve, x = splu(A).solve, np.cos(np.arange(A.shape[0]))
    for _ in range(4):
        x = solve(x)
        x /= np.linalg.norm(x)
    return float(x @ (A @ x)) > 30.0 * float(stiffness_noise(A, x[:, None])[0])


def _scaled(A: sp.spmatrix) -> sp.csc_matrix:
    """The symmetric part of a matrix, scaled to a diagonal of ones."""
    size = np.sqrt(np.abs(A.diagonal()))
    scale = sp.diags(1.0 / np.where(size > 0.0, size, 1.0))
    return sp.csc_matrix(scale @ (0.5 * (A + A.T)) @ scale)
