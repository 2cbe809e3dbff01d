"""Linear equations taken apart: pairs of states that nothing couples, however the damping couples modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen

if TYPE_CHECKING:
    from flexctrl.linear.statespace import FirstOrder

__all__ = ["Pairs", "pairs_of"]

_WORST = 1e5
_STILL = 1e-11


@frozen(eq=False)
class Pairs:
    """x = basis z, where z moves pair by pair.

    Attributes
    ----------
    basis, inverse : numpy.ndarray, shape (n, n)
    where : numpy.ndarray of int, shape (n,)
        Places of the entries of z: the first of every pair, then, from ``half`` on, the second.
    half : int
        Number of pairs, filled up to a multiple of eight.
    apart : bool
        Whether they are pairs that nothing couples; otherwise z is x.
    """

    basis: np.ndarray
    inverse: np.ndarray
    where: np.ndarray
    half: int
    apart: bool


def pairs_of(first: FirstOrder) -> Pairs:
    """Take equations apart.

    Blocks of more than two states are written in eigenvectors, real and imaginary parts of each, and what stands
    still or drifts in a basis of its own, where that is well conditioned.
    """
    import scipy.linalg as la

    n = len(first.A)
    basis, lengths = np.eye(n), []
    for block in first.blocks:
        if block.stop - block.start <= 2:
            lengths.append(block.stop - block.start)
            continue
        found = _apart(first.A[block, block])
        if found is None:
            return Pairs(np.eye(n), np.eye(n), np.arange(n), -(-((n + 1) // 2) // 8) * 8, False)
        basis[block, block] = found
        lengths += [2] * (len(found) // 2) + [1] * (len(found) % 2)
    half = -(-len(lengths) // 8) * 8
    where = np.concatenate([k + half * np.arange(length) for k, length in enumerate(lengths)]).astype(int)
    return Pairs(basis, la.inv(basis) if n else basis, where, half, True)


def _apart(A: np.ndarray) -> np.ndarray | None:
    """A basis in which A is blocks of two; None if it is badly conditioned."""
    import scipy.linalg as la

    values, vectors = la.eig(A)
    small = _STILL * float(np.abs(values).max())
    still = np.abs(values) <= small
    if still.sum() > 2:
        return None
    resting = la.schur(A, sort=lambda re, im: np.hypot(re, im) <= small)[1][:, : still.sum()].T
    turning = [part for i in np.flatnonzero(values.imag > small) for part in (vectors[:, i].real, vectors[:, i].imag)]
    straight = [vectors[:, i].real for i in np.flatnonzero(~still & (np.abs(values.imag) <= small))]
    basis = np.array([*turning, *resting, *straight]).T
    fits = basis.shape == A.shape and np.linalg.cond(basis) <= _WORST
    return basis if fits else None
