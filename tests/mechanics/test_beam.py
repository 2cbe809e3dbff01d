"""The beam kernels: minus the gradients of their energies, Lagrange's equations, the textbook matrices at rest."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from moving_nodes import gradient, kernel, lagrange, random_slots, slopes, slot, turned
from numpy.polynomial.legendre import leggauss
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.mechanics import beam, beam_inertia, corotation, strains
from flexctrl.mechanics.matrices import beam_mass, beam_stiffness, bending, plane_masses, to_space

SECTION = fc.Section(
    EA=900.0, EI_y=40.0, EI_z=70.0, GJ=30.0, rhoA=1.3, rhoJ=0.05, rhoI_y=0.02, rhoI_z=0.03, GA_y=400.0, GA_z=250.0
)
BEAM = fc.Beam("b", (0.1, -0.2, 0.3), (1.0, 0.5, -0.4), SECTION, up=(0.3, 0.2, 1.0))
norm, L, AXES = np.linalg.norm, BEAM.length, BEAM.axes
ENDS = np.array([BEAM.start.position, BEAM.end.position])
G = np.array([1.0, -2.0, -9.0])
REST = np.concatenate([slot(x, np.eye(3)) for x in ENDS])


def parameters(section: fc.Section = SECTION, L: float = L, axes: np.ndarray = AXES) -> ca.DM:
    y, z = bending(section.EI_y, section.GA_z, L), bending(section.EI_z, section.GA_y, L)
    about_z, about_y = plane_masses(section, L)
    rho = (section.rhoA * L, section.rhoJ * L, *about_z, *about_y)
    return ca.DM([*axes.ravel(), L, section.EA, section.GJ, *y, *z, *rho])


def motion(a, b):
    return corotation.beam_motion(a, b, ca.SX(parameters()))


def force(share):
    def make(a, b):
        m = motion(a, b)
        return beam.whole_force(m, share(m))

    return make


def weight(m):
    return beam_inertia.weight(m, G)


def height(a, b):
    return beam_inertia.height_energy(motion(a, b), G, 0.5 * (a.x + b.x))


def strain(a, b):
    return strains.strain_energy(motion(a, b))


def kinetic(a, b):
    return beam_inertia.kinetic_energy(motion(a, b))


ELASTIC = kernel(force(beam.elastic_force), 2)
INERTIAL = kernel(force(beam_inertia.inertial_force), 2)
WEIGHT = kernel(force(weight), 2)
VISCOUS = kernel(force(beam.viscous_force), 2)
DRAG = kernel(force(beam_inertia.drag), 2)
STATES = [
    random_slots(seed, ENDS, turn, push, 2.0)
    for seed, (turn, push) in enumerate([(0.0, 0.0), (1e-6, 1e-6), (0.05, 0.02), (0.3, 0.1), (0.6, 0.3), (0.9, 0.4)])
]


def element_frame(slots):
    """The element frame and the nodes' rotation vectors in it, in plain numpy."""
    (x1, R1), (x2, R2) = ((s[:3], s[3:12].reshape(3, 3)) for s in slots.reshape(2, -1))
    e1 = (x2 - x1) / np.linalg.norm(x2 - x1)
    across = null_space(e1[None])[:, 0]
    about = np.column_stack([e1, across, np.cross(e1, across)])
    mean = about.T @ (R1 + R2) @ AXES
    angle = np.arctan2(mean[2, 1] - mean[1, 2], mean[1, 1] + mean[2, 2])  # as near to both as it gets about the chord
    E = about @ Rotation.from_euler("x", angle).as_matrix()
    turns = [Rotation.from_matrix(E.T @ R @ AXES).as_rotvec() for R in (R1, R2)]
    return E, np.linalg.norm(x2 - x1), turns


def close(found, expected, tolerance=1e-11):
    scale = max(1.0, np.abs(expected).max())
    assert np.abs(np.asarray(found) - expected).max() < tolerance * scale


def curved(t1, t2):
    """End rotations of the linear curvatures nearest to κ = θ' − ½ θ × θ', of sections square to a cubic axis.

    That axis runs along (1, θ_z + ½ θ_x θ_y, ½ θ_x θ_z − θ_y), at the ends as between them; all to second order.
    """
    s, weights = (0.5 * (leggauss(6)[0] + 1.0), 0.5 * leggauss(6)[1])
    first, second = 1 - 4 * s + 3 * s**2, 3 * s**2 - 2 * s
    twist, side = (t2 - t1)[0], np.array([0.0, -0.5, 0.5])
    cubic = np.outer(first, t1) + np.outer(second, t2)
    slope = np.outer(6 * s - 4, t1) + np.outer(6 * s - 2, t2)
    cubic[:, 0], slope[:, 0] = twist * (s - 0.5), twist
    square = side * (
        np.outer(6 * s - 4, -0.5 * twist * t1[[0, 2, 1]]) + np.outer(6 * s - 2, 0.5 * twist * t2[[0, 2, 1]])
    )
    square -= side * (twist * cubic[:, [0, 2, 1]] + cubic[:, :1] * slope[:, [0, 2, 1]])
    kappa = slope + square - 0.5 * np.cross(cubic, slope)
    turn, bend = weights @ kappa, (weights * (s - 0.5)) @ kappa
    along, across = np.array([0.5 * turn[0], 0.0, 0.0]), np.array([0.0, 1.0, 1.0])
    return across * (bend - 0.5 * turn) - along, across * (bend + 0.5 * turn) + along


