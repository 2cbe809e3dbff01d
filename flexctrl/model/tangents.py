"""Mass, damping and stiffness of a model in a state at rest, without the rounding of what has none."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.dust import clean_mass, clean_stiffness
from flexctrl.model.model import Model
from flexctrl.model.rounding import shaken
from flexctrl.model.state import State
from flexctrl.model.units import units

__all__ = ["tangents"]

_LAST_DIGITS, _CAUTION = 1e-14, 30.0
_DUST = 4.0 * float(np.finfo(float).eps)


def tangents(model: Model, state: State, u: np.ndarray) -> tuple[sp.csc_matrix, sp.csc_matrix, sp.csc_matrix]:
    """Return M, C and K in a state at rest, without the rounding of what has no mass or no stiffness at all.

    Parameters
    ----------
    model : Model
    state : State
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    tuple of 3 scipy.sparse.csc_matrix, shape (n, n)
        M symmetric; the others as they come.
    """
    still, groups, place = np.zeros(model.n), _groups(model.coordinates), model.place(state)
    seeds = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    M, C, K = ((-model.slope(state, still, still, seed, u)).tocsc() for seed in seeds)
    sizes = abs(model.motion.jacobian(place)).T @ np.sqrt(model.forces.inertias(place))
    M = clean_mass(0.5 * (M + M.T), sizes, groups)
    C = _without_dust(model, place, C)
    return M, C, clean_stiffness(K, _unsure(model, state, u, K), groups) if model.large else K


def _without_dust(model: Model, place: State, C: sp.csc_matrix) -> sp.csc_matrix:
    """C without what levers leave of dampers that do not move: entries below the rounding of their terms."""
    if model.motion.plain or not C.nnz:
        return C
    T = abs(model.motion.jacobian(place))
    clean = sp.csc_matrix(C.multiply(abs(C) > _DUST * sp.csc_matrix(T.T @ model.forces.drags(place) @ T)))
    clean.eliminate_zeros()
    return clean


def _unsure(model: Model, state: State, u: np.ndarray, K: sp.csc_matrix) -> np.ndarray:
    """By how much entries in each row of K change with the last digits of the places, with some caution."""
    reach = max(model.structure.size, float(np.abs(state.x).max(initial=0.0)))
    still, largest, unit = np.zeros(model.n), np.zeros(model.n), units(model, reach)
    for seed in range(2):
        signs = np.random.default_rng(seed).choice((-1.0, 1.0), model.n)
        near = model.advance(state, _LAST_DIGITS * signs * unit, still, 0.0)
        if not model.motion.plain:
            near = shaken(near, reach * _LAST_DIGITS, _LAST_DIGITS, seed)
        change = abs(K + model.slope(near, still, still, (1.0, 0.0, 0.0), u))
        largest = np.maximum(largest, change.max(axis=1).toarray().ravel())
    return _CAUTION * largest


def _groups(coordinates: tuple[str, ...]) -> tuple[np.ndarray, ...]:
    """The coordinates that are the displacements or the turns of one node together; others by themselves."""
    kinds = {end: kind for kind in (("_u", "_v", "_w"), ("_rx", "_ry", "_rz")) for end in kind}
    nodes: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for i, name in enumerate(coordinates):
        head, end = name[: name.rfind("_")], name[name.rfind("_") :]
        nodes.setdefault((head, kinds[end]) if end in kinds else (name, ()), []).append(i)
    sizes = {len(places) for places in nodes.values()}
    return tuple(np.array([p for p in nodes.values() if len(p) == size], dtype=int) for size in sorted(sizes))
