"""What a structure checks when it is made: each error names the part and the remedy."""

from __future__ import annotations

import dataclasses

import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

SECTION = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.0, rhoJ=1e-4)
A = fc.Beam("a", (0, 0, 0), (1, 0, 0), SECTION)
B = fc.Beam("b", (1, 0, 0), (2, 0, 0), SECTION, elements=2)
RING = fc.BeamChain("ring", [(0, 0, 0), (1, 0, 0), (1, 1, 0)], SECTION)
ROPE = fc.Rope("rope", (1, 0, 0), (1, 0, -1), EA=1e3)
LOAD = fc.PointMass("load", (1, 0, -1), 5.0)
BODY = fc.RigidBody("body", (1, 0, 0.5), 5.0, (1, 1, 1), {"foot": (1, 0, 0), "head": (1, 0, 1)})
CLAMP = fc.Support(A.start)


def motor(node, against=None, axis="x"):
    return fc.RotaryDrive("motor", node, against, axis=axis, stiffness=1.0)


def mover(node, against=None, direction="x"):
    return fc.LinearDrive("mover", node, against, direction=direction, radius=0.1, stiffness=1.0)


def test_nodes_are_numbered_in_the_order_of_the_parts():
    s = fc.Structure([A, B], [fc.Weld(A.end, B.start)])
    assert s.nodes == (*A.nodes, *B.nodes)
    assert [s.number(n) for n in B.nodes] == [2, 3, 4]


def test_parts_and_drives_are_found_by_name():
    drive = motor(B.end)
    s = fc.Structure([A, B], [fc.Weld(A.end, B.start)], [drive])
    assert s.part("b") is B
    assert s.part("motor") is drive


def test_with_keeps_what_is_left_out():
    s = fc.Structure([A, B], [CLAMP, fc.Weld(A.end, B.start)], inputs=[fc.Force("push", B.end, "x")], name="arm")
    changed = s.with_(name="other", inputs=[])
    assert (changed.elements, changed.joints, changed.inputs, changed.name) == (s.elements, s.joints, (), "other")
    assert s.with_() == s


def test_a_structure_need_not_be_supported_and_may_hang_on_the_ground_in_pieces():
    fc.Structure([A])
    fc.Structure([A, LOAD], [CLAMP, fc.Support(LOAD.node, "v w")])


def test_several_supports_at_a_node_add_up():
    table = fc.Structure([A], [fc.Support(A.start, "u v"), fc.Support(A.start, "v w")]).join_table
    assert table.rows[0] == (0, 0, 0, 1, 2, 3)


def test_ropes_and_point_masses_may_be_pinned_or_welded_to_each_other():
    for joint in (fc.Pin, fc.Weld):
        table = fc.Structure([ROPE, LOAD], [fc.Support(ROPE.start), joint(ROPE.end, LOAD.node)]).join_table
        assert table.rows == ((0,) * 6, (1, 2, 3, 0, 0, 0), (1, 2, 3, 0, 0, 0))


def test_forces_and_drives_may_act_on_levers():
    """The point of a body that is held at another point moves, although its row shows the held one."""
    pinned = fc.Support(BODY.point("foot"), "u v w")
    push = fc.Force("push", BODY.point("head"), "x")
    ram = mover(BODY.point("head"))
    structure = fc.Structure([BODY], [pinned], [ram], [push])
    assert structure.join_table.rows[2][:3] == (0, 0, 0)
    assert {(2, c) for c in range(3)} <= structure.join_table.relative


def test_a_drive_about_a_skew_hinge_axis_is_right():
    fc.Structure([A, B], [CLAMP, fc.Hinge(A.end, B.start, (1, 1, 0))], [motor(B.start, A.end, (-2, -2, 0))])


def test_the_node_of_an_equal_part_is_as_good():
    twin = fc.Beam("a", (0, 0, 0), (1, 0, 0), SECTION)
    fc.Structure([A], [fc.Support(twin.start)])


