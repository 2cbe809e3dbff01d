"""Linear solves: dense while small, banded after reverse Cuthill–McKee, sparse LU where the band is wide.

What solves is imported where it is needed: it takes longer than a short march, which does not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen

Solve = Callable[[np.ndarray], np.ndarray]

_DENSE_UP_TO = 40
_ROOM = 2e7
"""Numbers that a band may take: those of large trees are wide, as branches lie side by side there."""
_UPRIGHT = 0.1
"""Share of the largest of its column that a diagonal entry is a pivot with: matrices of masses and stiffnesses have
nearly symmetric patterns, which pivots elsewhere fill in three to five times as much."""
_FULL = 0.3
"""Share of entries from which on a matrix is dealt with as a full one."""


@frozen(eq=False)
class Plan:
    """How matrices of one pattern are factorised: worked out once, used for every new set of values.

    Attributes
    ----------
    indptr, indices : numpy.ndarray
        The pattern (CSR).
    order : numpy.ndarray
        Reverse Cuthill–McKee.
    band : int
        Half bandwidth in that order; 0 where the matrix is dense or its band too wide.
    places : numpy.ndarray
        Where each entry stands in LAPACK's band storage.
    """

    indptr: np.ndarray
    indices: np.ndarray
    order: np.ndarray
    band: int
    places: np.ndarray

    def fits(self, A: sp.csr_matrix) -> bool:
        """Tell whether a matrix has the plan's pattern."""
        return A.indices is self.indices or (
            A.nnz == len(self.indices)
            and np.array_equal(A.indptr, self.indptr)
            and np.array_equal(A.indices, self.indices)
        )


def plan(A: sp.csr_matrix) -> Plan:
    """Work out how to factorise matrices of the pattern of A."""
    n = A.shape[0]
    empty = np.zeros(0, dtype=int)
    if n <= _DENSE_UP_TO:
        return Plan(A.indptr, A.indices, empty, 0, empty)
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    # entries that happen to be 0 count as well: a run that goes on elsewhere would be solved in another order
    pattern = sp.csr_matrix((np.ones(A.nnz), A.indices, A.indptr), shape=A.shape)
    order = reverse_cuthill_mckee(pattern, symmetric_mode=False)
    back = np.empty(n, dtype=int)
    back[order] = np.arange(n)
    rows, columns = back[np.repeat(np.arange(n), np.diff(A.indptr))], back[A.indices]
    band = int(np.abs(rows - columns).max(initial=0))
    if band > max(24, n // 6) or n * (3 * band + 1) > _ROOM:
        return Plan(A.indptr, A.indices, empty, 0, empty)
    return Plan(A.indptr, A.indices, order, band, columns * (3 * band + 1) + 2 * band + rows - columns)


def factorise(A: sp.spmatrix, known: Plan | None = None) -> Solve:
    """Factorise a square matrix once and return its solve.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)
    known : Plan, optional
        From an earlier matrix of the same pattern; saves finding the order again.

    Returns
    -------
    callable
        b ↦ A⁻¹ b.

    Raises
    ------
    SingularMatrixError
        For a zero pivot or an entry that is not finite.
    """
    A = A.tocsr()
    if not np.isfinite(A.data).all():
        bad = int(np.flatnonzero(~np.isfinite(A.data))[0])
        raise SingularMatrixError(int(np.searchsorted(A.indptr, bad, side="right")) - 1)
    if A.shape[0] <= _DENSE_UP_TO or A.nnz > _FULL * A.shape[0] ** 2:
        return _dense(A.toarray())
    known = known if known is not None and known.fits(A) else plan(A)
    return _banded(A, known) if known.band else _sparse(A)


def _dense(A: np.ndarray) -> Solve:
    if not A.size:
        return lambda b: b
    from scipy.linalg import lapack

    lu, pivots, info = lapack.dgetrf(A)
    if info:
        raise SingularMatrixError(info - 1)
    return lambda b: lapack.dgetrs(lu, pivots, b)[0]


def _banded(A: sp.csr_matrix, known: Plan) -> Solve:
    from scipy.linalg import lapack

    n, band, order = A.shape[0], known.band, known.order
    storage = np.bincount(known.places, weights=A.data, minlength=n * (3 * band + 1))
    lu, pivots, info = lapack.dgbtrf(storage.reshape(n, -1).T, band, band, overwrite_ab=True)
    if info:
        raise SingularMatrixError(int(order[info - 1]))

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.empty_like(b)
        x[order] = lapack.dgbtrs(lu, band, band, b[order], pivots)[0]
        return x

    return solve


def _sparse(A: sp.csr_matrix) -> Solve:
    from scipy.sparse.linalg import splu

    try:
        return splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=_UPRIGHT).solve
    except RuntimeError:
        empty = np.flatnonzero(np.diff(A.indptr) == 0)
        raise SingularMatrixError(int(empty[0]) if empty.size else 0) from None
