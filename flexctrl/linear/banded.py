"""Cholesky factors of sparse matrices of narrow band."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

__all__ = ["Band", "Factor", "band_of"]

WIDEST = 64


@dataclass(frozen=True, eq=False)
class Factor:
    """L of A = L Lᵀ.

    Attributes
    ----------
    pivots : numpy.ndarray, shape (n,)
        Squares of the diagonal of L, in the band's order.
    solve : callable
        rhs ↦ A⁻¹ rhs.
    """

    pivots: np.ndarray
    solve: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Band:
    """The order (reverse Cuthill–McKee) in which a symmetric pattern is a narrow band, and where entries stand in it.

    Attributes
    ----------
    order : numpy.ndarray of int, shape (n,)
    width : int
        Half bandwidth.
    lower : numpy.ndarray of int
        Which entries lie on or under the diagonal of the ordered matrix.
    places : numpy.ndarray of int
        Where these stand in LAPACK's band storage, column by column.
    """

    order: np.ndarray
    width: int
    lower: np.ndarray
    places: np.ndarray

    def factorise(self, data: np.ndarray) -> Factor | None:
        """Cholesky factor of the matrix with these entries, or None if it is not positive definite.

        Parameters
        ----------
        data : numpy.ndarray
            Entries in the order of the pattern.

        Returns
        -------
        Factor or None
        """
        n, order = self.order.size, self.order
        storage = np.zeros(n * (self.width + 1))
        storage[self.places] = data[self.lower]
        L, info = lapack.dpbtrf(storage.reshape(n, -1).T, lower=1, overwrite_ab=1)
        if info:
            return None

        def solve(rhs: np.ndarray) -> np.ndarray:
            x = np.empty_like(rhs)
            x[order] = lapack.dpbtrs(L, rhs[order], lower=1)[0]
            return x

        return Factor(L[0] ** 2, solve)


def band_of(A: sp.csc_matrix) -> Band | None:
    """The band of a symmetric pattern, or None where it is wide.

    Parameters
    ----------
    A : scipy.sparse.csc_matrix, shape (n, n)

    Returns
    -------
    Band or None
    """
    n = A.shape[0]
    order = reverse_cuthill_mckee(sp.csr_matrix((A.data, A.indices, A.indptr), A.shape), symmetric_mode=True)
    back = np.empty(n, dtype=int)
    back[order] = np.arange(n)
    rows, columns = back[A.indices], np.repeat(back, np.diff(A.indptr))
    width = int((rows - columns).max(initial=0))
    if width > WIDEST:
        return None
    lower = np.flatnonzero(rows >= columns)
    return Band(order, width, lower, columns[lower] * width + rows[lower])
