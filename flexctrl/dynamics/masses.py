"""Accelerations from forces, with a factorised mass matrix that is kept while it is good."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from flexctrl.dynamics.steps import Counts
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model
from flexctrl.model.motion import State
from flexctrl.model.solve import Plan, Solve, factorise, plan

__all__ = ["Masses"]

_EXACT = 1e-13
_MASSLESS = 1e-14
_GOOD = 0.2
_SWEEPS = 12


@dataclass
class Masses:
    """The mass matrix of a model wherever it moves.

    Attributes
    ----------
    model : Model
    counts : Counts
        Factorisations are counted here.
    made_at : State or None
        Where the factors in use were made.
    """

    model: Model
    counts: Counts
    made_at: State | None = None
    _solve: Solve | None = None
    _plan: Plan | None = None
    _still: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self._still = np.zeros(self.model.n)
        if self.made_at is not None:
            self.make(self.made_at)

    def make(self, state: State) -> None:
        """Factorise the mass matrix of a state.

        Raises
        ------
        SingularMatrixError
            If some freedom moves no mass.
        """
        nothing = np.zeros(len(self.model.inputs))
        slope = self.model.slope(state, self._still, self._still, (0.0, 0.0, 1.0), nothing)
        diagonal = -slope.diagonal()
        if diagonal.size and not diagonal.min() > _MASSLESS * diagonal.max():
            raise SingularMatrixError(int(np.argmin(diagonal)))
        if self._plan is None or not self._plan.fits(slope):
            self._plan = plan(slope)
        self._solve = factorise(slope, self._plan)
        self.counts.factorisations += 1
        self.made_at = state

    def accelerations(self, state: State, u: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return the accelerations of a state under its inputs.

        The equations are checked with the factors in use; where those are no longer good they are made anew.
        """
        loads = self.model.loads(state, u)
        return self.solve(lambda a: -self.model.balance(state, state.v, a) - loads, state, guess)

    def solve(self, gap: Callable[[np.ndarray], np.ndarray], state: State, guess: np.ndarray) -> np.ndarray:
        """Return the root of what has the mass matrix of a state as its slope."""
        value, last = guess, np.inf
        if self._solve is None:
            self.make(state)
        for _ in range(_SWEEPS):
            assert self._solve is not None
            change = self._solve(gap(value))
            value = value + change
            size = float(np.abs(change).max(initial=0.0))
            if size <= _EXACT * float(np.abs(value).max(initial=0.0)):
                return value
            if size > _GOOD * last:
                self.make(state)
                size = np.inf
            last = size
        return value
