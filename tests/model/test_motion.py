"""How nodes move with the degrees of freedom: geometry of slides, hinges, points and lines after large motion."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc

E = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.5, rhoJ=0.02)
RIGID = [fc.LargeRotation()]


def assembled(structure: fc.Structure, effects=RIGID) -> fc.Model:
    return fc.assemble(structure, effects, fc.CasadiVM())


def turned(model: fc.Model, steps: list[dict[str, float]]) -> fc.State:
    state = model.rest
    for step in steps:
        d = np.zeros(model.n)
        for name, value in step.items():
            d[model.coordinate(name)] = value
        state = model.advance(state, d, np.zeros(model.n), 0.0)
    return state


def test_points_of_a_body_ride_on_it():
    points = {"a": (1, 0, 0), "b": (0, 2, 1)}
    model = assembled(fc.Structure([fc.RigidBody("body", (0.5, 0, 0), 1.0, (1, 1, 1), points)]))
    theta = np.array([0.4, -1.1, 0.7])
    names = {n.rsplit("_", 1)[1]: n for n in model.coordinates}
    state = turned(model, [dict(zip((names["rx"], names["ry"], names["rz"]), theta, strict=True)), {names["u"]: 0.3}])
    Q = Rotation.from_rotvec(theta).as_matrix()
    for i, point in enumerate(points.values(), 1):
        assert np.allclose(state.x[i] - state.x[0], Q @ (np.array(point) - [0.5, 0, 0]), atol=1e-14)
        assert np.allclose(state.R[i], Q, atol=1e-14)


def slide(along) -> fc.Model:
    """A body that turns about z at the origin, and a carriage that slides on it."""
    table = fc.RigidBody("table", (0, 0, 0), 5.0, (1, 1, 1), {"edge": (1, 0, 0)})
    carriage = fc.RigidBody("carriage", (1, 0, 0), 1.0, (1, 1, 1))
    joints = [fc.Support(table.node, "u v w rx ry"), fc.Slide(table.point("edge"), carriage.node, along)]
    return assembled(fc.Structure([table, carriage], joints))


@pytest.mark.parametrize("along", [(1, 0, 0), (3, 4, 0), (0, 1, 1)])
def test_a_carriage_slides_along_its_rail_wherever_that_points(along):
    model = slide(along)
    assert model.coordinates == ("table_0_rz", "carriage_0_slide")
    state = turned(model, [{"table_0_rz": 0.6}, {"table_0_rz": 0.9}, {"carriage_0_slide": 0.5}])
    Q = state.R[1]
    assert np.allclose(Q, Rotation.from_rotvec([0, 0, 1.5]).as_matrix(), atol=1e-13)
    off = Q.T @ (state.x[2] - state.x[1])
    unit = np.array(along) / np.linalg.norm(along)
    assert np.linalg.norm(np.cross(off, unit)) < 1e-13
    assert np.allclose(state.R[2], Q, atol=1e-13)


def test_a_slide_through_the_pivot_keeps_its_stretch_while_it_turns():
    """The rail's edge moves square to a rail through the pivot: nothing of it along the rail, to each step's square."""
    model = slide((1, 0, 0))
    state = turned(model, [{"carriage_0_slide": 0.5}, *[{"table_0_rz": 0.01}] * 100])
    assert np.linalg.norm(state.x[2] - state.x[1]) == pytest.approx(0.5, abs=1e-10)


def test_a_hinge_about_a_skew_axis_turns_one_body_about_it():
    base = fc.RigidBody("base", (0, 0, 0), 5.0, (1, 1, 1))
    flap = fc.RigidBody("flap", (1, 0, 0), 1.0, (1, 1, 1), {"root": (0, 0, 0)})
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    model = assembled(fc.Structure([base, flap], [fc.Hinge(base.node, flap.point("root"), axis)]))
    theta = np.array([0.3, 0.5, -0.9])
    base_turn = dict(zip(("base_0_rx", "base_0_ry", "base_0_rz"), theta, strict=True))
    state = turned(model, [{"flap_1_turn": 0.8}, base_turn])
    Q = state.R[0].T @ state.R[2]
    assert np.allclose(Q @ axis, axis, atol=1e-14)
    angle = Rotation.from_matrix(Q).as_rotvec() @ axis
    # the flap's own freedom is its absolute turn: the base's turn about the axis is taken off again
    assert angle == pytest.approx(0.8 - theta @ axis, abs=1e-13)


@pytest.mark.parametrize("effects", [RIGID, [*RIGID, fc.BeamFlexibility()]], ids=["rigid", "flexible"])
def test_a_chain_of_hinges_passes_motion_on(effects):
    """Followers of followers: three links, each axis riding on the link before."""
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]
    links = [fc.Beam(f"link{i}", a, b, E) for i, (a, b) in enumerate(pairwise(points))]
    joints = [fc.Support(links[0].start, "u v w rx ry")]
    joints += [fc.Hinge(links[0].end, links[1].start, "y"), fc.Hinge(links[1].end, links[2].start, "x")]
    model = assembled(fc.Structure(links, joints), effects)
    state = model.displace(0.4 * np.random.default_rng(3).normal(size=model.n))
    for master, node, axis in ((1, 2, [0, 1, 0]), (3, 4, [1, 0, 0])):
        Q = state.R[master].T @ state.R[node]
        assert np.allclose(Q @ axis, axis, atol=1e-13)
        assert np.allclose(state.x[master], state.x[node], atol=1e-14)


def test_rotations_stay_rotations_over_many_steps():
    model = slide((1, 0, 0))
    state = turned(model, [{"table_0_rz": 0.7, "carriage_0_slide": 0.0}] * 2000)
    assert np.allclose(np.swapaxes(state.R, 1, 2) @ state.R, np.eye(3), atol=1e-14)
    assert np.allclose(state.R[2], Rotation.from_rotvec([0, 0, 1400.0]).as_matrix(), atol=1e-10)


def test_the_ground_never_moves():
    model = slide((1, 0, 0))
    state = turned(model, [{"table_0_rz": 0.7, "carriage_0_slide": 0.4}])
    assert not state.x[-1].any()
    assert np.array_equal(state.R[-1], np.eye(3))


def test_a_plain_machine_needs_no_followers():
    """The paper's crane: T is a selection, every entry 0 or 1."""
    girder = fc.Beam("girder", (0, -3, 0), (0, 3, 0), E, elements=6)
    link = fc.Beam("link", (0, 0, 0), (0, 0, -1), E)
    joints = [fc.Support(girder.start, "v w"), fc.Support(girder.end, "v w"), fc.Pin(girder.node(3), link.start)]
    model = assembled(fc.Structure([girder, link], joints), [*RIGID, fc.Flexible()])
    assert model.motion.plain
    T = model.motion.jacobian(model.displace(0.3 * np.ones(model.n)))
    assert set(np.unique(T.data)) == {1.0}
    assert T.sum(axis=1).max() == 1.0


@pytest.mark.parametrize("end", [(0, 0, -1), (0, 0, 1), (-1, 0, 0), (0.2, -0.9, 0.1)])
def test_freedoms_of_a_rigid_line_turn_about_the_axes_they_are_named_after(end):
    rope = fc.Rope("rope", (0, 0, 0), end, EA=1.0)
    load = fc.PointMass("load", end, 1.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node)]
    model = fc.assemble(fc.Structure([rope, load], joints), [fc.LargeRotation()], fc.CasadiVM())
    for name in model.coordinates:
        turned = model.displace({name: 1e-3}).R[0]
        axial = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        assert axial[("rx", "ry", "rz").index(name[-2:])] > 0.9e-3
