"""Momenta of a model and how they change: the equations of motion in the form ṗ = F(place, rates).

With the inertia of a piece written as −(M a + c), c of second order in the rates, its momentum is p = M v and
d/dt (M v) = force − c + Ṁ v: nothing but v and the place is needed, and where nothing pushes, momenta are constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.mechanics.beam import NodeMotion
from flexctrl.model.kinds import DRIVE_SLOT, NODE_SLOT, Kind, moved, symbols_of
from flexctrl.model.model import Model
from flexctrl.model.motion import State

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["Momenta"]


@dataclass(frozen=True, eq=False)
class Momenta:
    """Momenta of the degrees of freedom, and the forces that change them.

    Attributes
    ----------
    model : Model
    """

    model: Model

    def at(self, state: State, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the momenta of a state, conjugate to its rates, and their rates of change under some inputs.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        momenta, change : numpy.ndarray, shape (n,)
        """
        model, v = self.model, state.v
        if not model.large:
            return self.of(state, v), model.balance(state, v, np.zeros(model.n)) + model.loads(state, u)
        motion, both = model.motion, self._raw(state, v)
        momenta, change = both[: motion.raw], both[motion.raw :]
        pushed = motion.collect(state, change + model.signals.loads @ u)
        if model.viscous.nnz:
            pushed = pushed - model.viscous @ v
        if not motion.plain:
            pushed = pushed + motion.stiffening(state, momenta) @ v
        return motion.collect(state, momenta), pushed

    def of(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the momenta of some rates in the place of a state, shape (n,)."""
        model = self.model
        if not model.large:
            return model.balance(state, v, np.zeros(model.n)) - model.balance(state, v, v)
        return model.motion.collect(state, self._raw(state, v)[: model.motion.raw])

    def _raw(self, state: State, v: np.ndarray) -> np.ndarray:
        forces = self.model.forces
        z, both = forces.slots(state, v, np.zeros(self.model.n)), np.zeros(2 * self.model.motion.raw)
        for batch in self._batches:
            batch(z, both)
        return both

    @cached_property
    def _batches(self) -> tuple[Run, ...]:
        forces = self.model.forces
        raw = self.model.motion.raw
        found = []
        for f in forces.families:
            cells = f.scatter(self.model.motion.source_base)
            scatter = np.hstack([cells, raw + cells])
            kernel = _kernel_of(f.kernels.kind, f.kernels.effects)
            found.append(forces.backend.bind(kernel, f.gather(forces.drive_base), f.parameters, scatter))
        return tuple(found)


@cache
def _kernel_of(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """Return the kernel of a piece's momenta and of what changes them."""
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    step = ca.SX.sym("step", kind.width)
    nodes = moved(kind, symbols, step, ca.SX([1, 0, 0]))
    slot = symbols[NODE_SLOT * kind.nodes :]
    still = [NodeMotion(m.x, m.R, m.v, m.w, ca.SX(3, 1), ca.SX(3, 1)) for m in nodes]
    along = [NodeMotion(m.x, m.R, m.v, m.w, m.v, m.w) for m in nodes]
    shares = kind.physics(effects, still, _accelerated(slot, 0.0), parameters)
    pushed = kind.physics(effects, along, _accelerated(slot, 1.0), parameters)
    momenta = shares.inertia - pushed.inertia
    rates = ca.vertcat(*[ca.vertcat(m.v, m.w)[: kind.freedoms] for m in nodes], slot[1::DRIVE_SLOT])
    change = shares.force + shares.inertia + ca.jtimes(momenta, step, rates)
    both = ca.substitute(ca.vertcat(momenta, change), step, ca.SX.zeros(kind.width))
    return Kernel(f"{kind.name}_momenta", symbols, parameters, ca.cse(ca.densify(both)))


def _accelerated(slot: ca.SX, share: float) -> ca.SX:
    """The slots of drives and inner freedoms with accelerations replaced by a share of their rates."""
    import casadi as ca

    columns = ca.reshape(slot, DRIVE_SLOT, slot.numel() // DRIVE_SLOT)
    return ca.vec(ca.vertcat(columns[0, :], columns[1, :], share * columns[1, :], columns[3, :]))
