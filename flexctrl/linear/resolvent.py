"""(μ − A)⁻¹ for many μ: by eigenvectors where these are well conditioned, else by a Schur form."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg as la

from flexctrl.frozen import frozen

__all__ = ["Resolvent", "cached_resolvent", "resolvent"]

WORST_BASIS = 1e3
BLOCK = 32


@frozen(eq=False)
class Resolvent:
    """A = Q T Q⁻¹ with T diagonal or upper triangular.

    Attributes
    ----------
    T : numpy.ndarray, shape (n,) or (n, n)
    Q, inverse : numpy.ndarray, shape (n, n)
    """

    T: np.ndarray
    Q: np.ndarray
    inverse: np.ndarray

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A, shape (n,)."""
        return self.T if self.T.ndim == 1 else self.T.diagonal()

    def solve(self, rhs: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """(μ − A)⁻¹ rhs for each μ.

        Parameters
        ----------
        rhs : numpy.ndarray, shape (n, m, N)
        mu : numpy.ndarray, shape (N,)

        Returns
        -------
        numpy.ndarray, shape (n, m, N)
        """
        n, m, N = rhs.shape
        start = (self.inverse @ rhs.reshape(n, m * N)).reshape(n, m, N)
        diagonal = self.T.ndim == 1
        x = start / (mu - self.T[:, None])[:, None, :] if diagonal else _substituted(self.T, start, mu)
        return np.asarray((self.Q @ x.reshape(n, m * N)).reshape(n, m, N))


def resolvent(A: np.ndarray) -> Resolvent:
    """Prepare (μ − A)⁻¹.

    Parameters
    ----------
    A : numpy.ndarray, shape (n, n)

    Returns
    -------
    Resolvent
    """
    poles, vectors = la.eig(A, check_finite=False)
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        inverse = np.full_like(vectors, np.inf)
    if np.linalg.norm(vectors) * np.linalg.norm(inverse) < WORST_BASIS * max(len(A), 1):
        return Resolvent(poles, vectors, inverse)
    T, Q = la.schur(A, output="complex", check_finite=False)
    return Resolvent(T, Q, Q.conj().T)


def cached_resolvent(A: np.ndarray) -> Resolvent:
    """As `resolvent`; that of the last matrix is kept, for a response and its refinement.

    Parameters
    ----------
    A : numpy.ndarray, shape (n, n)

    Returns
    -------
    Resolvent
    """
    return _of_bytes(np.ascontiguousarray(A).tobytes(), len(A))


@lru_cache(maxsize=1)
def _of_bytes(data: bytes, n: int) -> Resolvent:
    return resolvent(np.frombuffer(data).reshape(n, n))


def _substituted(T: np.ndarray, start: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """(μ − T)⁻¹ start for upper triangular T, block row by block row."""
    n, m, N = start.shape
    x = np.zeros((n, m, N), dtype=complex)
    for high in range(n, 0, -BLOCK):
        low = max(0, high - BLOCK)
        pull = start[low:high] + (T[low:high, high:] @ x[high:].reshape(n - high, m * N)).reshape(high - low, m, N)
        for i in range(high - 1, low - 1, -1):
            total = pull[i - low] + np.tensordot(T[i, i + 1 : high], x[i + 1 : high], axes=1)
            x[i] = total / (mu - T[i, i])
    return x
