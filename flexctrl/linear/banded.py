"""Cholesky factors of sparse matrices of narrow band."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import can_compile
from flexctrl.linear.krylov import Space

__all__ = ["Band", "Factor", "band_of", "prominent"]

WIDEST = 64
TRIES = 4
UNCLEAR = 1e-12


@frozen(eq=False)
class Factor:
    """L of A = L Lᵀ.

    Attributes
    ----------
    pivots : numpy.ndarray, shape (n,)
        Squares of the diagonal of L, in the band's order.
    diagonal : numpy.ndarray, shape (n,)
        That of A, in the band's order.
    order : numpy.ndarray of int, shape (n,)
        Freedoms in the band's order.
    solve : callable
        rhs ↦ A⁻¹ rhs.
    space : callable, optional
        Entries of M, q of M-length one and M q ↦ the Krylov space of A⁻¹M that begins with q, where loops are compiled.
    """

    pivots: np.ndarray
    diagonal: np.ndarray
    order: np.ndarray
    solve: Callable[[np.ndarray], np.ndarray]
    space: Callable[[np.ndarray, np.ndarray, np.ndarray], Space] | None = None


@frozen(eq=False)
class Band:
    """The order (reverse Cuthill–McKee) in which a symmetric pattern is a narrow band, and where entries stand in it.

    Attributes
    ----------
    order : numpy.ndarray of int, shape (n,)
    starts, indices : numpy.ndarray of int, shapes (n + 1,) and (entries,)
        The pattern: where its columns start, and the rows of their entries.
    """

    order: np.ndarray
    starts: np.ndarray
    indices: np.ndarray

    @cached_property
    def back(self) -> np.ndarray:
        """Place of each freedom in the order."""
        back = np.empty(self.order.size, dtype=np.int64)
        back[self.order] = np.arange(self.order.size)
        return back

    @cached_property
    def reach(self) -> np.ndarray:
        """Last row of each column of the ordered matrix, its diagonal at least. Shape (n,)."""
        rows, filled = self.back.take(self.indices), np.flatnonzero(np.diff(self.starts))
        reach = np.arange(self.order.size)
        last = self.back[filled]
        reach[last] = np.maximum(last, np.maximum.reduceat(rows, self.starts[filled])) if filled.size else last
        return reach

    @cached_property
    def _under(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which entries lie on or under the diagonal of the ordered matrix, their rows and their columns."""
        rows, columns = self.back.take(self.indices), np.repeat(self.back, np.diff(self.starts))
        chosen = np.flatnonzero(rows >= columns)
        return chosen, rows.take(chosen), columns.take(chosen)

    @property
    def narrow(self) -> bool:
        """Whether factors in it are worth while."""
        return self._width <= WIDEST

    @cached_property
    def _width(self) -> int:
        """Half bandwidth."""
        return int((self.reach - np.arange(self.reach.size)).max(initial=0))

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
        storage = self._stored(data)
        diagonal = storage[:, 0].copy()
        L, info = lapack.dpbtrf(storage.T, lower=1, overwrite_ab=1)
        if info:
            return None

        def solve(rhs: np.ndarray) -> np.ndarray:
            return np.asarray(lapack.dpbtrs(L, rhs.take(self.order, axis=0), lower=1)[0].take(self.back, axis=0))

        return Factor(L[0] ** 2, diagonal, self.order, solve)

    def negative(self, data: np.ndarray, near: Callable[[], np.ndarray], growth: float) -> int | None:
        """How many negative eigenvalues the matrix with these entries has, if it is definite with some freedoms held.

        They are then those of the Schur complement of the held ones (E. Haynsworth, Linear Algebra Appl. 1 (1968)
        73–81). Those are held that tell the vectors given apart, and more where that turns out to be needed.

        Parameters
        ----------
        data : numpy.ndarray
            Entries in the order of the pattern.
        near : callable
            Vectors that span about the eigenvectors of these eigenvalues, and more, shape (n, k).
        growth : float
            By how much rounding of the entries may grow without any consequence.

        Returns
        -------
        int or None
            None if it is not definite, or the complement singular to rounding.
        """
        storage, held = self._stored(data), self.back[prominent(near())]
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
        storage = np.zeros(n * (self._width + 1))
        chosen, rows, columns = self._under
        storage[columns * self._width + rows] = data.take(chosen)
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
    band = _kind()(reverse_cuthill_mckee(A, symmetric_mode=True), A.indptr, A.indices)
    return band if band.narrow else None


def _kind() -> type[Band]:
    if not can_compile():
        return Band
    from flexctrl.linear.compiled_band import CompiledBand

    return CompiledBand