@pytest.mark.parametrize(
    ("elements", "joints", "rest", "message"),
    [
        ([], [], {}, "has no elements; give at least one"),
        ([A, A], [], {}, "the part name 'a' is used twice; rename one"),
        ([A], [CLAMP], {"drives": [fc.RotaryDrive("a", A.end, stiffness=1.0)]}, "the part name 'a' is used twice"),
        (
            [A],
            [CLAMP],
            {"inputs": [fc.Force("f", A.end, "x")], "outputs": [fc.Position("f", A.end, "x")]},
            "the signal name 'f' is used twice",
        ),
        ([A, B], [], {}, "2 separate pieces: a is not joined to b; add a Weld, Pin, Hinge, Slide or Support"),
        ([A, B], [CLAMP], {}, "separate pieces: b is not joined to a"),
        ([A, B, ROPE, LOAD], [CLAMP, fc.Pin(ROPE.end, LOAD.node), fc.Weld(A.end, B.start)], {}, "load, rope are not"),
        ([A], [fc.Support(B.start)], {}, "Support of node 0 of b: node 0 of b at .* is not in structure"),
        ([A, B], [fc.Weld(A.start, B.start)], {}, "the nodes are 1 m apart.*Move a part, or put a RigidBody"),
        ([A, B], [fc.Weld(A.end, B.start), fc.Pin(B.start, A.end)], {}, "joined already; keep one of the joints"),
        (
            [A, B],
            [fc.Hinge(A.end, B.start, "x"), fc.Hinge(A.end, B.start, "y")],
            {},
            "Hinge of node 1 of a to node 0 of b: the two are joined already",
        ),
        ([A, ROPE], [CLAMP, fc.Weld(A.end, ROPE.start)], {}, "node 0 of rope has no rotations to share; use Pin"),
        ([A, ROPE], [CLAMP, fc.Slide(A.end, ROPE.start, "x")], {}, "no rotations to share; use Pin"),
        ([ROPE, LOAD], [fc.Slide(ROPE.end, LOAD.node, "x")], {}, "node 1 of rope has no rotations to share; use Pin"),
        ([A], [CLAMP], {"drives": [motor(A.start)]}, "drive 'motor': its joint holds the rotation.*the ground; free"),
        (
            [A, B],
            [CLAMP, fc.Hinge(A.end, B.start, "x")],
            {"drives": [motor(B.start, A.end, "y")]},
            "holds the rotation along .*free it with a Hinge along that axis, or correct the axis",
        ),
        (
            [A, B],
            [CLAMP, fc.Hinge(A.end, B.start, "x")],
            {"drives": [motor(B.start, A.end, (1, 1, 0))]},
            "or part of it",
        ),
        (
            [A, B],
            [CLAMP, fc.Hinge(A.end, B.start, (1, 1, 0))],
            {"drives": [motor(B.start, A.end, (1, -1, 0))]},
            "holds the rotation",
        ),
        (
            [A, B],
            [CLAMP, fc.Hinge(A.end, B.start, "x")],
            {"drives": [mover(B.start, A.end)]},
            "'mover': its joint holds the displacement .* free it with a Slide",
        ),
        (
            [A, B],
            [CLAMP, fc.Slide(A.end, B.start, "x")],
            {"drives": [mover(B.start, A.end, "z")]},
            "holds the displacement",
        ),
        ([A], [fc.Support(A.start, "v w")], {"drives": [mover(A.start, direction=(1, 1, 0))]}, "or part of it"),
        ([BODY], [], {"drives": [mover(BODY.point("foot"), BODY.node)]}, "holds the displacement"),
        ([B], [fc.Support(B.start)], {"drives": [motor(B.end, B.node(1))]}, "are 0.5 m apart; a rotary drive sits in"),
        ([A], [CLAMP], {"drives": [motor(A.end, A.end)]}, "holds the rotation"),
        ([A], [CLAMP], {"drives": [motor(B.end)]}, "drive 'motor': node 2 of b at .* is not in structure"),
        ([A], [CLAMP], {"inputs": [fc.MotorTorque("pull", "motor")]}, "'pull': there is no drive 'motor': the struct"),
        (
            [A],
            [CLAMP],
            {"drives": [motor(A.end)], "outputs": [fc.DriveAngle("angle", "moter")]},
            "there is no drive 'moter'; did you mean 'motor'",
        ),
        ([A], [CLAMP], {"outputs": [fc.Tension("pull", "a")]}, "'pull': there is no rope, spring or winch 'a': the"),
        ([A], [CLAMP], {"inputs": [fc.Force("f", B.end, "x")]}, "Force 'f': node 2 of b"),
        ([A], [CLAMP], {"outputs": [fc.Position("p", A.end, "x", minus=B.end)]}, "Position 'p': node 2 of b"),
        ([A], [CLAMP], {"outputs": [fc.SwayAngle("s", A.end, LOAD.node, "x")]}, "SwayAngle 's': node 0 of load"),
        ([A], [CLAMP], {"inputs": [fc.Position("p", A.end, "x")]}, "among inputs; expected one of Force, Torque"),
        ([A], [CLAMP], {"outputs": [fc.Force("p", A.end, "x")]}, "among outputs; expected one of Position"),
        ([A, CLAMP], [], {}, "among elements; expected one of .*; put a Support among joints"),
        ([A], [fc.Weld(A.end, B.start)], {}, "'structure'; add b to its elements"),
        ([A], [A], {}, "among joints; expected one of Support, Weld, Pin, Hinge, Slide"),
        ([SECTION], [], {}, "among elements; expected one of Beam, Rope, Spring, PointMass, RigidBody, Trolley$"),
        ([RING], [], {}, r"put \*ring.beams among elements and \*ring.welds among joints"),
        (RING.beams, [RING], {}, r"put \*ring.beams among elements and \*ring.welds among joints"),
        (A, [], {}, "Structure: elements = .*; expected a list"),
        ([A], CLAMP, {}, "Structure: joints = .*; expected a list"),
        ("abc", [], {}, "elements = 'abc'; expected a list"),
        ([A], [], {"name": "my crane"}, "Structure: name = 'my crane'; expected ASCII letters"),
    ],
)
def test_impossible_structures_are_refused(elements, joints, rest, message):
    with pytest.raises(StructureError, match=message):
        fc.Structure(elements, joints, **rest)


