"""A model in coordinates of which the first are its rigid-body motions, so that no rounding of K resists these.

Entries of K are as large as its stiffest member and rounded accordingly. In the machine's own coordinates a solver
finds that rounding in the way of free motion; at low frequencies it is more than the inertia −ω² M. With
q = Φ a + q_kept, Φ the rigid-body modes and as many coordinates left out as these are, K has nothing in the rows and
columns of a.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from flexctrl.linear.condense import Scaled
from flexctrl.linear.modes import Modes

BLIND = 1e-11

__all__ = ["with_free_motion_apart"]


def with_free_motion_apart(base: Scaled, modes: Modes) -> tuple[Scaled, Modes]:
    """Change to coordinates of which the first are the rigid-body motions.

    Parameters
    ----------
    base : Scaled
    modes : Modes
        Of the same model, all rigid-body modes among them.

    Returns
    -------
    base : Scaled
        The same if there are none. Its responses are those of the model given.
    modes : Modes
        In the new coordinates.
    """
    shapes = modes.shapes / base.scales[:, None]
    free = shapes[:, modes.unstable : modes.unstable + modes.rigid]
    count = free.shape[1]
    if not count:
        return base, modes
    gone = la.qr(free.T, mode="r", pivoting=True)[1][:count]
    kept = np.setdiff1d(np.arange(len(shapes)), gone)
    model, T = base.model, sp.csc_matrix(sp.hstack([free, sp.identity(len(shapes), format="csc")[:, kept]]))
    names = (*(f"free_{i}" for i in range(count)), *(model.coordinates[i] for i in kept))
    apart = replace(
        model,
        M=sp.csc_matrix(T.T @ model.M @ T),
        C=_damping(model.C, T, count),
        K=sp.csc_matrix(sp.block_diag([sp.csc_matrix((count, count)), model.K[kept][:, kept]])),
        B=np.vstack([_shares(free.T, model.B), model.B[kept]]),
        Cq=np.hstack([_shares(model.Cq, free), model.Cq[:, kept]]),
        Cv=np.hstack([_shares(model.Cv, free), model.Cv[:, kept]]),
        coordinates=names,
    )
    share = np.linalg.solve(free[gone], shapes[gone])
    moved = np.vstack([share, shapes[kept] - free[kept] @ share])
    return (
        replace(base, model=apart, scales=np.ones(len(names)), band=None),
        replace(modes, shapes=moved, coordinates=names, place=None),
    )


def _shares(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Their product, where it is more than rounding."""
    found = rows @ columns
    return np.where(np.abs(found) > BLIND * (np.abs(rows) @ np.abs(columns)), found, 0.0)


def _damping(C: sp.csc_matrix, T: sp.csc_matrix, count: int) -> sp.csc_matrix:
    """Tᵀ C T, its first rows and columns without rounding: what resists free motion is small beside C's entries."""
    free, kept = T[:, :count].toarray().astype(np.longdouble), T[:, count:]
    long = sp.csr_matrix(C).astype(np.longdouble)
    columns, rows = np.asarray(long @ free), np.asarray(long.T @ free).T
    inner = np.asarray(free.T @ columns, dtype=float)
    right, below = np.asarray(rows, dtype=float) @ kept, kept.T @ np.asarray(columns, dtype=float)
    return sp.csc_matrix(sp.bmat([[inner, right], [sp.csc_matrix(below), kept.T @ C @ kept]]))
