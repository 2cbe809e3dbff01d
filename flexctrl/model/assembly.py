"""M and K at rest, assembled from the textbook element matrices through the join table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.component_modes import ComponentModes
from flexctrl.effects.effect import Effect
from flexctrl.mechanics.matrices import beam_mass, beam_stiffness, rope_mass, to_space
from flexctrl.mechanics.modal_matrices import modal_matrices
from flexctrl.mechanics.rotation import cross
from flexctrl.model.motion import Motion
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.drives import Drive, RotaryDrive
from flexctrl.structure.elements import Part
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.structure import Structure

Block = tuple[np.ndarray, np.ndarray]
"""Raw places and the square matrix that stands there."""


def mass_blocks(s: Structure, motion: Motion) -> Iterator[tuple[str, Block]]:
    """Yield each part's name and its mass blocks."""
    for part in s.elements:
        if isinstance(part, Beam):
            matrix = to_space(beam_mass(part.section, part.length / part.elements), part.axes)
            for places in _elements(s, part):
                yield part.name, (places, matrix)
        elif isinstance(part, PointMass | RigidBody):
            yield part.name, (6 * s.number(part.node) + np.arange(6), _body_mass(part))
        elif isinstance(part, Rope) and part.rhoA:
            places = np.concatenate([6 * s.number(node) + np.arange(3) for node in part.nodes])
            yield part.name, (places, np.kron(rope_mass(part), np.eye(3)))
    for i, drive in enumerate(s.drives):
        yield drive.name, (np.array([motion.source_base + i]), np.array([[drive.inertia]]))


def stiffness_blocks(
    s: Structure, motion: Motion, bends: Callable[[Part | Drive], bool]
) -> Iterator[tuple[str, Block]]:
    """Yield each flexible part's name and its stiffness blocks at rest, without prestress."""
    for part in s.elements:
        if isinstance(part, Beam) and bends(part):
            matrix = to_space(beam_stiffness(part.section, part.length / part.elements), part.axes)
            for places in _elements(s, part):
                yield part.name, (places, matrix)
        elif isinstance(part, Spring | Rope) and bends(part):
            yield part.name, _line_stiffness(s, part)
    for i, drive in enumerate(s.drives):
        if bends(drive):
            yield drive.name, _drive_stiffness(s, motion, i, drive)


def modal_blocks(
    s: Structure, effects: Sequence[Effect], motion: Motion
) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
    """Yield what component modes add: the beam's name, raw places, mass and stiffness."""
    place = motion.inner_base
    for effect in effects:
        for part in s.elements:
            if isinstance(effect, ComponentModes) and isinstance(part, Beam) and effect.modes(part):
                mass, stiffness = modal_matrices(part.section, part.length / part.elements, effect.count, effect.along)
                own_count = len(mass) - 12
                turn = np.eye(len(mass))
                turn[:12, :12] = np.kron(np.eye(4), part.axes)
                for i, places in enumerate(_elements(s, part)):
                    own = place + own_count * i + np.arange(own_count)
                    yield part.name, (np.append(places, own), turn @ mass @ turn.T, stiffness)
                place += own_count * part.elements
        if not isinstance(effect, ComponentModes):
            place += len(effect.inner(s))


def assembled(motion: Motion, blocks: Iterator[tuple[str, Block]]) -> sp.csc_matrix:
    """Return Tᵀ (Σ blocks) T over the degrees of freedom, symmetric to round-off."""
    rows, columns, values = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
    for _, (places, matrix) in blocks:
        rows.append(np.repeat(places, len(places)))
        columns.append(np.tile(places, len(places)))
        values.append(matrix.ravel())
    size = motion.raw
    raw = sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    T = motion.jacobian(motion.rest)
    matrix = (T.T @ raw @ T).tocsc()
    return (0.5 * (matrix + matrix.T)).tocsc()


def _elements(s: Structure, beam: Beam) -> Iterator[np.ndarray]:
    first = s.number(beam.start)
    for i in range(beam.elements):
        yield 6 * (first + i) + np.arange(12)


def _body_mass(part: PointMass | RigidBody) -> np.ndarray:
    M = np.zeros((6, 6))
    M[:3, :3] = part.mass * np.eye(3)
    if isinstance(part, RigidBody):
        M[3:, 3:] = part.inertia
    return M


def _line_stiffness(s: Structure, line: Rope | Spring) -> Block:
    d = np.subtract(line.end.position, line.start.position)
    n = d / np.linalg.norm(d)
    row = np.concatenate([-n, n])
    places = np.concatenate([6 * s.number(node) + np.arange(3) for node in (line.start, line.end)])
    taut = not isinstance(line, Rope) or line.length <= float(np.linalg.norm(d)) * (1 + 1e-12)
    return places, (line.stiffness if taut else 0.0) * np.outer(row, row)


def _drive_stiffness(s: Structure, motion: Motion, number: int, drive: Drive) -> Block:
    """The matrix of eq. 4 on the raw freedoms, or of eq. 5 where the other side is the ground."""
    base = len(s.nodes) if drive.against is None else s.number(drive.against)
    a, node = np.array(drive.direction), s.number(drive.node)
    if isinstance(drive, RotaryDrive):
        turning = np.concatenate([0 * a, a, 0 * a, -a])
    else:
        arm = np.array(drive.node.position) - (0 if drive.against is None else np.array(drive.against.position))
        turning = np.concatenate([a, 0 * a, -a, cross(a, np.asarray(arm, float))])
    row = np.append(drive.effective_ratio * turning, -1.0)
    cells = np.arange(6)
    places = np.concatenate([6 * node + cells, 6 * base + cells, [motion.source_base + number]])
    return places, drive.stiffness * np.outer(row, row)
