"""Steps along a path of equilibria: pseudo-arclength continuation with predicted stresses.

Unknown are the displacements and the load factor λ together. A step of length s goes along the tangent and is
corrected across it, f(q, λ) = 0 and tᵀ W (Δq, Δλ) = s (Keller 1977), so that points at which the load turns
back are points as any other.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.mixed import Excess
from flexctrl.model.paths.pivots import turned
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

__all__ = ["Course", "Direction", "Station"]

_SETTLED, _CONTRACTION = 1e-10, 0.7


@frozen(eq=False)
class Direction:
    """A direction in displacements of the free coordinates and the load factor."""

    place: np.ndarray
    factor: float

    def __mul__(self, by: float) -> Direction:
        return Direction(by * self.place, by * self.factor)


@frozen(eq=False)
class Station:
    """An equilibrium on a path.

    Attributes
    ----------
    state : State
    factor : float
        λ.
    tangent : Direction
        Of length one.
    turned : int
        What changes where the stiffness becomes singular.
    iterations : int
        Newton's, to get there.
    """

    state: State
    factor: float
    tangent: Direction
    turned: int
    iterations: int


@frozen(eq=False)
class Course:
    """The equations of a path: constant inputs and λ times a load.

    Attributes
    ----------
    balance : Balance
        Under the constant inputs.
    load : numpy.ndarray, shape (inputs,)
    factor_scale : float
        The change of λ that counts like a turn by a radian.
    """

    balance: Balance
    load: np.ndarray
    factor_scale: float

    @cached_property
    def weight(self) -> np.ndarray:
        """What squares of displacements of the free coordinates count: their mean in radians or sizes."""
        unit = self.balance.unit[self.balance.free]
        return 1.0 / (unit**2 * max(len(unit), 1))

    def product(self, a: Direction, b: Direction) -> float:
        """Return the inner product in which lengths are measured."""
        return float(a.place @ (self.weight * b.place) + a.factor * b.factor / self.factor_scale**2)

    def unit(self, a: Direction) -> Direction:
        """Return a direction with length one."""
        return a * (1.0 / np.sqrt(self.product(a, a)))

    def between(self, a: Station, b: Station) -> Direction:
        """Return what leads from one station to another."""
        return Direction((b.state.q - a.state.q)[self.balance.free], b.factor - a.factor)

    def at(self, factor: float) -> Balance:
        """Return the balance at a load factor."""
        return self.balance.under(self.balance.u + factor * self.load)

    def push(self, state: State) -> np.ndarray:
        """Return ∂f/∂λ on the free coordinates."""
        return self.balance.among(state, self.balance.model.loads(state, self.load))

    def stiffness(self, state: State, factor: float, excess: Excess | None = None) -> sp.csr_matrix:
        """Return K of the free coordinates."""
        balance = self.at(factor)
        return balance.among_free(balance.slope(state, excess))

    def solve(self, K: sp.csr_matrix, state: State, along: Direction, force: np.ndarray, way: float) -> Direction:
        """Return the displacement and change of λ that balance a force, ``way`` far along a direction.

        K is bordered by the load and the direction, so that limit points are regular; every row and column is
        scaled to the stiffness.
        """
        stiff = float(np.abs(K.data).max()) if K.nnz else 1.0
        row = self.weight * along.place
        ahead, scale = along.factor / self.factor_scale, stiff / max(float(np.abs(row).max(initial=0.0)), 1e-300)
        scale = min(scale, stiff / max(abs(ahead), 1e-300))
        column = sp.csr_matrix(-self.factor_scale * self.push(state)[:, None])
        matrix = sp.bmat([[K, column], [sp.csr_matrix(scale * row[None]), sp.csr_matrix([[scale * ahead]])]], "csr")
        found = factorise(matrix)(np.append(force, scale * way))
        return Direction(found[:-1], float(self.factor_scale * found[-1]))

    def tangent(self, state: State, factor: float, along: Direction) -> Direction:
        """Return the direction of the path at an equilibrium, on the side of another direction."""
        still = np.zeros(len(self.balance.free))
        return self.unit(self.solve(self.stiffness(state, factor), state, along, still, 1.0))

    def moved(self, state: State, step: np.ndarray) -> State:
        """Return the state after a step of the free coordinates, in which those that are held keep their places."""
        balance, full = self.balance, np.zeros(self.balance.model.n)
        full[balance.free] = step
        after = balance.model.advance(state, balance.whole(state, full), balance.still, 0.0)
        return balance.put_back(after)

    def station(self, state: State, factor: float, along: Direction, iterations: int) -> Station:
        """Return an equilibrium with its tangent."""
        K = self.stiffness(state, factor)
        return Station(state, factor, self.tangent(state, factor, along), turned(K), iterations)

    def step(self, start: Station, along: Direction, length: float, most: int = 12) -> Station | None:
        """Return the equilibrium at a distance along a direction; none without convergence, or if parts come apart."""
        state, factor = start.state, start.factor
        delta, excess, before = along * length, None, np.inf
        for iteration in range(1, most + 1):
            state, excess = self._predicted(state, delta)
            factor += delta.factor
            if not np.isfinite(state.x).all():
                return None
            K = self.stiffness(state, factor, excess)
            force = self.at(factor).force(state)
            try:
                delta = self.solve(K, state, along, force, 0.0)
            except SingularMatrixError:
                return None
            size = np.sqrt(self.product(delta, delta))
            if not size <= max(_CONTRACTION * before, 1e-7):
                return None
            if size <= _SETTLED * max(1.0, length) or (iteration > 3 and size < 1e-7 and size > 0.3 * before):
                state, _ = self._predicted(state, delta)
                if self.balance.model.apart(state):
                    return None
                return self.station(state, factor + delta.factor, along, iteration)
            before = size
        return None

    def _predicted(self, state: State, delta: Direction) -> tuple[State, Excess | None]:
        """A whole step, with the stresses it leads to in first order."""
        model, balance = self.balance.model, self.balance
        after = self.moved(state, delta.place)
        mixed = model.forces.mixed
        if not model.large or not mixed.count:
            return after, None
        full = np.zeros(model.n)
        full[balance.free] = delta.place
        _, target = mixed.stress(state, balance.whole(state, full))
        now, _ = mixed.stress(after, balance.still)
        return after, mixed.excess(after, target - now)
