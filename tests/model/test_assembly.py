"""The join table assembles what the traditional synthesis does; drives enter as the paper's matrices."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.mechanics.matrices import beam_mass, beam_stiffness, to_space

E = fc.Section(EA=3e4, EI_y=90.0, EI_z=157.0, GJ=50.0, rhoA=1.2, rhoJ=0.01, rhoI_y=0.02, rhoI_z=0.03)
FLEXIBLE = [fc.Flexible()]
K_THETA, R = 50.0, 3.0


def support_frame(*drives, joints=None) -> fc.Structure:
    """Fig. 5: legs ① and ②, clamped at nodes 1 and 3 and welded at 2 and 4; pendulum ③ pinned there at node 5."""
    left = fc.Beam("left", (-1, 0, 0), (0, 1.5, 0), E)
    right = fc.Beam("right", (1.2, 0, 0), (0, 1.5, 0), E)
    pendulum = fc.Beam("pendulum", (0, 1.5, 0), (0.2, 0.3, 0), E)
    if joints is not None:
        return fc.Structure([left, right, pendulum], joints)
    ties = [fc.Support(left.start), fc.Support(right.start), fc.Weld(left.end, right.end)]
    ties += [fc.Pin(right.end, pendulum.start)]
    made = [make(right.end, pendulum.start) for make in drives]
    return fc.planar(fc.Structure([left, right, pendulum], ties, made))


def frame_element(start, end) -> tuple[np.ndarray, np.ndarray]:
    """Textbook plane frame element, K and M (6 × 6) over (u, v, θ) of both nodes in space axes."""
    (dx, dy), L = np.subtract(end, start), math.dist(start, end)
    a, b, c, d = E.EA / L, 12 * E.EI_z / L**3, 6 * E.EI_z / L**2, E.EI_z / L
    K = np.array(
        [
            [a, 0, 0, -a, 0, 0],
            [0, b, c, 0, -b, c],
            [0, c, 4 * d, 0, -c, 2 * d],
            [-a, 0, 0, a, 0, 0],
            [0, -b, -c, 0, b, -c],
            [0, c, 2 * d, 0, -c, 4 * d],
        ]
    )
    m, r = E.rhoA * L / 420, E.rhoI_z / (30 * L)
    M = m * np.array(
        [
            [140, 0, 0, 70, 0, 0],
            [0, 156, 22 * L, 0, 54, -13 * L],
            [0, 22 * L, 4 * L**2, 0, 13 * L, -3 * L**2],
            [70, 0, 0, 140, 0, 0],
            [0, 54, 13 * L, 0, 156, -22 * L],
            [0, -13 * L, -3 * L**2, 0, -22 * L, 4 * L**2],
        ]
    ) + r * np.array(
        [
            [0, 0, 0, 0, 0, 0],
            [0, 36, 3 * L, 0, -36, 3 * L],
            [0, 3 * L, 4 * L**2, 0, -3 * L, -(L**2)],
            [0, 0, 0, 0, 0, 0],
            [0, -36, -3 * L, 0, 36, -3 * L],
            [0, 3 * L, -(L**2), 0, -3 * L, 4 * L**2],
        ]
    )
    turn = np.kron(np.eye(2), np.array([[dx, dy, 0], [-dy, dx, 0], [0, 0, L]]) / L)
    return turn.T @ K @ turn, turn.T @ M @ turn


def traditional(which: int) -> np.ndarray:
    """Eq. 2 (K) or 3 (M) before the restraint, over structure nodes 1 … 4 and the pendulum's own angle at node 3.

    Small matrices [k_ij] of element e go to the rows and columns of structure nodes i and j; nodes 1 and 2
    are then struck out. Element ③ turns by itself at node 3.
    """
    places = {1: (0, 1, 2), 2: (3, 4, 5), 3: (6, 7, 8), "3 of ③": (6, 7, 9), 4: (10, 11, 12)}
    points = {1: (-1, 0), 2: (1.2, 0), 3: (0, 1.5), "3 of ③": (0, 1.5), 4: (0.2, 0.3)}
    whole = np.zeros((13, 13))
    for i, j in ((1, 3), (2, 3), ("3 of ③", 4)):
        element = frame_element(points[i], points[j])[which]
        for row, of in enumerate((i, j)):
            for column, to in enumerate((i, j)):
                block = element[3 * row : 3 * row + 3, 3 * column : 3 * column + 3]
                whole[np.ix_(places[of], places[to])] += block
    return whole[6:, 6:]


def test_traditional_synthesis_and_join_table_give_the_same_matrices():
    model = fc.assemble(support_frame(), FLEXIBLE)
    assert model.n == 7
    assert np.allclose(model.stiffness().toarray(), traditional(0), rtol=1e-13, atol=1e-9)
    assert np.allclose(model.mass().toarray(), traditional(1), rtol=1e-13, atol=1e-14)


def test_the_pinned_element_of_the_traditional_synthesis():
    """Eq. 2 uses the stiffness matrix of a pinned element, 3EI/L³: ours with its own angle eliminated."""
    K = fc.assemble(support_frame(), FLEXIBLE).stiffness().toarray()
    own, kept = [3], [0, 1, 2, 4, 5, 6]
    condensed = K[np.ix_(kept, kept)] - K[np.ix_(kept, own)] @ np.linalg.solve(
        K[np.ix_(own, own)], K[np.ix_(own, kept)]
    )
    L, d = math.dist((0, 1.5), (0.2, 0.3)), np.subtract((0.2, 0.3), (0, 1.5))
    n = np.array([-d[1], d[0]]) / L
    across = np.concatenate([-n, [0.0], n, [-L]])
    axial = np.concatenate([-d, [0.0], d, [0.0]]) / L
    pinned = 3 * E.EI_z / L**3 * np.outer(across, across) + E.EA / L * np.outer(axial, axial)
    legs = sum(frame_element(p, (0, 1.5))[0][3:, 3:] for p in ((-1, 0), (1.2, 0)))
    pinned[:3, :3] += legs
    assert np.allclose(condensed, pinned, rtol=1e-12, atol=1e-8)


def test_rows_in_place_of_joints_give_the_same_matrices():
    rows = [(0, 0, 0), (1, 2, 3), (0, 0, 0), (1, 2, 3), (1, 2, 4), (5, 6, 7)]
    table = fc.JoinTable.from_rows(rows, columns="u v θz")
    by_joints, by_rows = (fc.assemble(s, FLEXIBLE) for s in (support_frame(), support_frame(joints=table)))
    assert by_rows.coordinates == by_joints.coordinates
    assert (by_rows.stiffness() != by_joints.stiffness()).nnz == 0
    assert (by_rows.mass() != by_joints.mass()).nnz == 0


def motor(node, against):
    return fc.RotaryDrive("motor", node, against, axis="z", stiffness=K_THETA, ratio=R, inertia=0.4)


def test_a_drive_between_elements_adds_eq_4_sign_for_sign():
    """Rows and columns θz4 (number 3), θz5 (number 4) and θd (number 8) of Table 3."""
    without = fc.assemble(support_frame(), FLEXIBLE)
    model = fc.assemble(support_frame(motor), FLEXIBLE)
    assert model.coordinates[-1] == "motor_source"
    added = model.stiffness().toarray()
    added[:7, :7] -= without.stiffness().toarray()
    expected = np.zeros((8, 8))
    expected[np.ix_([2, 3, 7], [2, 3, 7])] = K_THETA * np.array([[R**2, -(R**2), -R], [-(R**2), R**2, R], [-R, R, 1]])
    assert np.allclose(added, expected, rtol=0, atol=1e-10)
    mass = model.mass().toarray()
    mass[:7, :7] -= without.mass().toarray()
    assert np.array_equal(mass, np.diag([0, 0, 0, 0, 0, 0, 0, 0.4]))


def test_a_drive_table_of_rows_gives_the_same_matrices():
    rows = [(0, 0, 0), (1, 2, 3), (0, 0, 0), (1, 2, 3), (1, 2, 4), (5, 6, 7)]
    table = fc.JoinTable.from_rows(rows, columns="u v θz", drives=[(0, 0, 8)])
    by_joints = support_frame(motor)
    models = [fc.assemble(s, FLEXIBLE) for s in (by_joints, by_joints.with_(joints=table))]
    assert (models[0].stiffness() != models[1].stiffness()).nnz == 0
    assert (models[0].mass() != models[1].mass()).nnz == 0


def test_a_drive_to_ground_adds_eq_5_sign_for_sign():
    pivot = fc.Beam("pivot", (0, 0, 0), (1, 0, 0), E)
    plain = fc.planar(fc.Structure([pivot], [fc.Support(pivot.start, "u v")]))
    driven = plain.with_(drives=[fc.RotaryDrive("slew", pivot.start, axis="z", stiffness=K_THETA, ratio=R)])
    added = fc.assemble(driven, FLEXIBLE).stiffness().toarray()
    added[:4, :4] -= fc.assemble(plain, FLEXIBLE).stiffness().toarray()
    expected = np.zeros((5, 5))
    expected[np.ix_([0, 4], [0, 4])] = K_THETA * np.array([[R**2, -R], [-R, 1]])
    assert np.allclose(added, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("grounded", [True, False])
def test_a_wheel_drive_adds_the_same_with_the_ratio_over_the_radius(grounded):
    rail = fc.Beam("rail", (0, 0, 0), (1, 0, 0), E)
    carriage = fc.RigidBody("carriage", (1, 0, 0), 5.0, (1, 1, 1))
    plain = fc.Structure(
        [rail, carriage],
        [
            fc.Support(rail.start, "v w rx ry rz"),
            fc.Support(rail.end, "rx ry rz"),
            fc.Slide(rail.end, carriage.node, "x"),
        ],
    )
    against = None if grounded else rail.end
    wheel = fc.LinearDrive(
        "wheel", carriage.node, against, direction="x", radius=0.25, stiffness=K_THETA, ratio=R, inertia=0.1
    )
    model, without = (fc.assemble(s, FLEXIBLE) for s in (plain.with_(drives=[wheel]), plain))
    added = model.stiffness().toarray()
    added[:-1, :-1] -= without.stiffness().toarray()
    g = R / 0.25
    row = np.zeros(model.n)
    row[model.coordinate("carriage_0_u")] = g
    row[model.coordinate("wheel_source")] = -1.0
    if not grounded:
        row[model.coordinate("rail_1_u")] = -g
    assert np.allclose(added, K_THETA * np.outer(row, row), rtol=0, atol=1e-9)


def crane() -> fc.Structure:
    girder = fc.Beam("girder", (0, -3, 0), (0, 3, 0), E, elements=6)
    chain = [fc.Beam(f"link{i}", (0, 0, 1 - i), (0, 0, -i), E) for i in (1, 2, 3)]
    joints = [fc.Support(girder.start, "v w"), fc.Support(girder.end, "v w"), fc.Pin(girder.node(3), chain[0].start)]
    return fc.Structure([girder, *chain], joints + [fc.Pin(a.end, b.start) for a, b in pairwise(chain)])


def test_every_element_of_the_crane_is_added_at_its_numbers():
    """Dense assembly by the numbers of the join table alone, in three dimensions."""
    structure = crane()
    table, model = structure.join_table, fc.assemble(structure, FLEXIBLE)
    K, M = np.zeros((66, 66)), np.zeros((66, 66))
    first = 0
    for beam in structure.elements:
        for i in range(beam.elements):
            numbers = np.array(table.rows[first + i] + table.rows[first + i + 1])
            for whole, element in ((K, beam_stiffness(E, 1.0)), (M, beam_mass(E, 1.0))):
                np.add.at(whole, np.ix_(numbers, numbers), to_space(element, beam.axes))
        first += beam.elements + 1
    assert np.allclose(model.stiffness().toarray(), K[1:, 1:], rtol=0, atol=1e-9)
    assert np.allclose(model.mass().toarray(), M[1:, 1:], rtol=0, atol=1e-13)


def test_matrices_are_symmetric_to_the_last_bit():
    model = fc.assemble(crane(), FLEXIBLE)
    for matrix in (model.stiffness(), model.mass()):
        assert abs(matrix - matrix.T).max() == 0.0
        assert matrix.format == "csc"


def test_a_free_beam_keeps_its_six_rigid_motions():
    """Singular K is accepted: six zero eigenvalues, none more."""
    model = fc.assemble(fc.Structure([fc.Beam("b", (0, 0, 0), (1, 2, 2), E, elements=3)]), FLEXIBLE)
    values = np.linalg.eigvalsh(model.stiffness().toarray())
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-6 * values[-1]


def test_springs_and_ropes_add_k_n_n_transposed():
    spring = fc.Spring("spring", (0, 0, 0), (1, 2, 2), stiffness=90.0)
    rope = fc.Rope("rope", (1, 2, 2), (1, 2, 0), EA=60.0)
    load = fc.PointMass("load", (1, 2, 2), 3.0)
    joints = [
        fc.Support(spring.start),
        fc.Support(rope.end),
        fc.Pin(spring.end, load.node),
        fc.Pin(rope.start, load.node),
    ]
    model = fc.assemble(fc.Structure([spring, rope, load], joints), FLEXIBLE)
    n = np.array([1, 2, 2]) / 3
    assert np.allclose(model.stiffness().toarray(), 90 * np.outer(n, n) + np.diag([0, 0, 30.0]))
    assert np.allclose(model.mass().toarray(), 3 * np.eye(3))


def test_a_slack_rope_has_no_stiffness_at_rest():
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=60.0, length=1.2)
    load = fc.PointMass("load", (0, 0, -1), 3.0)
    structure = fc.Structure([rope, load], [fc.Support(rope.start), fc.Pin(rope.end, load.node)])
    assert abs(fc.assemble(structure, FLEXIBLE).stiffness()).max() == 0.0


def test_coordinates_are_named_after_the_first_node_that_has_them():
    model = fc.assemble(support_frame(motor), FLEXIBLE)
    assert model.coordinates == (
        "left_1_u",
        "left_1_v",
        "left_1_rz",
        "pendulum_0_rz",
        "pendulum_1_u",
        "pendulum_1_v",
        "pendulum_1_rz",
        "motor_source",
    )
