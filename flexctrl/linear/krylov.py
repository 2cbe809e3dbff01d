"""Lanczos with full reorthogonalisation for A⁻¹M, A symmetric positive definite."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from flexctrl.frozen import frozen

__all__ = ["NOTHING", "Blocks", "Grown", "Krylov", "Space", "krylov"]

STILL = 1e-10
ROUGH = 1e-3
GAP = 1e-6
NOTHING = 1e-14
PARALLEL = 1e-12
ORTHOGONAL = 1e-2
SELDOM = 7


@frozen(eq=False)
class Krylov:
    """What `krylov` found.

    Attributes
    ----------
    theta : numpy.ndarray, shape (k,)
        Descending.
    vectors : numpy.ndarray, shape (n, k)
        M-orthonormal, A⁻¹M y = θ y.
    images : numpy.ndarray, shape (n, k)
        M y.
    """

    theta: np.ndarray
    vectors: np.ndarray
    images: np.ndarray


class Grown(NamedTuple):
    """How far a space has come.

    Attributes
    ----------
    known : int
        Vectors whose images under A⁻¹M are known.
    rest : numpy.ndarray, shape (fresh, width)
        What the images of the last `width` of them have beyond these, as shares of the vectors after them.
    ended : bool
        Whether there are no more.
    """

    known: int
    rest: np.ndarray
    ended: bool


class Space(Protocol):
    """A Krylov space of A⁻¹M that grows."""

    @property
    def width(self) -> int:
        """Vectors that it grows by at once."""

    @property
    def vectors(self) -> np.ndarray:
        """M-orthonormal Q, shape (n, size)."""

    def combined(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first vectors times shares, shape (known, k), and their products with M."""

    def grown(self, until: int) -> Grown:
        """Grow until the images of so many vectors are known."""

    def projected(self, known: int) -> np.ndarray:
        """Qᵀ M A⁻¹ M Q of the first vectors, shape (known, known)."""


