"""Block Lanczos with full reorthogonalisation for A⁻¹M, A symmetric positive definite."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

__all__ = ["krylov"]

STILL = 1e-10
ROUGH = 1e-3
GAP = 1e-6
NOTHING = 1e-14
PARALLEL = 1e-12
ORTHOGONAL = 1e-2


def krylov(
    inverse: Callable[[np.ndarray], np.ndarray], M: np.ndarray | sp.csc_matrix, start: np.ndarray, count: int
) -> np.ndarray:
    """Vectors for the `count` largest θ of A⁻¹M y = θ y, and on to the next gap; M-orthonormal, largest θ first.

    The space grows by blocks until the residuals of the pairs wanted are 1e-10 of their θ, so that θ has all its
    digits (G. H. Golub, R. Underwood, Mathematical Software III (1977) 361–377). A multiple θ is found as often
    as the block is wide. The last pair, beyond the gap, is known to some six digits.

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
    numpy.ndarray, shape (n, count + 1) or more
        Fewer columns if M has no more rank.
    """
    space = _Space(M, start.shape[0])
    width, _ = space.grown(inverse(M @ start), 0.0)
    check = 2 * count + width
    while True:
        Z = inverse(space.images[:, -width:])
        known = space.project(Z, width)
        fresh, R = space.grown(Z, space.largest)
        if not fresh or known >= check:
            theta, s = np.linalg.eigh(space.projected[:known, :known])
            miss = np.linalg.norm(R @ s[-width:, ::-1], axis=0) / np.maximum(theta[::-1], NOTHING * space.largest)
            wanted = _to_the_gap(theta[::-1], count)
            if not fresh or (wanted < known and (miss[:wanted] <= STILL).all() and miss[wanted] <= ROUGH):
                return space.vectors[:, :known] @ s[:, : -wanted - 2 : -1]
            check = known + max(width, count // 2)
        width = fresh


def _to_the_gap(theta: np.ndarray, count: int) -> int:
    """How many from the largest on until, after `count`, two differ."""
    beyond = theta[count - 1 :]
    gaps = np.flatnonzero(beyond[:-1] - beyond[1:] > GAP * np.abs(beyond[:-1]))
    return count + int(gaps[0]) if gaps.size else theta.size


class _Space:
    """An M-orthonormal basis Q that grows by blocks, with M Q and Qᵀ M A⁻¹ M Q."""

    def __init__(self, M: np.ndarray | sp.csc_matrix, n: int) -> None:
        self._M, self._size, self.largest = M, 0, 0.0
        self._Q, self._MQ = np.empty((n, 0), order="F"), np.empty((n, 0), order="F")
        self.projected = np.zeros((0, 0))

    @property
    def vectors(self) -> np.ndarray:
        """Q."""
        return self._Q[:, : self._size]

    @property
    def images(self) -> np.ndarray:
        """M Q."""
        return self._MQ[:, : self._size]

    def project(self, Z: np.ndarray, width: int) -> int:
        """Note what A⁻¹M makes of the last columns; return how many columns there are."""
        column, size = self.images.T @ Z, self._size
        self.projected[size - width : size, :size] = column.T
        self.projected[:size, size - width : size] = column
        self.largest = max(self.largest, float(np.abs(column).max(initial=0.0)))
        return size

    def grown(self, Z: np.ndarray, size: float) -> tuple[int, np.ndarray]:
        """Add what of Z is new beside vectors of length `size`; return how many columns, and R in Z = … + new R."""
        for _ in range(2 if self._size else 0):
            Z = Z - self.vectors @ (self.images.T @ Z)
        image = self._M @ Z
        new, image, R = _orthonormal(Z, image, NOTHING * size)
        count = min(new.shape[1], self._Q.shape[0] - self._size)
        self._append(new[:, :count], image[:, :count])
        return count, R[:count]

    def _append(self, new: np.ndarray, image: np.ndarray) -> None:
        wanted = self._size + new.shape[1]
        if wanted > self._Q.shape[1]:
            self._Q, self._MQ = (_wider(A, 2 * wanted + 40, self._size) for A in (self._Q, self._MQ))
            self.projected = np.pad(self.projected, (0, self._Q.shape[1] - len(self.projected)))
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
