"""How a model's equations of motion read: where parts move as far as they like, and where they move little."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import exponential
from flexctrl.model.mixed import Excess
from flexctrl.model.motion import DENSE_UP_TO
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Equations", "LargeMotion", "Small", "SmallMotion"]

Seeds = tuple[float, float, float]


class Equations(Protocol):
    """Forces and motion of a model; `Model` says what each method gives."""

    def place(self, state: State) -> State:
        """Return where levers and directions of forces are taken."""
        ...

    def loads(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return the generalised forces of the inputs, shape (n,)."""
        ...

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the sum of all other forces, shape (n,)."""
        ...

    def slope(
        self, state: State, v: np.ndarray, a: np.ndarray, seeds: Seeds, u: np.ndarray, excess: Excess | None
    ) -> sp.csr_matrix:
        """Return the slope of all forces, shape (n, n)."""
        ...

    def strain(self, state: State, u: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of some motions, shape (k, k)."""
        ...

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state after a step."""
        ...

    def energy(self, state: State) -> tuple[float, float, float]:
        """Return kinetic energy [J], stored energy [J] and dissipated power [W]."""
        ...


@frozen(eq=False)
class LargeMotion:
    """Equations about the place where the machine is: Tᵀ (f(x, v, a) + loads) − viscous v = 0.

    Attributes
    ----------
    model : Model
    """

    model: Model

    def place(self, state: State) -> State:
        """Return where levers and directions of forces are taken: where the machine is."""
        return state

    def loads(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return the generalised forces of the inputs; what sticks does not move."""
        force = self.model.motion.collect(state, self.model.pushes(state, u))
        switches = self.model.switches
        return switches.freed(state, force) if switches.sticks(state) else force

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the sum of all other forces."""
        viscous, switches = self.model.viscous, self.model.switches
        force = self.model.forces.balance(state, v, a)
        force = force - viscous @ v if viscous.nnz else force
        return switches.held(state, v, a, force) if switches.sticks(state) else force

    def slope(
        self, state: State, v: np.ndarray, a: np.ndarray, seeds: Seeds, u: np.ndarray, excess: Excess | None
    ) -> sp.csr_matrix:
        """Return the slope of all forces."""
        model, switches = self.model, self.model.switches
        gusts = (model.gusts, u) if model.gusts else None
        slope = model.forces.slope(state, v, a, seeds, model.pushes(state, u), excess, gusts)
        if seeds[0] and model.signals.follows:
            T = model.motion.jacobian(state)
            slope = (slope + seeds[0] * (T.T @ model.signals.turning(state, u) @ T)).tocsr()
        slope = slope - seeds[1] * model.viscous if model.viscous.nnz else slope
        return switches.held_slope(state, slope, seeds) if switches.sticks(state) else slope

    def strain(self, state: State, u: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of some motions, without the rounding of K's entries."""
        model, motion, signals = self.model, self.model.motion, self.model.signals
        raw, loads = motion.jacobian(state) @ motions, model.pushes(state, u)
        total = model.forces.strain(state, raw)
        if not motion.plain:
            still = np.zeros(model.n)
            total = total - motions.T @ (
                motion.stiffening(state, model.forces.raw(state, still, still) + loads) @ motions
            )
        if model.gusts:
            total = total - raw.T @ (model.gusts.matrix(model.slots(state), u, (1.0, 0.0, 0.0), motion.raw) @ raw)
        return total - raw.T @ (signals.turning(state, u) @ raw) if signals.follows else total

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state after a step."""
        return self.model.motion.advance(state, step, v, t)

    def energy(self, state: State) -> tuple[float, float, float]:
        """Return kinetic energy, stored energy and dissipated power."""
        kinetic, stored, power = self.model.forces.energy(state, state.v)
        return kinetic, stored, power + float(state.v @ (self.model.viscous @ state.v))


@frozen(eq=False)
class Small:
    """Constant matrices of a model that moves little: load − K (q − q₀) − C v − M a, q₀ being those at rest.

    ``inputs`` are those of the place it is laid about; the load is minus theirs, and what held it there.
    """

    load: np.ndarray
    K: sp.csc_matrix
    C: sp.csr_matrix
    M: sp.csc_matrix
    inputs: np.ndarray


@frozen(eq=False)
class SmallMotion:
    """Linear equations about the drawn shape or another place q₀: load + loads − K (q − q₀) − C v − M a = 0.

    Attributes
    ----------
    model : Model
    """

    model: Model

    @cached_property
    def matrices(self) -> Small:
        """The matrices; those of the elements and the damping at rest unless the model brings its own."""
        model = self.model
        if model.about:
            return model.about
        still = np.zeros(model.n)
        load = model.forces.balance(model.rest, still, still)
        damping = -model.forces.slope(model.rest, still, still, (0.0, 1.0, 0.0)).tocsr()
        return Small(load, model.stiffness(), damping + model.viscous, model.mass(), np.zeros(len(model.inputs)))

    def place(self, state: State) -> State:
        """Return where levers and directions of forces are taken: at rest."""
        return self.model.rest

    def loads(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return the generalised forces of the inputs."""
        return self.model.motion.collect(self.model.rest, self._reach @ u + self.model.carried)

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the sum of all other forces."""
        m = self.matrices
        return m.load - m.K @ (state.q - self.model.rest.q) - m.C @ v - m.M @ a

    def slope(
        self, state: State, v: np.ndarray, a: np.ndarray, seeds: Seeds, u: np.ndarray, excess: Excess | None
    ) -> sp.csr_matrix:
        """Return the slope of all forces."""
        m = self.matrices
        return -(seeds[0] * m.K + seeds[1] * m.C + seeds[2] * m.M).tocsr()

    def strain(self, state: State, u: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of some motions."""
        return motions.T @ (self.matrices.K @ motions)

    @cached_property
    def _reach(self) -> sp.csr_matrix:
        """Raw forces of unit inputs."""
        return self.model.reach(self.model.rest, self.matrices.inputs)

    @cached_property
    def _plain(self) -> tuple[np.ndarray | sp.spmatrix, ...]:
        """K, C and M, as arrays while these are quicker."""
        m = self.matrices
        return tuple(A.toarray() if self.model.n <= DENSE_UP_TO else A for A in (m.K, m.C, m.M))

    @cached_property
    def _levers(self) -> np.ndarray | sp.csr_matrix:
        """Motion of the nodes per unit of each degree of freedom."""
        motion = self.model.motion
        levers = motion.jacobian(self.model.rest)[: motion.source_base]
        return levers.toarray() if self.model.n <= DENSE_UP_TO else levers

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state after a step."""
        motion, rest = self.model.motion, self.model.rest
        q = state.q + step
        small = q - rest.q
        raw = (self._levers @ small).reshape(-1, 6)
        x, R = rest.x + raw[:, :3], exponential(raw[:, 3:]) @ rest.R
        driven = motion.unwound(x, R, motion.wound(state, step, rest))
        return State(x, R, q, v, driven, t, state.dry)

    def energy(self, state: State) -> tuple[float, float, float]:
        """Return kinetic energy, stored energy and dissipated power."""
        (K, C, M), q, v = self._plain, state.q - self.model.rest.q, state.v
        stored = 0.5 * float(q @ (K @ q)) - float(self.matrices.load @ q)
        return 0.5 * float(v @ (M @ v)), stored, float(v @ (C @ v))