def krylov(space: Space, count: int) -> Krylov:
    """The `count` largest θ of A⁻¹M y = θ y, and on to the next gap.

    The space grows until the residuals of the pairs wanted are 1e-10 of their θ, so that θ has all its
    digits (G. H. Golub, R. Underwood, Mathematical Software III (1977)
    361–377). A multiple θ is found as often as the space is wide. The last pair, beyond the gap, is known to some six
    digits.

    Parameters
    ----------
    space : Space
        Begun with anything that holds a share of the vectors wanted.
    count : int

    Returns
    -------
    Krylov
        Fewer pairs if M has no more rank.
    """
    check, step = 2 * count + max(space.width, SELDOM), max(space.width, count // 3)
    while True:
        known, rest, ended = space.grown(check)
        theta, s, _ = lapack.dsyevd(space.projected(known), lower=1)
        theta, s = theta[::-1], s[:, ::-1]
        miss = np.sqrt(np.square(rest @ s[-rest.shape[1] :]).sum(axis=0)) / np.maximum(theta, NOTHING * theta[0])
        wanted = _to_the_gap(theta, count)
        if ended or (wanted < known and (miss[:wanted] <= STILL).all() and miss[wanted] <= ROUGH):
            kept = slice(None, wanted + 1)
            return Krylov(theta[kept], *space.combined(s[:, kept]))
        check = known + step


def _to_the_gap(theta: np.ndarray, count: int) -> int:
    """How many from the largest on until, after `count`, two differ."""
    beyond = theta[count - 1 :]
    gaps = np.flatnonzero(beyond[:-1] - beyond[1:] > GAP * np.abs(beyond[:-1]))
    return count + int(gaps[0]) if gaps.size else theta.size


class Blocks:
    """The space of block Lanczos with full reorthogonalisation.

    Parameters
    ----------
    inverse : callable
        rhs ↦ A⁻¹ rhs.
    M : array or sparse matrix, shape (n, n)
        Symmetric, positive semidefinite.
    start : numpy.ndarray, shape (n, width)
    room : int
        About how many vectors there will be.
    """

    def __init__(
        self, inverse: Callable[[np.ndarray], np.ndarray], M: np.ndarray | sp.csc_matrix, start: np.ndarray, room: int
    ) -> None:
        self._inverse, self._M, self._size, self._largest, self.width = inverse, M, 0, 0.0, 0
        self._Q, self._MQ = (np.empty((len(start), room), order="F") for _ in range(2))
        self._projected = np.zeros((room, room))
        self.width = self._joined(inverse(M @ start))[0]

    @property
    def vectors(self) -> np.ndarray:
        """See `Space`."""
        return self._Q[:, : self._size]

    def combined(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Space`."""
        return self._Q[:, : len(shares)] @ shares, self._MQ[:, : len(shares)] @ shares

    def projected(self, known: int) -> np.ndarray:
        """See `Space`."""
        return self._projected[:known, :known]

    def grown(self, until: int) -> Grown:
        """See `Space`."""
        while True:
            known = self._size
            fresh, rest = self._joined(self._inverse(self._MQ[:, known - self.width : known]))
            self.width = fresh
            if not fresh or known >= until:
                return Grown(known, rest, not fresh)

    def _joined(self, Z: np.ndarray) -> tuple[int, np.ndarray]:
        """Add what is new of Z, which A⁻¹M made of the last `width` columns.

        Returns how many columns that are, and R in Z = … + new R.
        """
        Q, MQ = self.vectors, self._MQ[:, : self._size].T
        if self.width:
            column = MQ @ Z
            self._note(column)
            Z = Z - Q @ column
            Z = Z - Q @ (MQ @ Z)
        new, image, R = _orthonormal(Z, self._M @ Z, NOTHING * self._largest)
        count = min(new.shape[1], self._Q.shape[0] - self._size)
        self._append(new[:, :count], image[:, :count])
        return count, R[:count]

    def _note(self, column: np.ndarray) -> None:
        last = slice(self._size - self.width, self._size)
        self._projected[last, : self._size] = column.T
        self._projected[: self._size, last] = column
        self._largest = max(self._largest, float(np.abs(column).max(initial=0.0)))

    def _append(self, new: np.ndarray, image: np.ndarray) -> None:
        wanted = self._size + new.shape[1]
        if wanted > self._Q.shape[1]:
            self._Q, self._MQ = (_wider(A, 2 * wanted, self._size) for A in (self._Q, self._MQ))
            self._projected = np.pad(self._projected, (0, 2 * wanted - len(self._projected)))
        self._Q[:, self._size : wanted], self._MQ[:, self._size : wanted] = new, image
        self._size = wanted


def _orthonormal(Z: np.ndarray, image: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M-orthonormal N that spans Z, M N, and R in Z = N R; columns shorter than `least` are left out.

    Columns that lie nearly in the span of the others come out orthogonal to the rounding of what sets them apart:
    these go through it twice.
    """
    N, image, R, spread = _once_orthonormal(Z, image, least)
    if spread < ORTHOGONAL:
        N, image, again, _ = _once_orthonormal(N, image, 0.0)
        R = again @ R
    return N, image, R


def _once_orthonormal(
    Z: np.ndarray, image: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """N, M N, R, and the smallest over the largest eigenvalue of the Gram matrix of the columns kept."""
    gram = Z.T @ image
    length = np.sqrt(np.maximum(gram.diagonal(), 0.0))
    if length.size == 1 and length[0] > least:
        return Z / length, image / length, length[:, None], 1.0
    long = np.flatnonzero(length > least)
    scale = length[long]
    values, turn = np.linalg.eigh(gram[long[:, None], long] / (scale[:, None] * scale))
    kept = values > PARALLEL * values.max(initial=0.0)
    size = np.sqrt(values[kept])
    T = turn[:, kept] / size / scale[:, None]
    R = np.zeros((size.size, length.size))
    R[:, long] = (turn[:, kept] * size).T * scale
    spread = float(values[kept].min(initial=1.0) / values.max(initial=1.0))
    return Z[:, long] @ T, image[:, long] @ T, R, spread


def _wider(A: np.ndarray, columns: int, filled: int) -> np.ndarray:
    grown = np.empty((A.shape[0], columns), order="F")
    grown[:, :filled] = A[:, :filled]
    return grown
