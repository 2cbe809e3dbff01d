"""Families: the pieces of one kind in a structure, as tables for their kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexctrl.effects.component_modes import ComponentModes
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import BeamFlexibility, RopeStretch
from flexctrl.frozen import frozen
from flexctrl.mechanics.matrices import beam_mass, bending, coupling, plane_masses, rope_mass
from flexctrl.model.laws import part_kinds
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT, Kernels, Kind, kernels_of
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.drives import Drive, LinearDrive, RotaryDrive, Winch
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.structure import Structure


@frozen
class Family:
    """Pieces of one kind.

    Attributes
    ----------
    kernels : Kernels
    parts : tuple of str
        The part each piece belongs to.
    nodes : numpy.ndarray of int, shape (pieces, nodes a piece)
        Node numbers; the ground is one past the last.
    drives : numpy.ndarray of int, shape (pieces, drives a piece)
        Numbers of drives; inner freedoms count on after the last drive.
    parameters : numpy.ndarray, shape (pieces, n_par)
    """

    kernels: Kernels
    parts: tuple[str, ...]
    nodes: np.ndarray
    drives: np.ndarray
    parameters: np.ndarray

    @property
    def count(self) -> int:
        """Number of pieces."""
        return len(self.parts)

    def gather(self, drive_base: int) -> np.ndarray:
        """Places in z that each piece reads; drives' slots start at ``drive_base``."""
        slots = NODE_SLOT * self.nodes[:, :, None] + np.arange(NODE_SLOT)
        drives = drive_base + DRIVE_SLOT * self.drives[:, :, None] + np.arange(DRIVE_SLOT)
        return np.hstack([_rows(slots), _rows(drives)])

    def scatter(self, source_base: int) -> np.ndarray:
        """Places in the raw vector that each piece pushes; source angles start at ``source_base``."""
        freedoms = np.arange(self.kernels.kind.freedoms)
        return np.hstack([_rows(6 * self.nodes[:, :, None] + freedoms), source_base + self.drives])


def _rows(table: np.ndarray) -> np.ndarray:
    return table.reshape(len(table), table.shape[1] * table.shape[2])


def families_of(
    structure: Structure, effects: tuple[Effect, ...], rigid: frozenset[str], loose: frozenset[str] = frozenset()
) -> tuple[Family, ...]:
    """Return the families of a structure under some effects; a rigid beam is one piece, a rigid rope none.

    ``loose`` names the springs and drives that have play, and families of their own.
    """
    parts, modal = structure.elements, _modal_beams(structure, effects)
    effects = _kernel_effects(effects)
    beams = [p for p in parts if isinstance(p, Beam)]
    bent = [b for b in beams if b.name not in rigid and b.name not in {name for f in modal for name in f.parts}]
    stiff = tuple(e for e in effects if not isinstance(e, BeamFlexibility))
    springs = [p for p in parts if isinstance(p, Spring) and p.name not in loose]
    ropes = [p for p in parts if isinstance(p, Rope) and not p.rhoA and p.name not in rigid]
    heavy = [p for p in parts if isinstance(p, Rope) and p.rhoA]
    links = tuple(e for e in effects if not isinstance(e, RopeStretch))
    tight = [d for d in structure.drives if d.name not in loose]
    made = [
        _beams(part_kinds.BEAM, structure, effects, [b for b in bent if not b.section.shears], rigid),
        _beams(part_kinds.SHEARING_BEAM, structure, effects, [b for b in bent if b.section.shears], rigid),
        *modal,
        _rigid_beams(structure, stiff, [b for b in beams if b.name in rigid]),
        lines_family(part_kinds.SPRING, structure, effects, springs),
        lines_family(part_kinds.ROPE, structure, effects, ropes),
        lines_family(part_kinds.HEAVY_ROPE, structure, effects, [p for p in heavy if p.name not in rigid]),
        lines_family(part_kinds.HEAVY_ROPE, structure, links, [p for p in heavy if p.name in rigid]),
        _bodies(part_kinds.POINT, structure, effects, [p for p in parts if isinstance(p, PointMass)]),
        _bodies(part_kinds.BODY, structure, effects, [p for p in parts if isinstance(p, RigidBody)]),
        drives_family(part_kinds.ROTARY_DRIVE, structure, effects, [d for d in tight if isinstance(d, RotaryDrive)]),
        drives_family(part_kinds.LINEAR_DRIVE, structure, effects, [d for d in tight if isinstance(d, LinearDrive)]),
        drives_family(part_kinds.WINCH, structure, effects, [d for d in tight if isinstance(d, Winch)]),
    ]
    return tuple(f for f in made if f.count)


