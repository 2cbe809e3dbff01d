"""Linear solves: dense while small, banded after reverse Cuthill–McKee, sparse LU where the band is wide."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from flexctrl.errors import FlexctrlError

Solve = Callable[[np.ndarray], np.ndarray]

_DENSE_UP_TO = 40


class SingularMatrixError(FlexctrlError, ArithmeticError):
    """A matrix that cannot be factorised; ``where`` is the row of its zero pivot."""

    def __init__(self, where: int) -> None:
        super().__init__(f"the matrix is singular at row {where}")
        self.where = where


def factorise(A: sp.spmatrix) -> Solve:
    """Factorise a square matrix once and return its solve.

    Parameters
    ----------
    A : scipy.sparse matrix, shape (n, n)

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
        raise SingularMatrixError(int(np.flatnonzero(~np.isfinite(A.data))[0]))
    if A.shape[0] <= _DENSE_UP_TO:
        return _dense(A.toarray())
    order = reverse_cuthill_mckee(A, symmetric_mode=False)
    permuted = A[order][:, order].tocoo()
    band = int(np.abs(permuted.row - permuted.col).max(initial=0))
    return _banded(permuted, order, band) if band <= max(16, A.shape[0] // 6) else _sparse(A)


def _dense(A: np.ndarray) -> Solve:
    lu, pivots, info = lapack.dgetrf(A)
    if info:
        raise SingularMatrixError(info - 1)
    return lambda b: lapack.dgetrs(lu, pivots, b)[0]


def _banded(A: sp.coo_matrix, order: np.ndarray, band: int) -> Solve:
    n = A.shape[0]
    storage = np.zeros((3 * band + 1, n))
    np.add.at(storage, (2 * band + A.row - A.col, A.col), A.data)
    lu, pivots, info = lapack.dgbtrf(storage, band, band)
    if info:
        raise SingularMatrixError(int(order[info - 1]))

    def solve(b: np.ndarray) -> np.ndarray:
        x = np.empty_like(b)
        x[order] = lapack.dgbtrs(lu, band, band, b[order], pivots)[0]
        return x

    return solve


def _sparse(A: sp.csr_matrix) -> Solve:
    try:
        return splu(A.tocsc()).solve
    except RuntimeError:
        empty = np.flatnonzero(np.diff(A.indptr) == 0)
        raise SingularMatrixError(int(empty[0]) if empty.size else 0) from None
