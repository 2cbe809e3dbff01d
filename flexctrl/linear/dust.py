"""Mass and stiffness that are only rounding, taken out where it is known what they were rounded from.

A massless direction n across the turns of a node, for one the spin of a rod about its own axis, has the rounding of
the inertias about other axes for its mass: eps of these, of either sign. Beside them it is nothing, but scaled to
unit diagonal it may pass for a light part, or for a negative mass. The same holds for the stiffness of a node across
the line of unloaded springs. With p the largest entries of n, and W the identity but for W n = 0 in its columns p,
Wᵀ M W has n in its null space to the last digit of every entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

__all__ = ["clean_mass", "clean_stiffness"]

RANK = 1e-12
_LEAN = 1e-9

Groups: TypeAlias = Sequence[np.ndarray]


def clean_mass(M: sp.csc_matrix, sizes: np.ndarray, groups: Groups) -> sp.csc_matrix:
    """Take out of a mass matrix the rounding that looks like mass.

    Parameters
    ----------
    M : scipy.sparse.csc_matrix, shape (n, n)
        Symmetric.
    sizes : numpy.ndarray, shape (n,)
        Square root of the largest inertia that each diagonal entry may have been rounded from.
    groups : sequence of numpy.ndarray of int, shapes (k, size)
        Displacements or turns of each node; every coordinate once.

    Returns
    -------
    scipy.sparse.csc_matrix, shape (n, n)
    """
    inverse = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    nulls = []
    for places in groups:
        scale = inverse[places]
        values, vectors = np.linalg.eigh(_diagonal_blocks(M, places) * scale[:, :, None] * scale[:, None, :])
        most = values[:, -1:] if places.shape[1] > 1 else 1.0
        light = (values <= RANK * most) & (values[:, -1:] != 0.0)
        for node in np.flatnonzero(light.any(axis=1)):
            nulls.append((places[node], scale[node][:, None] * vectors[node][:, light[node]]))
    return _without(nulls, M)


def clean_stiffness(K: sp.csc_matrix, noise: np.ndarray, groups: Groups) -> sp.csc_matrix:
    """Take out of a stiffness matrix what stands for a node that nothing holds in some direction.

    Parameters
    ----------
    K : scipy.sparse.csc_matrix, shape (n, n)
    noise : numpy.ndarray, shape (n,)
        By how much the entries of each row are unsure.
    groups : sequence of numpy.ndarray of int, shapes (k, size)
        Displacements or turns of each node; every coordinate once.

    Returns
    -------
    scipy.sparse.csc_matrix, shape (n, n)
    """
    even, nulls = sp.csr_matrix(0.5 * (K + K.T)), []
    for places in groups:
        values, vectors = np.linalg.eigh(_diagonal_blocks(even, places))
        limit = noise[places].max(axis=1)
        idle = np.abs(values) <= limit[:, None]
        for node in np.flatnonzero(idle.any(axis=1) & (limit > 0.0)):
            null = vectors[node][:, idle[node]]
            # what the noise leaves open of a direction: left in, its square would pass for a stiffness
            open_to = min(limit[node] / np.abs(values[node]).max(initial=limit[node]), _LEAN)
            null = np.where(np.abs(null) > open_to, null, 0.0)
            if np.abs(even[places[node]].T @ null).max() <= limit[node]:
                nulls.append((places[node], null))
    return _without(nulls, K)


def _without(nulls: list[tuple[np.ndarray, np.ndarray]], A: sp.csc_matrix) -> sp.csc_matrix:
    """Return Wᵀ A W with W = 0 along some directions (columns) of some coordinates, and 1 across them."""
    import scipy.linalg as la

    if not nulls:
        return A
    W = sp.lil_matrix(sp.identity(A.shape[0]))
    for places, null in nulls:
        pivot = la.qr(null.T, mode="r", pivoting=True)[1][: null.shape[1]]
        kept = np.setdiff1d(np.arange(len(places)), pivot)
        if kept.size:
            W[np.ix_(places[kept], places[pivot])] = -la.solve(null[pivot].T, null[kept].T).T
        W[places[pivot], places[pivot]] = 0.0
    W = sp.csc_matrix(W)
    clean = sp.csc_matrix(W.T @ A @ W)
    clean.eliminate_zeros()
    return clean


def _diagonal_blocks(A: sp.spmatrix, groups: np.ndarray) -> np.ndarray:
    """Blocks of a matrix on some groups of coordinates, shape (k, size, size)."""
    count, size = groups.shape
    rows, columns = np.repeat(groups, size, axis=1).ravel(), np.tile(groups, (1, size)).ravel()
    return np.asarray(A[rows, columns]).reshape(count, size, size)
