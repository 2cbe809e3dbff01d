"""Undamped modes against closed forms, at both ends of the spectrum and with rigid, repeated and unstable ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from fixtures import structures as s

import flexctrl as fc
from flexctrl.errors import LinearizationError, MechanismError, StructureError
from flexctrl.linear import eigen
from flexctrl.linear.krylov import _orthonormal
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import PartMatrices
from flexctrl.linear.statespace import PhysicalForm

CLAMPED_FREE = np.array([1.87510406871, 4.69409113297, 7.85475743824, 10.9955407349, 14.1371683910])
FREE_FREE = np.array([4.73004074486, 7.8532046241, 10.9956078380, 14.1371654913])


def orthonormality(linear: LinearModel, modes) -> float:
    return np.abs(modes.shapes.T @ (linear.M @ modes.shapes) - np.eye(len(modes))).max()


@pytest.mark.parametrize("n", [2, 6, 40, 250, 600])
def test_chain_has_its_sine_frequencies_dense_and_sparse(n):
    linear = s.chain(n, mass=3.0, stiffness=7e4)
    modes = linear.modes(None if n < 500 else 25)
    exact = s.chain_omega(n, 3.0, 7e4)[: len(modes)]
    np.testing.assert_allclose(modes.omega, exact, rtol=2e-12)
    assert orthonormality(linear, modes) < 1e-13


def discrete_pinned_beam(n: int) -> np.ndarray:
    """λ of n unit Hermite cells (EI = h = 1, ρA = 420), pinned at both ends, from the 2 × 2 cell problem.

    w_j = W sin jθ, θ_j = P cos jθ with θ = iπ/n; the determinant's constant term is expanded by hand in
    sin²(θ/2), where it would cancel.
    """
    theta = np.arctan(np.longdouble(1)) * 4 * np.arange(1, n, dtype=np.longdouble) / n
    s2, c = np.sin(theta / 2) ** 2, np.cos(theta)
    kww, kpp, kwp = 48 * s2, 8 + 4 * c, 12 * np.sin(theta)
    mww, mpp, mwp = 312 + 108 * c, 8 - 6 * c, -26 * np.sin(theta)
    a, b = mww * mpp - mwp**2, -(kww * mpp + kpp * mww - 2 * kwp * mwp)
    constant = 192 * s2**2
    high = (-b + np.sqrt(b * b - 4 * a * constant)) / (2 * a)
    return np.sort(np.concatenate([constant / a / high, high]).astype(float))


@pytest.mark.parametrize(("n", "low", "high"), [(20, 1e-12, 1e-11), (100, 2e-10, 1e-8)])
def test_complete_spectrum_is_right_at_both_ends(n, low, high):
    linear = s.beam(n, ("w0", f"w{n}"), EI=1.0, rhoA=420.0, length=float(n))
    modes = linear.modes()
    exact = np.sqrt(discrete_pinned_beam(n))
    np.testing.assert_allclose(modes.omega[: n // 2], exact[: n // 2], rtol=low)
    found = modes.omega[:, None]
    assert (np.abs(found / exact - 1.0).min(axis=0) < high).all()
    dense = np.sqrt(la.eigh(linear.K.toarray(), linear.M.toarray(), eigvals_only=True)[0])
    assert abs(modes.omega[0] / exact[0] - 1) < max(1e-13, 0.1 * abs(dense / exact[0] - 1))


@pytest.mark.parametrize("mode", [0, 2, 4])
def test_cantilever_error_is_that_of_cubic_elements(mode):
    meshes = np.array([8, 16, 32]) if mode else np.array([1, 2, 4, 8])
    errors = []
    for n in meshes:
        modes = s.cantilever(int(n)).modes()
        errors.append(modes.omega[mode] / CLAMPED_FREE[mode] ** 2 - 1)
    expected = (CLAMPED_FREE[mode] / meshes) ** 4 / 1440
    keep = meshes > CLAMPED_FREE[mode]
    assert (np.array(errors) > 0).all()
    assert (np.array(errors)[keep] / expected[keep] < 1.5).all()
    assert (np.array(errors)[keep] / expected[keep] > 1 / 1.5).all()
    slope = np.polyfit(np.log(meshes[keep]), np.log(np.array(errors)[keep]), 1)[0]
    assert slope == pytest.approx(-4, abs=0.1)


@pytest.mark.parametrize(("n", "count"), [(10, None), (100, None), (400, 10)])
def test_free_beam_has_two_exact_rigid_modes(n, count):
    linear = s.beam(n)
    modes = linear.modes(count)
    assert modes.rigid == 2
    assert modes.kinds[:3] == ("rigid", "rigid", "flexible")
    assert (modes.omega_squared[:2] == 0).all()
    rigid = modes.shapes[:, :2]
    size = abs(linear.K) @ np.abs(rigid)
    assert (np.abs(linear.K @ rigid) <= 1e-14 * size.max()).all()
    assert orthonormality(linear, modes) < 1e-13
    x = np.arange(n + 1) / n
    assert np.abs(rigid[::2] - np.outer(x, rigid[1]) - rigid[0]).max() < (1e-9 if n < 400 else 1e-7)
    np.testing.assert_allclose(modes.omega[2:6], FREE_FREE**2, rtol=3e-3 if n == 10 else 5e-7)


def test_slow_pendulum_on_a_stiff_structure_is_not_a_rigid_mode():
    """ω² = g/L stays beside a first flexible ω² 1e12 times larger."""
    stiff = 1e13
    modes = s.model(np.eye(3), [[9.81, 0, 0], [0, stiff, -stiff], [0, -stiff, stiff]]).modes()
    assert modes.rigid == 1
    np.testing.assert_allclose(modes.omega, [0, np.sqrt(9.81), np.sqrt(2 * stiff)], rtol=1e-14)


def test_hinged_rod_swings_at_g_over_l_whatever_its_bending_stiffness():
    """A heavy tip on a hinged beam: geometric stiffness T/h against 12 EI/h³ that is 1e9 times larger."""
    n, tip, EI = 10, 1e6, 1e9
    K, M = s.beam_matrices(n, EI=EI, rhoA=1e-3)
    h = 1.0 / n
    unit = np.array(
        [
            [36, 3 * h, -36, 3 * h],
            [3 * h, 4 * h * h, -3 * h, -h * h],
            [-36, -3 * h, 36, -3 * h],
            [3 * h, -h * h, -3 * h, 4 * h * h],
        ]
    )
    K, M = K.tolil(), M.tolil()
    for e in range(n):
        rows = slice(2 * e, 2 * e + 4)
        K[rows, rows] = K[rows, rows].toarray() + tip * s.G / (30 * h) * unit
    M[2 * n, 2 * n] += tip
    modes = s.model(sp.csc_matrix(M)[1:, 1:], sp.csc_matrix(K)[1:, 1:]).modes()
    assert modes.rigid == 0
    assert modes.omega[0] == pytest.approx(np.sqrt(s.G), rel=1e-7)


def test_uniform_bar_fixed_free():
    K, M = s.bar(400)
    modes = s.model(M, K).modes(5)
    np.testing.assert_allclose(modes.omega, (2 * np.arange(1, 6) - 1) * np.pi / 2, rtol=2e-4)


@pytest.mark.parametrize(
    ("ratio", "root"), [(1e-6, 9.999998333e-4), (1e-3, 0.03161750711), (0.1, 0.3110528482), (10, 1.4288700112)]
)
def test_rod_with_tip_mass(ratio, root):
    K, M = s.bar(10, tip_mass=1.0 / ratio)
    assert s.model(M, K).modes().omega[0] == pytest.approx(root, rel=1e-3 if ratio == 10 else 1e-4)


@pytest.mark.parametrize(("mu", "first"), [(1.0, 1.05642248), (100.0, 1.00082912), (1e6, 1.0000000833333)])
def test_hanging_rope_with_tip_mass(mu, first):
    modes = s.hanging_rope(20, mu).modes()
    assert modes.omega[0] == pytest.approx(first, rel=1e-6 if mu > 1e3 else 1e-4)
    if mu == 1e6:
        assert modes.omega[1] == pytest.approx(3141.593757, rel=1e-2)


@pytest.mark.parametrize(
    ("l1", "l2", "r", "expected"),
    [
        (1, 1, 1, (2.39719940, 5.78735130)),
        (2, 1, 0.5, (1.99799401, 4.25211947)),
        (6, 2, 10, (1.11709286, 8.40785963)),
        (20, 4, 50, (0.64021032, 12.23450574)),
    ],
)
def test_double_pendulum_crane(l1, l2, r, expected):
    np.testing.assert_allclose(s.double_pendulum(1.0, r, l1, l2).modes().omega, expected, rtol=1e-8)


@pytest.mark.parametrize(
    ("M", "m", "l", "pole"),
    [(3.355, 1, 0.5, 5.046582), (59008, 65000, 25, 0.908100), (59008, 15000, 25, 0.701533)],
)
def test_overhead_crane(M, m, l, pole):
    modes = s.crane(M, m, l).modes()
    assert modes.kinds == ("rigid", "flexible")
    assert modes.omega[1] == pytest.approx(pole, rel=1e-6)


@pytest.mark.parametrize(("bays", "storeys", "count"), [(2, 3, None), (4, 30, None), (9, 60, 12)])
def test_free_frame_in_local_axes_keeps_three_rigid_modes(bays, storeys, count):
    """Every node has axes of its own, so that K's entries carry rounding: 3 exact zeros, and only 3."""
    frame = s.grid_frame(bays, storeys, clamped=False)
    nodes = len(frame.coordinates) // 3
    rng = np.random.default_rng(bays)
    angles = rng.uniform(0, 2 * np.pi, nodes)
    c, sn = np.cos(angles), np.sin(angles)
    blocks = [np.array([[a, -b, 0], [b, a, 0], [0, 0, 1]]) for a, b in zip(c, sn, strict=True)]
    T = sp.block_diag(blocks, format="csc")
    turned = s.model(T.T @ frame.M @ T, T.T @ frame.K @ T).modes(count)
    plain = frame.modes(count)
    assert turned.rigid == plain.rigid == 3
    np.testing.assert_allclose(turned.omega[3:12], plain.omega[3:12], rtol=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "stiffness", "locked", "free"),
    [
        (48014.0 + 2 / 9, 65000.0, 1.8e6, 5.262348, 8.073488),
        (0.0021, 0.0059, 1.61, 16.519121, 32.242023),
    ],
)
def test_hoist_and_flexible_joint(first, second, stiffness, locked, free):
    """Drum mass (30·30² + 8)/0.75² with 65 t on a rope; joint with hub and link: locked and free."""
    held = s.model(np.array([[second]]), np.array([[stiffness]])).modes()
    both = s.model(np.diag([first, second]), stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])).modes()
    assert held.omega == pytest.approx([locked], rel=1e-6)
    assert both.omega == pytest.approx([0.0, free], rel=1e-6)


