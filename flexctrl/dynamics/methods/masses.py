"""Accelerations from forces, with a factorised mass matrix that is kept while it is good."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Counts
from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.flat.flattening import Flattened, can_be_flat, flatten
from flexctrl.model.model import Model
from flexctrl.model.momenta import inertia
from flexctrl.model.plant import Plant
from flexctrl.model.solve import Plan, Solve, factorise, plan
from flexctrl.model.state import State

__all__ = ["Masses"]

Vectors = Callable[[np.ndarray], np.ndarray]

_EXACT = 1e-12
_SWEEPS = 12


@frozen(eq=False)
class _Entire:
    """A machine of few freedoms, all accelerations of which one kernel tells."""

    flattened: Flattened

    def accelerations(self, state: State, u: np.ndarray) -> np.ndarray | None:
        """Return the accelerations of a state under its inputs; None where the kernel does not tell them."""
        F, f = self.flattened, self.flattened.flat
        pose = f.pose.reshape(-1, 12)
        pose[:, :3], pose[:, 3:] = state.x, state.R.reshape(-1, 9)
        f.q[: f.n], f.v[: f.n] = state.q[F.plan.order], state.v[F.plan.order]
        f.driven[:], f.u[:] = state.driven, u
        if not F.keeps_shape:
            return None
        f.entire[0](f.z, f.z)
        return F.own(f.answer) if np.isfinite(f.answer).all() else None


@dataclass
class Masses:
    """The mass matrix of a model wherever it moves.

    Attributes
    ----------
    model : Plant
    counts : Counts
        Factorisations are counted here.
    made_at : State or None
        Where the factors in use were made.
    """

    model: Plant
    counts: Counts
    made_at: State | None = None
    _solve: Solve | None = None
    _plan: Plan | None = None
    _still: np.ndarray = field(default_factory=lambda: np.zeros(0))
    _weight: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self._still, self._weight = np.zeros(self.model.n), 1.0 / yardsticks(self.model)
        if self.made_at is not None:
            self.make(self.made_at)

    @cached_property
    def _entire(self) -> _Entire | None:
        """Kernels of the whole machine, if it has such; where contacts stick or slide, they do not tell."""
        model = self.model
        if not isinstance(model, Model) or model.switches.names or not can_be_flat(model):
            return None
        flattened = flatten(model)
        return _Entire(flattened) if flattened.entire.runs and not flattened.entire.pressing else None

    def make(self, state: State) -> None:
        """Factorise the mass matrix of a state.

        Raises
        ------
        SingularMatrixError
            If some freedom moves no mass.
        """
        nothing = np.zeros(len(self.model.inputs))
        slope = self.model.slope(state, self._still, self._still, (0.0, 0.0, 1.0), nothing)
        light = np.flatnonzero(~(-slope.diagonal() > self.model.dust))
        if light.size:
            raise SingularMatrixError(int(light[0]))
        if self._plan is None or not self._plan.fits(slope):
            self._plan = plan(slope)
        self._solve = factorise(slope, self._plan)
        self.counts.factorisations += 1
        self.made_at = state

    def accelerations(self, state: State, u: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return the accelerations of a state under its inputs."""
        if self._entire is not None and (told := self._entire.accelerations(state, u)) is not None:
            return told
        loads = self.model.loads(state, u)
        return self.solve(
            lambda a: -self.model.balance(state, state.v, a) - loads,
            lambda a: inertia(self.model, state, a),
            state,
            guess,
        )

    def solve(self, gap: Vectors, weighed: Vectors, state: State, guess: np.ndarray) -> np.ndarray:
        """Return the root of what is linear with the mass matrix of a state as its slope.

        Conjugate gradients with the factors in use; where these are far from the masses here, new ones are made.

        Parameters
        ----------
        gap : callable
            What is to vanish. Near its root it is round-off, which tells nothing of its slope.
        weighed : callable
            The mass matrix times a motion.
        state : State
        guess : numpy.ndarray, shape (n,)
        """
        if self._solve is None:
            self.make(state)
        with np.errstate(over="ignore", invalid="ignore"):  # far too long a step; who takes it sees what is not finite
            value, done = self._conjugate(gap(guess), weighed, guess, _SWEEPS)
            if done:
                return value
            self.make(state)
            return self._conjugate(gap(value), weighed, value, _SWEEPS)[0]

    def _conjugate(self, left: np.ndarray, weighed: Vectors, guess: np.ndarray, sweeps: int) -> tuple[np.ndarray, bool]:
        assert self._solve is not None
        value, residual, direction, power = guess, -left, np.zeros_like(guess), np.inf
        for _ in range(sweeps):
            change = -self._solve(residual)
            if self._size(change) <= _EXACT * self._size(value + change):
                return value + change, True
            with np.errstate(over="ignore", invalid="ignore"):  # a trial far too long: it is turned down below
                before, power = power, float(residual @ change)
                direction = change + (power / before) * direction
                pushed = weighed(direction)
                curvature = float(direction @ pushed)
            if not np.isfinite(curvature) and np.isfinite(change).all():
                return value + change, False  # too large to be squared
            if not curvature > 0.0:
                break
            share = power / curvature
            value, residual = value + share * direction, residual - share * pushed
        return value, False

    def _size(self, a: np.ndarray) -> float:
        return float(np.abs(a * self._weight).max(initial=0.0))
