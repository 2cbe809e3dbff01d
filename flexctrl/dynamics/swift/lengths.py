"""Lengths of lines that give way: how what moves changes them, and states that have given ones."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.scales import once
from flexctrl.dynamics.swift.stiff_lines import (
    ends_of,
    frequencies,
    giving_way,
    mobility,
    own_frequencies,
    pulls_of,
)
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch

__all__ = ["lengthening", "lengths_of", "long_as", "stiff_in"]

_HELD = 1e-10
"""Share of its own that a line's matrix is firmer by, where lines side by side are one too many."""


def lengthening(model: Model, state: State) -> tuple[list[str], sp.csr_matrix, np.ndarray]:
    """Return how each degree of freedom lengthens each line that gives way.

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    list of str
        The lines' names.
    scipy.sparse.csr_matrix, shape (lines, n)
    numpy.ndarray, shape (lines,)
        The frequency of each as if all others let go [rad/s].
    """
    lines = giving_way(model)
    if not lines:
        return [], sp.csr_matrix((0, model.n)), np.zeros(0)
    rows = (pulls_of(model, lines, state) @ model.motion.jacobian(state)).tocsr()
    return [line.name for line in lines], rows, once(model, own_frequencies)


def lengths_of(model: Model, state: State) -> np.ndarray:
    """Return how far apart the ends of lines that give way are, less what winches have paid out, shape (lines,).

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    numpy.ndarray
    """
    found = []
    for line in giving_way(model):
        first, second = ends_of(model, line)
        paid = (
            state.driven[model.structure.drives.index(line)] / line.effective_ratio if isinstance(line, Winch) else 0.0
        )
        found.append(float(np.linalg.norm(state.x[second] - state.x[first])) - paid)
    return np.array(found)


def stiff_in(model: Plant, h: float) -> np.ndarray:
    """Return the numbers of the lines that turn by more than a radian of their vibration in a step of some length [s].

    Parameters
    ----------
    model : Plant
    h : float

    Returns
    -------
    numpy.ndarray of int
    """
    return np.flatnonzero(h * once(model, frequencies) > 1.0)


def long_as(model: Model, state: State, lengths: np.ndarray, which: np.ndarray) -> State:
    """Return a state moved a little, along some lines and as light things move, to lengths of all.

    Parameters
    ----------
    model : Model
    state : State
    lengths : numpy.ndarray, shape (lines,)
        As `lengths_of` tells them.
    which : numpy.ndarray of int
        The lines that are to have them.

    Returns
    -------
    State
    """
    pulls = (pulls_of(model, giving_way(model), state) @ model.motion.jacobian(state)).tocsr()[which]
    moves = sp.diags(once(model, mobility)) @ pulls.T
    between = (pulls @ moves).tocsr()
    own = between.diagonal()
    firm = between + sp.diags(np.where(own > _HELD * own.max(initial=0.0), _HELD * own, 1.0))
    gap = (lengths - lengths_of(model, state))[which]
    return model.advance(state, moves @ factorise(firm.tocsr())(gap), state.v, state.t)
