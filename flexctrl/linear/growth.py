"""How many motions of a linear model grow by themselves, beyond what rounding may pretend."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from flexctrl.linear.modal import ModalSystem
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pencil import EPS
from flexctrl.linear.statespace import first_order

__all__ = ["growing"]

_CAUTION, _CLEAR = 30.0, 1e3


def growing(linear: LinearModel) -> int:
    """Return how many motions grow: poles to the right, a conjugate pair (flutter) counted as one.

    A pole moves by its condition number times the rounding of K and of the whole: where two of them meet, as at the
    onset of flutter, by its root. What may be that does not count. Motions without any stiffness are cut out before,
    chain by chain (V. N. Kublanovskaya's staircase), so that their poles at 0 do not show on either side of it.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    int
        At least this many where massless freedoms stand on negative stiffness: those are counted alone.

    Raises
    ------
    LinearizationError
        If the poles cannot be told: beyond 1000 freedoms, or where massless freedoms are damped under loads that
        have no potential.
    MechanismError
        For a motion with neither mass nor stiffness.
    """
    falling = linear._scaled.massless.falling.shape[1]
    if falling:
        return falling
    A, noise = _states(linear._modal, _rounding(linear))
    A = _without_chains(A, _CAUTION * noise)
    if not A.size:
        return 0
    poles, left, right = la.eig(A, left=True, right=True)
    alike = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    doubt = _CAUTION * noise / np.maximum(alike, np.finfo(float).tiny)
    grow, turn = poles.real > doubt, np.abs(poles.imag) > doubt
    return int(np.count_nonzero(grow & ~turn) + np.count_nonzero(grow & turn & (poles.imag > 0.0)))


def _rounding(linear: LinearModel) -> np.ndarray:
    """What φᵀ K φ may be by the rounding of the entries of K, for every two modes [(rad/s)²]."""
    modes = linear._modal.modes
    at = [linear.coordinates.index(name) for name in modes.coordinates]
    shapes = np.abs(modes.shapes)
    return np.asarray(EPS * shapes.T @ (abs(linear.K)[at][:, at] @ shapes))


def _states(system: ModalSystem, unsure: np.ndarray) -> tuple[np.ndarray, float]:
    """A in coordinates (r η, η̇), and the rounding of it; r by all that pulls at a mode, as its ω may be nothing."""
    A, modes = first_order(system).A, system.modes
    square = np.abs(modes.omega_squared)
    clear = square[square > _CLEAR * np.diag(unsure)]
    pull = np.maximum(square, np.abs(system.circulatory).max(axis=1, initial=0.0))
    wanted = np.sqrt(np.maximum(pull, clear.min(initial=np.inf) if clear.size else 1.0))
    given = np.where(square > 0.0, np.sqrt(square), 1.0)
    scale = np.ones(len(A))
    scale[0 : 2 * len(modes) : 2] = wanted / given
    A = scale[:, None] * A / scale
    return A, float(EPS * np.linalg.norm(A) + np.linalg.norm(unsure / wanted))


def _without_chains(A: np.ndarray, limit: float) -> np.ndarray:
    """A on what is left when its null space is taken out, and that of what is left, until there is none."""
    while A.size:
        _, sigma, rows = la.svd(A)
        rank = int(np.count_nonzero(sigma > limit))
        if rank == len(A):
            return A
        A = rows[:rank] @ A @ rows[:rank].T
    return A