@pytest.mark.parametrize("slots", STATES)
def test_strain_energy_is_that_of_the_textbook_stiffness_on_curvatures_of_second_order(slots):
    """½ dᵀ K_e d of the rotations against the chord, and ½ EA L (stretch/L + ∫½(v'² + w'²)/L)²."""
    _, chord, (t1, t2) = element_frame(slots)
    m1, m2 = curved(t1, t2)
    d = np.concatenate([np.zeros(3), m1, np.zeros(3), m2])
    s, weights = (0.5 * (leggauss(4)[0] + 1.0), 0.5 * leggauss(4)[1])
    slope = [(1 - 4 * s + 3 * s**2) * a + (3 * s**2 - 2 * s) * b for a, b in ((t1[1], t2[1]), (t1[2], t2[2]))]
    axial = chord / L - 1.0 + 0.5 * weights @ (slope[0] ** 2 + slope[1] ** 2)
    expected = 0.5 * d @ beam_stiffness(SECTION, L) @ d + 0.5 * SECTION.EA * L * axial**2
    close(kernel(strain, 2)(slots), expected)


@pytest.mark.parametrize("slots", STATES)
def test_height_energy_is_that_of_the_deflected_axis(slots):
    """−∫ρA g·x ds along the cubic between the nodes, drawn in where it slopes; to second order of its slopes."""
    E, _, turns = element_frame(slots)
    t1, t2 = (E.T @ row[3:12].reshape(3, 3) @ AXES[:, 0] for row in slots.reshape(2, -1))
    s, weights = (0.5 * (leggauss(4)[0] + 1.0), 0.5 * leggauss(4)[1])
    n2, n4 = s * (1 - s) ** 2 * L, s**2 * (s - 1) * L
    off = sum(np.outer(n2 * t1[k] + n4 * t2[k], E[:, k]) for k in (1, 2))
    slope = [(1 - 4 * s + 3 * s**2) * t1[k] + (3 * s**2 - 2 * s) * t2[k] for k in (1, 2)]
    drawn_in = L * weights @ ((s - 0.5) * 0.5 * (slope[0] ** 2 + slope[1] ** 2))
    axis = np.outer(1 - s, slots[:3]) + np.outer(s, slots[24:27]) + off + drawn_in * E[:, 0]
    far = max(norm(turn) for turn in turns)
    close(kernel(height, 2)(slots), -SECTION.rhoA * L * weights @ (axis @ G), 1e-11 + far**4 / 20.0)


@pytest.mark.parametrize("slots", STATES)
def test_the_mean_of_the_axis_is_that_of_hermites_cubic_but_along_the_chord(slots):
    """Whose slopes are the nodes' axes: the mean lies ½(x₁ + x₂) + L/12 (t₁ − t₂); along the chord two fifths of it."""
    E, _, _ = element_frame(slots)
    (x1, t1), (x2, t2) = ((s[:3], s[3:12].reshape(3, 3) @ AXES[:, 0]) for s in slots.reshape(2, -1))
    s, weights = (0.5 * (leggauss(4)[0] + 1.0), 0.5 * leggauss(4)[1])
    h = np.array([1 - 3 * s**2 + 2 * s**3, s * (1 - s) ** 2 * L, 3 * s**2 - 2 * s**3, s**2 * (s - 1) * L])
    off = weights @ (h.T @ np.array([x1, t1, x2, t2])) - 0.5 * (x1 + x2)
    along = (off @ E[:, 0]) * E[:, 0]
    mean = 0.5 * (x1 + x2) + off - 0.6 * along
    close(kernel(height, 2)(slots), -SECTION.rhoA * L * mean @ G)


