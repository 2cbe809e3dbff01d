"""Parts of a machine that nothing holds: what is left of forces there moves them away."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.scales import components
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

__all__ = ["floats"]

_SOFT = 1e-3
"""Of the stiffness of its pieces what holds a part may have that floats."""


def floats(model: Plant) -> bool:
    """Tell whether a part of a machine, or more of them, can go in all directions that it knows, two at least.

    A part on soft springs floats too: what its pieces hold each other with is far stiffer than what holds it.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    bool
    """
    if not (isinstance(model, Model) and model.large):
        return False
    loose = ~_pinned(model)
    return bool(loose.any()) and bool((loose & _soft(model)).any())


def _pinned(model: Model) -> np.ndarray:
    """Which parts have nodes that turn where they stand: without the stiffness, which takes long in large machines."""
    part, T = components(model), sp.csr_matrix(model.motion.jacobian(model.rest))
    moved = np.diff(T.indptr)[: model.motion.source_base].reshape(-1, 6) > 0
    pinned = np.zeros(part.max(initial=0) + 1, dtype=bool)
    for node in np.flatnonzero(~moved[:, :3].any(axis=1) & moved[:, 3:].any(axis=1)):
        pinned[part[T[6 * node : 6 * node + 6].indices]] = True
    return pinned


def _soft(model: Model) -> np.ndarray:
    """Which parts go in two directions at least, and are held in none."""
    shifts = [cells[cells < model.n] for cells in model.motion.place[:, :3].T]
    part, K = components(model), model.stiffness()
    stiffest = np.zeros(part.max(initial=0) + 1)
    np.maximum.at(stiffest, part[(cells := np.concatenate(shifts))], K.diagonal()[cells])
    soft, firm = np.zeros((2, stiffest.size), dtype=int)
    for cells in shifts:
        shift = np.zeros(model.n)
        shift[cells] = 1.0
        held, known = np.zeros((2, stiffest.size))
        np.add.at(held, part, shift * (K @ shift))
        np.add.at(known, part, shift)
        loose = held <= _SOFT * stiffest
        soft += (known > 0.0) & loose
        firm += (known > 0.0) & ~loose
    return np.asarray((soft > 1) & (firm == 0))
