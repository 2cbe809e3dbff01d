"""Freedoms that move no mass set out with the rates and accelerations that their forces leave them.

Where the inputs have jumped, a freedom with neither mass nor damping follows what it hangs on from one moment to the
next, and one with damping alone moves as fast as its forces push it. Both are told by the balance of their own rows,

    F(q, v, a) = 0,    K v + C a = 0,

the latter its derivative in time: damped freedoms take their rates from the first and their accelerations from the
second, the others their rates from the second. Left with the rates they had, they would swing about their motion by
all that the step's own formulas do not damp, or lose an order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.settling import dragged, quasistatic
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

__all__ = ["Massless", "massless"]

_ITERATIONS = 25
_EXACT = 1e-13


def massless(model: Model) -> Massless:
    """Return the freedoms of a model that move no mass."""
    return Massless(model, quasistatic(model), dragged(model))


@dataclass(frozen=True, eq=False)
class Massless:
    """The freedoms of a model that move no mass.

    Attributes
    ----------
    model : Model
    loose : numpy.ndarray of int
        Those with stiffness alone.
    damped : numpy.ndarray of int
        Those with damping.
    """

    model: Model
    loose: np.ndarray
    damped: np.ndarray

    @cached_property
    def all(self) -> np.ndarray:
        """Both kinds."""
        return np.concatenate([self.loose, self.damped])

    @cached_property
    def none(self) -> Massless:
        """None of them."""
        return Massless(self.model, self.loose[:0], self.damped[:0])

    def seen(self, state: State, u: np.ndarray, step: float, sight: float) -> bool:
        """Tell whether a step sees how the damped ones come to their balance: it is so many time constants at most."""
        if not self.damped.size or sight == np.inf:
            return True
        zero = np.zeros(self.model.n)
        K, C = (self.model.slope(state, state.v, zero, seed, u).diagonal() for seed in ((1.0, 0, 0), (0, 1.0, 0)))
        return bool((np.abs(K) * step <= sight * np.abs(C))[self.damped].all())

    def pushed(self, state: State, u: np.ndarray) -> State:
        """Return a state whose damped freedoms move as fast as their forces push them."""
        light, zero = self.damped, np.zeros(self.model.n)
        if not light.size:
            return state
        for _ in range(_ITERATIONS):
            force = (self.model.balance(state, state.v, zero) + self.model.loads(state, u))[light]
            slope = self.model.slope(state, state.v, zero, (0.0, 1.0, 0.0), u).tocsr()
            try:
                change = factorise(slope[light][:, light])(-force)
            except SingularMatrixError:
                return state
            v = state.v.copy()
            v[light] += change
            if not np.isfinite(v).all():
                return state
            state = state.with_(v=v)
            if np.abs(change).max() <= _EXACT * np.abs(v[light]).max():
                break
        return state

    def moving(self, state: State, rate: np.ndarray, u: np.ndarray) -> tuple[State, np.ndarray]:
        """Return a state with the rates of freedoms with stiffness alone, and with the accelerations of damped ones.

        Where nothing holds them (a slack rope, a shaft within its play) they keep the rates they had.

        Parameters
        ----------
        state : State
        rate : numpy.ndarray, shape (n,)
            Accelerations of all others.
        u : numpy.ndarray, shape (inputs,)
        """
        v, rate = state.v.copy(), rate.copy()
        v[self.loose], rate[self.all] = 0.0, 0.0
        try:
            found = self._balanced(state, v, rate, u)
        except SingularMatrixError:
            return state, rate
        v[self.loose], rate[self.damped] = found[: self.loose.size], found[self.loose.size :]
        return state.with_(v=v), rate

    def hurried(self, state: State, rate: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the rates of freedoms with stiffness alone that come of inner freedoms of first order."""
        inner, none = np.zeros_like(rate), np.zeros_like(rate)
        inner[self.model.motion.flows] = rate[self.model.motion.flows]
        try:
            return self._balanced(state, none, inner, u)[: self.loose.size]
        except SingularMatrixError:
            return none[: self.loose.size]

    def _balanced(self, state: State, v: np.ndarray, rate: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rates of the loose and accelerations of the damped that balance those of all others."""
        K = self.model.slope(state, state.v, rate, (1.0, 0.0, 0.0), u).tocsr()
        C = self.model.slope(state, state.v, rate, (0.0, 1.0, 0.0), u).tocsr()
        matrix = sp.hstack([K[self.all][:, self.loose], C[self.all][:, self.damped]]).tocsr()
        found = np.asarray(factorise(matrix)(-(K @ v + C @ rate)[self.all]))
        if not np.isfinite(found).all():
            raise SingularMatrixError(int(self.all[np.argmin(np.isfinite(found))]))
        return found
