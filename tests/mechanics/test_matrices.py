"""Element matrices at rest against quadrature of their shape functions and beam theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.linalg import eigvals

import flexctrl as fc
from flexctrl.mechanics.matrices import beam_mass, beam_stiffness, bending, to_space

L = 1.7
SECTION = fc.Section(EA=900.0, EI_y=40.0, EI_z=70.0, GJ=30.0, rhoA=1.3, rhoJ=0.05, rhoI_y=0.02, rhoI_z=0.03)
SHEAR = fc.Section(EA=900.0, EI_y=40.0, EI_z=70.0, GJ=30.0, rhoA=1.3, rhoJ=0.05, GA_y=300.0, GA_z=200.0)


def shapes(x: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Displacements (u, v, w, θx) along a beam, bending slopes (v', w') and curvatures over the 12 freedoms."""
    s = x / L
    hermite = np.array([1 - 3 * s**2 + 2 * s**3, (s - 2 * s**2 + s**3) * L, 3 * s**2 - 2 * s**3, (s**3 - s**2) * L])
    slope = np.array([6 * s**2 - 6 * s, (1 - 4 * s + 3 * s**2) * L, 6 * s - 6 * s**2, (3 * s**2 - 2 * s) * L]) / L
    curve = np.array([12 * s - 6, (6 * s - 4) * L, 6 - 12 * s, (6 * s - 2) * L]) / L**2
    N, dN, ddN = np.zeros((4, 12)), np.zeros((2, 12)), np.zeros((2, 12))
    N[0, [0, 6]] = N[3, [3, 9]] = 1 - s, s
    for row, freedoms, sign in ((0, [1, 5, 7, 11], 1.0), (1, [2, 4, 8, 10], -1.0)):
        signs = np.array([1.0, sign, 1.0, sign])
        N[1 + row, freedoms], dN[row, freedoms], ddN[row, freedoms] = (signs * f for f in (hermite, slope, curve))
    return N, dN, ddN


def integral(integrand) -> np.ndarray:
    points, weights = leggauss(6)
    return sum(w * L / 2 * integrand(L / 2 * (1 + p)) for p, w in zip(points, weights, strict=True))


def test_mass_is_the_integral_over_the_shapes():
    def density(x):
        N, dN, _ = shapes(x)
        mass = np.diag([SECTION.rhoA, SECTION.rhoA, SECTION.rhoA, SECTION.rhoJ])
        return N.T @ mass @ N + dN.T @ np.diag([SECTION.rhoI_z, SECTION.rhoI_y]) @ dN

    assert np.allclose(beam_mass(SECTION, L), integral(density), rtol=0, atol=1e-14)


def test_stiffness_is_the_integral_over_the_strains():
    def density(x):
        _, _, ddN = shapes(x)
        stretch, twist = np.zeros(12), np.zeros(12)
        stretch[[0, 6]] = twist[[3, 9]] = -1 / L, 1 / L
        bend = ddN.T @ np.diag([SECTION.EI_z, SECTION.EI_y]) @ ddN
        return bend + SECTION.EA * np.outer(stretch, stretch) + SECTION.GJ * np.outer(twist, twist)

    assert np.allclose(beam_stiffness(SECTION, L), integral(density), rtol=0, atol=1e-11)


@pytest.mark.parametrize("section", [SECTION, SHEAR])
def test_cantilever_deflection(section):
    """P L³/3EI + P L/GA and P L²/2EI, in both planes; P L/EA and M L/GJ."""
    tip = np.linalg.solve(beam_stiffness(section, L)[6:, 6:], np.eye(6))
    for along, about, EI, GA, sign in ((1, 5, section.EI_z, section.GA_y, 1), (2, 4, section.EI_y, section.GA_z, -1)):
        assert tip[along, along] == pytest.approx(L**3 / (3 * EI) + L / GA)
        assert tip[about, along] == pytest.approx(sign * L**2 / (2 * EI))
        assert tip[about, about] == pytest.approx(L / EI)
    assert tip[0, 0] == pytest.approx(L / section.EA)
    assert tip[3, 3] == pytest.approx(L / section.GJ)


