"""One basis, always the same, for modes that rounding could turn: clusters, order and signs."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

__all__ = ["canonical", "clusters"]

CLOSE = 1e-9
TIE = 1e-6


def clusters(values: np.ndarray, rigid: np.ndarray, noise: np.ndarray) -> list[slice]:
    """Runs of equal eigenvalues (to 1e-9 in ω, or to rounding); all rigid ones together.

    Parameters
    ----------
    values : numpy.ndarray, shape (k,)
        λ in ascending order.
    rigid : numpy.ndarray of bool, shape (k,)
    noise : numpy.ndarray, shape (k,)
        Rounding spread of each λ.

    Returns
    -------
    list of slice
    """
    cuts = [0]
    for i in range(1, values.size):
        close = max(2 * CLOSE * abs(values[i]), noise[i])
        same = rigid[i] and rigid[i - 1] if rigid[i] or rigid[i - 1] else values[i] - values[i - 1] <= close
        if not same:
            cuts.append(i)
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], values.size], strict=True)] if values.size else []


def canonical(shapes: np.ndarray, weight: np.ndarray, damping: sp.csc_matrix, groups: list[slice]) -> np.ndarray:
    """Turn each cluster to the basis that its space alone defines.

    Within a cluster the damping is made diagonal; what is still free is fixed so that each shape after the
    first vanishes at the coordinates where the ones before it are largest. The largest entry is positive;
    among equals (to 1e-6) the first coordinate counts.

    Parameters
    ----------
    shapes : numpy.ndarray, shape (n, k)
        Mass-orthonormal.
    weight : numpy.ndarray, shape (n,)
        Makes entries of different units comparable.
    damping : sparse matrix, shape (n, n)
        C.
    groups : list of slice

    Returns
    -------
    numpy.ndarray, shape (n, k)
    """
    turned = shapes.copy()
    for group in groups:
        if group.stop - group.start > 1:
            own = shapes[:, group]
            turned[:, group] = _turn(own, weight, own.T @ (damping @ own))
    leading = np.argmax(_nearly_largest(np.abs(turned) * weight[:, None]), axis=0)
    return turned * np.where(turned[leading, np.arange(turned.shape[1])] < 0, -1.0, 1.0) + 0.0


def _turn(shapes: np.ndarray, weight: np.ndarray, damping: np.ndarray) -> np.ndarray:
    rates, y = la.eigh(0.5 * (damping + damping.T))
    spread = 1e-9 * max(np.abs(rates).max(), np.finfo(float).tiny)
    if rates[-1] - rates[0] <= spread:
        return _staircase(shapes, weight)
    cuts = [0, *(np.flatnonzero(np.diff(rates) > spread) + 1), rates.size]
    pieces = [_staircase(shapes @ y[:, a:b], weight) for a, b in itertools.pairwise(cuts)]
    return np.hstack(pieces)


def _staircase(shapes: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Pivoted Householder on the rows: column j is zero at the pivots of the columns before it."""
    turned = shapes.copy()
    for j in range(turned.shape[1] - 1):
        rows = np.linalg.norm(turned[:, j:], axis=1) * weight
        pivot = int(np.argmax(_nearly_largest(rows[:, None])[:, 0]))
        target = turned[pivot, j:]
        reflection = target / np.linalg.norm(target)
        reflection = reflection - np.eye(reflection.size)[0] * -_sign(reflection[0])
        reflection /= np.linalg.norm(reflection)
        turned[:, j:] -= 2.0 * np.outer(turned[:, j:] @ reflection, reflection)
        turned[pivot, j + 1 :] = 0.0
    return turned


def _sign(x: float) -> float:
    return -1.0 if x < 0 else 1.0


def _nearly_largest(sizes: np.ndarray) -> np.ndarray:
    return sizes >= (1.0 - TIE) * sizes.max(axis=0)
