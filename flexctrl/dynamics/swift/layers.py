"""What drag settles in a time that no step sees: a run sets out beyond such a layer.

A part of next to no mass is at once as fast as the wind lets it be. A step that does not see that swings about this
speed for long, and what the drag takes from the swing is none of the motion's. So modes of C x = λ M x whose time
1/λ is below a step set out with the speeds v₁ that they have some steps later, at the places there are, and behind by
the way that they lose until then,

    ∫ (v_s − v) M dv/F(v) from v₀ to v₁, v_s the speeds at last,

along the straight way of speeds. By what share a mode does so, 1/(1 + z⁻⁴) with 1/(1 + z) of the way to v_s left after
a step, is of fourth order in steps that see it: methods keep theirs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.first_step import unseen
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Fixed, Pace
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.effects.wind import Wind
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.model.state import State

__all__ = ["beyond_layers"]

_POWER, _SEEN, _LATER, _LAST = 4, 0.1, 6, 1e4
_MOST, _FEW = 300, 4
"""Freedoms in layers whose modes are looked for: dense."""
_ITERATIONS, _EXACT, _NEAR = 30, 1e-12, 1e-2
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(12)
_LEFT = (0.5 - 0.5 * _GAUSS) ** 4
"""Shares of the speed yet to be gained, dense where forces fade."""
_WEIGHTS = 2.0 * _GAUSS_WEIGHTS * (0.5 - 0.5 * _GAUSS) ** 3

_Seeds = tuple[float, float, float]
_PLACE, _RATE, _ACCELERATION = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def beyond_layers(
    feed: Feed, state: State, supply: Supply, pace: Pace, tolerance: Tolerance
) -> tuple[State, Supply, tuple[str, ...]]:
    """Return a state beyond the layers that drag settles, its inputs, and a note; as it is where there are none.

    Parameters
    ----------
    feed : Feed
    state : State
        Where a run begins.
    supply : Supply
    pace : Fixed or Controlled
        What is over in far less than its first step is not seen.
    tolerance : Tolerance

    Returns
    -------
    tuple of State, Supply and tuple of str
    """
    model = feed.model
    if not isinstance(model, Model) or not any(isinstance(e, Wind) and e.acts(model.structure) for e in model.effects):
        return state, supply, ()
    span = pace.step if isinstance(pace, Fixed) else unseen(feed, state, supply, tolerance)
    layers = _Layers(feed, supply, span)
    try:
        light, swift = layers.light(state) if span > 0.0 else (np.zeros(0, dtype=int), state)
        beyond = layers.beyond(state, light, swift) if 0 < light.size <= _MOST else state
    except np.linalg.LinAlgError:  # nothing that damps alone
        return state, supply, ()
    if beyond is state:
        return state, supply, ()
    return beyond, feed.restart(beyond, supply), (_told([model.coordinates[i] for i in light]),)


def _told(names: list[str]) -> str:
    few = names if len(names) <= _FEW else [*names[:_FEW], f"{len(names) - _FEW} more"]
    return (
        f"{', '.join(few)}: these parts are nearly massless in the wind and start at the velocity at which drag "
        "balances the other forces on them, as the steps do not resolve how they reach it"
    )


@frozen
class _Layers:
    """The layers under a feed."""

    feed: Feed
    supply: Supply
    span: float

    def light(self, state: State) -> tuple[np.ndarray, State]:
        """Return the freedoms with more damping than mass over a step, and a state with the speeds at its end.

        By the implicit Euler rule, of each of them by itself: still air damps nothing that is at rest.
        """
        model, h, start = self.feed.model, self.span, state.v
        mass, stiff = (self._own(state, seeds) for seeds in (_ACCELERATION, _PLACE))
        moved = mass > model.dust
        moved[model.motion.flows] = moved[weightless(model)] = False
        held = np.where(moved, mass / h + h * np.maximum(stiff, 0.0), 1.0)
        for _ in range(_ITERATIONS):
            damping = np.maximum(self._own(state, _RATE), 0.0)
            gap = self._force(state) - h * stiff * state.v - mass * (state.v - start) / h
            change = np.where(moved, gap / (held + damping), 0.0)
            state = state.with_(v=state.v + change)
            if np.abs(change).max() <= _NEAR * np.abs(state.v - start).max():
                break
        return np.flatnonzero(moved & (h * damping > _SEEN * mass)), state

    def beyond(self, start: State, light: np.ndarray, swift: State) -> State:
        """Return the state beyond the layers of light freedoms, whose modes are those at their speeds."""
        M = self._on(start, light, _ACCELERATION)
        X = self._modes(M, *(self._on(swift, light, seeds) for seeds in (_RATE, _PLACE)))
        if not X.size:
            return start
        soon = later = self._gained(start, light, X, self.span, np.zeros(X.shape[1]))
        for _ in range(_LATER):
            later = self._gained(start, light, X, self.span, later)
        last = self._gained(start, light, X, _LAST * self.span, later)
        if (self.span * np.abs(X @ last) <= _EXACT * yardsticks(self.feed.model)[light]).all():
            return start
        clear = np.abs(last) > _EXACT * np.abs(last).max()
        left = np.divide(np.abs(last - soon), np.abs(last), out=np.ones(last.size), where=clear)
        share = 1.0 / (1.0 + (left / np.maximum(1.0 - left, _EXACT)) ** _POWER)
        lost = self._lost(start, light, X, later, last)
        return self._moved(start, light, -X @ (share * lost), X @ (share * later))

    def _modes(self, M: np.ndarray, C: np.ndarray, K: np.ndarray) -> np.ndarray:
        """Modes in columns, xᵀ M x = 1, that creep rather than swing, and in less than a step."""
        down = np.linalg.inv(np.linalg.cholesky(M))
        rates, own = np.linalg.eigh(0.5 * down @ (C + C.T) @ down.T)
        shapes = down.T @ own
        stiff = np.einsum("ij,ij->j", shapes, K @ shapes)
        return shapes[:, (self.span * rates > _SEEN) & (stiff < 0.25 * rates * rates)]

    def _gained(self, start: State, light: np.ndarray, X: np.ndarray, span: float, before: np.ndarray) -> np.ndarray:
        """The speeds of modes after a step of the implicit Euler rule in which they do not move."""
        here, gained = np.eye(before.size) / span, before
        for _ in range(_ITERATIONS):
            state = self._moved(start, light, None, X @ gained)
            gap = X.T @ self._force(state)[light] - (gained - before) / span
            change = np.linalg.solve(X.T @ self._on(state, light, _RATE) @ X + here, gap)
            gained = gained + change
            if np.abs(change).max() <= _EXACT * np.abs(gained).max():
                return gained
        raise np.linalg.LinAlgError

    def _lost(self, start: State, light: np.ndarray, X: np.ndarray, gained: np.ndarray, last: np.ndarray) -> np.ndarray:
        """The way that each mode loses until it has gained its speed."""
        lost = np.zeros(gained.size)
        for point, weight in zip(1.0 - _LEFT, _WEIGHTS, strict=True):
            force = X.T @ self._force(self._moved(start, light, None, X @ (point * gained)))[light]
            driven = force * gained > 0.0
            lost[driven] += weight * ((last - point * gained) * gained)[driven] / force[driven]
        return lost

    def _moved(self, state: State, light: np.ndarray, way: np.ndarray | None, gained: np.ndarray) -> State:
        """Return the state moved on a way and faster by some speeds; what sticks goes on sticking."""
        motion = np.zeros((2, state.v.size))
        motion[0, light], motion[1, light] = 0.0 if way is None else way, gained
        step, faster = (self.feed.model.switches.still(state, part) for part in motion)
        state = state.with_(v=state.v + faster)
        return state if way is None else self.feed.model.advance(state, step, state.v, state.t)

    def _force(self, state: State) -> np.ndarray:
        model = self.feed.model
        return model.balance(state, state.v, np.zeros(model.n)) + model.loads(state, self.supply.u)

    def _own(self, state: State, seeds: _Seeds) -> np.ndarray:
        return self._resisting(state, seeds).diagonal()

    def _on(self, state: State, light: np.ndarray, seeds: _Seeds) -> np.ndarray:
        return self._resisting(state, seeds).tocsr()[light][:, light].toarray()

    def _resisting(self, state: State, seeds: _Seeds) -> Any:
        model, feed = self.feed.model, self.feed
        slope = model.slope(state, state.v, np.zeros(model.n), seeds, self.supply.u)
        return -(slope + feed.slope(state, self.supply, 0.0, seeds) if feed.continuous else slope)
