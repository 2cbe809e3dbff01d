"""Families: pieces of one kind and the sum of what all effects do to them, as one kernel each.

Kernels read node slots of a flat vector z and add forces to a raw vector. A node's slot holds
x (3), R (9, row by row), velocity (6) and acceleration (6); a drive's slot θ_d, its two rates, and the
whole turns of its joint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.mechanics import beam, pieces
from flexctrl.mechanics.beam import NodeMotion
from flexctrl.mechanics.kernel import Kernel
from flexctrl.mechanics.matrices import bending
from flexctrl.structure.drives import Drive, RotaryDrive
from flexctrl.structure.elements import Beam, PointMass, RigidBody, Rope, Spring
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca

NODE_SLOT = 24
DRIVE_SLOT = 4

Physics = Callable[[Sequence[NodeMotion], "ca.SX", "ca.SX"], "Shares"]


@dataclass(frozen=True)
class Shares:
    """What acts on a piece: forces of inertia, all other forces, kinetic and stored energy."""

    inertia: ca.SX
    force: ca.SX
    kinetic: ca.SX
    stored: ca.SX


@dataclass(frozen=True)
class Family:
    """Pieces of one kind.

    Attributes
    ----------
    kind : str
    parts : tuple of str
        The part each piece belongs to.
    nodes : numpy.ndarray of int, shape (pieces, nodes per piece)
        Node numbers; the ground is one past the last.
    drives : numpy.ndarray of int, shape (pieces, 0 or 1)
    parameters : numpy.ndarray, shape (pieces, n_par)
    freedoms : int
        Raw freedoms a node that the piece pushes (3 or 6).
    physics : callable
        (node motions, drive slot, parameters) → `Shares`.
    """

    kind: str
    parts: tuple[str, ...]
    nodes: np.ndarray
    drives: np.ndarray
    parameters: np.ndarray
    freedoms: int
    physics: Physics

    @property
    def count(self) -> int:
        """Number of pieces."""
        return len(self.parts)

    def gather(self, drive_base: int) -> np.ndarray:
        """Places in z that each piece reads; drives' slots start at ``drive_base``."""
        slots = (NODE_SLOT * self.nodes[:, :, None] + np.arange(NODE_SLOT)).reshape(self.count, -1)
        drives = (drive_base + DRIVE_SLOT * self.drives[:, :, None] + np.arange(DRIVE_SLOT)).reshape(self.count, -1)
        return np.hstack([slots, drives])

    def scatter(self, source_base: int) -> np.ndarray:
        """Places in the raw vector that each piece pushes; source angles start at ``source_base``."""
        cells = (6 * self.nodes[:, :, None] + np.arange(self.freedoms)).reshape(self.count, -1)
        return np.hstack([cells, source_base + self.drives])

    @cached_property
    def force(self) -> Kernel:
        """Kernel of the sum of all forces, inertia included."""
        symbols, parameters, shares = self._rest
        return _kernel(f"{self.kind}_force", symbols, parameters, shares.force + shares.inertia)

    @cached_property
    def energy(self) -> Kernel:
        """Kernel of kinetic energy, stored energy and dissipated power."""
        import casadi as ca

        symbols, parameters, shares = self._rest
        velocities = self._velocities(symbols)
        still = ca.substitute(shares.force, velocities, ca.SX.zeros(velocities.numel()))
        power = ca.dot(still - shares.force, self._raw_rates(symbols))
        return _kernel(f"{self.kind}_energy", symbols, parameters, ca.vertcat(shares.kinetic, shares.stored, power))

    @cached_property
    def tangent(self) -> Kernel:
        """Kernel of ∂force/∂(raw motion), column by column.

        Three more inputs say how a raw increment moves the piece: it changes place, velocity
        and acceleration by that factor. (1, 0, 0) gives −K, (0, 1, 0) gives −C, (0, 0, 1) gives −M.
        """
        import casadi as ca

        symbols, parameters, _ = self._rest
        seeds = ca.SX.sym("seeds", 3)
        width = self.nodes.shape[1] * self.freedoms + self.drives.shape[1]
        increment = ca.SX.sym("increment", width)
        shares = self._evaluate(symbols, parameters, increment, seeds)
        slope = ca.jacobian(ca.cse(shares.force + shares.inertia), increment)
        slope = ca.substitute(slope, increment, ca.SX.zeros(width))
        return _kernel(f"{self.kind}_tangent", ca.vertcat(symbols, seeds), parameters, ca.vec(ca.densify(slope)))

    @property
    def _rest(self) -> tuple[ca.SX, ca.SX, Shares]:
        import casadi as ca

        symbols = ca.SX.sym("z", NODE_SLOT * self.nodes.shape[1] + DRIVE_SLOT * self.drives.shape[1])
        parameters = ca.SX.sym("p", self.parameters.shape[1])
        width = self.nodes.shape[1] * self.freedoms + self.drives.shape[1]
        return symbols, parameters, self._evaluate(symbols, parameters, ca.SX(width, 1), ca.SX(3, 1))

    def _evaluate(self, symbols: ca.SX, parameters: ca.SX, increment: ca.SX, seeds: ca.SX) -> Shares:
        import casadi as ca

        count = self.nodes.shape[1]
        nodes = []
        for i in range(count):
            d = increment[self.freedoms * i : self.freedoms * (i + 1)]
            d = d if self.freedoms == 6 else ca.vertcat(d, ca.SX(3, 1))
            nodes.append(_node_motion(symbols[NODE_SLOT * i : NODE_SLOT * (i + 1)], d, seeds))
        slot = symbols[NODE_SLOT * count :]
        if self.drives.size:
            slot = slot + ca.vertcat(seeds, 0) * increment[-1]
        return self.physics(nodes, slot, parameters)

    def _velocities(self, symbols: ca.SX) -> ca.SX:
        """All velocity symbols, the source's rate included: zeroed to find what dissipates."""
        import casadi as ca

        count = self.nodes.shape[1]
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 18] for i in range(count)]
        return ca.vertcat(*found, *([symbols[NODE_SLOT * count + 1]] if self.drives.size else []))

    def _raw_rates(self, symbols: ca.SX) -> ca.SX:
        import casadi as ca

        count = self.nodes.shape[1]
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 12 + self.freedoms] for i in range(count)]
        return ca.vertcat(*found, *([symbols[NODE_SLOT * count + 1]] if self.drives.size else []))


