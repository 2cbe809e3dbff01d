"""Mass and stiffness that are only rounding, taken out where it is known what they were rounded from.

A massless direction n across the turns of a node, for one the spin of a rod about its own axis, has the rounding of
the inertias about other axes for its mass: eps of these, of either sign. Beside them it is nothing, but scaled to
unit diagonal it may pass for a light part, or for a negative mass. The same holds for the stiffness of a node across
the line of unloaded springs. With p the largest entries of n, and W the identity but for W n = 0 in its columns p,
Wᵀ M W has n in its null space to the last digit of every entry.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

__all__ = ["clean_mass", "clean_stiffness"]

RANK = 1e-12


def clean_mass(M: sp.csc_matrix, sizes: np.ndarray, triples: np.ndarray) -> sp.csc_matrix:
    """Take out of a mass matrix the rounding that looks like mass.

    Parameters
    ----------
    M : scipy.sparse.csc_matrix, shape (n, n)
        Symmetric.
    sizes : numpy.ndarray, shape (n,)
        Square root of the largest inertia that each diagonal entry may have been rounded from.
    triples : numpy.ndarray of int, shape (k, 3)
        Displacements or turns of each node.

    Returns
    -------
    scipy.sparse.csc_matrix, shape (n, n)
    """
    inverse = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    heavy = M.diagonal() * inverse**2 > RANK
    heavy[triples] = True
    scale = inverse[triples]
    values, vectors = np.linalg.eigh(_diagonal_blocks(M, triples) * scale[:, :, None] * scale[:, None, :])
    light = (values <= RANK * values[:, -1:]) & (values[:, -1:] > 0.0)
    if heavy.all() and not light.any():
        return M
    W = sp.lil_matrix(sp.diags(heavy.astype(float)))
    for node in np.flatnonzero(light.any(axis=1)):
        _take_out(W, triples[node], scale[node][:, None] * vectors[node][:, light[node]])
    return _congruent(sp.csc_matrix(W), M)


def clean_stiffness(K: sp.csc_matrix, noise: np.ndarray, triples: np.ndarray) -> sp.csc_matrix:
    """Take out of a stiffness matrix what stands for a node that nothing holds in some direction.

    Parameters
    ----------
    K : scipy.sparse.csc_matrix, shape (n, n)
    noise : numpy.ndarray, shape (n,)
        By how much the entries of each row are unsure.
    triples : numpy.ndarray of int, shape (k, 3)
        Displacements or turns of each node.

    Returns
    -------
    scipy.sparse.csc_matrix, shape (n, n)
    """
    even = sp.csr_matrix(0.5 * (K + K.T))
    values, vectors = np.linalg.eigh(_diagonal_blocks(even, triples))
    limit = noise[triples].max(axis=1, initial=0.0)
    idle = np.abs(values) <= limit[:, None]
    W = sp.lil_matrix(sp.identity(K.shape[0]))
    found = False
    for node in np.flatnonzero(idle.any(axis=1) & (limit > 0.0)):
        null = vectors[node][:, idle[node]]
        if np.abs(even[triples[node]].T @ null).max() <= limit[node]:
            _take_out(W, triples[node], null)
            found = True
    return _congruent(sp.csc_matrix(W), K) if found else K


def _take_out(W: sp.lil_matrix, places: np.ndarray, null: np.ndarray) -> None:
    """Let W take directions (columns) of some coordinates to zero, and leave what is across them."""
    pivot = la.qr(null.T, mode="r", pivoting=True)[1][: null.shape[1]]
    kept = np.setdiff1d(np.arange(len(places)), pivot)
    W[np.ix_(places[kept], places[pivot])] = -la.solve(null[pivot].T, null[kept].T).T
    W[places[pivot], places[pivot]] = 0.0


def _congruent(W: sp.csc_matrix, A: sp.csc_matrix) -> sp.csc_matrix:
    clean = sp.csc_matrix(W.T @ A @ W)
    clean.eliminate_zeros()
    return clean


def _diagonal_blocks(A: sp.spmatrix, triples: np.ndarray) -> np.ndarray:
    """Blocks of a matrix on some triples of coordinates, shape (k, 3, 3)."""
    rows, columns = np.repeat(triples, 3, axis=1).ravel(), np.tile(triples, (1, 3)).ravel()
    return np.asarray(A[rows, columns]).reshape(-1, 3, 3)