def test_very_soft_in_shear_bends_not_at_all():
    """Φ → ∞: the element only shears, its end rotations are equal."""
    a, b = bending(EI=1.0, GA=1e-9, length=L)
    assert a + b == pytest.approx(0.5 * 1e-9 * L)
    assert a - b == pytest.approx(2.0 / L)


def rigid_motions() -> np.ndarray:
    """Six motions of both nodes: displacements, and turns about the first node."""
    modes = np.vstack([np.eye(6), np.eye(6)])
    modes[7, 5], modes[8, 4] = L, -L
    return modes


@pytest.mark.parametrize("section", [SECTION, SHEAR])
def test_rigid_motion_costs_nothing_and_has_the_mass_of_a_rod(section):
    R = rigid_motions()
    assert np.abs(beam_stiffness(section, L) @ R).max() < 1e-12 * 900
    M = R.T @ beam_mass(section, L) @ R
    m = section.rhoA * L
    assert np.allclose(np.diag(M)[:3], m)
    assert M[3, 3] == pytest.approx(section.rhoJ * L)
    assert M[4, 4] == pytest.approx(m * L**2 / 3 + section.rhoI_y * L)
    assert M[5, 5] == pytest.approx(m * L**2 / 3 + section.rhoI_z * L)
    assert M[1, 5] == pytest.approx(m * L / 2)


@pytest.mark.parametrize("matrix", [beam_stiffness(SHEAR, L), beam_mass(SECTION, L)])
def test_symmetric_to_the_last_bit(matrix):
    assert np.array_equal(matrix, matrix.T)


def test_to_space_keeps_energies():
    axes = fc.Beam("b", (0, 0, 0), (1, 2, 3), SECTION).axes
    d = np.random.default_rng(0).normal(size=12)
    local = np.concatenate([axes.T @ d[k : k + 3] for k in range(0, 12, 3)])
    K = beam_stiffness(SHEAR, L)
    assert d @ to_space(K, axes) @ d == pytest.approx(local @ K @ local)


def test_infinite_shear_stiffness_is_euler_bernoulli():
    assert bending(2.0, math.inf, L) == pytest.approx((8.0 / L, 4.0 / L))


@pytest.mark.parametrize("elements", [10, 20])
def test_sections_that_shear_turn_apart_from_the_axis(elements):
    """Simply supported Timoshenko beam, h/L = 0.2, ν = 0.3, k = 5/6: the closed form's frequencies over Euler's.

    The ratio is the lower root of (ω²ρ/(kG) − β²)(ω² − c²β²) = ω² kG/(r²ρ), β = nπ/L (Timoshenko 1921).
    """
    E, rho, kG, length, r2 = 1.0, 1.0, 5 / 6 / 2.6, 1.0, 0.2**2 / 12
    section = fc.Section(E, E * r2, E * r2, 1.0, rho, 1.0, rho * r2, rho * r2, kG, kG)
    h = length / elements
    K, M = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    plane = np.ix_([1, 5, 7, 11], [1, 5, 7, 11])
    for i in range(elements):
        cells = np.ix_(range(2 * i, 2 * i + 4), range(2 * i, 2 * i + 4))
        K[cells] += beam_stiffness(section, h)[plane]
        M[cells] += beam_mass(section, h)[plane]
    free = [i for i in range(2 * elements + 2) if i not in (0, 2 * elements)]
    found = np.sqrt(eigvals(K[np.ix_(free, free)], M[np.ix_(free, free)]).real)
    for n in (1, 2, 3):
        beta = n * math.pi / length
        b = 1.0 + r2 * beta**2 * (1.0 + E / kG)
        square = kG / (2 * r2 * rho) * (b - math.sqrt(b * b - 4 * E / kG * r2**2 * beta**4))
        nearest = found[np.argmin(np.abs(found - math.sqrt(square)))]
        assert nearest == pytest.approx(math.sqrt(square), rel=2e-3 * n**2 * (10 / elements) ** 2)