def _node_motion(slot: ca.SX, d: ca.SX, seeds: ca.SX) -> NodeMotion:
    import casadi as ca

    R = ca.reshape(slot[3:12], 3, 3).T
    turned = R if d.is_zero() else R + ca.skew(seeds[0] * d[3:]) @ R
    return NodeMotion(
        slot[:3] + seeds[0] * d[:3],
        turned,
        slot[12:15] + seeds[1] * d[:3],
        slot[15:18] + seeds[1] * d[3:],
        slot[18:21] + seeds[2] * d[:3],
        slot[21:24] + seeds[2] * d[3:],
    )


def _kernel(name: str, inputs: ca.SX, parameters: ca.SX, outputs: ca.SX) -> Kernel:
    import casadi as ca

    return Kernel(name, inputs, parameters, ca.cse(ca.densify(outputs)))


def families_of(structure: Structure, effects: tuple[Effect, ...], rigid: frozenset[str]) -> tuple[Family, ...]:
    """Return the families of a structure under some effects; the beams in ``rigid`` are one piece each."""
    beams = [p for p in structure.elements if isinstance(p, Beam)]
    bodies = [p for p in structure.elements if isinstance(p, PointMass | RigidBody)]
    made = [
        _beams("beam", structure, [b for b in beams if b.name not in rigid], _beam_physics(effects)),
        _beams("rigid_beam", structure, [b for b in beams if b.name in rigid], _beam_physics(effects), whole=True),
        _lines(structure, [p for p in structure.elements if isinstance(p, Spring)], _spring_physics(effects)),
        _lines(
            structure,
            [p for p in structure.elements if isinstance(p, Rope) and p.name not in rigid],
            _rope_physics(effects),
        ),
        _bodies(structure, [b for b in bodies if isinstance(b, PointMass)], 3, _body_physics(effects)),
        _bodies(structure, [b for b in bodies if isinstance(b, RigidBody)], 6, _body_physics(effects)),
        _drives(structure, RotaryDrive, effects),
        _drives(structure, None, effects),
    ]
    return tuple(f for f in made if f.count)


def _beams(kind: str, s: Structure, beams: list[Beam], physics: Physics, whole: bool = False) -> Family:
    rows = [(b, i, b.elements if whole else i + 1) for b in beams for i in range(1 if whole else b.elements)]
    return Family(
        kind,
        tuple(b.name for b, _, _ in rows),
        np.array([[s.number(b.node(i)), s.number(b.node(j))] for b, i, j in rows]).reshape(-1, 2),
        np.zeros((len(rows), 0), dtype=int),
        np.array([_beam_parameters(b, b.length * (j - i) / b.elements) for b, i, j in rows]),
        6,
        physics,
    )


def _beam_parameters(b: Beam, length: float) -> np.ndarray:
    s = b.section
    y, z = bending(s.EI_y, s.GA_z, length), bending(s.EI_z, s.GA_y, length)
    inertia = (s.rhoA * length, s.rhoJ * length, s.rhoI_y, s.rhoI_z)
    return np.array([*b.axes.ravel(), length, s.EA, s.GJ, *y, *z, *inertia])