@pytest.mark.parametrize(("motor", "ratio"), [(1e-4, 100.0), (1e-6, 1e3), (1e-8, 1e4)])
def test_gear_drive_seen_from_either_side(motor, ratio):
    modes = s.geared(motor, ratio, 5.0, 1000.0).modes()
    assert modes.rigid == 1
    assert modes.omega[1] == pytest.approx(np.sqrt(1000 * (1 / 5 + 1 / (ratio**2 * motor))), rel=1e-12)


def test_inverted_chain_grows_at_the_laguerre_rates():
    modes = s.inverted_chain(5).modes()
    assert modes.unstable == 5
    roots = np.sqrt(np.polynomial.laguerre.lagroots([0, 0, 0, 0, 0, 1]))
    np.testing.assert_allclose(np.sort(modes.growth), roots, rtol=1e-10)
    assert modes.growth[-1] == pytest.approx(0.51338126, rel=1e-8)
    assert "grows" in str(modes)


def test_one_unstable_mode_in_a_large_sparse_model():
    """A fixed chain of 400 with a push at its end: one negative ω², checked by its own Rayleigh quotient."""
    linear = s.chain(400)
    K = linear.K.tolil()
    K[399, 399] -= 0.2
    linear = s.model(linear.M, K)
    modes = linear.modes(6)
    exact = la.eigvalsh(K.toarray())[:6]
    assert modes.unstable == 1
    np.testing.assert_allclose(modes.omega_squared, exact, rtol=1e-9)


