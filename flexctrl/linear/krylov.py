"""Block Lanczos with full reorthogonalisation for A⁻¹M, A symmetric positive definite."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

__all__ = ["Krylov", "krylov"]

STILL = 1e-10
ROUGH = 1e-3
GAP = 1e-6
NOTHING = 1e-14
PARALLEL = 1e-12
ORTHOGONAL = 1e-2


@dataclass(frozen=True, eq=False)
class Krylov:
    """What `krylov` found.

    Attributes
    ----------
    theta : numpy.ndarray, shape (k,)
        Descending.
    vectors : numpy.ndarray, shape (n, k)
        M-orthonormal, A⁻¹M y = θ y.
    basis : numpy.ndarray, shape (n, j)
        The whole space, M-orthonormal.
    """

    theta: np.ndarray
    vectors: np.ndarray
    basis: np.ndarray


def krylov(
    inverse: Callable[[np.ndarray], np.ndarray], M: np.ndarray | sp.csc_matrix, start: np.ndarray, count: int
) -> Krylov:
    """The `count` largest θ of A⁻¹M y = θ y, and on to the next gap.

    The space grows by blocks until the residuals of the pairs wanted are 1e-10 of their θ, so that θ has all its
    digits (G. H. Golub, R. Underwood, Mathematical Software III (1977)
    361–377). A multiple θ is found as often as the block is wide. The last pair, beyond the gap, is known to some six
    digits.

    Parameters
    ----------
    inverse : callable
        rhs ↦ A⁻¹ rhs.
    M : array or sparse matrix, shape (n, n)
        Symmetric, positive semidefinite.
    start : numpy.ndarray, shape (n, width)
        Anything that holds a share of the vectors wanted.
    count : int

    Returns
    -------
    Krylov
        Fewer pairs if M has no more rank.
    """
    space = _Space(M, start.shape[0], 3 * (count + start.shape[1]))
    width, _ = space.grown(inverse(M @ start), 0)
    check = 2 * count + width
    while True:
        known = space.size
        fresh, R = space.grown(inverse(space.images[:, -width:]), width)
        if not fresh or known >= check:
            theta, s = np.linalg.eigh(space.projected[:known, :known])
            theta, s = theta[::-1], s[:, ::-1]
            miss = np.sqrt(np.square(R @ s[-width:]).sum(axis=0)) / np.maximum(theta, NOTHING * space.largest)
            wanted = _to_the_gap(theta, count)
            if not fresh or (wanted < known and (miss[:wanted] <= STILL).all() and miss[wanted] <= ROUGH):
                basis, kept = space.vectors[:, :known], slice(None, wanted + 1)
                return Krylov(theta[kept], basis @ s[:, kept], basis)
            check = known + max(width, count // 3)
        width = fresh


def _to_the_gap(theta: np.ndarray, count: int) -> int:
    """How many from the largest on until, after `count`, two differ."""
    beyond = theta[count - 1 :]
    gaps = np.flatnonzero(beyond[:-1] - beyond[1:] > GAP * np.abs(beyond[:-1]))
    return count + int(gaps[0]) if gaps.size else theta.size


class _Space:
    """An M-orthonormal basis Q that grows by blocks, with M Q and Qᵀ M A⁻¹ M Q."""

    def __init__(self, M: np.ndarray | sp.csc_matrix, n: int, room: int) -> None:
        self._M, self.size, self.largest = M, 0, 0.0
        self._Q, self._MQ = np.empty((n, room), order="F"), np.empty((n, room), order="F")
        self.projected = np.zeros((room, room))

    @property
    def vectors(self) -> np.ndarray:
        """Q."""
        return self._Q[:, : self.size]

    @property
    def images(self) -> np.ndarray:
        """M Q."""
        return self._MQ[:, : self.size]

    def grown(self, Z: np.ndarray, width: int) -> tuple[int, np.ndarray]:
        """Add what is new of Z, which A⁻¹M made of the last `width` columns.

        Returns how many columns that are, and R in Z = … + new R.
        """
        Q, MQ = self.vectors, self.images.T
        if width:
            column = MQ @ Z
            self._note(column, width)
            Z = Z - Q @ column
            Z = Z - Q @ (MQ @ Z)
        new, image, R = _orthonormal(Z, self._M @ Z, NOTHING * self.largest)
        count = min(new.shape[1], self._Q.shape[0] - self.size)
        self._append(new[:, :count], image[:, :count])
        return count, R[:count]

    def _note(self, column: np.ndarray, width: int) -> None:
        last = slice(self.size - width, self.size)
        self.projected[last, : self.size] = column.T
        self.projected[: self.size, last] = column
        self.largest = max(self.largest, float(np.abs(column).max(initial=0.0)))

    def _append(self, new: np.ndarray, image: np.ndarray) -> None:
        wanted = self.size + new.shape[1]
        if wanted > self._Q.shape[1]:
            self._Q, self._MQ = (_wider(A, 2 * wanted, self.size) for A in (self._Q, self._MQ))
            self.projected = np.pad(self.projected, (0, 2 * wanted - len(self.projected)))
        self._Q[:, self.size : wanted], self._MQ[:, self.size : wanted] = new, image
        self.size = wanted


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
