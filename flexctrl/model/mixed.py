"""Stresses that Newton's method predicts for itself: what its next tangent rests on.

A displacement step that is right to first order stretches stiff parts by its second-order error, and the
stress of that error, times EA, would rule the next tangent. So the tangent's geometric part is made with the
stress that the strains call forth to first order in the step, s* = s + ∂s/∂q·δ: the mixed-integration-point
Newton method (Magisano, Leonetti & Garcea 2017). The equations and their solution stay the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.mechanics import beam, pieces
from flexctrl.mechanics.kernel import Kernel, Run
from flexctrl.model import kinds
from flexctrl.model.kinds import Kind
from flexctrl.model.motion import State

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.model.families import Family
    from flexctrl.model.forces import Forces

Elastic = Callable[..., tuple["ca.SX", Callable[["ca.SX"], "ca.SX"]]]
"""(effects, node motions, parameters) → stresses, and the raw force of given stresses."""


def _beam(effects: tuple[Effect, ...], nodes: list, parameters: ca.SX) -> tuple:
    import casadi as ca

    m = beam.beam_motion(nodes[0], nodes[1], parameters)
    stress = sum((e.beam_stress(m) for e in effects), ca.SX(6, 1))
    return stress, lambda s: beam.nodal_force(m, beam.stress_force(m, s))


def _spring(effects: tuple[Effect, ...], nodes: list, parameters: ca.SX) -> tuple:
    m = pieces.line_motion(nodes[0], nodes[1], parameters)
    return kinds.spring_pull(effects, m), lambda s: pieces.line_force(m, s)


def _rope(effects: tuple[Effect, ...], nodes: list, parameters: ca.SX) -> tuple:
    m = pieces.line_motion(nodes[0], nodes[1], parameters)
    return kinds.rope_pull(effects, m), lambda s: pieces.line_force(m, s)


_ELASTIC: dict[Kind, tuple[int, Elastic]] = {
    kinds.BEAM: (6, _beam),
    kinds.SHEARING_BEAM: (6, _beam),
    kinds.SPRING: (1, _spring),
    kinds.ROPE: (1, _rope),
}
"""Kinds that strain, with the number of their stresses."""


@cache
def _stress_kernel(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """Stresses, then what they become to first order under the increment in the velocity slots."""
    import casadi as ca

    symbols, parameters = kinds.symbols_of(kind)
    increment = ca.SX.sym("increment", kind.width)
    stress, _ = _ELASTIC[kind][1](effects, _nodes(kind, symbols, increment), parameters)
    step = ca.vertcat(*[_rates(symbols, i)[: kind.freedoms] for i in range(kind.nodes)])
    zero = ca.SX.zeros(kind.width)
    change = ca.substitute(ca.jtimes(stress, increment, step), increment, zero)
    outputs = ca.vertcat(ca.substitute(stress, increment, zero), change)
    return Kernel(f"{kind.name}_stress", symbols, parameters, ca.cse(ca.densify(outputs)))


@cache
def _geometric_kernel(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """The slope of the force of given stresses, column by column, then that force."""
    import casadi as ca

    count, elastic = _ELASTIC[kind]
    symbols, parameters = kinds.symbols_of(kind)
    increment, stress = ca.SX.sym("increment", kind.width), ca.SX.sym("stress", count)
    _, push = elastic(effects, _nodes(kind, symbols, increment), parameters)
    force = ca.cse(push(stress))
    both = ca.vertcat(ca.vec(ca.densify(ca.jacobian(force, increment))), force)
    both = ca.substitute(both, increment, ca.SX.zeros(kind.width))
    return Kernel(f"{kind.name}_geometric", ca.vertcat(symbols, stress), parameters, ca.cse(ca.densify(both)))


def _rates(symbols: ca.SX, node: int) -> ca.SX:
    return symbols[kinds.NODE_SLOT * node + 12 : kinds.NODE_SLOT * node + 18]


def _nodes(kind: Kind, symbols: ca.SX, increment: ca.SX) -> list:
    """The nodes displaced, without rates: the velocity slots hold a step here."""
    import casadi as ca

    rates = ca.vertcat(*[_rates(symbols, i) for i in range(kind.nodes)])
    still = ca.substitute(symbols, rates, ca.SX.zeros(rates.numel()))
    return kinds.moved(kind, still, increment, ca.SX([1.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class Excess:
    """Stresses borne beside those of a state, and what they do there.

    Attributes
    ----------
    stress : numpy.ndarray
    blocks : numpy.ndarray
        What they add to the tangent blocks, in the order of `Forces`.
    raw : numpy.ndarray, shape (raw,)
        Their raw forces.
    """

    stress: np.ndarray
    blocks: np.ndarray
    raw: np.ndarray


@dataclass(frozen=True)
class Mixed:
    """The stresses of all pieces of a model that strain.

    Attributes
    ----------
    forces : Forces
    """

    forces: Forces

    @cached_property
    def count(self) -> int:
        """Number of stresses."""
        return int(sum(places.size for places in self._places))

    def stress(self, state: State, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the stresses of a state, and after a step of its freedoms to first order; no rope pushes."""
        z = self.forces.slots(state, step, np.zeros_like(step))
        out = np.zeros(2 * self.count)
        for run in self._stress_runs:
            run(z, out)
        here, after = out[: self.count], out[: self.count] + out[self.count :]
        return here, np.where(self._ropes, np.maximum(after, 0.0), after)

    def excess(self, state: State, stress: np.ndarray) -> Excess:
        """Return what given stresses do beside those of a state."""
        still = np.zeros(self.forces.motion.n)
        z = np.append(self.forces.slots(state, still, still), stress)
        size = self.forces.entries
        out = np.zeros(size + self.forces.motion.raw)
        for run in self._geometric_runs:
            run(z, out)
        return Excess(stress, out[:size], out[size:])

    @cached_property
    def _families(self) -> tuple[Family, ...]:
        return tuple(f for f in self.forces.families if f.kernels.kind in _ELASTIC)

    @cached_property
    def _ropes(self) -> np.ndarray:
        ropes = [
            np.full(places.size, f.kernels.kind is kinds.ROPE)
            for f, places in zip(self._families, self._places, strict=True)
        ]
        return np.concatenate([np.zeros(0, dtype=bool), *ropes])

    @cached_property
    def _places(self) -> list[np.ndarray]:
        """Where the stresses of each family stand."""
        found, start = [], 0
        for f in self._families:
            size = _ELASTIC[f.kernels.kind][0]
            found.append(start + np.arange(f.count * size).reshape(f.count, size))
            start += f.count * size
        return found

    @cached_property
    def _stress_runs(self) -> tuple[Run, ...]:
        base, bind = self.forces.drive_base, self.forces.backend.bind
        runs = []
        for f, places in zip(self._families, self._places, strict=True):
            kernel = _stress_kernel(f.kernels.kind, f.kernels.effects)
            runs.append(bind(kernel, f.gather(base), f.parameters, np.hstack([places, self.count + places])))
        return tuple(runs)

    @cached_property
    def _geometric_runs(self) -> tuple[Run, ...]:
        forces = self.forces
        starts = {id(f): start for f, start in zip(forces.families, forces.block_starts, strict=True)}
        runs = []
        for f, places in zip(self._families, self._places, strict=True):
            size = f.kernels.kind.width**2
            cells = starts[id(f)] + np.arange(f.count * size).reshape(f.count, size)
            scatter = np.hstack([cells, forces.entries + f.scatter(forces.motion.source_base)])
            gather = np.hstack([f.gather(forces.drive_base), forces.slot_count + places])
            kernel = _geometric_kernel(f.kernels.kind, f.kernels.effects)
            runs.append(forces.backend.bind(kernel, gather, f.parameters, scatter))
        return tuple(runs)
