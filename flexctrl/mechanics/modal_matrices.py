"""Matrices at rest of an element with modes of its own, beside those of its ends."""

from __future__ import annotations

import numpy as np

from flexctrl.mechanics.clamped_modes import clamped_modes, held_shapes
from flexctrl.structure.sections import Section

__all__ = ["modal_matrices"]


def modal_matrices(section: Section, length: float, count: int, along: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what the modes add to an element's mass and stiffness, (12 + 2m) × (12 + 2m), in the element's axes.

    Order of the freedoms: the twelve of the nodes, modes along y, along z, of stretch, of twist. Static shapes and
    clamped modes have no stiffness in common (Craig & Bampton 1968).
    """
    modes, L, m = clamped_modes(count), length, section.rhoA * length
    mass, stiffness = np.zeros((2, 12 + 2 * (count + along), 12 + 2 * (count + along)))
    planes = (((1, 5, 7, 11), 1.0, section.rhoI_z, section.EI_z), ((2, 4, 8, 10), -1.0, section.rhoI_y, section.EI_y))
    for k, (places, sign, rhoI, EI) in enumerate(planes):
        ends, own = np.array(places), 12 + k * count + np.arange(count)
        scale = np.array([1.0, sign * L, 1.0, sign * L])
        coupling = scale[:, None] * (m * modes.mass + rhoI / L * modes.rotary)
        mass[np.ix_(ends, own)], mass[np.ix_(own, ends)] = coupling, coupling.T
        mass[np.ix_(own, own)] = m * np.eye(count) + rhoI / L * modes.slope
        stiffness[own, own] = EI / L**3 * modes.stiffness
    held, lines = held_shapes(along), ((0, m, section.EA), (3, section.rhoJ * L, section.GJ))
    for k, (freedom, inertia, EA) in enumerate(lines):
        ends, own = np.array([freedom, freedom + 6]), 12 + 2 * count + k * along + np.arange(along)
        mass[np.ix_(ends, own)], mass[np.ix_(own, ends)] = inertia * held.ends, inertia * held.ends.T
        mass[np.ix_(own, own)] = inertia * held.mass
        stiffness[own, own] = EA / L
    return mass, stiffness