def test_a_stale_node_of_a_part_that_was_changed_is_refused():
    longer = fc.Beam("a", (0, 0, 0), (2, 0, 0), SECTION)
    with pytest.raises(StructureError, match="take the node from the part of that name that the structure has"):
        fc.Structure([longer], [fc.Support(A.end)])
    with pytest.raises(StructureError, match="take the node from the part"):
        fc.Structure([ROPE], [fc.Support(dataclasses.replace(ROPE.start, freedoms=frozenset(range(6))))])


def test_unknown_names_get_a_hint():
    s = fc.Structure([A])
    with pytest.raises(StructureError, match="has no part 'A'"):
        s.part("A")
    with pytest.raises(StructureError, match=r"has no part \['a'\]"):
        s.part(["a"])
    with pytest.raises(StructureError, match="'a' is no node"):
        s.number("a")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((A,), "is no Structure"),
        ((fc.Structure([A]), "w"), "no direction 'w'"),
        ((fc.Structure([A]), (1, 1, 0)), "is no global axis; give 'x', 'y' or 'z'"),
        ((fc.Structure([A], fc.JoinTable.from_rows([range(1, 7), range(7, 13)])),), "the joints are a JoinTable"),
    ],
)
def test_planar_refuses(arguments, message):
    with pytest.raises(StructureError, match=message):
        fc.planar(*arguments)


def test_planar_holds_the_three_freedoms_out_of_the_plane():
    rows = fc.planar(fc.Structure([A, ROPE], [fc.Pin(A.end, ROPE.start)]), "y").join_table.rows
    assert all(row[1] == row[3] == row[5] == 0 for row in rows)
    assert fc.planar(fc.Structure([A]), "-y") == fc.planar(fc.Structure([A]), "y")


def test_a_signal_is_not_called_t():
    with pytest.raises(StructureError, match="t is the time"):
        fc.Force("t", A.end, "x")


def test_a_rotary_drive_sits_in_a_joint():
    far = fc.Beam("far", A.end, (3.0, 1.0, 0.0), A.section)
    with pytest.raises(StructureError, match="apart"):
        fc.Structure([A, far], [CLAMP, fc.Weld(A.end, far.start)], [fc.RotaryDrive("d", far.end, A.end, stiffness=1.0)])