def _beam_physics(effects: tuple[Effect, ...]) -> Physics:
    def physics(nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
        import casadi as ca

        m = beam.beam_motion(nodes[0], nodes[1], parameters)
        force, middle = beam.no_force(), 0.5 * (nodes[0].x + nodes[1].x)
        for effect in effects:
            force = force + effect.beam(m)
        stored = sum((e.beam_energy(m, middle) for e in effects), ca.SX(1, 1))
        return Shares(
            beam.nodal_force(m, beam.inertial_force(m)), beam.nodal_force(m, force), beam.kinetic_energy(m), stored
        )

    return physics


def _lines(s: Structure, lines: Sequence[Rope | Spring], physics: Physics) -> Family:
    return Family(
        "rope" if any(isinstance(line, Rope) for line in lines) else "spring",
        tuple(line.name for line in lines),
        np.array([[s.number(line.start), s.number(line.end)] for line in lines]).reshape(-1, 2),
        np.zeros((len(lines), 0), dtype=int),
        np.array([[line.stiffness, line.length, line.damping] for line in lines]),
        3,
        physics,
    )


def _spring_physics(effects: tuple[Effect, ...]) -> Physics:
    def physics(nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
        import casadi as ca

        m = pieces.line_motion(nodes[0], nodes[1], parameters)
        tension = sum((e.spring(m) for e in effects), pieces.spring_tension(m))
        return Shares(ca.SX(6, 1), pieces.line_force(m, tension), ca.SX(1, 1), pieces.spring_energy(m))

    return physics


def _rope_physics(effects: tuple[Effect, ...]) -> Physics:
    def physics(nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
        import casadi as ca

        m = pieces.line_motion(nodes[0], nodes[1], parameters)
        pull = sum((e.rope(m) for e in effects), ca.SX(1, 1))
        stored = sum((e.rope_energy(m) for e in effects), ca.SX(1, 1))
        return Shares(ca.SX(6, 1), pieces.line_force(m, pieces.unilateral(m, pull)), ca.SX(1, 1), stored)

    return physics


def _bodies(s: Structure, bodies: Sequence[PointMass | RigidBody], freedoms: int, physics: Physics) -> Family:
    rows = []
    for b in bodies:
        J = b.inertia if isinstance(b, RigidBody) else ((0.0,) * 3,) * 3
        rows.append([b.mass, J[0][0], J[1][1], J[2][2], J[0][1], J[0][2], J[1][2]])
    return Family(
        "body" if freedoms == 6 else "point",
        tuple(b.name for b in bodies),
        np.array([[s.number(b.node)] for b in bodies], dtype=int).reshape(-1, 1),
        np.zeros((len(bodies), 0), dtype=int),
        np.array(rows).reshape(-1, 7),
        freedoms,
        physics,
    )


def _body_physics(effects: tuple[Effect, ...]) -> Physics:
    def physics(nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
        import casadi as ca

        p = pieces.named(pieces.BODY_PARAMETERS, parameters)
        force = sum((e.body(nodes[0], p) for e in effects), ca.SX(6, 1))
        stored = sum((e.body_energy(nodes[0], p) for e in effects), ca.SX(1, 1))
        return Shares(pieces.body_inertia(nodes[0], p), force, pieces.body_energy(nodes[0], p), stored)

    return physics


def _drives(s: Structure, kind: type | None, effects: tuple[Effect, ...]) -> Family:
    rotary = kind is RotaryDrive
    chosen = [(i, d) for i, d in enumerate(s.drives) if isinstance(d, RotaryDrive) == rotary]
    ground = len(s.nodes)
    sides = [[s.number(d.node), ground if d.against is None else s.number(d.against)] for _, d in chosen]
    return Family(
        "rotary_drive" if rotary else "linear_drive",
        tuple(d.name for _, d in chosen),
        np.array(sides, dtype=int).reshape(-1, 2),
        np.array([[i] for i, _ in chosen], dtype=int).reshape(-1, 1),
        np.array([_drive_parameters(d) for _, d in chosen]).reshape(-1, len(pieces.DRIVE_PARAMETERS)),
        6,
        _drive_physics(effects, rotary),
    )


def _drive_parameters(d: Drive) -> np.ndarray:
    base = np.zeros(3) if d.against is None else np.array(d.against.position)
    rest = np.array(d.node.position) - base
    return np.array([d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *rest])


def _drive_physics(effects: tuple[Effect, ...], rotary: bool) -> Physics:
    def physics(nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
        import casadi as ca

        if rotary:
            m = pieces.rotary_motion(nodes[0], nodes[1], slot[:3], slot[3], parameters)
        else:
            m = pieces.linear_motion(nodes[0], nodes[1], slot[:3], parameters)
        force = sum((e.drive(m) for e in effects), ca.SX(13, 1))
        stored = sum((e.drive_energy(m) for e in effects), ca.SX(1, 1))
        inertia = ca.vertcat(ca.SX(12, 1), -m.p["inertia"] * m.source_acceleration)
        return Shares(inertia, force, 0.5 * m.p["inertia"] * m.source_rate**2, stored)

    return physics