def _kernel_effects(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """What kernels are made for: each effect everywhere; modes of an element bend as the rest of it does."""
    bending = any(type(e) is BeamFlexibility for e in effects)
    acting = [e for e in effects if not e.apart and not (bending and isinstance(e, ComponentModes))]
    return tuple(BeamFlexibility() if isinstance(e, ComponentModes) else e.everywhere() for e in acting)


def _modal_beams(s: Structure, effects: tuple[Effect, ...]) -> list[Family]:
    """Families of elements with modes of their own, whose amplitudes are inner freedoms."""
    found, inner = [], len(s.drives)
    for effect in effects:
        chosen = [p for p in s.elements if isinstance(effect, ComponentModes) and effect.modes(p)]
        if isinstance(effect, ComponentModes) and chosen:
            kind = part_kinds.modal_beam(effect.count, effect.along)
            found.append(_beams(kind, s, _kernel_effects(effects), chosen, frozenset(), inner))
        inner += len(effect.inner(s))
    return found


def family(
    kind: Kind,
    effects: tuple[Effect, ...],
    parts: Sequence[str],
    nodes: Sequence[Sequence[int]],
    parameters: Sequence[Sequence[float]],
    drives: Sequence[int] | Sequence[Sequence[int]] | np.ndarray = (),
) -> Family:
    """Return the family of some pieces: what they belong to, and their rows of nodes, parameters and drives."""
    return Family(
        kernels_of(kind, effects),
        tuple(parts),
        np.array(nodes, dtype=int).reshape(len(parts), kind.nodes),
        np.array(drives, dtype=int).reshape(len(parts), kind.drives),
        np.array(parameters, dtype=float).reshape(len(parts), len(parameters[0]) if parameters else kind.parameters),
    )


def _beams(
    kind: Kind,
    s: Structure,
    effects: tuple[Effect, ...],
    beams: list[Beam],
    rigid: frozenset[str],
    first: int = 0,
) -> Family:
    spans = []
    for b in beams:
        ends = [(0, b.elements)] if b.name in rigid else [(i, i + 1) for i in range(b.elements)]
        spans += [(b, i, j) for i, j in ends]
    nodes = [[s.number(b.start) + i, s.number(b.start) + j] for b, i, j in spans]
    parameters = [_beam_parameters(b, b.length * (j - i) / b.elements)[: kind.parameters] for b, i, j in spans]
    numbers = first + np.arange(len(spans) * kind.drives)
    return family(kind, effects, [b.name for b, _, _ in spans], nodes, parameters, numbers)


def _rigid_beams(s: Structure, effects: tuple[Effect, ...], beams: list[Beam]) -> Family:
    nodes = [[s.number(b.start), s.number(b.end)] for b in beams]
    rows = [[b.section.rhoA * b.length, *_inertia(b)[((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))].tolist()] for b in beams]
    return family(part_kinds.RIGID_BEAM, effects, [b.name for b in beams], nodes, rows)


def _inertia(b: Beam) -> np.ndarray:
    """The inertia of a rigid beam about its middle: its element's mass matrix on a turn."""
    turn = np.zeros((12, 3))
    turn[3:6] = turn[9:12] = np.eye(3)
    for first, sign in ((0, -0.5), (6, 0.5)):
        turn[first + 1, 2], turn[first + 2, 1] = sign * b.length, -sign * b.length
    local = turn.T @ beam_mass(b.section, b.length) @ turn
    return b.axes @ local @ b.axes.T


def _beam_parameters(b: Beam, length: float) -> list[float]:
    s = b.section
    y, z = bending(s.EI_y, s.GA_z, length), bending(s.EI_z, s.GA_y, length)
    about_z, about_y = plane_masses(s, length)
    axes = b.axes.ravel().tolist()
    plain = [*axes, length, s.EA, s.GJ, *y, *z, s.rhoA * length, s.rhoJ * length, *about_z, *about_y]
    if not s.shears:
        return plain
    ratios = [1.0 / (1.0 + 12.0 * EI / (GA * length**2)) for EI, GA in ((s.EI_y, s.GA_z), (s.EI_z, s.GA_y))]
    return [*plain, *ratios, *coupling(s, length)[np.triu_indices(6)].tolist()]


def lines_family(kind: Kind, s: Structure, effects: tuple[Effect, ...], lines: Sequence[Rope | Spring]) -> Family:
    """Return the family of some ropes or springs."""
    nodes = [[s.number(line.start), s.number(line.end)] for line in lines]
    parameters = [[line.stiffness, line.length, line.damping] for line in lines]
    if kind is part_kinds.HEAVY_ROPE:
        parameters = [
            [*p, *rope_mass(line)[[0, 0, 1], [0, 1, 1]].tolist()]
            for p, line in zip(parameters, lines, strict=True)
            if isinstance(line, Rope)
        ]
    return family(kind, effects, [line.name for line in lines], nodes, parameters)


def _bodies(kind: Kind, s: Structure, effects: tuple[Effect, ...], bodies: Sequence[PointMass | RigidBody]) -> Family:
    rows = []
    for b in bodies:
        J = b.inertia if isinstance(b, RigidBody) else ((0.0,) * 3,) * 3
        rows.append([b.mass, J[0][0], J[1][1], J[2][2], J[0][1], J[0][2], J[1][2]])
    return family(kind, effects, [b.name for b in bodies], [[s.number(b.node)] for b in bodies], rows)


def drives_family(kind: Kind, s: Structure, effects: tuple[Effect, ...], drives: Sequence[Drive]) -> Family:
    """Return the family of some drives."""
    ground, places = len(s.nodes), {d.name: i for i, d in enumerate(s.drives)}
    sides = [[s.number(d.node), ground if d.against is None else s.number(d.against)] for d in drives]
    names = [d.name for d in drives]
    return family(kind, effects, names, sides, [_drive_parameters(d) for d in drives], [places[n] for n in names])


def _drive_parameters(d: Drive) -> list[float]:
    if isinstance(d, Winch):
        return winch_parameters(d)
    base = (0.0, 0.0, 0.0) if d.against is None else d.against.position
    rest = [a - b for a, b in zip(d.node.position, base, strict=True)]
    return [d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *rest]


def winch_parameters(d: Winch) -> list[float]:
    """Return the parameters of a winch in the order of `WINCH_PARAMETERS`."""
    return [d.EA, d.damping, d.inertia, d.effective_ratio, d.length, d.shortest]