@pytest.mark.parametrize("slots", STATES)
def test_kinetic_energy_is_that_of_the_consistent_mass_but_for_the_mean_which_moves_as_weight_says(slots):
    """½ Vᵀ M_e V − ½ m |c|² + ½ m |Ẋ|², c the mean velocity that M_e knows, Ẋ by the power of weights."""
    E, _, _ = element_frame(slots)
    V = np.concatenate([E.T @ s[k : k + 3] for s in slots.reshape(2, -1) for k in (12, 15)])
    M, m = beam_mass(SECTION, L), SECTION.rhoA * L
    known = (M[:3] + M[6:9]) @ V / m
    close(
        kernel(kinetic, 2)(slots),
        0.5 * V @ M @ V + 0.5 * m * (mean_velocity(slots) @ mean_velocity(slots) - known @ known),
    )


def mean_velocity(slots):
    rates = slots.reshape(2, -1)[:, 12:18].ravel()
    heights = (lambda a, b, g=g: beam_inertia.height_energy(motion(a, b), g, 0.5 * (a.x + b.x)) for g in np.eye(3))
    return np.array([-(gradient(height, 2)(slots) @ rates) / (SECTION.rhoA * L) for height in heights])


@pytest.mark.parametrize("slots", STATES)
def test_a_speed_of_the_whole_adds_its_own_energy_and_its_share_of_the_momentum(slots):
    """T(v + V) = T(v) + m Ẋ·V + ½ m |V|²: who moves along sees the same (Galilei)."""
    V, m = np.array([30.0, -20.0, 50.0]), SECTION.rhoA * L
    faster = slots.copy()
    for k in (12, 36):
        faster[k : k + 3] += V
    gained = kernel(kinetic, 2)(faster) - kernel(kinetic, 2)(slots)
    close(gained, m * mean_velocity(slots) @ V + 0.5 * m * V @ V)
    close(INERTIAL(faster), INERTIAL(slots), 1e-10)


@pytest.mark.parametrize("slots", STATES)
def test_inertia_in_free_fall_is_the_weight(slots):
    falling = slots.copy()
    for k in (18, 42):
        falling[k : k + 3] += G
    close(INERTIAL(falling) - INERTIAL(slots), -WEIGHT(slots), 1e-10)


@pytest.mark.parametrize("slots", STATES)
def test_elastic_force_is_minus_the_gradient_of_the_strain_energy(slots):
    close(ELASTIC(slots), -gradient(strain, 2)(slots))


@pytest.mark.parametrize("slots", STATES)
def test_weight_is_minus_the_gradient_of_the_height_energy(slots):
    close(WEIGHT(slots), -gradient(height, 2)(slots))


@pytest.mark.parametrize("slots", STATES)
def test_inertial_force_is_lagranges(slots):
    close(INERTIAL(slots), -lagrange(kinetic, 2)(slots))


@pytest.mark.parametrize("slots", STATES[2:])
def test_drag_takes_twice_the_kinetic_energy_a_second(slots):
    V = np.concatenate([slots[12:18], slots[36:42]])
    assert DRAG(slots) @ V == pytest.approx(-2.0 * kernel(kinetic, 2)(slots))


@pytest.mark.parametrize("slots", STATES[2:])
def test_viscous_force_dissipates_but_not_in_rigid_motion(slots):
    V = np.concatenate([slots[12:18], slots[36:42]])
    assert VISCOUS(slots) @ V < 0.0
    spin, drift = np.array([0.4, -0.8, 1.7]), np.array([1.0, 2.0, 3.0])
    rigid = slots.copy()
    for start in (0, 24):
        rigid[start + 12 : start + 18] = [*(drift + np.cross(spin, rigid[start : start + 3])), *spin]
    close(VISCOUS(rigid), np.zeros(12), 1e-10)


@pytest.mark.parametrize("theta", [0.05, 0.2, 0.5])
def test_a_wire_that_bends_along_arcs_is_damped_as_bending(theta):
    """EI/L θ̇²: its axis keeps its length L while its chord, L sin(θ/2)/(θ/2), gets shorter."""
    length, rate, wire = 2.0, 3.0, fc.Section(EA=4e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.1)

    def share(a, b):
        m = corotation.beam_motion(a, b, ca.SX(parameters(wire, length, np.eye(3))))
        return beam.whole_force(m, beam.viscous_force(m))

    half = 0.5 * theta
    chord, nearing = (
        length * np.sin(half) / half,
        rate * length * (half * np.cos(half) - np.sin(half)) / (2.0 * half**2),
    )
    spin, own = np.array([0.0, 0.5 * rate, 0.0]), Rotation.from_rotvec([0.0, half, 0.0]).as_matrix()
    none = np.zeros(3)
    first, second = slot(none, own.T, none, -spin), slot([chord, 0, 0], own, [nearing, 0, 0], spin)
    V = np.concatenate([none, -spin, [nearing, 0, 0], spin])
    taken = -kernel(share, 2)(np.concatenate([first, second])) @ V
    left = wire.EA * length * (rate * theta**3 / 480.0) ** 2  # strain of θ⁴/1920 that bowing of second order leaves
    assert taken == pytest.approx(wire.EI_y / length * rate**2 + left, rel=0.02)


