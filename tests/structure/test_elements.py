"""Parts: where their nodes are, how their axes lie, and what they refuse."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

SECTION = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.0, rhoJ=1e-4)


def test_nodes_of_a_beam_are_evenly_spaced():
    beam = fc.Beam("girder", (0, -3, 0), (0, 3, 0), SECTION, elements=6)
    assert [n.position for n in beam.nodes] == [(0, y, 0) for y in range(-3, 4)]
    assert beam.node(0) == beam.start
    assert beam.node(6) == beam.node(-1) == beam.end
    assert beam.node(np.int64(2)) == beam.node(-5)
    assert beam.length == 6.0


@pytest.mark.parametrize(
    ("end", "up", "axes"),
    [
        ((1, 0, 0), None, [[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        ((0, 1, 0), None, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        ((0, 0, 1), None, [[0, 0, 1], [0, -1, 0], [1, 0, 0]]),
        ((0, 0, -1), None, [[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
        ((2, 0, 0), "y", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
        ((2, 0, 0), (5, 1, 0), [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    ],
)
def test_local_axes(end, up, axes):
    """x along the beam, z the part of ``up`` across it (default: global z, for beams along z global x)."""
    assert np.allclose(fc.Beam("b", (0, 0, 0), end, SECTION, up=up).axes.T, axes)


@pytest.mark.parametrize("seed", range(5))
def test_local_axes_are_right_handed_and_orthonormal(seed):
    rng = np.random.default_rng(seed)
    axes = fc.Beam("b", rng.normal(size=3), rng.normal(size=3), SECTION, up=rng.normal(size=3)).axes
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_part_may_start_at_a_node_of_another():
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 2), SECTION)
    jib = fc.Beam("jib", mast.end, (1, 0, 2), SECTION)
    assert jib.start == fc.Node("jib", 0, (0.0, 0.0, 2.0))
    assert fc.PointMass("load", jib.end, 1.0).at == jib.end.position


def test_ropes_have_displacements_only():
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=4e3, length=1.9)
    assert rope.start.freedoms == frozenset({0, 1, 2})
    assert rope.stiffness == pytest.approx(4e3 / 1.9)
    assert fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=4e3).length == 2.0


def test_points_of_a_body_come_after_its_centre_in_order():
    body = fc.RigidBody("hook", (0, 0, 0), 2.0, (1, 1, 1), {"eye": (0, 0, 1), "tip": (0, 0, -1)})
    assert body.nodes == (body.node, body.point("eye"), body.point("tip"))
    assert body.point("tip") == fc.Node("hook", 2, (0.0, 0.0, -1.0))


def test_inertia_may_be_a_diagonal_or_a_tensor():
    diagonal = fc.RigidBody("b", (0, 0, 0), 1.0, (1, 2, 2.5)).inertia
    assert diagonal == fc.RigidBody("b", (0, 0, 0), 1.0, np.diag([1, 2, 2.5])).inertia
    assert diagonal == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))


def test_a_rod_and_a_plate_are_just_possible():
    fc.RigidBody("rod", (0, 0, 0), 1.0, (0, 1, 1))
    fc.RigidBody("plate", (0, 0, 0), 1.0, (1, 1, 2))


def test_parts_and_structures_can_be_pickled():
    """Studies send structures to other processes."""
    body = fc.RigidBody("hook", (1, 0, 0), 2.0, (1, 1, 1), {"eye": (1, 0, 0)})
    beam = fc.Beam("b", (0, 0, 0), (1, 0, 0), SECTION, up="y")
    structure = fc.Structure([beam, body], [fc.Support(beam.start), fc.Hinge(beam.end, body.point("eye"), "y")])
    assert pickle.loads(pickle.dumps(structure)) == structure


def beam(**change):
    good = {"name": "b", "start": (0, 0, 0), "end": (1, 0, 0), "section": SECTION}
    return fc.Beam(**(good | change))


def body(**change):
    good = {"name": "hook", "at": (0, 0, 0), "mass": 1.0, "inertia": (1, 1, 1)}
    return fc.RigidBody(**(good | change))


def rope(**change):
    return fc.Rope(**({"name": "r", "start": (0, 0, 0), "end": (1, 0, 0), "EA": 1.0} | change))


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, "5", True, None, [1.0], 1j, 10**400])
def test_numbers_must_be_numbers(value):
    if value is not None:
        with pytest.raises(StructureError, match="Rope 'r': length = "):
            rope(length=value)
    for make, name in (
        (lambda: rope(EA=value), "Rope 'r': EA = "),
        (lambda: rope(damping=value), "Rope 'r': damping = "),
        (lambda: fc.Spring("s", (0, 0, 0), (1, 0, 0), stiffness=value), "Spring 's': stiffness = "),
        (lambda: fc.PointMass("m", (0, 0, 0), value), "PointMass 'm': mass = "),
        (lambda: body(mass=value), "RigidBody 'hook': mass = "),
    ):
        with pytest.raises(StructureError, match=name):
            make()


@pytest.mark.parametrize(
    "place", [(0, 0), (0, 0, 0, 0), "123", ("1", "2", "3"), 5, None, (0, 0, math.nan), (0, 0, math.inf), np.eye(3)]
)
def test_places_are_three_finite_numbers(place):
    for make in (
        lambda: beam(start=place),
        lambda: rope(end=place),
        lambda: body(at=place),
        lambda: body(points={"eye": place}),
        lambda: fc.PointMass("m", place, 1.0),
    ):
        with pytest.raises(StructureError, match=r"expected three finite numbers \(x, y, z\)"):
            make()


@pytest.mark.parametrize("name", ["", "a b", "a.b", "1a", "ä", "a\n", None, 5, ("a",)])
def test_names_are_identifiers(name):
    for make in (lambda: beam(name=name), lambda: body(name=name), lambda: body(points={name: (0, 0, 0)})):
        with pytest.raises(StructureError, match="expected ASCII letters, digits and underscores"):
            make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: beam(end=(0, 0, 0)), r"Beam 'b': start .* and end .* coincide; a part needs a length > 0"),
        (lambda: beam(end=(1e-14, 0, 0)), "coincide"),
        (lambda: rope(end=(0, 0, 0)), "Rope 'r': start .* coincide"),
        (lambda: fc.Spring("s", (1, 1, 1), (1, 1, 1), 5.0), "Spring 's': start .* coincide"),
        (lambda: beam(section=5), "Beam 'b': section = 5; expected a flexctrl.Section"),
        (lambda: beam(elements=0), "Beam 'b': elements = 0; expected a whole number from 1"),
        (lambda: beam(elements=2.0), "elements = 2.0"),
        (lambda: beam(elements=True), "elements = True"),
        (lambda: beam(elements=10**9), "elements = 1000000000; expected a whole number from 1 to 1000000"),
        (lambda: beam(up="x"), "up = 'x' points along the beam; choose a direction across it"),
        (lambda: beam(up=(-2, 0, 0)), "points along the beam"),
        (lambda: beam(up="--z"), "no direction '--z'; give x, y, z"),
        (lambda: beam(up=(0, 0, 0)), "has no length"),
        (lambda: beam().node(2), "Beam 'b' has nodes 0…1; there is no node 2"),
        (lambda: beam().node(-3), "there is no node -3"),
        (lambda: beam().node("1"), "there is no node '1'"),
        (lambda: beam().node(1.0), "there is no node 1.0"),
        (lambda: body(points={"eye": (0, 0, 0)}).point("eyes"), "no point 'eyes'; did you mean 'eye'"),
        (lambda: body().point(3), "no point 3"),
        (
            lambda: fc.RigidBody("hook", (0, 0, 0), 1.0, (1, 1, 1)).point("b"),
            r"no point 'b'; it has none: give it points=",
        ),
        (lambda: body(points=[("eye", (0, 0, 0))]), "points = .*expected a mapping"),
        (lambda: body(inertia=(1, 1, 5)), "belong to no body"),
        (lambda: body(inertia=(1, 1, -1)), "belong to no body"),
        (lambda: body(inertia=[[1, 2], [3]]), "expected 3 moments or a symmetric 3 × 3 tensor"),
        (lambda: body(inertia="abc"), "expected 3 moments"),
        (lambda: body(inertia=(1, 1, math.nan)), "expected 3 moments"),
        (lambda: body(inertia=(True, 1, 1)), "expected 3 moments"),
        (lambda: body(inertia=np.array([[1, 5, 0], [0, 1, 0], [0, 0, 1]]) * 1e-9), "expected 3 moments"),
    ],
)
def test_impossible_parts_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()
