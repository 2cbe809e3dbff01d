"""Element matrices at rest, as the textbooks print them: the linear face of the kernels."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flexctrl.structure.lines import Rope, RopePiece
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
    # deformations from nodal freedoms: stretch, twist, end rotations against the chord
    B = np.zeros((6, 12))
    B[0, [0, 6]] = -1.0, 1.0
    B[1, [3, 9]] = -1.0, 1.0
    for row, end in ((2, 4), (3, 10)):
        B[row, [end, 2, 8]] = 1.0, -1.0 / L, 1.0 / L
    for row, end in ((4, 5), (5, 11)):
        B[row, [end, 1, 7]] = 1.0, 1.0 / L, -1.0 / L
    return B.T @ (plain_law(section, L) + coupling(section, L)) @ B


def plain_law(section: Section, length: float) -> np.ndarray:
    """Return the stiffness of an element against its six deformations, couplings of the section left out.

    Order: stretch, twist, end rotations against the chord about y (two) and z (two).
    """
    y, z = bending(section.EI_y, section.GA_z, length), bending(section.EI_z, section.GA_y, length)
    D = np.zeros((6, 6))
    D[0, 0], D[1, 1] = section.EA / length, section.GJ / length
    D[2:4, 2:4] = [[y.a, y.b], [y.b, y.a]]
    D[4:6, 4:6] = [[z.a, z.b], [z.b, z.a]]
    return D


def coupling(section: Section, length: float) -> np.ndarray:
    """Return what the couplings of a section add to `plain_law`, exact for a prismatic element without load on it.

    The inverse of the flexibility ∫ Sᵀ C⁻¹ S dx, S(x) the section forces of unit end forces: N and T are constant,
    the moments linear, and the shears their slopes.
    """
    if not section.stiffness:
        return np.zeros((6, 6))
    flexible = np.linalg.inv(np.array(section.stiffness))
    F = np.zeros((6, 6))
    for at, weight in ((0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0)):
        S = np.zeros((6, 6))
        S[0, 0] = S[3, 1] = 1.0
        S[4, 2:4] = S[5, 4:6] = at - 1.0, at
        S[2, 2:4], S[1, 4:6] = 1.0 / length, -1.0 / length
        F += weight * length * S.T @ flexible @ S
    return np.asarray(np.linalg.inv(F) - plain_law(section, length))


def beam_mass(section: Section, length: float) -> np.ndarray:
    """Return the consistent M_e (12 × 12) in the element's axes, with rotary inertia (Przemieniecki 1968, §11.3).

    With shear deformation the shapes are those of Timoshenko's beam: rotary inertia belongs to the sections, which
    do not turn as the axis does.
    """
    m, j = section.rhoA * length, section.rhoJ * length
    M = np.zeros((12, 12))
    M[np.ix_([0, 6], [0, 6])] = m / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    M[np.ix_([3, 9], [3, 9])] = j / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    about_z, about_y = plane_masses(section, length)
    for freedoms, sign, mass in (([1, 5, 7, 11], 1.0, about_z), ([2, 4, 8, 10], -1.0, about_y)):
        turn = np.array([1.0, sign, 1.0, sign])
        M[np.ix_(freedoms, freedoms)] = np.outer(turn, turn) * mass.matrix
    return M


def rope_mass(rope: Rope) -> np.ndarray:
    """Return the M_e (2 × 2) of a rope's element, the same in every direction (docs/theory/effects.md).

    The mean of the lumped and the consistent one; at either end of the rope it hands the inner node 1/24 of the mass,
    so that all the rope's mass, centre and moment of inertia are exact: the one element of a rope is consistent.

    Parameters
    ----------
    rope : Rope
        Of one element.

    Returns
    -------
    (2, 2) array
    """
    first, last = rope.outer if isinstance(rope, RopePiece) else (True, True)
    shared = 2 + first + last
    return rope.mass / 24.0 * np.array([[10 - 2 * first, shared], [shared, 10 - 2 * last]])


class PlaneMass(NamedTuple):
    """Consistent mass in one plane of bending, over (v₁, θ₁, v₂, θ₂).

    Own end, then other end: displacement on displacement [kg], rotation on displacement [kg m], rotation on
    rotation [kg m²].
    """

    vv: float
    tv: float
    tt: float
    other_vv: float
    other_tv: float
    other_tt: float

    @property
    def matrix(self) -> np.ndarray:
        """The matrix, shape (4, 4); the second end is the mirror image of the first."""
        m = self
        return np.array(
            [
                [m.vv, m.tv, m.other_vv, -m.other_tv],
                [m.tv, m.tt, m.other_tv, m.other_tt],
                [m.other_vv, m.other_tv, m.vv, -m.tv],
                [-m.other_tv, m.other_tt, -m.tv, m.tt],
            ]
        )


def plane_masses(section: Section, length: float) -> tuple[PlaneMass, PlaneMass]:
    """Return the mass of an element in bending about its z axis (v, θz) and about y (w, −θy).

    Parameters
    ----------
    section : Section
    length : float
        [m]

    Returns
    -------
    tuple of PlaneMass
    """
    s = section
    return (
        _plane_mass(s.rhoA, s.rhoI_z, 12.0 * s.EI_z / (s.GA_y * length**2), length),
        _plane_mass(s.rhoA, s.rhoI_y, 12.0 * s.EI_y / (s.GA_z * length**2), length),
    )


@lru_cache(maxsize=256)
def _plane_mass(mass: float, rotary: float, phi: float, length: float) -> PlaneMass:
    """∫ρA w² + ρI ψ²: deflection and turn of the sections as in a beam without load (Friedman & Kosmatka 1993)."""
    points, weights = np.polynomial.legendre.leggauss(4)
    x, weights = 0.5 * (points + 1.0), 0.5 * length * weights / (1.0 + phi) ** 2
    far = x * x * (3.0 - 2.0 * x) + phi * x
    lean = length * (x * (1.0 - x) ** 2 + 0.5 * phi * x * (1.0 - x))
    lean_far = -length * (x * x * (1.0 - x) + 0.5 * phi * x * (1.0 - x))
    w = np.array([1.0 + phi - far, lean, far, lean_far])
    tilt = 6.0 * x * (1.0 - x) / length
    psi = np.array([-tilt, (1.0 - x) * (1.0 - 3.0 * x + phi), tilt, x * (3.0 * x - 2.0 + phi)])
    M = (mass * (w * weights) @ w.T + rotary * (psi * weights) @ psi.T).tolist()
    return PlaneMass(M[0][0], M[0][1], M[1][1], M[0][2], M[1][2], M[1][3])


def to_space(matrix: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Turn a 12 × 12 element matrix from the element's axes (columns of ``axes``) to space axes."""
    T = np.kron(np.eye(4), axes)
    return T @ matrix @ T.T
