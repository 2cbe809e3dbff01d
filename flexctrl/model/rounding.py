"""How far forces and stiffness in a state are unsure by the last digits of places, levers and pieces' forces.

A generalised force is a sum of the forces of pieces through levers, Tᵀ Σf. It may be nothing where each of them is
large: about a vertical hinge, weights. Its rounding is that of its terms, whatever their sum (N. J. Higham, Accuracy
and Stability of Numerical Algorithms, 2002, § 3.1):

|Δ(Tᵀ Σf)| ≤ ε (|T|ᵀ (Σ|k| |x| + Σ|f|) + g),  |ΔK| ≤ ε (|T|ᵀ Σ|k| |T| + g ωᵀ + ω gᵀ)

with k the tangents of the pieces, g what the last digits of levers make of the forces on their nodes, and ω what
levers turn by with each coordinate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.place import Place
from flexctrl.mechanics.rotation import exponential
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.model.units import units

__all__ = ["DIGITS", "force_rounding", "rounded", "shaken", "slope_terms", "stress_noise"]

DIGITS = 4.0 * float(np.finfo(float).eps)
"""Share of each term that is unsure: it is made by a few roundings."""

_SHAKES = 4


def force_rounding(model: Model, state: State, u: np.ndarray) -> np.ndarray:
    """Return the largest forces on the coordinates that may be rounding alone.

    Parameters
    ----------
    model : Model
    state : State
        At rest.
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    if not model.large:
        still = np.zeros(model.n)
        K = model.slope(state, still, still, (1.0, 0.0, 0.0), u)
        return DIGITS * (abs(K) @ np.maximum(_unit(model, state), np.abs(state.q)))
    terms, loads = model.forces.terms(state), abs(model.signals.loads_at(state)) @ np.abs(u)
    parts = terms.slopes @ _places(model, state) + terms.forces + loads + _on_levers(model, state, u)
    return DIGITS * (abs(model.motion.jacobian(state)).T @ parts)


def slope_terms(model: Model, state: State, u: np.ndarray, K: sp.spmatrix) -> sp.csr_matrix:
    """Return the sizes of the terms that the entries of K are sums of.

    Parameters
    ----------
    model : Model
    state : State
        At rest.
    u : numpy.ndarray, shape (inputs,)
    K : sparse matrix, shape (n, n)
        In that state.

    Returns
    -------
    scipy.sparse.csr_matrix, shape (n, n)
    """
    if not model.large or model.motion.plain:
        return sp.csr_matrix(abs(K))
    T = abs(model.motion.jacobian(state))
    led = T.T @ _on_levers(model, state, u)
    rates = np.where(led > 0.0, 1.0 / _unit(model, state), 0.0)
    turned = sp.csr_matrix(led[:, None]) @ sp.csr_matrix(rates[None, :])
    return sp.csr_matrix(T.T @ model.forces.terms(state).slopes @ T + turned + turned.T)


def stress_noise(place: Place[Model, State], shapes: np.ndarray) -> np.ndarray:
    """Return by how much φᵀKφ of some shapes may be wrong because places have no more digits.

    The stress of a stiff part is told by the last ones: at EA = 1e12 N a strain of 1e-14 is 0.01 N,
    and what hangs on that part swings with it.

    Parameters
    ----------
    place : Place
    shapes : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray, shape (k,)
    """
    model, state = place.model, place.state
    if not model.large:
        return np.zeros(shapes.shape[1])
    here = place.strain(shapes).diagonal()
    near = [replace(place, state=rounded(state, seed)) for seed in range(_SHAKES)]
    return np.asarray(np.max([np.abs(p.strain(shapes).diagonal() - here) for p in near], axis=0))


def shaken(state: State, shift: np.ndarray | float, turn: float, seed: int) -> State:
    """Return a state with other last digits of every node's place: what rides on others moves with them up to these.

    Parameters
    ----------
    state : State
    shift : numpy.ndarray, shape of the places, or float
        By how much places are others [m].
    turn : float
        By how much rotations are [rad].
    seed : int

    Returns
    -------
    State
    """
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), (2, *state.x.shape))
    return replace(state, x=state.x + shift * signs[0], R=exponential(turn * signs[1]) @ state.R)


def rounded(state: State, seed: int) -> State:
    """Return a state with other last digits.

    Parameters
    ----------
    state : State
    seed : int

    Returns
    -------
    State
    """
    return shaken(state, np.spacing(np.abs(state.x)), float(np.finfo(float).eps), seed)


def _reach(model: Model, state: State) -> float:
    """How far from the origin places are, at most, or how large the machine is."""
    return max(model.structure.size, float(np.abs(state.x).max(initial=0.0)))


def _unit(model: Model, state: State) -> np.ndarray:
    """A radian, or the reach, for each coordinate; of a source angle, what makes that of what it drives."""
    return units(model, _reach(model, state))


def _places(model: Model, state: State) -> np.ndarray:
    """What raw places are rounded relative to: rotations to 1, source angles and the like to themselves."""
    motion = model.motion
    angles = np.where(motion.rigid, motion.ratios * state.driven, np.append(state.q, 0.0)[motion.sources])
    nodes = np.tile(np.repeat([_reach(model, state), 1.0], 3), len(motion.place))
    return np.abs(np.concatenate([nodes, angles, np.append(state.q, 0.0)[motion.inner]]))


def _on_levers(model: Model, state: State, u: np.ndarray) -> np.ndarray:
    """Raw forces that stand for what the last digits of levers make of the forces on the nodes that they lead."""
    motion, still = model.motion, np.zeros(model.n)
    found = np.zeros(motion.raw)
    if motion.plain:
        return found
    acting = model.forces.raw(state, still, still) + model.signals.loads_at(state) @ u
    push, turn = np.linalg.norm(acting[: motion.source_base].reshape(-1, 2, 3)[motion.nodes], axis=2).T
    led = np.stack([push, _reach(model, state) * push + turn], axis=1)
    found[: motion.source_base].reshape(-1, 2, 3)[motion.nodes] = led[:, :, None]
    return found
