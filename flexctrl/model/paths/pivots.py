"""Signs of pivots: whether a stiffness matrix holds, and in how many directions it does not."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

ZERO_PIVOT = 1e-13
"""Pivots of a matrix scaled to a unit diagonal that count as zero."""

SKEW = 1e-9
"""A matrix is symmetric that differs from its transpose by a smaller share of its largest entry."""

ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Share of the terms of an entry that is its rounding."""


def unit_scaled(A: sp.spmatrix, terms: sp.spmatrix | None) -> tuple[sp.dia_matrix, sp.csr_matrix, np.ndarray]:
    """Return the symmetric part of a matrix with a diagonal of about ones, and how unsure it is.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    terms : scipy.sparse matrix, shape (n, n), or None
        Sizes of what the entries are sums of; None: their own.

    Returns
    -------
    scale, scaled : sparse matrices, shape (n, n)
        S and S A S.
    unsure : numpy.ndarray, shape (n,)
        Sums of the rounding of each row.
    """
    sizes = abs(A) if terms is None else terms
    size = np.sqrt(np.abs(sizes.diagonal()))
    scale = sp.diags(1.0 / np.where(size > 0.0, size, 1.0))
    rows = np.asarray((scale @ (0.5 * (sizes + sizes.T)) @ scale).sum(axis=1)).ravel()
    return scale, sp.csr_matrix(scale @ (0.5 * (A + A.T)) @ scale), ROUNDING * rows


def pivots(A: sp.spmatrix, terms: sp.spmatrix | None, side: float) -> np.ndarray:
    """Return the pivots of the symmetric part of a matrix, scaled to a diagonal of about ones.

    Their signs are those of the eigenvalues (Sylvester's law of inertia). Whatever the rounding of the entries, at
    most a share of their terms, the matrix lies between those with ``side`` −1 and +1: the row sums of a symmetric
    matrix of one sign, on the diagonal, exceed it (Gershgorin).

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    terms : scipy.sparse matrix, shape (n, n), or None
        Sizes of what the entries are sums of; None: their own.
    side : float

    Returns
    -------
    numpy.ndarray, shape (n,)
        NaN throughout if the matrix cannot be factorised without exchanging rows.
    """
    from scipy.sparse.linalg import splu

    if not A.shape[0] or not np.isfinite(A.data).all():
        return np.full(A.shape[0], np.nan)
    _, even, unsure = unit_scaled(A, terms)
    nothing = 0.1 * ZERO_PIVOT if side > 0.0 else 0.0
    scaled = even + sp.diags(side * unsure + nothing)
    try:
        lu = splu(
            sp.csc_matrix(scaled), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:
        return np.full(A.shape[0], np.nan)
    return np.asarray(lu.U.diagonal())


def negative_pivots(A: sp.spmatrix, terms: sp.spmatrix | None = None) -> int:
    """Return in how many independent directions the quadratic form of a matrix is negative, rounding or not.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    terms : scipy.sparse matrix, shape (n, n), optional
        Sizes of what the entries are sums of; default: their own.

    Returns
    -------
    int
    """
    found = pivots(A, terms, 1.0)
    if np.isnan(found).any():
        values = np.linalg.eigvalsh((0.5 * (A + A.T)).toarray())
        return int((values < -1e-12 * np.abs(values).max()).sum())
    return int((found < -ZERO_PIVOT).sum())


def perhaps_negative(A: sp.spmatrix, terms: sp.spmatrix | None = None) -> int:
    """Return in how many independent directions the quadratic form of a matrix may be negative, if only by rounding.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    terms : scipy.sparse matrix, shape (n, n), optional
        Sizes of what the entries are sums of; default: their own.

    Returns
    -------
    int
        All of them if the matrix cannot be factorised without exchanging rows.
    """
    return int(np.count_nonzero(~(pivots(A, terms, -1.0) >= ZERO_PIVOT)))


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
    from scipy.sparse.linalg import splu

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
    from scipy.sparse.csgraph import connected_components

    n = order.size
    cycles = connected_components(sp.csr_matrix((np.ones(n), (np.arange(n), order)), (n, n)), directed=False)[0]
    return n - int(cycles)


def holds(A: sp.spmatrix, terms: sp.spmatrix | None = None) -> bool:
    """Tell whether a stiffness matrix resists every displacement, by more than the rounding of its entries.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    terms : scipy.sparse matrix, shape (n, n), optional
        Sizes of what the entries are sums of; default: their own.

    Returns
    -------
    bool
    """
    return bool((pivots(A, terms, -1.0) > 0.0).all())
