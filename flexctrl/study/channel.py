"""First-order matrices of a channel, without the free motion that it neither drives nor sees."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction.low_frequency import nearest_modes, undamped, unsymmetric
from flexctrl.linear.statespace import modal_first_order

__all__ = ["Quadruple", "channel_states"]

Quadruple = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
UNSEEN = 1e-10


def channel_states(linear: LinearModel) -> Quadruple:
    """A, B, C, D in scaled modal form, free rigid-body motion reduced to its minimal part.

    A link that may spin about its own axis, or a trolley whose position does not enter the output, would
    leave poles at 0 that no feedback moves. Undamped rigid-body motion has the response
    C_R B_R/s² + V_R B_R/s; only the directions in which the two products do not vanish are kept, and of
    those seen through their velocity alone only the velocity. Under loads that follow the machine nothing is left
    out: K is not symmetric there, and free motion stands apart from the rest no more.

    Parameters
    ----------
    linear : LinearModel
        The signals of the channel only; at most 1000 coordinates.

    Returns
    -------
    A, B, C, D : numpy.ndarray
    """
    first, modes = modal_first_order(linear), nearest_modes(linear)
    if unsymmetric(linear):
        return first.A, first.B, first.C, first.D
    position = 2 * (modes.unstable + np.arange(modes.rigid))
    free = position[undamped(linear, modes.shapes[:, modes.unstable : modes.unstable + modes.rigid])]
    rest = np.setdiff1d(np.arange(len(first.A)), np.concatenate([free, free + 1]))
    gains = modes.input_gain.T, modes.output_gain, modes.output_rate_gain
    bases = _driven_and_seen(first.B[free + 1].T, first.C[:, free], first.C[:, free + 1], gains)
    A, B, C = _free_motion(first.B[free + 1], first.C[:, free], first.C[:, free + 1], *bases)
    return (
        la.block_diag(A, first.A[np.ix_(rest, rest)]),
        np.vstack([B, first.B[rest]]),
        np.hstack([C, first.C[:, rest]]),
        first.D,
    )


def _driven_and_seen(
    push: np.ndarray, seen: np.ndarray, seen_rate: np.ndarray, gains: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions that are driven and seen by position, and those seen by their rate alone.

    Signals (rows) are measured against their gains on all modes, below 1e-10 of which there is only rounding.
    """
    push, seen, seen_rate = (
        rows / np.maximum(np.linalg.norm(every, axis=1), np.finfo(float).tiny)[:, None]
        for rows, every in zip((push, seen, seen_rate), gains, strict=True)
    )
    driven = _row_space(push)
    shown = driven @ _row_space(seen @ driven)
    hidden = driven @ la.null_space(shown.T @ driven) if driven.shape[1] else driven
    return shown, hidden @ _row_space(seen_rate @ hidden)


def _free_motion(
    push: np.ndarray, seen: np.ndarray, seen_rate: np.ndarray, shown: np.ndarray, moving: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (positions, rates) of the directions shown, rates of those that only move."""
    k, r = shown.shape[1], moving.shape[1]
    A = np.zeros((2 * k + r, 2 * k + r))
    A[:k, k : 2 * k] = np.eye(k)
    B = np.vstack([np.zeros((k, push.shape[1])), shown.T @ push, moving.T @ push])
    return A, B, np.hstack([seen @ shown, seen_rate @ shown, seen_rate @ moving])


def _row_space(rows: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the row space, rows of about unit size."""
    if not rows.size:
        return np.zeros((rows.shape[1], 0))
    _, sigma, vh = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(vh[sigma > UNSEEN].T)
