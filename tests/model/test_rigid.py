"""Rigid twins: the same machine with fewer freedoms, against closed forms of rigid-body mechanics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

E = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.5, rhoJ=0.02)
G = 9.81
WEIGHT = [fc.Gravity(), fc.LargeRotation()]


def rigid(structure: fc.Structure) -> fc.Model:
    return fc.assemble(structure, WEIGHT, fc.CasadiVM())


def mass(model: fc.Model, state: fc.State) -> np.ndarray:
    still = np.zeros(model.n)
    return -model.slope(state, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs))).toarray()


def stiffness(model: fc.Model, state: fc.State) -> np.ndarray:
    still = np.zeros(model.n)
    return -model.slope(state, still, still, (1.0, 0.0, 0.0), np.zeros(len(model.inputs))).toarray()


def frequencies(model: fc.Model) -> np.ndarray:
    values = np.linalg.eigvals(np.linalg.solve(mass(model, model.rest), stiffness(model, model.rest)))
    return np.sqrt(np.sort(values.real))


def crane() -> fc.Structure:
    girder = fc.Beam("girder", (0, -3, 0), (0, 3, 0), E, elements=6)
    chain = [fc.Beam(f"link{i}", (0, 0, 1 - i), (0, 0, -i), E) for i in (1, 2, 3)]
    joints = [fc.Support(girder.start, "v w"), fc.Support(girder.end, "v w"), fc.Pin(girder.node(3), chain[0].start)]
    return fc.Structure([girder, *chain], joints + [fc.Pin(a.end, b.start) for a, b in pairwise(chain)])


def driven_arm() -> fc.Structure:
    """Base on wheels, a link on a skew hinge with its motor, a load pinned to it, all in space."""
    base = fc.RigidBody("base", (0, 0, 0), 8.0, (1, 1.2, 1.5), {"top": (0.1, 0, 0.3)})
    link = fc.Beam("link", (0.1, 0, 0.3), (0.7, 0.4, 1.0), E, elements=2)
    load = fc.PointMass("load", link.end, 2.0)
    joints = [fc.Support(base.node, "w rx ry"), fc.Hinge(base.point("top"), link.start, (1, 1, 1))]
    drives = [
        fc.RotaryDrive("elbow", link.start, base.point("top"), axis=(1, 1, 1), stiffness=9.0, ratio=20, inertia=0.01),
        fc.LinearDrive("travel", base.node, direction="x", radius=0.1, stiffness=9.0, ratio=5, inertia=0.02),
    ]
    return fc.Structure([base, link, load], [*joints, fc.Pin(link.end, load.node)], drives)


@pytest.mark.parametrize("structure", [crane(), driven_arm()], ids=["crane", "arm"])
def test_the_twins_mass_is_the_flexible_one_on_its_motion(structure):
    """M_rigid = Sᵀ M_flexible S: the motion of the twin, T_rigid = T_flexible S, is one of the flexible machine."""
    flexible = fc.assemble(structure, [*WEIGHT, fc.Flexible()], fc.CasadiVM())
    twin = fc.rigid(flexible)
    whole, part = (m.motion.jacobian(m.rest).toarray() for m in (flexible, twin))
    S = np.linalg.lstsq(whole, part, rcond=None)[0]
    assert np.allclose(whole @ S, part, rtol=0, atol=1e-12)
    expected = S.T @ flexible.mass() @ S
    assert np.allclose(twin.mass().toarray(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert np.allclose(mass(twin, twin.rest), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_the_rigid_ceiling_crane():
    """The girder keeps its travel and two turns, each link of the chain three."""
    twin = rigid(crane())
    chain = [f"link{i}_0_{r}" for i in (1, 2, 3) for r in ("rx", "ry", "rz")]
    assert len(twin.coordinates) == 12
    assert set(chain) < set(twin.coordinates)
    assert "girder_0_u" in twin.coordinates
    assert any("v of node 6 of girder" in note for note in twin.notes)
    push = np.zeros(twin.n)
    push[twin.coordinate("girder_0_u")] = 1.0
    assert push @ twin.mass() @ push == pytest.approx(9 * E.rhoA)


def test_without_what_bends_a_model_is_its_own_twin():
    assert fc.rigid([fc.Gravity(), fc.Flexible(), fc.LargeRotation()]) == (fc.Gravity(), fc.LargeRotation())
    twin = rigid(crane())
    assert fc.rigid(twin).coordinates == twin.coordinates


def test_a_motor_behind_a_rigid_shaft_is_reflected_by_its_ratio_squared():
    """M = J + R² J_m about a hinge, m + (R/r)² J_m along a rail."""
    drum = fc.RigidBody("drum", (0, 0, 0), 5.0, (1, 1, 1.7))
    slew = fc.RotaryDrive("slew", drum.node, axis="z", stiffness=1.0, ratio=-30, inertia=0.02)
    M = rigid(fc.Structure([drum], [fc.Support(drum.node, "u v w rx ry")], [slew])).mass().toarray()
    assert np.allclose(M, [[1.7 + 30**2 * 0.02]])
    travel = fc.LinearDrive("travel", drum.node, direction="x", stiffness=1.0, ratio=30, radius=0.5, inertia=0.02)
    M = rigid(fc.Structure([drum], [fc.Support(drum.node, "v w rx ry rz")], [travel])).mass().toarray()
    assert np.allclose(M, [[5.0 + 60**2 * 0.02]])


def hanging(lengths, masses) -> fc.Structure:
    """Point masses one under the other on ropes."""
    elements, joints, top, above = [], [], (0.0, 0.0, 0.0), None
    for i, (length, m) in enumerate(zip(lengths, masses, strict=True)):
        rope = fc.Rope(f"rope{i}", top, (0, 0, top[2] - length), EA=1e5)
        load = fc.PointMass(f"load{i}", rope.end, m)
        joints += [fc.Support(rope.start) if above is None else fc.Pin(above, rope.start), fc.Pin(rope.end, load.node)]
        elements, top, above = [*elements, rope, load], rope.end.position, load.node
    return fc.Structure(elements, joints)


def test_a_load_on_a_rigid_rope_is_a_spherical_pendulum():
    model = rigid(hanging([2.5], [3.0]))
    assert model.n == 2
    assert frequencies(model) == pytest.approx(np.sqrt(G / 2.5) * np.ones(2), rel=1e-12)


def test_a_rope_may_be_drawn_from_its_load_upwards():
    load = fc.PointMass("load", (0, 0, -2.5), 3.0)
    rope = fc.Rope("rope", load.node, (0, 0, 0), EA=1e5)
    model = rigid(fc.Structure([rope, load], [fc.Support(rope.end), fc.Pin(rope.start, load.node)]))
    assert frequencies(model) == pytest.approx(np.sqrt(G / 2.5) * np.ones(2), rel=1e-12)


@pytest.mark.parametrize(
    ("l1", "l2", "ratio", "omega1", "omega2"),
    [
        (1, 1, 1, 2.39719940, 5.78735130),
        (2, 1, 0.5, 1.99799401, 4.25211947),
        (6, 2, 10, 1.11709286, 8.40785963),
        (20, 4, 50, 0.64021032, 12.23450574),
    ],
)
def test_hook_and_payload_swing_as_singhoses_double_pendulum(l1, l2, ratio, omega1, omega2):
    """ω² of the double-pendulum crane (Singhose), ratio = payload/hook; each twice, in both planes."""
    model = rigid(hanging([l1, l2], [1.0, ratio]))
    assert frequencies(model) == pytest.approx([omega1, omega1, omega2, omega2], rel=2e-8)


def test_a_rope_rigid_and_far_from_hanging_keeps_its_length_and_direction():
    model = rigid(hanging([2.0, 1.0], [1.0, 4.0]))
    state = model.displace(np.array([1.0, -0.7, 2.0, 0.4]))
    for part in ("rope0", "rope1"):
        rope = model.structure.part(part)
        a, b = (model.structure.number(n) for n in (rope.start, rope.end))
        d = state.x[b] - state.x[a]
        assert np.linalg.norm(d) == pytest.approx(rope.length, rel=1e-14)
        assert np.allclose(state.R[a] @ [0, 0, -1], d / rope.length, atol=1e-14)


def hinged_chain(links: int, length: float, axis: str = "y") -> fc.Structure:
    """Rods hanging one under the other, each hinged to the one above."""
    rods = [fc.Beam(f"rod{i}", (0, 0, -i * length), (0, 0, -(i + 1) * length), E) for i in range(links)]
    top = fc.Support(rods[0].start, "u v w rx rz")
    return fc.Structure(rods, [top, *(fc.Hinge(a.end, b.start, axis) for a, b in pairwise(rods))])


@pytest.mark.parametrize("seed", range(3))
def test_a_chain_of_hinged_rods_has_the_mass_matrix_of_the_textbook(seed):
    """Absolute angles θ: M_ij = m l² (n − max(i, j) − ½) cos(θ_i − θ_j), M_ii = m l² (n − i − ⅔), i from 0."""
    n, length = 4, 0.8
    model = rigid(hinged_chain(n, length))
    assert model.n == n
    theta = np.random.default_rng(seed).uniform(-2.0, 2.0, n)
    state = model.displace(theta)
    m, i = E.rhoA * length, np.arange(n)
    below = n - np.maximum.outer(i, i) - 0.5
    M = m * length**2 * (below * np.cos(np.subtract.outer(theta, theta)) - np.eye(n) / 6)
    assert np.allclose(mass(model, state), M, rtol=0, atol=1e-12)
    weight = -m * G * length * (n - i - 0.5) * np.sin(theta)
    still = np.zeros(n)
    assert np.allclose(model.balance(state, still, still), weight, rtol=0, atol=1e-10)


def test_a_chain_of_hinged_rods_feels_the_speed_of_its_links():
    """Centrifugal terms: − m l² (n − max(i, j) − ½) sin(θ_i − θ_j) θ̇_j²."""
    n, length = 3, 0.8
    model = rigid(hinged_chain(n, length))
    rng = np.random.default_rng(7)
    theta, speed = rng.uniform(-2.0, 2.0, n), rng.normal(size=n)
    state, still, i = model.displace(theta), np.zeros(n), np.arange(n)
    below = n - np.maximum.outer(i, i) - 0.5
    expected = -E.rhoA * length**3 * (below * np.sin(np.subtract.outer(theta, theta))) @ speed**2
    found = model.balance(state, speed, still) - model.balance(state, still, still)
    assert np.allclose(found, expected, rtol=0, atol=1e-12)


def test_rods_on_turned_hinges_leave_the_plane():
    """The second hinge turns with the first rod: both axes square to each other, a universal joint."""
    rods = [fc.Beam(f"rod{i}", (0, 0, -i), (0, 0, -(i + 1)), E) for i in range(2)]
    joints = [fc.Support(rods[0].start, "u v w rx rz"), fc.Hinge(rods[0].end, rods[1].start, "x")]
    model = rigid(fc.Structure(rods, joints))
    state = model.displace({"rod0_0_ry": np.pi / 2, "rod1_0_turn": 0.0})
    state = model.advance(state, np.array([0.0, 0.5]), np.zeros(2), 0.0)
    lower = state.x[3] - state.x[2]
    # the axis, x at rest, points along −z now; the rod hung along −x
    assert np.allclose(lower, [-np.cos(0.5), np.sin(0.5), 0.0], atol=1e-14)


def parallelogram() -> fc.Structure:
    """Two equal upright cranks and the coupler between them."""
    left, right = (fc.Beam(n, (x, 0, 0), (x, 0, 1.2), E) for n, x in (("left", 0), ("right", 2)))
    coupler = fc.Beam("coupler", left.end, right.end, E, elements=2)
    joints = [fc.Support(b.start, "u v w rx rz") for b in (left, right)]
    joints += [fc.Hinge(left.end, coupler.start, "y"), fc.Hinge(right.end, coupler.end, "y")]
    return fc.Structure([left, right, coupler], joints)


def test_a_parallelogram_of_rigid_bars_has_one_freedom():
    """M = 2 m_c l²/3 + m l², the coupler does not turn; Q = g (m_c + m) l sin θ."""
    model = rigid(parallelogram())
    assert model.n == 1
    l, crank, coupler = 1.2, 1.2 * E.rhoA, 2.0 * E.rhoA
    state = model.rest
    for _ in range(8):
        state = model.advance(state, np.array([0.1]), np.zeros(1), 0.0)
        ends = state.x[[1, 3]] - state.x[[0, 2]]
        angle = np.arctan2(ends[:, 0], ends[:, 2])
        assert angle[0] == pytest.approx(angle[1], abs=1e-13)
        assert np.allclose(state.R[4], np.eye(3), atol=1e-13)
    assert abs(angle[0]) == pytest.approx(0.8, abs=1e-12)
    assert mass(model, state)[0, 0] == pytest.approx(2 * crank * l**2 / 3 + coupler * l**2)
    force = model.balance(state, np.zeros(1), np.zeros(1))[0]
    assert abs(force) == pytest.approx(G * (crank + coupler) * l * np.sin(0.8))


def test_a_slider_crank_moves_its_slider_by_the_textbook():
    """x = r cos φ + √(l² − r² sin² φ)."""
    r, l = 0.3, 0.8
    crank = fc.Beam("crank", (0, 0, 0), (0, 0, r), E)
    rod = fc.Beam("rod", crank.end, (np.sqrt(l**2 - r**2), 0, 0), E)
    slider = fc.PointMass("slider", rod.end, 2.0)
    joints = [fc.Support(crank.start, "u v w rx rz"), fc.Hinge(crank.end, rod.start, "y"), fc.Pin(rod.end, slider.node)]
    model = rigid(fc.Structure([crank, rod, slider], [*joints, fc.Support(slider.node, "v w")]))
    assert model.n == 1
    state = model.rest
    for _ in range(10):
        state = model.advance(state, np.array([0.05]), np.zeros(1), 0.0)
        pin = state.x[1]
        assert np.hypot(pin[0], pin[2]) == pytest.approx(r, abs=1e-13)
        assert state.x[3, 0] == pytest.approx(pin[0] + np.sqrt(l**2 - pin[2] ** 2), abs=1e-12)
        assert state.x[3, 2] == pytest.approx(0.0, abs=1e-13)


def frame(skew: float) -> tuple[fc.Beam, fc.Beam, fc.Beam]:
    left = fc.Beam("left", (0, 0, 0), (0, 0, 2), E)
    girder = fc.Beam("girder", (0, 0, 2), (3, skew, 2), E, elements=2)
    right = fc.Beam("right", (3, skew, 2), (3, skew, 0), E)
    return left, girder, right


@pytest.mark.parametrize(("held", "free"), [("all", 0), ("u v w", 1)])
@pytest.mark.parametrize("skew", [0.0, 1.0])
def test_a_rigid_portal_frame_stands_still_or_turns_about_its_feet(held, free, skew):
    left, girder, right = frame(skew)
    joints = [fc.Support(left.start, held), fc.Support(right.end, held)]
    joints += [fc.Weld(left.end, girder.start), fc.Weld(girder.end, right.start)]
    model = rigid(fc.Structure([left, girder, right], joints))
    assert model.n == free
    if free:
        d = np.array([3.0, skew, 0.0]) / np.hypot(3.0, skew)
        state = model.displace(np.array([0.3]))
        left_top, right_foot = state.x[1], state.x[6]
        assert np.allclose(right_foot, [3, skew, 0], atol=1e-13)
        assert left_top @ d == pytest.approx(0.0, abs=1e-13)
        assert np.linalg.norm(left_top) == pytest.approx(2.0)
        assert left_top[2] < 1.99


def test_a_rigid_truss_of_pinned_bars_does_not_move():
    a, b, c = (0, 0, 0), (1, 0, 0), (0.4, 0.9, 0)
    bars = [fc.Beam("ab", a, b, E), fc.Beam("ac", a, c, E), fc.Beam("cb", c, b, E)]
    joints = [fc.Support(bars[0].start, "u v"), fc.Support(bars[0].end, "v")]
    joints += [
        fc.Pin(bars[0].start, bars[1].start),
        fc.Pin(bars[1].end, bars[2].start),
        fc.Pin(bars[2].end, bars[0].end),
    ]
    model = rigid(fc.planar(fc.Structure(bars, joints)))
    assert model.n == 0
    assert model.mass().shape == model.stiffness().shape == (0, 0)


def test_a_trolley_on_four_wheels_travels_and_turns():
    wheels = {"a": (1, 0.6, -0.2), "b": (1, -0.6, -0.2), "c": (-1, 0.6, -0.2), "d": (-1, -0.6, -0.2)}
    trolley = fc.RigidBody("trolley", (0.2, 0.1, 0.3), 10.0, (1, 1, 1.5), wheels)
    model = rigid(fc.Structure([trolley], [fc.Support(trolley.point(w), "w") for w in wheels]))
    assert model.n == 3
    state = model.displace(np.array([0.4, -0.3, 0.8]))
    assert np.allclose(state.x[1:5, 2], -0.2, atol=1e-13)
    rails = fc.Structure([trolley], [fc.Support(trolley.point(w), "v w") for w in wheels])
    assert rigid(rails).n == 1
    assert rigid(rails).mass().toarray() == pytest.approx(np.array([[10.0]]))


def test_rigid_parts_of_a_machine_tied_by_numbers_are_refused():
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), E)
    structure = fc.Structure([beam], fc.JoinTable.from_rows([(0,) * 6, (1, 2, 3, 4, 5, 6)]))
    with pytest.raises(StructureError, match="tied by a join table of numbers; rigid parts need joints to ride on"):
        rigid(structure)


def test_a_hinge_works_whichever_side_is_named_first():
    """Only the sign and the place of the free angle may differ."""
    arm = fc.RigidBody("arm", (1, 0, 0), 2.0, (1, 1, 1), {"pivot": (0, 0, 0)})
    post = fc.Beam("post", (0, 0, -1), (0, 0, 0), E)
    models = []
    for ends in ((post.end, arm.point("pivot")), (arm.point("pivot"), post.end)):
        joints = [fc.Support(post.start, "u v w rx ry"), fc.Hinge(*ends, (1, 2, 0.5))]
        models.append(rigid(fc.Structure([post, arm], joints)))
    first, second = (np.sort(np.linalg.eigvalsh(m.mass().toarray())) for m in models)
    assert len(first) == 2
    assert np.allclose(first, second)


def test_a_stiff_coupler_between_soft_cranks_is_no_loop():
    left, right = (fc.Beam(n, (x, 0, 0), (x, 0, 1), E) for n, x in (("left", 0), ("right", 2)))
    coupler = fc.RigidBody("coupler", (1, 0, 1), 3.0, (0.1, 1, 1), {"l": (0, 0, 1), "r": (2, 0, 1)})
    joints = [fc.Support(b.start, "u v w rx rz") for b in (left, right)]
    joints += [fc.Hinge(left.end, coupler.point("l"), "y"), fc.Hinge(right.end, coupler.point("r"), "y")]
    model = fc.assemble(fc.Structure([left, right, coupler], joints), [*WEIGHT, fc.BeamFlexibility()], fc.CasadiVM())
    # cranks: 1 + 1 at the feet; left tip 6; coupler's angle; right tip follows the coupler in place, and turns on it
    assert model.n == 2 + 6 + 1 + 1
    assert model.notes == ()
