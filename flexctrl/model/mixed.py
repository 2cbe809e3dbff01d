"""Stresses that Newton's method predicts for itself: what its next tangent rests on.

A displacement step that is right to first order stretches stiff parts by its second-order error, and the
stress of that error, times EA, would rule the next tangent. So the tangent's geometric part is made with the
stress that the strains call forth to first order in the step, s* = s + ∂s/∂q·δ: the mixed-integration-point
Newton method (Magisano, Leonetti & Garcea 2017). The equations and their solution stay the same.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Backend, CasadiVM, Kernel, Run
from flexctrl.mechanics import beam, corotation, pieces, strains, winch
from flexctrl.mechanics.beam_tangent import beam_slope
from flexctrl.model.laws import part_kinds
from flexctrl.model.laws.kinds import NODE_SLOT, Kind, Physics, moved, symbols_of
from flexctrl.model.state import State

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.model.forces import Forces
    from flexctrl.model.laws.families import Family

_FEW = 64
"""Pieces up to which the virtual machine runs a kernel sooner than it could be compiled."""


@frozen
class _Elastic:
    """How a kind of piece strains: how many stresses it has, and its two kernels' outputs.

    ``stress`` gives the stresses, then what the increment in the velocity slots adds to them in first order;
    ``geometric`` the slope of the raw force of given stresses, and that force.
    """

    count: int
    stress: Callable[[Kind, tuple[Effect, ...], ca.SX, ca.SX], ca.SX]
    geometric: Callable[[Kind, tuple[Effect, ...], ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]


def _beam_stress(kind: Kind, effects: tuple[Effect, ...], symbols: ca.SX, parameters: ca.SX) -> ca.SX:
    import casadi as ca

    first, second = moved(kind, symbols, ca.SX(kind.width, 1), ca.SX(3, 1))
    m = corotation.beam_motion(
        first, second, parameters, part_kinds.modes_in(symbols[NODE_SLOT * kind.nodes :], part_kinds.along_of(kind))
    )
    seen, local = strains.seen_deformed(m)
    now = ca.vertcat(m.stretch, *m.theta, *m.modal[:1])
    stress = sum((e.beam_stress(local) for e in effects), ca.SX(6, 1))
    change = ca.jtimes(stress, seen, ca.vertcat(strains.deformation_rates(m), *m.modal[1:2]))
    return ca.substitute(ca.vertcat(stress, change), seen, now)


def _beam_geometric(
    kind: Kind, effects: tuple[Effect, ...], symbols: ca.SX, parameters: ca.SX, stress: ca.SX
) -> tuple[ca.SX, ca.SX]:
    import casadi as ca

    first, second = _still(kind, symbols, ca.SX(kind.width, 1))
    modal = part_kinds.modes_in(symbols[NODE_SLOT * kind.nodes :], part_kinds.along_of(kind))
    if modal:
        modal = modal._replace(rates=0.0 * modal.rates, accelerations=0.0 * modal.accelerations)
    slope = beam_slope(first, second, parameters, ca.SX([1, 0, 0]), lambda m: beam.stress_force(m, stress), modal)
    m = corotation.beam_motion(first, second, parameters, modal)
    return slope, beam.whole_force(m, beam.stress_force(m, stress))


def _line_stress(kind: Kind, effects: tuple[Effect, ...], symbols: ca.SX, parameters: ca.SX) -> ca.SX:
    import casadi as ca

    pull = part_kinds.spring_pull if kind is part_kinds.SPRING else part_kinds.rope_pull
    increment, zero = ca.SX.sym("increment", kind.width), ca.SX.zeros(kind.width)
    stress = pull(effects, _line_motion(kind, symbols, increment, parameters))
    step = ca.vertcat(*[_rates(symbols, i)[: kind.freedoms] for i in range(kind.nodes)], *_slot(kind, symbols)[1:2])
    return ca.substitute(ca.vertcat(stress, ca.jtimes(stress, increment, step)), increment, zero)


def _line_geometric(
    kind: Kind, effects: tuple[Effect, ...], symbols: ca.SX, parameters: ca.SX, stress: ca.SX
) -> tuple[ca.SX, ca.SX]:
    import casadi as ca

    increment, zero = ca.SX.sym("increment", kind.width), ca.SX.zeros(kind.width)
    m = _line_motion(kind, symbols, increment, parameters)
    wound = [stress / winch.named(winch.WINCH_PARAMETERS, parameters)["ratio"]] if kind is part_kinds.WINCH else []
    force = ca.vertcat(pieces.line_force(m, stress), *wound)
    return ca.substitute(ca.jacobian(force, increment), increment, zero), ca.substitute(force, increment, zero)


def _line_motion(kind: Kind, symbols: ca.SX, increment: ca.SX, parameters: ca.SX) -> pieces.LineMotion:
    import casadi as ca

    first, second = _still(kind, symbols, increment)
    if kind is not part_kinds.WINCH:
        return pieces.line_motion(first, second, parameters)
    return winch.paid_out(first, second, ca.vertcat(_slot(kind, symbols)[0] + increment[-1], 0, 0), parameters)


_BEAM, _LINE = _Elastic(6, _beam_stress, _beam_geometric), _Elastic(1, _line_stress, _line_geometric)
_ROPES = (part_kinds.ROPE, part_kinds.HEAVY_ROPE, part_kinds.WINCH)
_ELASTIC = {part_kinds.BEAM.physics: _BEAM, **{kind.physics: _LINE for kind in (part_kinds.SPRING, *_ROPES)}}
"""The physics of pieces that strain."""


def _physics(kind: Kind) -> Physics:
    """The physics of a kind, whatever modes it has along it."""
    return kind.physics.func if isinstance(kind.physics, partial) else kind.physics


@cache
def _stress_kernel(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    outputs = _ELASTIC[_physics(kind)].stress(kind, effects, symbols, parameters)
    return Kernel(f"{kind.name}_stress", symbols, parameters, ca.cse(ca.densify(outputs)))


@cache
def _geometric_kernel(kind: Kind, effects: tuple[Effect, ...]) -> Kernel:
    """The slope column by column, then the force."""
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    stress = ca.SX.sym("stress", _ELASTIC[_physics(kind)].count)
    slope, force = _ELASTIC[_physics(kind)].geometric(kind, effects, symbols, parameters, stress)
    outputs = ca.cse(ca.vertcat(ca.vec(ca.densify(slope)), ca.densify(force)))
    return Kernel(f"{kind.name}_geometric", ca.vertcat(symbols, stress), parameters, outputs)


def _rates(symbols: ca.SX, node: int) -> ca.SX:
    return symbols[NODE_SLOT * node + 12 : NODE_SLOT * node + 18]


def _slot(kind: Kind, symbols: ca.SX) -> list[ca.SX]:
    """What a piece reads beside its nodes."""
    import casadi as ca

    return ca.vertsplit(symbols[NODE_SLOT * kind.nodes :])


def _still(kind: Kind, symbols: ca.SX, increment: ca.SX) -> list:
    """The nodes displaced, without rates: the velocity slots hold a step here."""
    import casadi as ca

    rates = ca.vertcat(*[_rates(symbols, i) for i in range(kind.nodes)])
    still = ca.substitute(symbols, rates, ca.SX.zeros(rates.numel()))
    return moved(kind, still, increment, ca.SX([1.0, 0.0, 0.0]))


@frozen(eq=False)
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


@frozen
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
        return tuple(f for f in self.forces.families if _physics(f.kernels.kind) in _ELASTIC)

    @cached_property
    def _ropes(self) -> np.ndarray:
        ropes = [
            np.full(places.size, f.kernels.kind in _ROPES)
            for f, places in zip(self._families, self._places, strict=True)
        ]
        return np.concatenate([np.zeros(0, dtype=bool), *ropes])

    @cached_property
    def _places(self) -> list[np.ndarray]:
        """Where the stresses of each family stand."""
        found, start = [], 0
        for f in self._families:
            size = _ELASTIC[_physics(f.kernels.kind)].count
            found.append(start + np.arange(f.count * size).reshape(f.count, size))
            start += f.count * size
        return found

    def _backend(self, family: Family) -> Backend:
        return CasadiVM() if family.count <= _FEW else self.forces.backend

    @cached_property
    def _stress_runs(self) -> tuple[Run, ...]:
        base = self.forces.drive_base
        runs = []
        for f, places in zip(self._families, self._places, strict=True):
            kernel = _stress_kernel(f.kernels.kind, f.kernels.effects)
            scatter = np.hstack([places, self.count + places])
            runs.append(self._backend(f).bind(kernel, f.gather(base), f.parameters, scatter))
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
            runs.append(self._backend(f).bind(kernel, gather, f.parameters, scatter))
        return tuple(runs)
