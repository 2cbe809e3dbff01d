"""Elements that shear or whose section couples its strains: energies, matrices at rest, the law of a prismatic rod."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from moving_nodes import gradient, kernel, random_slots, slopes, slot
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.mechanics import beam, corotation, strains
from flexctrl.mechanics.matrices import beam_stiffness, bending, coupling, plain_law, plane_masses, to_space

RNG = np.random.default_rng(4)
_MIXED = RNG.standard_normal((6, 6)) * np.array([20.0, 15.0, 12.0, 5.0, 6.0, 8.0])[:, None]
LAW = np.diag([900.0, 400.0, 250.0, 30.0, 40.0, 70.0]) + 0.02 * _MIXED @ _MIXED.T
SECTION = fc.Section.coupled(LAW, rhoA=1.3, rhoJ=0.05, rhoI_y=0.02, rhoI_z=0.03)
BEAM = fc.Beam("b", (0.1, -0.2, 0.3), (1.0, 0.5, -0.4), SECTION, up=(0.3, 0.2, 1.0))
L, AXES = BEAM.length, BEAM.axes
ENDS = np.array([BEAM.start.position, BEAM.end.position])


def parameters() -> ca.DM:
    s = SECTION
    y, z = bending(s.EI_y, s.GA_z, L), bending(s.EI_z, s.GA_y, L)
    about_z, about_y = plane_masses(s, L)
    plain = [*AXES.ravel(), L, s.EA, s.GJ, *y, *z, s.rhoA * L, s.rhoJ * L, *about_z, *about_y]
    ratios = [1.0 / (1.0 + 12.0 * EI / (GA * L**2)) for EI, GA in ((s.EI_y, s.GA_z), (s.EI_z, s.GA_y))]
    return ca.DM([*plain, *ratios, *coupling(s, L)[np.triu_indices(6)]])


def motion(a, b):
    return corotation.beam_motion(a, b, ca.SX(parameters()))


def elastic(a, b):
    m = motion(a, b)
    return beam.whole_force(m, beam.elastic_force(m))


def strain(a, b):
    return strains.strain_energy(motion(a, b))


ELASTIC = kernel(elastic, 2)
STATES = [random_slots(seed, ENDS, turn, push, 2.0) for seed, (turn, push) in enumerate([(0.05, 0.02), (0.4, 0.2)])]


@pytest.mark.parametrize("slots", STATES)
def test_elastic_force_is_minus_the_gradient_of_the_strain_energy(slots):
    found, expected = np.ravel(ELASTIC(slots)), -np.ravel(gradient(strain, 2)(slots))
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_the_tangent_at_rest_is_the_matrix():
    rest = np.concatenate([slot(x, np.eye(3)) for x in ENDS])
    K = -slopes(elastic, 2)[0](rest)
    expected = to_space(beam_stiffness(SECTION, L), AXES)
    assert np.abs(K - expected).max() < 1e-10 * np.abs(expected).max()


def test_a_law_without_couplings_is_that_of_a_plain_section():
    plain = fc.Section(900.0, 40.0, 70.0, 30.0, rhoA=1.0, rhoJ=1.0, GA_y=400.0, GA_z=250.0)
    full = fc.Section.coupled(np.diag([900.0, 400.0, 250.0, 30.0, 40.0, 70.0]), 1.0, 1.0)
    assert np.allclose(beam_stiffness(full, 0.7), beam_stiffness(plain, 0.7), rtol=1e-13, atol=1e-10)
    assert np.abs(coupling(full, 0.7)).max() < 1e-11 * np.abs(plain_law(full, 0.7)).max()


def test_the_end_of_a_clamped_element_moves_by_the_integral_of_its_strains():
    """Castigliano: u = ∫ Eᵀ C⁻¹ E dx, E(x) the section forces of unit forces and moments at the end."""

    def strains(x: float) -> np.ndarray:
        E = np.eye(6)
        arm = L - x
        E[4, 2], E[5, 1] = -arm, arm
        return E.T @ np.linalg.solve(LAW, E)

    flexibility = quad_vec(strains, 0.0, L)[0]
    assert np.allclose(np.linalg.inv(beam_stiffness(SECTION, L)[6:, 6:]), flexibility, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("seed", range(6))
def test_short_elements_have_reissners_strains(seed):
    """Γ = (1 + ε) Rᵀe₁ − e₁ and κ in the axes of sections turned by 0.02: not to second order only, which is 1e-4."""
    length, stretch = 1e-3, 1e-3
    turn, curvature = 0.02 * np.random.default_rng(seed).standard_normal((2, 3))
    piece = fc.Beam("b", (0, 0, 0), (length, 0, 0), SECTION, up="z")
    model = fc.assemble(fc.Structure([piece], []), [fc.Flexible(), fc.LargeRotation()])
    middle, half = Rotation.from_rotvec(turn), Rotation.from_rotvec(0.5 * length * curvature)
    ends = np.concatenate([(middle * half.inv()).as_rotvec(), (middle * half).as_rotvec()])
    places = dict(zip([f"b_{i}_r{axis}" for i in (0, 1) for axis in "xyz"], ends, strict=True))
    stored = model.energy(model.displace({**places, "b_1_u": stretch * length}))[1]
    x = np.array([1.0, 0.0, 0.0])
    strain = np.concatenate([(1.0 + stretch) * middle.inv().apply(x) - x, curvature])
    assert stored == pytest.approx(0.5 * length * strain @ LAW @ strain, rel=3e-6)


@pytest.mark.parametrize("law", [np.eye(5), LAW + np.triu(np.ones((6, 6)), 1), -LAW, "stiff"])
def test_a_law_no_section_can_have_is_refused(law):
    with pytest.raises(StructureError, match=r"Section\.coupled"):
        fc.Section.coupled(law, 1.0, 1.0)