# -- repeated modes


def square_beam(detune: float = 0.0) -> LinearModel:
    """Steel cantilever-like simply clamped 0.3 × 0.3 × 10 m in two planes, one beam model each."""
    EI, rhoA = 210e9 * 0.3**4 / 12, 7850 * 0.09
    one, two = (s.cantilever(20, EI=EI * f, rhoA=rhoA, length=10.0) for f in (1.0, 1.0 + detune))
    return s.model(
        sp.block_diag([one.M, two.M]), sp.block_diag([one.K, two.K]), Cq=np.eye(80)[[38, 78]], B=np.eye(80)[:, :1]
    )


def rotated(linear: LinearModel, angle: float) -> LinearModel:
    """The same beam in axes turned about its own."""
    c, sn = np.cos(angle), np.sin(angle)
    T = sp.kron(np.array([[c, -sn], [sn, c]]), sp.identity(linear.M.shape[0] // 2))
    return s.model(T.T @ linear.M @ T, T.T @ linear.K @ T)


def test_repeated_modes_are_equal_orthonormal_and_ordered():
    modes = square_beam().modes()
    assert modes.omega[0] == modes.omega[1]
    closed = CLAMPED_FREE[0] ** 2 * np.sqrt(210e9 * 0.3**4 / 12 / (7850 * 0.09)) / 100
    assert modes.omega[0] == pytest.approx(closed, rel=1e-6)
    assert orthonormality(square_beam(), modes) < 1e-12
    assert np.abs(modes.shapes[40:, 0]).max() < 1e-9 * np.abs(modes.shapes[:40, 0]).max()


def test_basis_of_a_repeated_space_does_not_depend_on_rounding():
    """In turned axes the two planes mix; the canonical basis comes out the same from perturbed inputs."""
    linear = rotated(square_beam(), 0.7)
    rng = np.random.default_rng(1)
    noise = sp.diags(1.0 + 1e-15 * rng.standard_normal(80))
    other = s.model(noise @ linear.M @ noise, noise @ linear.K @ noise)
    a, b = linear.modes().shapes[:, :6], other.modes().shapes[:, :6]
    assert np.abs(a - b).max() < 1e-7 * np.abs(a).max()


def test_detuning_opens_the_gap_it_should():
    omega = square_beam(1e-6).modes().omega
    assert omega[1] / omega[0] - 1 == pytest.approx(5e-7, rel=1e-3)


def test_damping_chooses_the_basis_inside_a_repeated_space():
    """Equal springs, unequal dampers along turned axes: shapes along the dampers."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    linear = s.model(np.eye(2), 4 * np.eye(2), C=turn @ np.diag([0.1, 0.5]) @ turn.T)
    modes = linear.modes()
    np.testing.assert_allclose(modes.decay, [0.1, 0.5], rtol=1e-12)
    np.testing.assert_allclose(np.abs(modes.shapes), np.abs(turn), atol=1e-12)


# -- massless freedoms, units, participation, refusals


def test_massless_drive_angle_gives_no_invented_mode():
    free = s.model(np.diag([0.0, 5.0]), [[1000, -1000], [-1000, 1000]]).modes()
    assert (free.massless, free.rigid, len(free)) == (1, 1, 1)
    held = s.model(np.diag([0.0, 5.0]), [[1500, -1000], [-1000, 1000]]).modes()
    assert held.omega == pytest.approx([8.164965809], rel=1e-9)
    assert len(held) == 1


def test_mechanism_is_refused_by_name():
    linear = s.model(np.diag([1.0, 0.0, 1.0]), np.diag([1.0, 0.0, 2.0]), coordinates=("x", "theta_loose", "z"))
    with pytest.raises(MechanismError, match="theta_loose"):
        linear.modes()


@pytest.mark.parametrize(("length", "mass", "time"), [(1e3, 1e-3, 1.0), (1e6, 1e9, 1e3)])
def test_units_do_not_matter(length, mass, time):
    """mm-t-s and µm-µg-ms: rigid count and ratios stay."""
    si = s.beam(30, EI=5e3, rhoA=2.0)
    names = si.coordinates
    scale = np.array([1.0 if name.startswith("w") else length for name in names])
    T = sp.diags(scale)
    other = s.model(mass * T @ si.M @ T, mass / time**2 * T @ si.K @ T)
    a, b = si.modes(), other.modes()
    assert a.rigid == b.rigid == 2
    np.testing.assert_allclose(b.omega[2:] * time, a.omega[2:], rtol=1e-8)


def test_participation_is_the_share_of_the_immediate_acceleration():
    linear = s.six_mass_chain()
    modes = linear.modes()
    np.testing.assert_allclose(modes.input_participation.sum(axis=0), 1.0, rtol=1e-13)
    j = np.arange(1, 7)
    closed = 4 / 13 * np.sin((2 * j - 1) * np.pi / 13) ** 2
    np.testing.assert_allclose(modes.input_participation[:, 0], closed, rtol=1e-11)
    np.testing.assert_allclose(modes.damping, 0.01 * modes.omega, rtol=1e-12)


def test_outputs_are_moved_by_modes_as_the_state_space_says():
    """C times an eigenvector of A, of unit mass, is what its mode gives the output; participation is its square."""
    Cq, given = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, -2.0, 0, 0, 5.0]]), s.six_mass_chain()
    D = np.zeros((2, len(given.inputs)))
    linear = replace(given, Cq=Cq, Cv=np.zeros((2, 6)), D=D, outputs=("first", "apart"))
    modes, plant = linear.modes(), linear.to_ss(PhysicalForm())
    poles, vectors = np.linalg.eig(plant.A)
    upper = np.flatnonzero(poles.imag > 0.0)
    upper = upper[np.argsort(np.abs(poles[upper]))]
    shapes = vectors[:6, upper]
    gain = plant.C @ vectors[:, upper] / np.sqrt(np.sum(shapes * (linear.M @ shapes), axis=0))
    shares = np.abs(gain) ** 2 / (np.abs(gain) ** 2).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(modes.output_participation, shares, rtol=1e-9)
    np.testing.assert_allclose(modes.output_participation.sum(axis=1), 1.0, rtol=1e-13)
    j = np.arange(1, 7)
    closed = 4 / 13 * np.sin((2 * j - 1) * np.pi / 13) ** 2
    np.testing.assert_allclose(modes.output_participation[0], closed, rtol=1e-10)


def test_energy_shares_by_part():
    """Two springs in a row with one mass between: the stiffer one stores its share k/(k1 + k2)."""
    springs = {
        name: PartMatrices(sp.csc_matrix([[k]]), sp.csc_matrix([[0.0]]))
        for name, k in (("left", 30.0), ("right", 10.0))
    }
    springs["mass"] = PartMatrices(sp.csc_matrix([[0.0]]), sp.csc_matrix([[2.0]]))
    modes = s.model(np.array([[2.0]]), np.array([[40.0]]), parts=springs).modes()
    assert modes.strain_shares["left"] == pytest.approx([0.75])
    assert modes.kinetic_shares["mass"] == pytest.approx([1.0])
    assert modes.dominant_part(0) == "left"
    assert "left" in str(modes)


def test_selection_keeps_the_labels():
    modes = s.beam(6).modes()
    few = modes.select([1, 3])
    assert few.kinds == ("rigid", "flexible")
    np.testing.assert_array_equal(few.omega, modes.omega[[1, 3]])
    with pytest.raises(StructureError, match="0 to 13"):
        modes.select([14])


def test_unsymmetric_stiffness_and_negative_mass_are_refused():
    with pytest.raises(LinearizationError, match="damped_poles"):
        s.model(np.eye(2), [[1.0, 0.5], [-0.5, 1.0]]).modes()
    with pytest.raises(LinearizationError, match="negative mass"):
        s.model(np.diag([1.0, -0.1]), np.eye(2)).modes()


def test_no_repeated_mode_is_missed_by_lanczos():
    """Three equal chains side by side: every frequency three times, and as many found as Sturm counts."""
    one = s.chain(200)
    linear = s.model(sp.block_diag([one.M] * 3), sp.block_diag([one.K] * 3))
    modes = linear.modes(14)
    np.testing.assert_allclose(modes.omega, np.repeat(s.chain_omega(200)[:5], 3)[:14], rtol=1e-11)
    assert orthonormality(linear, modes) < 1e-12


def test_nearly_parallel_columns_come_out_orthogonal():
    """A Krylov space that starts with modes known and noise: inverse iteration turns both to the softest ones."""
    rng = np.random.default_rng(3)
    M = sp.diags(rng.uniform(0.5, 2.0, 40)).tocsc()
    known = rng.standard_normal((40, 6))
    Z = np.hstack([known, known[:, :3] + 3e-5 * rng.standard_normal((40, 3))])
    N, image, R = _orthonormal(Z, M @ Z, 0.0)
    assert N.shape[1] == 9
    np.testing.assert_allclose(N.T @ image, np.eye(9), atol=1e-11)
    np.testing.assert_allclose(N @ R, Z, atol=1e-11)


def test_columns_that_are_all_but_parallel_are_made_orthonormal():
    """As inverse iteration near a rigid-body mode leaves them: their products are too alike for Cholesky's method."""
    rng = np.random.default_rng(3)
    M = np.diag(rng.uniform(0.5, 2.0, 40))
    nested = rng.standard_normal((40, 1)) + 1e-10 * rng.standard_normal((40, 5))
    phi = eigen._orthonormal(M, nested.copy())
    assert np.abs(phi.T @ M @ phi - np.eye(5)).max() < 1e-14
    left = nested - phi @ (phi.T @ (M @ nested))
    assert np.abs(left).max() < 1e-14


@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_what_is_unstable_in_every_mode_has_them_all(n):
    """-A beside A: the lowest λ is the largest of all."""
    rng = np.random.default_rng(n)
    for _ in range(100):
        root, mass = rng.standard_normal((n, n)), rng.standard_normal((n, n))
        A, M = root @ root.T + np.eye(n), mass @ mass.T + np.eye(n)
        found = eigen.complete_pairs(-A, M)
        assert found.values == pytest.approx(-la.eigh(A, M)[0][::-1], rel=1e-9)
        assert found.misfit.max() <= eigen.MISFIT


@pytest.mark.parametrize("elements", [2, 6])
def test_a_bent_round_bar_turns_freely_about_its_own_line(elements):
    """It sags between two ball joints; its energy does not know which way a round section points."""
    section = fc.Section(6e5, 157.0, 157.0, 157.0, 1.0, 1e-4)
    bar = fc.Beam("bar", (0, -3, 0), (0, 3, 0), section, elements=elements)
    load = fc.PointMass("load", bar.node(elements // 2), 0.3)
    joints = [fc.Support(bar.start, "u v w"), fc.Support(bar.end, "u w"), fc.Pin(bar.node(elements // 2), load.node)]
    model = fc.assemble(fc.Structure([bar, load], joints), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    modes = fc.linearize(model).modes()
    assert modes.rigid == 1
    assert modes.coordinates[np.argmax(np.abs(modes.shapes[:, modes.unstable]))].endswith("_ry")
    assert modes.omega_squared[1] > 10.0
