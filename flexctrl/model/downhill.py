"""Directions of negative stiffness; where the entries of K leave a motion in doubt, the machine itself is asked.

Bounds on the rounding of K (`pivots`) take all of it to act together against one motion. Where EA L²/EI = 1e8 the last
digits of places make pulls and pushes in 64 elements that, were all of them pulls, would hold a mast 1 % beyond its
critical weight; they are of either sign, and come to a millionth of what the weight is to that motion. So each motion
between the bounds is asked by itself: for φᵀ K φ, piece by piece, and for the doubt about it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError
from flexctrl.linear.columns import energies
from flexctrl.linear.eigen import EPS, complete_pairs, lowest_pairs
from flexctrl.linear.place import Place
from flexctrl.linear.undamped import DENSE, EXTENDED_EPS, STRESS_NOISE
from flexctrl.model.balance import Balance
from flexctrl.model.paths.pivots import ZERO_PIVOT, negative_pivots, perhaps_negative, unit_scaled
from flexctrl.model.rounding import DIGITS, stress_noise
from flexctrl.model.state import State

__all__ = ["downhill"]

_MOST = 100
"""Motions that are asked; beyond, those count that no rounding makes."""


def downhill(balance: Balance, state: State) -> int:
    """Return in how many independent directions the stiffness of the free coordinates is negative.

    Parameters
    ----------
    balance : Balance
        Under loads with a potential.
    state : State

    Returns
    -------
    int
    """
    K = balance.slope(state)
    A, terms = balance.among_free(K), balance.terms(state, K)
    sure, perhaps = negative_pivots(A, terms), perhaps_negative(A, terms)
    if not sure < perhaps <= _MOST:
        return sure
    try:
        shapes = _softest(A, terms, perhaps)
    except LinearizationError:  # whether they are the softest cannot be told
        return sure
    return max(sure, _negative(balance, state, shapes))


def _softest(A: sp.csr_matrix, terms: sp.csr_matrix, count: int) -> np.ndarray:
    """The motions with the least stiffness beside the rounding of it, shape (n, count)."""
    scale, even, unsure = unit_scaled(A, terms)
    doubt = sp.diags(unsure + ZERO_PIVOT)
    if len(unsure) <= DENSE:
        pairs = complete_pairs(even.toarray(), doubt.toarray())
    else:
        pairs = lowest_pairs(even.tocsc(), doubt.tocsc(), count)
    return np.asarray(scale @ pairs.shapes[:, :count])


def _negative(balance: Balance, state: State, shapes: np.ndarray) -> int:
    """How many of the softest motions have a stiffness that is negative by more than rounding."""
    K = balance.slope(state)
    A, entries = balance.among_free(K), balance.entries(state, K)
    shapes = shapes[:, energies(A.tocsc(), shapes) < STRESS_NOISE * DIGITS * _spread(entries, shapes)]
    stiffness = balance.strain(state, shapes)
    values, turn = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    shapes = shapes @ turn
    digits = DIGITS * (EXTENDED_EPS / EPS if balance.told_by_pieces else 1.0)
    below = values < -STRESS_NOISE * digits * _spread(entries, shapes)
    if not below.any():
        return 0
    place = Place(balance.model, state, balance.basis(state), balance.u, 0.0)
    return int(np.count_nonzero(values[below] < -STRESS_NOISE * stress_noise(place, shapes[:, below])))


def _spread(entries: sp.csr_matrix, shapes: np.ndarray) -> np.ndarray:
    """How far φᵀ K φ is spread by a change of every entry of K by as much as it is, of either sign."""
    squares = shapes**2
    return np.sqrt(np.einsum("ij,ij->j", squares, entries.multiply(entries) @ squares))
