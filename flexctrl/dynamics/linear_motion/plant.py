"""A linear model where a run expects a machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.model.mixed import Excess
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite

__all__ = ["LinearPlant"]


@frozen
class _Machine:
    """What a run asks of a structure."""

    name: str
    size: float = 1.0
    sized: bool = True
    drives: tuple[Any, ...] = ()


@frozen
class _Flat:
    """What a run asks of a motion: coordinates are places."""

    n: int
    inputs: int
    basis: sp.csc_matrix | None = None

    @property
    def raw(self) -> int:
        return self.n

    @property
    def inner(self) -> np.ndarray:
        """There are no inner freedoms."""
        return np.zeros(0, dtype=int)

    @property
    def flows(self) -> np.ndarray:
        """There are no inner freedoms."""
        return self.inner

    @property
    def settling(self) -> np.ndarray:
        """There are no inner freedoms."""
        return self.inner

    @property
    def scales(self) -> dict[str, float]:
        """There are no inner freedoms."""
        return {}

    def counted(self, state: State) -> State:
        """Return the state with room for the inputs in force: one of the machine itself has none.

        Raises
        ------
        StructureError
            For a state of another number of degrees of freedom.
        """
        if state.q.size != self.n:
            raise StructureError(
                f"simulate: start has {state.q.size} degrees of freedom; the linear model has {self.n}: give a state "
                "of the model that it was made from, or leave out what has been condensed or reduced"
            )
        if self.basis is not None and len(state.x) > 1:  # of the machine, whose motors have angles in place of twists
            q, v = spsolve(self.basis, np.column_stack([state.q, state.v])).T
            state = replace(state, q=q, v=v)
        return state if state.driven.size == self.inputs else replace(state, driven=np.zeros(self.inputs))

    def jacobian(self, state: State) -> sp.csr_matrix:
        """Return the identity."""
        return sp.identity(self.n, format="csr")

    def dead_point(self, before: State, after: State) -> bool:
        """There are no loops."""
        return False

    def closure_error(self, state: State) -> float:
        """There are no loops."""
        return 0.0


@frozen(eq=False)
class _Signals:
    """What a run asks of signals: they are linear."""

    places: sp.csr_matrix
    rates: sp.csr_matrix

    def slopes(self, state: State, rates: np.ndarray, raw: int) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Return the output's slopes on coordinates and on rates."""
        return self.places, self.rates


