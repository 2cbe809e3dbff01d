"""A linear machine of second order, some of it without mass, as one of first order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as la

__all__ = ["Heavy", "without_light"]

_DUST, _SLOW = 1e-13, 1e-9


class Heavy(NamedTuple):
    """What has mass, with relaxing states a: M q̈ = −K q − C q̇ − pull a + B u, ȧ = rates (q, q̇, a, u).

    ``reads`` is of (q, q̇, a, u) too.
    """

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    pull: np.ndarray
    B: np.ndarray
    rates: tuple[np.ndarray, ...]
    reads: tuple[np.ndarray, ...]

    def in_modes(self) -> tuple[np.ndarray, ...]:
        """Return ẋ = A x + B u, y = C x + D u with x = (ω η, η̇, a) of undamped modes; (η, η̇, a) where ω is round-off.

        Returns
        -------
        A, B, C, D : numpy.ndarray
        """
        L, n, k = np.linalg.cholesky(self.M), len(self.M), self.pull.shape[1]
        normal = la.solve_triangular(L, la.solve_triangular(L, self.K, lower=True).T, lower=True).T
        squares, modes = np.linalg.eigh(0.5 * (normal + normal.T))
        squares[abs(squares) < _DUST * abs(squares).max()] = 0.0
        shapes = la.solve_triangular(L, modes, lower=True, trans=1)
        size = np.sqrt(abs(squares))
        size[size == 0.0] = 1.0
        turning = modes.T @ (0.5 * (normal - normal.T)) @ modes
        (a_q, a_v, a_a, a_u), (y_q, y_v, y_a, D) = self.rates, self.reads
        A = np.block(
            [
                [np.zeros((n, n)), np.diag(size), np.zeros((n, k))],
                [-(np.diag(squares) + turning) / size, -shapes.T @ self.C @ shapes, -shapes.T @ self.pull],
                [a_q @ shapes / size, a_v @ shapes, a_a],
            ]
        )
        B = np.vstack([np.zeros_like(self.B), shapes.T @ self.B, a_u])
        return A, B, np.hstack([y_q @ shapes / size, y_v @ shapes, y_a]), D


def without_light(
    M: np.ndarray,
    C: np.ndarray,
    K: np.ndarray,
    B: np.ndarray,
    reads: tuple[np.ndarray, np.ndarray],
    heavy: np.ndarray,
    span: float,
) -> Heavy:
    """Return what has mass by itself: what has none relaxes where it is damped, and follows at once where it is not.

    Its equations C l̇ + C_h q̇ + K l + K_h q = B u are taken apart by C = U S Vᵀ, l = V_a a + V_b b: rows of S ≠ 0 tell
    ȧ, the others b.

    Parameters
    ----------
    M, C, K : numpy.ndarray, shape (n, n)
        M q̈ + C q̇ + K q = B u.
    B : numpy.ndarray, shape (n, inputs)
    reads : tuple of numpy.ndarray, shape (read, n)
        Of q and of q̇.
    heavy : numpy.ndarray of bool, shape (n,)
        What has mass.
    span : float
        What relaxes in less than a billionth of it follows at once [s].

    Returns
    -------
    Heavy

    Raises
    ------
    ValueError
        Where that has no unique solution.
    """
    light = ~heavy
    sides = np.ix_(heavy, heavy), np.ix_(heavy, light), np.ix_(light, heavy), np.ix_(light, light)
    (C_hh, C_l, C_h, C_ll), (K_hh, K_l, K_h, K_ll) = ([A[side] for side in sides] for A in (C, K))
    stiff, damped = (np.abs(A).max(axis=1, initial=0.0) for A in (K_ll, C_ll))
    size = 1.0 / np.sqrt(np.maximum(stiff, damped / span))
    C_ll, K_ll, C_l, K_l = size[:, None] * C_ll * size, size[:, None] * K_ll * size, C_l * size, K_l * size
    C_h, K_h, B_l = size[:, None] * C_h, size[:, None] * K_h, size[:, None] * B[light]
    U, S, V = np.linalg.svd(C_ll)
    n, slow = len(K_hh), int((_SLOW * span < S).sum())
    U_a, U_b, V_a, V_b = U[:, :slow].T, U[:, slow:].T, V[:slow].T, V[slow:].T
    if np.abs(C_l @ V_b).max(initial=0.0) > _DUST * np.abs(C).max():
        raise ValueError("what has neither mass nor damping damps what has mass")
    pushed = np.hstack([-K_h, -C_h, -K_ll @ V_a, B_l])
    at_once = np.linalg.solve(U_b @ K_ll @ V_b, U_b @ pushed)
    rates = U_a @ (pushed - K_ll @ V_b @ at_once) / S[:slow, None]
    place = V_b @ at_once + np.pad(V_a, ((0, 0), (2 * n, B.shape[1])))
    force = np.hstack([-K_hh, -C_hh, np.zeros((n, slow)), B[heavy]]) - K_l @ place - C_l @ V_a @ rates
    mass, parts = M[sides[0]], [n, 2 * n, 2 * n + slow]
    moved = np.vstack([np.eye(n, force.shape[1], n), np.linalg.solve(mass, force), rates])
    rate = V_a @ rates + V_b @ at_once[:, : parts[-1]] @ moved
    seen = np.pad(np.hstack([A[:, heavy] for A in reads]), ((0, 0), (0, slow + B.shape[1])))
    seen += reads[0][:, light] * size @ place + reads[1][:, light] * size @ rate
    K_q, C_v, pull, push = np.split(force, parts, axis=1)
    told = (tuple(np.split(A, parts, axis=1)) for A in (rates, seen))
    return Heavy(mass, -C_v, -K_q, -pull, push, *told)
