"""Freedoms that move no mass set out with the rates and accelerations that their forces leave them.

Where the inputs have jumped, a freedom with neither mass nor damping follows what it hangs on from one moment to the
next, and one with damping alone moves as fast as its forces push it. Both are told by the balance of their own rows,

    F(q, v, a) = 0,    K v + C a = 0,

the latter its derivative in time, commands of continuous controllers included: damped freedoms take their rates from
the first and their accelerations from the second, the others their rates from the second. Left with the rates they had,
they would swing about their motion by all that the step's own formulas do not damp, or lose an order.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.swift.settling import dragged, quasistatic
from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

__all__ = ["Massless", "massless"]

_ITERATIONS = 25
_EXACT = 1e-13
_SHORT = 1e-6


def massless(feed: Feed, steady: np.ndarray | None = None) -> Massless:
    """Return the freedoms of a model that move no mass, under what feeds it; ``steady`` are those that this damps."""
    if steady is None or not steady.size:
        return Massless(feed, quasistatic(feed.model), dragged(feed.model))
    return Massless(feed, np.setdiff1d(quasistatic(feed.model), steady), np.union1d(dragged(feed.model), steady))


@frozen(eq=False)
class Massless:
    """The freedoms of a model that move no mass.

    Attributes
    ----------
    feed : Feed
        The commands of a continuous controller change with the motion.
    loose : numpy.ndarray of int
        Those with stiffness alone.
    damped : numpy.ndarray of int
        Those with damping.
    """

    feed: Feed
    loose: np.ndarray
    damped: np.ndarray

    @property
    def model(self) -> Plant:
        """The model."""
        return self.feed.model

    @cached_property
    def all(self) -> np.ndarray:
        """Both kinds."""
        return np.concatenate([self.loose, self.damped])

    @cached_property
    def none(self) -> Massless:
        """None of them."""
        return Massless(self.feed, self.loose[:0], self.damped[:0])

    def seen(self, state: State, supply: Supply, step: float, sight: float) -> bool:
        """Tell whether a step sees how they come to their balance.

        It is so many time constants of the damped ones at most, and no controller damps the others.
        """
        if self.feed.continuous and self.loose.size:
            fed = self.feed.slope(state, supply, 0.0, (0.0, 1.0, 0.0)).tocsr()[self.loose][:, self.loose]
            if fed.count_nonzero():
                return False
        if not self.damped.size or sight == np.inf:
            return True
        K, C = (self._slope(state, supply, None, seed).diagonal() for seed in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        return bool((np.abs(K) * step <= sight * np.abs(C))[self.damped].all())

    def _slope(
        self, state: State, supply: Supply, rate: np.ndarray | None, seeds: tuple[float, float, float]
    ) -> sp.csr_matrix:
        """The slope of the forces, through a continuous controller too."""
        rate = np.zeros(self.model.n) if rate is None else rate
        slope = self.model.slope(state, state.v, rate, seeds, supply.u)
        return (slope + self.feed.slope(state, supply, 0.0, seeds) if self.feed.continuous else slope).tocsr()

    def pushed(self, state: State, supply: Supply) -> tuple[State, Supply]:
        """Return a state whose damped freedoms move as fast as their forces push them, and the inputs there."""
        light, zero = self.damped, np.zeros(self.model.n)
        if not light.size:
            return state, supply
        for _ in range(_ITERATIONS):
            force = (self.model.balance(state, state.v, zero) + self.model.loads(state, supply.u))[light]
            slope = self._slope(state, supply, zero, (0.0, 1.0, 0.0))
            try:
                change = factorise(slope[light][:, light])(-force)
            except SingularMatrixError:
                break
            v = state.v.copy()
            v[light] += change
            if not np.isfinite(v).all():
                break
            state = state.with_(v=v)
            supply = self.feed.restart(state, supply)
            if np.abs(change).max() <= _EXACT * np.abs(v[light]).max():
                break
        return state, supply

    def moving(self, state: State, rate: np.ndarray, supply: Supply, step: float) -> tuple[State, np.ndarray]:
        """Return a state with the rates of freedoms with stiffness alone, and with the accelerations of damped ones.

        Where nothing holds them (a slack rope, a shaft within its play) they keep the rates they had.

        Parameters
        ----------
        state : State
        rate : numpy.ndarray, shape (n,)
            Accelerations of all others.
        supply : Supply
        step : float
            About to be taken [s].
        """
        v, rate = state.v.copy(), rate.copy()
        v[self.loose], rate[self.all] = 0.0, 0.0
        try:
            found = self._balanced(state, v, rate, supply, self._drawn(state, supply, _SHORT * step))
        except SingularMatrixError:
            return state, rate
        v[self.loose], rate[self.damped] = found[: self.loose.size], found[self.loose.size :]
        return state.with_(v=v), rate

    def _drawn(self, state: State, supply: Supply, span: float) -> np.ndarray:
        """How fast a controller's commands change the forces by its clock and its state alone."""
        if not self.feed.continuous:
            return np.zeros(self.model.n)
        later = self.feed.evaluate(state.with_(t=state.t + span), supply.x + span * supply.rate)
        return (self.model.loads(state, later.u) - self.model.loads(state, supply.u)) / span

    def hurried(self, state: State, rate: np.ndarray, supply: Supply) -> np.ndarray:
        """Return the rates of freedoms with stiffness alone that come of inner freedoms of first order."""
        inner, none = np.zeros_like(rate), np.zeros_like(rate)
        inner[self.model.motion.flows] = rate[self.model.motion.flows]
        try:
            return self._balanced(state, none, inner, supply, none)[: self.loose.size]
        except SingularMatrixError:
            return none[: self.loose.size]

    def _balanced(self, state: State, v: np.ndarray, rate: np.ndarray, supply: Supply, drawn: np.ndarray) -> np.ndarray:
        """Rates of the loose and accelerations of the damped that balance those of all others."""
        K = self._slope(state, supply, rate, (1.0, 0.0, 0.0))
        C = self._slope(state, supply, rate, (0.0, 1.0, 0.0))
        matrix = sp.hstack([K[self.all][:, self.loose], C[self.all][:, self.damped]]).tocsr()
        found = np.asarray(factorise(matrix)(-(K @ v + C @ rate + drawn)[self.all]))
        if not np.isfinite(found).all():
            raise SingularMatrixError(int(self.all[np.argmin(np.isfinite(found))]))
        return found
