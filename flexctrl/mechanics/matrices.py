"""Element matrices at rest, as the textbooks print them: the linear face of the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexctrl.structure.drives import Drive
from flexctrl.structure.sections import Section


class Bending(NamedTuple):
    """Moment per end rotation in one plane: own end ``a`` and other end ``b`` [N m/rad]."""

    a: float
    b: float


def bending(EI: float, GA: float, length: float) -> Bending:
    """Return the bending coefficients of an element, (4 + Φ, 2 − Φ) EI/(L (1 + Φ)), Φ = 12 EI/(GA L²).

    Parameters
    ----------
    EI : float
        Bending stiffness [N m²].
    GA : float
        Shear stiffness [N]; infinite for Euler–Bernoulli.
    length : float
        [m]

    Returns
    -------
    Bending
    """
    phi = 12.0 * EI / (GA * length**2)
    scale = EI / (length * (1.0 + phi))
    return Bending((4.0 + phi) * scale, (2.0 - phi) * scale)


def beam_stiffness(section: Section, length: float) -> np.ndarray:
    """Return K_e (12 × 12) in the element's axes (Przemieniecki 1968, eq. 5.116).

    Order of the freedoms: u v w θx θy θz of node 1, then of node 2.
    """
    L = length
    y, z = bending(section.EI_y, section.GA_z, L), bending(section.EI_z, section.GA_y, L)
    # deformations from nodal freedoms: stretch, twist, end rotations against the chord
    B = np.zeros((6, 12))
    B[0, [0, 6]] = -1.0, 1.0
    B[1, [3, 9]] = -1.0, 1.0
    for row, end in ((2, 4), (3, 10)):
        B[row, [end, 2, 8]] = 1.0, -1.0 / L, 1.0 / L
    for row, end in ((4, 5), (5, 11)):
        B[row, [end, 1, 7]] = 1.0, 1.0 / L, -1.0 / L
    D = np.zeros((6, 6))
    D[0, 0], D[1, 1] = section.EA / L, section.GJ / L
    D[2:4, 2:4] = [[y.a, y.b], [y.b, y.a]]
    D[4:6, 4:6] = [[z.a, z.b], [z.b, z.a]]
    return B.T @ D @ B


def beam_mass(section: Section, length: float) -> np.ndarray:
    """Return the consistent M_e (12 × 12) in the element's axes, with rotary inertia (Przemieniecki 1968, §11.3)."""
    L = length
    m, j = section.rhoA * L, section.rhoJ * L
    M = np.zeros((12, 12))
    M[np.ix_([0, 6], [0, 6])] = m / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    M[np.ix_([3, 9], [3, 9])] = j / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    for freedoms, sign, rotary in (([1, 5, 7, 11], 1.0, section.rhoI_z), ([2, 4, 8, 10], -1.0, section.rhoI_y)):
        turn = np.array([1.0, sign, 1.0, sign])
        M[np.ix_(freedoms, freedoms)] = np.outer(turn, turn) * _plane_mass(m, rotary, L)
    return M


def _plane_mass(mass: float, rotary: float, L: float) -> np.ndarray:
    translation = np.array(
        [
            [156.0, 22.0 * L, 54.0, -13.0 * L],
            [22.0 * L, 4.0 * L**2, 13.0 * L, -3.0 * L**2],
            [54.0, 13.0 * L, 156.0, -22.0 * L],
            [-13.0 * L, -3.0 * L**2, -22.0 * L, 4.0 * L**2],
        ]
    )
    rotation = np.array(
        [
            [36.0, 3.0 * L, -36.0, 3.0 * L],
            [3.0 * L, 4.0 * L**2, -3.0 * L, -(L**2)],
            [-36.0, -3.0 * L, 36.0, -3.0 * L],
            [3.0 * L, -(L**2), -3.0 * L, 4.0 * L**2],
        ]
    )
    return mass / 420.0 * translation + rotary / (30.0 * L) * rotation


def to_space(matrix: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Turn a 12 × 12 element matrix from the element's axes (columns of ``axes``) to space axes."""
    T = np.kron(np.eye(4), axes)
    return T @ matrix @ T.T


def drive_stiffness(drive: Drive) -> np.ndarray:
    """Return the matrix of eq. 4, k_θ [[R², −R², −R], [−R², R², R], [−R, R, 1]].

    Its rows are the driven freedom of ``node``, that of ``against`` (left out to ground: eq. 5) and θ_d. For a
    linear drive R is the ratio over the wheel radius.
    """
    row = np.array([drive.effective_ratio, -drive.effective_ratio, -1.0])
    matrix = drive.stiffness * np.outer(row, row)
    return matrix if drive.against is not None else matrix[np.ix_([0, 2], [0, 2])]
