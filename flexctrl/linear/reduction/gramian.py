"""Gramian factors and balancing of a stable first-order system."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, schur, solve_triangular, svd

from flexctrl.frozen import frozen

__all__ = ["Balanced", "balance", "gramian_factor"]


@frozen
class Balanced:
    """Left and right bases of a balanced realisation, ordered by Hankel singular value.

    Attributes
    ----------
    left, right : numpy.ndarray, shape (n, r)
        ``left.T @ right = I``; the balanced model is ``(left.T A right, left.T B, C right)``.
    hankel : numpy.ndarray, shape (n,)
        All Hankel singular values, decreasing.
    """

    left: np.ndarray
    right: np.ndarray
    hankel: np.ndarray


def gramian_factor(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Factor the controllability Gramian of a stable pair without forming it.

    Solves A P + P Aᵀ + B Bᵀ = 0 for L with P = L Lᵀ by Hammarling's recursion on the complex Schur
    form (S. J. Hammarling, IMA J. Numer. Anal. 2 (1982) 303–323); nothing is squared, so small
    Hankel values of lightly damped systems keep their digits.

    Parameters
    ----------
    A : numpy.ndarray, shape (n, n)
        Stable state matrix.
    B : numpy.ndarray, shape (n, m)
        Input matrix.

    Returns
    -------
    numpy.ndarray, shape (n, n)
        Real factor L.
    """
    T, Q = schur(A, output="complex")
    load = Q.conj().T @ B
    factor = np.zeros_like(T)
    for k in range(len(T) - 1, -1, -1):
        column, load = _hammarling_column(T, load, k)
        factor[: k + 1, k] = column
    factor = Q @ factor
    return qr(np.hstack([factor.real, factor.imag]).T, mode="r")[0][: len(T)].T


def _hammarling_column(T: np.ndarray, load: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return column k of the upper factor and the load left for the leading block."""
    b = load[k]
    pivot = np.linalg.norm(b) / np.sqrt(-2.0 * T[k, k].real)
    column = np.zeros(k + 1, complex)
    if pivot == 0.0:
        return column, load[:k]
    column[k] = pivot
    if k:
        shifted = T[:k, :k] + T[k, k].conj() * np.eye(k)
        column[:k] = solve_triangular(shifted, -T[:k, k] * pivot - load[:k] @ b.conj() / pivot)
    return column, load[:k] - np.outer(column[:k], b) / pivot


def balance(A: np.ndarray, B: np.ndarray, C: np.ndarray, order: int) -> Balanced:
    """Balance a stable system by the square-root method and keep its leading states.

    Parameters
    ----------
    A, B, C : numpy.ndarray
        Stable system, shapes (n, n), (n, m), (p, n).
    order : int
        Number of states to keep; clipped to the numerical rank of the Hankel operator.

    Returns
    -------
    Balanced
        Bases and all Hankel singular values.
    """
    reach, observe = gramian_factor(A, B), gramian_factor(A.T, C.T)
    u, sigma, vh = svd(observe.T @ reach)
    floor = len(A) * np.finfo(float).eps * sigma[0] if len(sigma) else 0.0
    r = min(order, int(np.count_nonzero(sigma > floor)))
    scale = 1.0 / np.sqrt(sigma[:r])
    return Balanced(observe @ u[:, :r] * scale, reach @ vh[:r].T * scale, sigma)
