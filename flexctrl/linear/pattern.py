"""Sparse matrices on one common pattern, so that sums of them are sums of their entries."""

from __future__ import annotations

import copy

import numpy as np
import scipy.sparse as sp

from flexctrl.kernels.kernel import can_compile
from flexctrl.kernels.native import Packed
from flexctrl.linear.pattern_loops import Mirroring, reflect

__all__ = ["aligned", "asymmetry", "congruent", "mirror", "symmetric", "with_entries"]

SMALL = 200
UNMISTAKABLE = 1e-6


def aligned(*matrices: sp.spmatrix) -> tuple[sp.csc_matrix, ...]:
    """The same matrices, each with explicit zeros wherever another has an entry.

    Parameters
    ----------
    *matrices : sparse matrices, shape (n, m)

    Returns
    -------
    tuple of scipy.sparse.csc_matrix
        Their entries stand in the same order.
    """
    given = tuple(_canonical(A) for A in matrices)
    widest = max(given, key=lambda A: A.nnz)
    spread = [_spread(A, widest) for A in given]
    if all(A is not None for A in spread):
        return tuple(A for A in spread if A is not None)
    union = _union(given)
    return tuple(A for A in (_spread(A, union) for A in given) if A is not None)


def with_entries(A: sp.csc_matrix, data: np.ndarray) -> sp.csc_matrix:
    """A matrix of the same pattern, without the checks that making one anew takes.

    Parameters
    ----------
    A : scipy.sparse.csc_matrix
    data : numpy.ndarray
        Its entries.

    Returns
    -------
    scipy.sparse.csc_matrix
    """
    other = copy.copy(A)
    other.data = data
    return other


def congruent(scale: np.ndarray, *matrices: sp.spmatrix) -> tuple[sp.csc_matrix, ...]:
    """S A S for diagonal S and each A, all on one pattern.

    Parameters
    ----------
    scale : numpy.ndarray, shape (n,)
    *matrices : sparse matrices, shape (n, n)

    Returns
    -------
    tuple of scipy.sparse.csc_matrix
    """
    given = aligned(*matrices)
    pattern = given[0]
    factor = scale.take(pattern.indices, mode="clip") * np.repeat(scale, np.diff(pattern.indptr))
    return tuple(with_entries(pattern, A.data * factor) for A in given)


def mirror(A: sp.csc_matrix) -> np.ndarray | None:
    """Where the entry across the diagonal stands for every entry; None if there is not one for each, or in small ones.

    Parameters
    ----------
    A : scipy.sparse.csc_matrix, shape (n, n)
        In canonical format.

    Returns
    -------
    numpy.ndarray of int, or None
    """
    if A.shape[0] <= SMALL:
        return None  # a dense comparison is quicker
    if not can_compile():
        T = with_entries(A, np.arange(A.nnz)).T.tocsc()
        return T.data if _same_pattern(A, T) else None
    n, starts, rows = A.shape[0], A.indptr.astype(np.int64), A.indices.astype(np.int64)
    across = np.empty_like(rows)
    missing = Packed(Mirroring(n, starts, rows, np.empty(n, dtype=np.int64), across)).bound(reflect)()
    return None if missing else across


def symmetric(A: sp.csc_matrix, across: np.ndarray | None = None) -> tuple[sp.csc_matrix, float]:
    """½ (A + Aᵀ), and the largest entry of A − Aᵀ.

    Parameters
    ----------
    A : scipy.sparse.csc_matrix, shape (n, n)
    across : numpy.ndarray of int, optional
        Its `mirror`, where that is known.

    Returns
    -------
    scipy.sparse.csc_matrix, shape (n, n)
    float
    """
    if A.shape[0] <= SMALL and np.array_equal(dense := A.toarray(), dense.T):
        return _canonical(A), 0.0
    if across is None:
        A, T = aligned(A, A.T)
        over = T.data
    else:
        over = A.data[across]
    gap = float(np.abs(A.data - over).max(initial=0.0))
    return (A if gap == 0.0 else with_entries(A, 0.5 * (A.data + over))), gap


def asymmetry(A: sp.csc_matrix, even: sp.csc_matrix) -> float:
    """Largest entry of A − Aᵀ relative to A's largest, or to the diagonal entries in its row and column.

    Stiff members that are light must not hide that soft and heavy ones are loaded by forces without a potential; the
    latter counts where it is more than what is left of sums that cancel.

    Parameters
    ----------
    A, even : scipy.sparse.csc_matrix, shape (n, n)
        The latter ½ (A + Aᵀ).

    Returns
    -------
    float
    """
    odd, tiny = sp.coo_matrix(A - A.T), np.finfo(float).tiny
    size, own = np.abs(odd.data), np.abs(even.diagonal())
    own = np.where(own > 0.0, own, abs(even).max(axis=1).toarray().ravel())
    near = float((size / np.maximum(np.sqrt(own[odd.row] * own[odd.col]), tiny)).max(initial=0.0))
    far = float(size.max(initial=0.0)) / max(float(np.abs(even.data).max(initial=0.0)), tiny)
    return near if near > UNMISTAKABLE else far


def _columns(A: sp.spmatrix) -> sp.csc_matrix:
    return A if isinstance(A, sp.csc_matrix) else sp.csc_matrix(A)


def _canonical(A: sp.spmatrix) -> sp.csc_matrix:
    A = _columns(A)
    if not A.has_canonical_format:
        A = A.copy()
        A.sum_duplicates()
    return A


def _same_pattern(A: sp.csc_matrix, B: sp.csc_matrix) -> bool:
    return A.nnz == B.nnz and np.array_equal(A.indptr, B.indptr) and np.array_equal(A.indices, B.indices)


def _keys(A: sp.csc_matrix) -> np.ndarray:
    columns = np.repeat(np.arange(A.shape[1], dtype=np.int64), np.diff(A.indptr))
    return columns * A.shape[0] + A.indices


def _union(given: tuple[sp.csc_matrix, ...]) -> sp.csc_matrix:
    """A matrix with an entry wherever one of them has one."""
    rows, columns = given[0].shape
    keys = np.unique(np.concatenate([_keys(A) for A in given]))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(keys // rows, minlength=columns))]).astype(np.int32)
    return sp.csc_matrix((np.zeros(keys.size), (keys % rows).astype(np.int32), indptr), given[0].shape)


def _spread(A: sp.csc_matrix, pattern: sp.csc_matrix) -> sp.csc_matrix | None:
    """A with the entries of a wider pattern; None if it has others."""
    if A is pattern or _same_pattern(A, pattern):
        return A
    keys, wide = _keys(A), _keys(pattern)
    places = np.searchsorted(wide, keys)
    if not np.array_equal(wide[np.minimum(places, wide.size - 1)], keys):
        return None
    data = np.zeros(wide.size, dtype=A.dtype)
    data[places] = A.data
    return with_entries(pattern, data)
