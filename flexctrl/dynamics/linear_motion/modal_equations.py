"""Linear equations of motion in modal form, open and closed by a linear controller."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.design.controller import LinearController
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.frozen import frozen
from flexctrl.linear.modal import ModalSystem, modal_system
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import FirstOrder, first_order
from flexctrl.model.plant import Plant

__all__ = ["ModalEquations", "closed", "feels_at_once", "opened"]

_DUST = 1e-12


@frozen(eq=False)
class ModalEquations:
    """ẋ = A x + B w, (q, v) = C x + D w with w = (inputs, 1); commands u = gain x + direct w.

    Open, the inputs are the commands. Closed by a linear controller, they are what is added to its commands, and its
    states are the last of x.

    Attributes
    ----------
    first : FirstOrder
    gain : numpy.ndarray, shape (inputs, states)
    direct : numpy.ndarray, shape (inputs, inputs + 1)
    modes : int
        States that are not the controller's.
    read : numpy.ndarray, shape (modes, 2 n)
        These states from (q, v) less what inputs do at once: of what has mass its place and rate, of what has damping
        alone its place.
    slowest_left : float
        Angular frequency of the slowest vibration left out [rad/s]; infinite where none is.
    """

    first: FirstOrder
    gain: np.ndarray
    direct: np.ndarray
    modes: int
    read: np.ndarray
    slowest_left: float = math.inf


def opened(model: Plant, modes: int | None = None) -> ModalEquations:
    """Return the modal form of a model that does not move far; the last input carries its constant loads, and where
    it rests.

    Parameters
    ----------
    model : Plant
    modes : int, optional
        Vibrations that are kept, the slowest ones, beside motion that is free or grows; those left out stay where
        the constant loads hold them. Default: all.

    Returns
    -------
    ModalEquations
    """
    n, m, rest = model.n, len(model.inputs), model.rest
    still, none = np.zeros(n), np.zeros(m)
    seeds = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    K, C, M = (-model.slope(rest, still, still, seed, none) for seed in seeds)
    loads = [model.loads(rest, unit) for unit in np.eye(m)] + [model.balance(rest, still, still)]
    linear = LinearModel(
        M.tocsc(),
        C.tocsc(),
        K.tocsc(),
        np.array(loads).T.reshape(n, m + 1),
        np.vstack([np.eye(n), np.zeros((n, n))]),
        np.vstack([np.zeros((n, n)), np.eye(n)]),
        np.zeros((2 * n, m + 1)),
        model.coordinates,
        (*model.inputs, "constant_loads"),
        tuple(f"{name}_{what}" for what in ("place", "rate") for name in model.coordinates),
        place=model.linear.place if isinstance(model, LinearPlant) else None,
    )
    system = replace(modal_system(linear), jump=np.zeros((2 * n, m + 1)))
    first = first_order(system)
    read, slowest = _reading(M, C, first, len(system.modes)), math.inf
    always = system.modes.unstable + system.modes.rigid
    if modes is not None and always + modes < len(system.modes):
        first, kept = _truncated(system, always + modes)
        read, slowest = read[kept], float(np.sqrt(abs(system.modes.omega_squared[always + modes])))
    drawn = np.zeros_like(first.D)
    drawn[:n, -1] = rest.q
    first = replace(first, D=first.D + drawn)
    return ModalEquations(first, np.zeros((m, len(first.A))), np.eye(m, m + 1), len(first.A), read, slowest)


def _truncated(system: ModalSystem, count: int) -> tuple[FirstOrder, np.ndarray]:
    """The equations of the first modes, and which of all states these are; the others are held by constant loads."""
    modes, relax, kept = system.modes, system.relaxation, np.arange(count)
    left = modes.select(np.arange(count, len(modes)))
    direct = system.feedthrough.copy()
    direct[:, -1] += left.output_gain @ (left.input_gain[:, -1] / left.omega_squared)
    smaller = replace(
        system,
        modes=modes.select(kept),
        damping=system.damping[:count, :count],
        circulatory=system.circulatory[:count, :count],
        relaxation=replace(relax, drag=relax.drag[:, :count], reaction=relax.reaction[:count]),
        feedthrough=direct,
    )
    relaxing = 2 * len(modes) + np.arange(relax.rates.size)
    return first_order(smaller), np.concatenate([np.arange(2 * count), relaxing])


def closed(plant: ModalEquations, model: LinearPlant, feed: Feed) -> ModalEquations:
    """Return the equations of a linear model with a linear continuous controller in them.

    With y = S x + F u read and u = w + W (C z + D y) commanded, u = (I − W D F)⁻¹ (w + W D S x + W C z).
    """
    law, first, n, linear = feed.controller, plant.first, model.n, model.linear
    assert isinstance(law, LinearController)
    m, k, d = len(model.inputs), len(law.A), len(first.A)
    W = np.zeros((m, len(law.outputs)))
    W[[model.inputs.index(name) for name in law.outputs], range(len(law.outputs))] = 1.0
    reads = [model.outputs.index(name) for name in law.inputs]
    S = (linear.Cq @ first.C[:n] + linear.Cv @ first.C[n:])[reads]
    F = (linear.Cq @ first.D[:n, :m] + linear.Cv @ first.D[n:, :m] + linear.D)[reads]
    solved = np.linalg.inv(np.eye(m) - W @ law.D @ F)
    gain = solved @ np.hstack([W @ law.D @ S, W @ law.C])
    seen = np.hstack([S, np.zeros((len(reads), k))]) + F @ gain
    own = np.hstack([np.zeros((k, d)), law.A]) + law.B @ seen
    A = np.vstack([np.hstack([first.A, np.zeros((d, k))]) + first.B[:, :m] @ gain, own])
    B = np.vstack([first.B[:, :m] @ solved, law.B @ F @ solved])
    C = np.hstack([first.C, np.zeros((2 * n, k))]) + first.D[:, :m] @ gain
    D = first.D[:, :m] @ solved
    C[n:] += first.D[:n, :m] @ gain @ A
    D[n:] += first.D[:n, :m] @ gain @ B
    states = (*first.states, *(f"controller{i + 1}" for i in range(k)))
    whole = FirstOrder(A, _unloaded(B), C, _unloaded(D), states, (slice(0, d + k),))
    return ModalEquations(whole, gain, _unloaded(solved), d, plant.read, plant.slowest_left)


def feels_at_once(plant: ModalEquations, model: LinearPlant, feed: Feed) -> bool:
    """Tell whether a controller reads the rate of a freedom without mass or damping that it moves itself."""
    n, reads, writes, Cv = model.n, feed.reads, list(feed.writes), model.linear.Cv
    moved = plant.first.D[:n, writes]
    felt, size = np.abs((Cv @ moved)[reads]), (np.abs(Cv) @ np.abs(moved))[reads]
    return bool((felt > _DUST * size).any())


def _reading(M: sp.csr_matrix, C: sp.csr_matrix, first: FirstOrder, modes: int) -> np.ndarray:
    """Modal states from (q, v) by the left vectors of (M q, M v, C q).

    These are what a jump of the inputs leaves as it is. It moves freedoms without mass and damping at once, and rates
    of those without mass: these tell nothing of the states behind the jump.
    """
    n, two = M.shape[0], 2 * modes
    sizes = first.A[np.arange(0, two, 2), np.arange(1, two, 2)]
    momenta = (M.T @ (first.C[:n, :two:2] * sizes)).T
    left = np.zeros((len(first.A), 2 * n))
    left[:two:2, :n], left[1:two:2, n:] = sizes[:, None] * momenta, momenta
    left[two:, :n] = (C.T @ first.C[:n, two:]).T
    return np.linalg.solve(left @ first.C, left)


def _unloaded(matrix: np.ndarray) -> np.ndarray:
    """A column of zeros more, for the constant loads that a linear model does not have."""
    return np.hstack([matrix, np.zeros((len(matrix), 1))])