@frozen
class _Smooth:
    """What a run asks of laws that switch: there are none."""

    names: tuple[str, ...] = ()

    def phases(self, state: State) -> np.ndarray:
        """Return nothing."""
        return np.zeros(0)

    def sticks(self, state: State) -> bool:
        """Nothing sticks."""
        return False

    def freed(self, state: State, force: sp.csr_matrix) -> sp.csr_matrix:
        """Return the force: nothing holds against it."""
        return force

    def still(self, state: State, motion: np.ndarray) -> np.ndarray:
        """Return the motion: nothing holds it."""
        return motion

    def at_rest(self, state: State) -> State:
        """Return the state: nothing is held."""
        return state

    def gaps(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return nothing."""
        return np.zeros(0)

    def gap(self, state: State, u: np.ndarray, contact: int) -> float:
        """Return infinity: nothing switches."""
        return np.inf

    def begin(self, state: State, u: np.ndarray) -> State:
        """Return the state."""
        return state

    def under(self, state: State, u: np.ndarray) -> State:
        """Return the state."""
        return state

    def like(self, state: State, other: State) -> State:
        """Return the state."""
        return state

    def after(self, state: State, u: np.ndarray, contact: int) -> State:
        """Return the state."""
        return state

    def withheld(self, state: State, contact: int) -> State:
        """Return the state."""
        return state


@frozen
class _Straight:
    """What a run asks of corners in laws of force: there are none."""

    names: tuple[str, ...] = ()
    ends: tuple[str, ...] = ()

    @property
    def met(self) -> _Straight:
        """Those that steps end at: none either."""
        return self

    @property
    def dust(self) -> np.ndarray:
        """Nothing."""
        return np.zeros(0)

    def values(self, state: State, before: State) -> np.ndarray:
        """Return nothing."""
        return np.zeros(0)

    def sides(self, state: State) -> np.ndarray:
        """Return nothing."""
        return np.zeros(0)


@frozen(eq=False)
class LinearPlant:
    """M q̈ + C q̇ + K q = B u as a machine to be run: a state's ``q`` are the coordinates, it has no nodes.

    ``driven`` of a state holds the inputs in force, for outputs that feel them at once (D).

    Attributes
    ----------
    linear : LinearModel
    """

    linear: LinearModel

    large = False
    notes: tuple[str, ...] = ()
    effects: tuple[Any, ...] = ()
    switches = _Smooth()
    kinks = _Straight()

    @property
    def n(self) -> int:
        return len(self.linear.coordinates)

    @property
    def coordinates(self) -> tuple[str, ...]:
        return self.linear.coordinates

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.linear.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        return self.linear.outputs

    @property
    def dust(self) -> np.ndarray:
        """Masses are taken as they are."""
        return np.zeros(self.n)

    @property
    def structure(self) -> _Machine:
        return _Machine(self.linear.name)

    @cached_property
    def motion(self) -> _Flat:
        place = self.linear.place
        return _Flat(self.n, len(self.inputs), place.basis if place and place.springs is not None else None)

    @cached_property
    def signals(self) -> _Signals:
        linear = self.linear
        return _Signals(sp.csr_matrix(linear.Cq), sp.csr_matrix(linear.Cv))

    @property
    def numbers(self) -> tuple[np.ndarray, ...]:
        """What tells the model from others with the same names."""
        m = self.linear
        return (*(np.asarray(A.toarray()) for A in (m.M, m.C, m.K)), m.B, m.Cq, m.Cv, m.D)

    @cached_property
    def rest(self) -> State:
        still = np.zeros(self.n)
        return State(np.zeros((1, 3)), np.eye(3)[None], still, still, np.zeros(len(self.inputs)))

    def input_vector(self, inputs: Mapping[str, float]) -> np.ndarray:
        """Return input values in order; what is not named is zero."""
        u = np.zeros(len(self.inputs))
        for name, value in inputs.items():
            if name not in self.inputs:
                raise StructureError(f"the linear model has no input {name!r}{did_you_mean(name, self.inputs)}")
            u[self.inputs.index(name)] = check_finite(value, f"input {name!r}", "model")
        return u

    def loads(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return B u."""
        return self.linear.B @ u

    def reach(self, state: State, u: np.ndarray) -> sp.csr_matrix:
        """Return B."""
        return sp.csr_matrix(self.linear.B)

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return −(M a + C v + K q)."""
        linear = self.linear
        return -(linear.M @ a + linear.C @ v + linear.K @ state.q)

    def slope(
        self,
        state: State,
        v: np.ndarray,
        a: np.ndarray,
        seeds: tuple[float, float, float],
        u: np.ndarray,
        excess: Excess | None = None,
    ) -> sp.csr_matrix:
        """Return −(s₀ K + s₁ C + s₂ M)."""
        linear = self.linear
        return -(seeds[0] * linear.K + seeds[1] * linear.C + seeds[2] * linear.M).tocsr()

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state a step further."""
        return State(state.x, state.R, state.q + step, v, state.driven, t)

    def apart(self, state: State) -> str:
        """There are no joints."""
        return ""

    def rates(self, state: State) -> np.ndarray:
        """Return the rates."""
        return state.v

    def measure(self, state: State) -> np.ndarray:
        """Return the outputs."""
        linear = self.linear
        return linear.Cq @ state.q + linear.Cv @ state.v + linear.D @ state.driven

    def energy(self, state: State) -> tuple[float, float, float]:
        """Return kinetic energy, stored energy and dissipated power."""
        q, v, linear = state.q, state.v, self.linear
        return 0.5 * float(v @ (linear.M @ v)), 0.5 * float(q @ (linear.K @ q)), float(v @ (linear.C @ v))
