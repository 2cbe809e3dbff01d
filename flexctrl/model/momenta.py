"""Momenta of a model and how they change: the equations of motion in the form ṗ = F(place, rates).

With the inertia of a piece written as −(M a + c), c of second order in the rates, its momentum is p = M v and
d/dt (M v) = force − c + Ṁ v: nothing but v and the place is needed, and where nothing pushes, momenta are constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import BeamFlexibility
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.mechanics.corotation import PARAMETERS, NodeMotion, reach
from flexctrl.mechanics.pieces import named
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT, Kernels, Kind, moved, symbols_of
from flexctrl.model.laws.part_kinds import BEAM, HEAVY_ROPE, ROPE, SPRING
from flexctrl.model.mixed import Excess
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["LinearMomenta", "Momenta", "inertia", "momenta_of"]

_FAR = 1e60
"""Accelerations beside which nothing else is felt: a spring of 1e12 Nm/rad on 1e-12 kg m² makes 1e24 rad/s²."""

_LINES = (SPRING, ROPE, HEAVY_ROPE)


@frozen(eq=False)
class Momenta:
    """Momenta of the degrees of freedom of a model that may move far, and the forces that change them.

    Attributes
    ----------
    model : Model
    """

    model: Model

    def at(self, state: State, u: np.ndarray, span: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the momenta of a state, conjugate to its rates, and their rates of change under some inputs.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)
        span : float
            Duration of the step whose middle the state is, its rates being their mean [s]: what lines between nodes do
            is that of the whole step (see `flexctrl.mechanics.beam.reach`); 0 for an instant.

        Returns
        -------
        momenta, change : numpy.ndarray, shape (n,)
        """
        model, v = self.model, state.v
        motion, both = model.motion, self._raw(state, v, span)
        momenta, change = both[: motion.raw], both[motion.raw :]
        pushed = motion.collect(state, change + model.pushes(state, u))
        if model.viscous.nnz:
            pushed = pushed - model.viscous @ v
        if not motion.plain:
            pushed = pushed + motion.stiffening(state, momenta) @ v
        return motion.collect(state, momenta), pushed

    def of(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the momenta of some rates in the place of a state, shape (n,)."""
        motion = self.model.motion
        return motion.collect(state, self._raw(state, v)[: motion.raw])

    def _raw(self, state: State, v: np.ndarray, span: float = 0.0) -> np.ndarray:
        forces = self.model.forces
        z, both = np.append(forces.slots(state, v, np.zeros(self.model.n)), span), np.zeros(2 * self.model.motion.raw)
        for batch in self._batches:
            batch(z, both)
        return both

    def excess(self, middle: State, span: float) -> Excess | None:
        """Return what lines that turn over a step bear beside their stresses in its middle; None without lines.

        Parameters
        ----------
        middle : State
            With the mean rates of the step.
        span : float
            Its duration [s].
        """
        if not self._lines:
            return None
        forces, raw = self.model.forces, self.model.motion.raw
        z = np.append(forces.slots(middle, middle.v, np.zeros(self.model.n)), span)
        blocks, borne = np.zeros(forces.entries), np.zeros(raw)
        for run in self._lines:
            run(z, blocks)
        if not self.model.motion.plain:
            borne = (self._raw(middle, middle.v, span) - self._raw(middle, middle.v))[raw:]
        return Excess(np.zeros(0), blocks, borne)

    @cached_property
    def _lines(self) -> tuple[Run, ...]:
        forces, found = self.model.forces, []
        for f, start in zip(forces.families, forces.block_starts, strict=True):
            if _stretches(f.kernels):
                size = f.kernels.kind.width**2
                scatter = start + np.arange(f.count * size).reshape(f.count, size)
                kernel = _turning_of(f.kernels.kind, f.kernels.effects)
                found.append(forces.backend.bind(kernel, self._gather(f), f.parameters, scatter))
        return tuple(found)

    def _gather(self, f: Family) -> np.ndarray:
        """What a piece reads, and the duration of the step."""
        forces = self.model.forces
        return np.hstack([f.gather(forces.drive_base), np.full((f.count, 1), forces.slot_count)])

    @cached_property
    def _batches(self) -> tuple[Run, ...]:
        forces = self.model.forces
        raw = self.model.motion.raw
        found = []
        for f in forces.families:
            cells = f.scatter(self.model.motion.source_base)
            scatter = np.hstack([cells, raw + cells])
            kernel = _kernel_of(f.kernels.kind, f.kernels.effects)
            found.append(forces.backend.bind(kernel, self._gather(f), f.parameters, scatter))
        return tuple(found)


@frozen(eq=False)
class LinearMomenta:
    """Momenta where masses are constant: M v; `Momenta` says what each method gives.

    Attributes
    ----------
    model : Plant
    """

    model: Plant

    def at(self, state: State, u: np.ndarray, span: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the momenta of a state and their rates of change."""
        model, v = self.model, state.v
        return self.of(state, v), model.balance(state, v, np.zeros(model.n)) + model.loads(state, u)

    def of(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the momenta of some rates."""
        return inertia(self.model, state, v)

    def excess(self, middle: State, span: float) -> Excess | None:
        """Return None: lines keep their directions."""
        return None


def inertia(model: Plant, state: State, a: np.ndarray) -> np.ndarray:
    """Return M a, without the rounding of forces beside which it is nothing: those of a loaded machine at rest, say.

    The balance is linear in accelerations: it is asked for far larger ones, beside which forces are nothing.

    Parameters
    ----------
    model : Plant
    state : State
    a : numpy.ndarray, shape (n,)

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    size, still = float(np.abs(a).max(initial=0.0)), np.zeros(model.n)
    return model.balance(state, still, a / size * _FAR) * (-size / _FAR) if size else still


def momenta_of(model: Plant) -> Momenta | LinearMomenta:
    """Return the momenta of a model.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    Momenta or LinearMomenta
    """
    return Momenta(model) if isinstance(model, Model) and model.large else LinearMomenta(model)


@cache
def _kernel_of(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """Return the kernel of a piece's momenta and of what changes them."""
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    step = ca.SX.sym("step", kind.width)
    span = ca.SX.sym("span")
    nodes = [replace(m, span=span) for m in moved(kind, symbols, step, ca.SX([1, 0, 0]))]
    moving = ca.kron(step[kind.nodes * kind.freedoms :], ca.SX([1] + [0] * (DRIVE_SLOT - 1)))
    slot = symbols[NODE_SLOT * kind.nodes :] + moving
    still = [replace(m, a=ca.SX(3, 1), b=ca.SX(3, 1)) for m in nodes]
    along = [replace(m, a=m.v, b=m.w) for m in nodes]
    shares = kind.physics(effects, still, _accelerated(slot, 0.0), parameters)
    pushed = kind.physics(effects, along, _accelerated(slot, 1.0), parameters)
    momenta = shares.inertia - pushed.inertia
    rates = ca.vertcat(*[ca.vertcat(m.v, m.w)[: kind.freedoms] for m in nodes], slot[1::DRIVE_SLOT])
    change = shares.force + shares.inertia + ca.jtimes(momenta, step, rates)
    both = ca.substitute(ca.vertcat(momenta, change), step, ca.SX.zeros(kind.width))
    return Kernel(f"{kind.name}_momenta", ca.vertcat(symbols, span), parameters, ca.cse(ca.densify(both)))


@cache
def _turning_of(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """Return the kernel of what the duration of a step adds to the slope of a line's force, column by column."""
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    span, step = ca.SX.sym("span"), ca.SX.sym("step", kind.width)
    nodes = moved(kind, symbols, step, ca.vertcat(0.5, 1.0 / span, 0.0))
    lasting = [replace(m, span=span) for m in nodes]
    forces = [_pull(kind, effects, motion, parameters) for motion in (lasting, nodes)]
    slope = ca.substitute(ca.jacobian(forces[0] - forces[1], step), step, ca.SX.zeros(kind.width))
    return Kernel(f"{kind.name}_turning", ca.vertcat(symbols, span), parameters, ca.cse(ca.vec(ca.densify(slope))))


def _stretches(kernels: Kernels) -> bool:
    """Tell whether pieces resist the distance of their nodes."""
    bending = any(isinstance(e, BeamFlexibility) for e in kernels.effects)
    return kernels.kind in _LINES or (kernels.kind.physics is BEAM.physics and bending)


def _pull(kind: Kind, effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], parameters: ca.SX) -> ca.SX:
    """The force of a line; that of a beam along its chord, without the little that bending adds to it."""
    import casadi as ca

    if kind in _LINES:
        return kind.physics(effects, nodes, ca.SX(0, 1), parameters).force
    p, length = named(PARAMETERS, parameters), reach(*nodes)[1]
    pull = p["EA"] * (length / p["L"] - 1.0) * (nodes[1].x - nodes[0].x) / length
    force = ca.vertcat(pull, ca.SX(3, 1), -pull)
    return ca.vertcat(force, ca.SX(kind.width - force.numel(), 1))


def _accelerated(slot: ca.SX, share: float) -> ca.SX:
    """The slots of drives and inner freedoms with accelerations replaced by a share of their rates."""
    import casadi as ca

    columns = ca.reshape(slot, DRIVE_SLOT, slot.numel() // DRIVE_SLOT)
    return ca.vec(ca.vertcat(columns[0, :], columns[1, :], share * columns[1, :], columns[3, :]))