@pytest.mark.parametrize("slots", STATES)
def test_forces_turn_with_the_machine(slots):
    Q = Rotation.from_rotvec([1.0, 2.0, -2.0]).as_matrix()
    for share in (ELASTIC, INERTIAL, VISCOUS, DRAG):
        close(share(turned(slots, Q)), np.kron(np.eye(4), Q) @ share(slots), 1e-12)


@pytest.mark.parametrize("slots", STATES)
def test_internal_forces_are_in_balance(slots):
    """No net force or moment: the element does not know where it is."""
    for share in (ELASTIC, VISCOUS):
        f1, m1, f2, m2 = share(slots).reshape(4, 3)
        close(f1 + f2, np.zeros(3))
        close(m1 + m2 + np.cross(slots[:3], f1) + np.cross(slots[24:27], f2), np.zeros(3), 1e-10)


def test_a_rigid_motion_makes_no_elastic_force():
    for seed in range(3):
        close(ELASTIC(random_slots(seed, ENDS, 0.0, 0.0, 1.0)), np.zeros(12), 1e-10)


def test_tangents_at_rest_are_the_textbook_matrices():
    """Timoshenko's K_e with GA, consistent M_e with rotary inertia, in the beam's own skew axes."""
    K, M = to_space(beam_stiffness(SECTION, L), AXES), to_space(beam_mass(SECTION, L), AXES)
    close(slopes(force(beam.elastic_force), 2)[0](REST), -K, 1e-12)
    close(slopes(force(beam.viscous_force), 2)[1](REST), -K, 1e-12)
    close(slopes(force(beam_inertia.inertial_force), 2)[2](REST), -M, 1e-12)
    close(slopes(force(beam_inertia.drag), 2)[1](REST), -M, 1e-12)


def test_tangents_of_a_turned_element_are_the_turned_matrices():
    slots = random_slots(3, ENDS, 0.0, 0.0, 0.0)
    Q = slots[3:12].reshape(3, 3)
    K, M = to_space(beam_stiffness(SECTION, L), Q @ AXES), to_space(beam_mass(SECTION, L), Q @ AXES)
    close(slopes(force(beam.elastic_force), 2)[0](slots), -K, 1e-11)
    close(slopes(force(beam_inertia.inertial_force), 2)[2](slots), -M, 1e-12)


def test_a_stretched_element_stiffens_as_a_string_in_bending():
    """Geometric stiffness of an axial force N, Przemieniecki 1968, §15.2: 6N/5L, N/10, 2NL/15, −NL/30.

    The stretched chord also is the new lever of the end moments, so K_e is taken with it.
    """
    stretch = 0.2 * L
    N, chord = SECTION.EA * stretch / L, L + stretch
    slots = np.concatenate([slot(ENDS[0], np.eye(3)), slot(ENDS[1] + stretch * AXES[:, 0], np.eye(3))])
    inward = np.kron(np.eye(4), AXES).T
    K = -inward @ slopes(force(beam.elastic_force), 2)[0](slots) @ inward.T
    geometric = N * np.array([[2 * L / 15, -L / 30], [-L / 30, 2 * L / 15]])
    against_chord = np.array([[1 / chord, 1, -1 / chord, 0], [1 / chord, 0, -1 / chord, 1]])
    string = N / chord * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
    a, b = bending(SECTION.EI_z, SECTION.GA_y, L)
    expected = against_chord.T @ (np.array([[a, b], [b, a]]) + geometric) @ against_chord + string
    plane = [1, 5, 7, 11]
    close(K[np.ix_(plane, plane)], expected)
    small = against_chord.T @ geometric @ against_chord + string
    assert small[0, 0] * chord / N == pytest.approx(1.0 + 0.2 * L / chord)


@pytest.mark.parametrize("slots", STATES[2:])
@pytest.mark.parametrize("shear", [{}, {"GA_y": 400.0, "GA_z": 400.0}], ids=["slender", "sheared"])
def test_a_round_beam_does_not_know_where_its_axes_lie_in_the_section(slots, shear):
    section = fc.Section(EA=900.0, EI_y=40.0, EI_z=40.0, GJ=30.0, rhoA=1.3, rhoJ=0.04, **shear)

    def total(axes):
        def make(a, b):
            m = corotation.beam_motion(a, b, ca.SX(parameters(section, axes=axes)))
            shares = (beam.elastic_force(m), beam.viscous_force(m), beam_inertia.inertial_force(m), weight(m))
            return beam.whole_force(m, sum(shares[1:], shares[0]))

        return np.asarray(kernel(make, 2)(slots)).ravel()

    close(total(AXES @ Rotation.from_euler("x", 0.7).as_matrix()), total(AXES), 1e-12)
