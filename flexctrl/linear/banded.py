"""Cholesky factors of sparse matrices of narrow band."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

__all__ = ["Band", "Factor", "band_of", "prominent"]

WIDEST = 64
TRIES = 4
UNCLEAR = 1e-12


@dataclass(frozen=True, eq=False)
class Factor:
    """L of A = L Lᵀ.

    Attributes
    ----------
    pivots : numpy.ndarray, shape (n,)
        Squares of the diagonal of L, in the band's order.
    order : numpy.ndarray of int, shape (n,)
        Freedoms in the band's order.
    solve : callable
        rhs ↦ A⁻¹ rhs.
    """

    pivots: np.ndarray
    order: np.ndarray
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
        order = self.order
        L, info = lapack.dpbtrf(self._stored(data).T, lower=1, overwrite_ab=1)
        if info:
            return None

        def solve(rhs: np.ndarray) -> np.ndarray:
            x = np.empty_like(rhs)
            x[order] = lapack.dpbtrs(L, rhs[order], lower=1)[0]
            return x

        return Factor(L[0] ** 2, order, solve)

    def negative(self, data: np.ndarray, held: np.ndarray) -> int | None:
        """How many negative eigenvalues the matrix with these entries has, if it is definite with some freedoms held.

        They are then those of the Schur complement of the held ones (E. Haynsworth, Linear Algebra Appl. 1 (1968)
        73–81). More freedoms are held where that turns out to be needed.

        Parameters
        ----------
        data : numpy.ndarray
            Entries in the order of the pattern.
        held : numpy.ndarray of int
            Freedoms.

        Returns
        -------
        int or None
            None if it is not definite, or the complement singular to rounding.
        """
        storage, places = self._stored(data), np.empty_like(self.order)
        places[self.order] = np.arange(self.order.size)
        held = places[held]
        for _ in range(TRIES):
            rest, columns, own = _without(storage, held)
            L, info = lapack.dpbtrf(rest.T, lower=1, overwrite_ab=1)
            if not info:
                half = lapack.dtbtrs(L, columns, uplo="L", overwrite_b=1)[0]
                values = np.linalg.eigvalsh(own - half.T @ half)
                clear = np.abs(values).min(initial=np.inf) > UNCLEAR * np.abs(values).max(initial=0.0)
                return int(np.count_nonzero(values < 0.0)) if clear else None
            held = np.append(held, info - 1)
        return None

    def _stored(self, data: np.ndarray) -> np.ndarray:
        """Lower band column by column, shape (n, width + 1)."""
        n = self.order.size
        storage = np.zeros(n * (self.width + 1))
        storage[self.places] = data[self.lower]
        return storage.reshape(n, -1)


def _without(storage: np.ndarray, held: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The band with some rows and columns those of the identity; what stood in these columns, and where they meet."""
    n, width = storage.shape[0], storage.shape[1] - 1
    rest, columns, steps = storage.copy(), np.zeros((n + 2 * width, held.size), order="F"), np.arange(width + 1)
    number = np.arange(held.size)[:, None]
    above = held[:, None] - steps
    inside = above >= 0
    columns[held[:, None] + steps + width, number] = storage[held]
    columns[above + width, number] = np.where(inside, storage[above, steps], 0.0)
    columns = columns[width : n + width]
    own = columns[held].copy()
    columns[held] = 0.0
    rest[held] = 0.0
    rest[above[inside], np.broadcast_to(steps, above.shape)[inside]] = 0.0
    rest[held, 0] = 1.0
    return rest, columns, own


def prominent(vectors: np.ndarray) -> np.ndarray:
    """Freedoms, one for each vector, that tell the vectors apart: the pivots of an elimination.

    Parameters
    ----------
    vectors : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray of int, shape (k,)
    """
    swaps = lapack.dgetrf(vectors)[1]
    order = np.arange(len(vectors))
    for i, j in enumerate(swaps.tolist()):
        order[i], order[j] = order[j], order[i]
    return order[: swaps.size]


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
