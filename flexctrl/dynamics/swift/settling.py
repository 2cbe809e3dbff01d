"""Freedoms that move no mass: they are at once where forces balance, whatever has jumped.

A motor's angle without inertia, the joint of two springs: with nothing to accelerate, a freedom with stiffness but
neither mass nor damping has no motion of its own. Its place is the root of its forces with all massive freedoms where
they are. Left where it was, a jump of the inputs would have it cross the gap within one step, however short.
"""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.scales import once, yardsticks
from flexctrl.errors import SingularMatrixError
from flexctrl.model.flows import flowing
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

__all__ = ["dragged", "quasistatic", "settled", "steadied", "weightless"]

_EXACT = 1e-12
_ITERATIONS = 25


def quasistatic(model: Plant) -> np.ndarray:
    """Return the degrees of freedom with stiffness but neither mass nor damping, shape (k,)."""
    return once(model, _quasistatic)


def dragged(model: Plant) -> np.ndarray:
    """Return the degrees of freedom with damping but no mass, shape (k,)."""
    return once(model, _dragged)


def weightless(model: Plant) -> np.ndarray:
    """Return the degrees of freedom that stiffness or damping holds without mass, shape (k,)."""
    return np.concatenate([quasistatic(model), dragged(model)])


def _quasistatic(model: Plant) -> np.ndarray:
    stiffness, damping, light = once(model, _light)
    return np.flatnonzero((light > 0.0) & (damping == 0.0) & (stiffness > 0.0))


def _dragged(model: Plant) -> np.ndarray:
    _, damping, light = once(model, _light)
    return np.flatnonzero((light > 0.0) & (damping > 0.0))


def _light(model: Plant) -> np.ndarray:
    """Stiffness and damping of each degree of freedom, these zero where they are rounding, and whether it is light."""
    if not isinstance(model, Model) or model.switches.names:
        return np.zeros((3, 0))
    light = _own(model, (0.0, 0.0, 1.0)) <= model.dust
    light[np.setdiff1d(model.motion.inner, model.n)] = False
    if not light.any():
        return np.zeros((3, model.n))
    stiffness, damping = (_own(model, seeds) for seeds in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    damping[damping <= model.forces.rounding((0.0, 1.0, 0.0))] = 0.0
    return np.array([stiffness, damping, light])


def _own(model: Plant, seeds: tuple[float, float, float]) -> np.ndarray:
    """Size of each degree of freedom's own entry in a slope at rest."""
    zero, u = np.zeros(model.n), np.zeros(len(model.inputs))
    return np.abs(model.slope(model.rest, zero, zero, seeds, u).diagonal())


def steadied(feed: Feed, state: State, supply: Supply, step: float, sight: float) -> np.ndarray:
    """Return the quasi-static freedoms that a continuous controller damps: they keep their place as its command jumps.

    Parameters
    ----------
    feed : Feed
    state : State
    supply : Supply
    step : float
        About to be taken [s].
    sight : float
        Time constants that a step may be long, so that it sees them; one that sees nothing finds them settled.

    Returns
    -------
    numpy.ndarray of int
    """
    light = quasistatic(feed.model)
    if not light.size or not feed.continuous:
        return light[:0]
    still, damping = np.zeros(feed.model.n), feed.slope(state, supply, 0.0, (0.0, 1.0, 0.0)).diagonal()[light]
    if not damping.any():
        return light[:0]
    held = feed.model.slope(state, state.v, still, (1.0, 0.0, 0.0), supply.u)
    stiffness = (held + feed.slope(state, supply, 0.0, (1.0, 0.0, 0.0))).diagonal()[light]
    seen = np.isinf(sight) | (np.abs(stiffness) * step <= sight * np.abs(damping))
    return light[seen & (damping != 0.0)]


def settled(
    model: Plant, state: State, feed: Feed, supply: Supply, steady: np.ndarray | None = None
) -> tuple[State, Supply]:
    """Return a state with its quasi-static freedoms where they balance under the inputs, and the inputs there.

    Inputs of a continuous controller follow what it reads. The state is left as it is where it is balanced, or where
    nothing holds such a freedom (a slack rope, a shaft within its play).

    Parameters
    ----------
    model : Plant
    state : State
    feed : Feed
    supply : Supply
        Inputs from now on.
    steady : numpy.ndarray of int, optional
        Those among them that keep their place.

    Returns
    -------
    tuple of State and Supply
    """
    light = quasistatic(model) if steady is None else np.setdiff1d(quasistatic(model), steady)
    if not light.size:
        return state, supply
    zero, weight, first = np.zeros(model.n), 1.0 / yardsticks(model)[light], (state, supply)
    for iteration in range(_ITERATIONS):
        state = flowing(model, state, supply.u)
        force = (model.balance(state, state.v, zero) + model.loads(state, supply.u))[light]
        slope = model.slope(state, state.v, zero, (1.0, 0.0, 0.0), supply.u)
        if feed.continuous:
            slope = slope + feed.slope(state, supply, 0.0, (1.0, 0.0, 0.0))
        try:
            correction = factorise(slope.tocsr()[light][:, light])(-force)
        except SingularMatrixError:
            return first
        size = float(np.abs(correction * weight).max())
        if not np.isfinite(size):
            return first
        if size <= _EXACT:
            return (state, supply) if iteration else first
        step = zero.copy()
        step[light] = correction
        state = model.advance(state, step, state.v, state.t)
        supply = feed.restart(state, supply)
    return first
