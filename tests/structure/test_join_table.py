"""Tables 1 to 4 of the paper, number for number, and what a join table refuses."""

from __future__ import annotations

from itertools import pairwise

import pytest

import flexctrl as fc
from flexctrl import cranes
from flexctrl.errors import StructureError

SECTION = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.0, rhoJ=1e-4)
PLANE = "u v θz"


def cantilever() -> fc.Structure:
    first = fc.Beam("first", (0, 0, 0), (1, 0, 0), SECTION)
    second = fc.Beam("second", (1, 0, 0), (2, 0, 0), SECTION)
    return fc.planar(fc.Structure([first, second], [fc.Support(first.start), fc.Weld(first.end, second.start)]))


def support_frame(drive: bool = False) -> fc.Structure:
    """Fig. 5 and, with the drive, Fig. 6: two legs clamped below and welded on top, a pendulum pinned there."""
    left = fc.Beam("left", (-1, 0, 0), (0, 1, 0), SECTION)
    right = fc.Beam("right", (1, 0, 0), (0, 1, 0), SECTION)
    pendulum = fc.Beam("pendulum", (0, 1, 0), (0, 0, 0), SECTION)
    joints = [
        fc.Support(left.start),
        fc.Support(right.start),
        fc.Weld(left.end, right.end),
        fc.Pin(right.end, pendulum.start),
    ]
    motor = fc.RotaryDrive("motor", right.end, pendulum.start, axis="z", stiffness=50, ratio=3, inertia=0.1)
    return fc.planar(fc.Structure([left, right, pendulum], joints, [motor] if drive else []))


def ceiling_crane() -> fc.Structure:
    girder = fc.Beam("girder", (0, -3, 0), (0, 3, 0), SECTION, elements=6)
    chain = [fc.Beam(f"link{i}", (0, 0, 1 - i), (0, 0, -i), SECTION) for i in (1, 2, 3)]
    joints = [fc.Support(girder.start, "v w"), fc.Support(girder.end, "v w"), fc.Pin(girder.node(3), chain[0].start)]
    joints += [fc.Pin(a.end, b.start) for a, b in pairwise(chain)]
    return fc.Structure([girder, *chain], joints)


TABLE_1 = ((0, 0, 0), (1, 2, 3), (1, 2, 3), (4, 5, 6))
TABLE_2 = ((0, 0, 0), (1, 2, 3), (0, 0, 0), (1, 2, 3), (1, 2, 4), (5, 6, 7))
TABLE_4 = (
    (1, 0, 0, 2, 3, 4),
    (5, 6, 7, 8, 9, 10),
    (11, 12, 13, 14, 15, 16),
    (17, 18, 19, 20, 21, 22),
    (23, 24, 25, 26, 27, 28),
    (29, 30, 31, 32, 33, 34),
    (35, 0, 0, 36, 37, 38),
    (17, 18, 19, 39, 40, 41),
    (42, 43, 44, 45, 46, 47),
    (42, 43, 44, 48, 49, 50),
    (51, 52, 53, 54, 55, 56),
    (51, 52, 53, 57, 58, 59),
    (60, 61, 62, 63, 64, 65),
)


def test_table_1_the_cantilever():
    table = cantilever().join_table
    assert table.columns(PLANE) == TABLE_1
    assert table.free == 6


def test_table_2_the_elastic_pendulum_support_frame():
    table = support_frame().join_table
    assert table.columns(PLANE) == TABLE_2
    assert table.free == 7


def test_table_3_the_frame_with_its_drive():
    table = support_frame(drive=True).join_table
    assert table.columns(PLANE) == TABLE_2
    assert table.drives == ((0, 0, 0, 0, 0, 8),)
    assert table.free == 8


@pytest.mark.parametrize("crane", [ceiling_crane, cranes.ceiling_crane], ids=["drawn", "shipped"])
def test_table_4_the_ceiling_crane(crane):
    table = crane().join_table
    assert table.rows == TABLE_4
    assert table.free == 65
    assert not table.relative


def test_the_printed_table_3():
    assert str(support_frame(drive=True).join_table).splitlines() == [
        "    Node |  u  v θz",
        "       1 |  0  0  0  left 0",
        "       2 |  1  2  3  left 1",
        "       3 |  0  0  0  right 0",
        "       4 |  1  2  3  right 1",
        "       5 |  1  2  4  pendulum 0",
        "       6 |  5  6  7  pendulum 1",
        "θd motor |  0  0  8",
    ]


def test_the_printed_table_4_holds_the_numbers_of_the_paper():
    head, *lines = str(ceiling_crane().join_table).splitlines()
    assert head.split() == ["Node", "|", "u", "v", "w", "θx", "θy", "θz"]
    printed = [line.split() for line in lines]
    assert [int(cells[0]) for cells in printed] == list(range(1, 14))
    assert [tuple(map(int, cells[2:8])) for cells in printed] == list(TABLE_4)


@pytest.mark.parametrize("normal", ["x", "y", "z"])
def test_every_plane_has_the_same_table(normal):
    """The cantilever lies in another plane, its two displacements and its rotation keep their numbers."""
    turn = {"x": lambda p: (0, *p), "y": lambda p: (p[1], 0, p[0]), "z": lambda p: (*p, 0)}[normal]
    columns = {"x": "v w θx", "y": "w u θy", "z": "u v θz"}[normal]
    first = fc.Beam("first", turn((0, 0)), turn((1, 0)), SECTION)
    second = fc.Beam("second", turn((1, 0)), turn((2, 0)), SECTION)
    joints = [fc.Support(first.start), fc.Weld(first.end, second.start)]
    table = fc.planar(fc.Structure([first, second], joints), normal).join_table
    assert table.free == 6
    assert [sorted(row) for row in table.columns(columns)] == [sorted(row) for row in TABLE_1]


def test_rows_come_back_as_they_were_given():
    table = fc.JoinTable.from_rows(TABLE_2, columns=PLANE, drives=[(0, 0, 8)])
    assert table.columns(PLANE) == TABLE_2
    assert table.drives == support_frame(drive=True).join_table.drives
    assert fc.JoinTable.from_rows(TABLE_4).rows == TABLE_4


def test_a_joint_in_the_middle_of_a_beam_shares_the_inner_node():
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 2), SECTION, elements=2)
    arm = fc.Beam("arm", (0, 0, 1), (1, 0, 1), SECTION)
    table = fc.Structure([mast, arm], [fc.Support(mast.start), fc.Weld(mast.node(1), arm.start)]).join_table
    assert table.rows[3] == table.rows[1] == (1, 2, 3, 4, 5, 6)


def test_a_slide_gives_its_direction_a_number_of_its_own():
    rail = fc.Beam("rail", (0, 0, 0), (1, 0, 0), SECTION)
    carriage = fc.Beam("carriage", (1, 0, 0), (1, 0, 1), SECTION)
    joints = [fc.Support(rail.start), fc.Support(rail.end, "rx ry rz"), fc.Slide(rail.end, carriage.start, "x")]
    rows = fc.Structure([rail, carriage], joints).join_table.rows
    assert rows[1] == (1, 2, 3, 0, 0, 0)
    assert rows[2] == (4, 2, 3, 0, 0, 0)


def test_what_rides_on_a_moving_master_is_marked():
    body = fc.RigidBody("body", (0, 0, 0), 2.0, (1, 1, 1), {"hook": (0, 0, -1)})
    arm = fc.Beam("arm", (0, 0, -1), (1, 0, -1), SECTION)
    table = fc.Structure([body, arm], [fc.Hinge(body.point("hook"), arm.start, "y")]).join_table
    assert table.rows[1] == table.rows[0]
    assert {(1, f) for f in range(3)} <= table.relative
    assert table.rows[2][3:] == (4, 7, 6)
    assert "~ follows a master node in the master's axes" in str(table)


def test_a_table_of_a_hinge_about_a_skew_axis_still_counts_right():
    a, b = fc.Beam("a", (0, 0, 0), (1, 0, 0), SECTION), fc.Beam("b", (1, 0, 0), (2, 0, 0), SECTION)
    table = fc.Structure([a, b], [fc.Support(a.start), fc.Hinge(a.end, b.start, (1, 2, 2))]).join_table
    assert table.free == 6 + 1 + 6


@pytest.mark.parametrize(
    ("rows", "columns", "drives", "message"),
    [
        ([[1, 2, 4]], PLANE, (), "numbered 1…3 without gaps; 3 is missing"),
        ([[1, 2, -3]], PLANE, (), "row 1: number = -3; expected a whole number"),
        ([[1, 2, 2.5]], PLANE, (), "row 1: number = 2.5"),
        ([[1, 2, True]], PLANE, (), "row 1: number = True"),
        ([["1", "2", "3"]], PLANE, (), "row 1: number = '1'"),
        ([[1, 2]], PLANE, (), r"row 1 is \[1, 2\]; expected 3 whole numbers"),
        ([[1, 2, 3], [1, 2]], PLANE, (), r"row 2 is \[1, 2\]"),
        (5, PLANE, (), "rows = 5; expected a list"),
        ([5], PLANE, (), "row 1 is 5"),
        ([[1, 2]], "u u", (), "name a freedom twice"),
        ([[1]], "q", (), "no freedom 'q'; columns are some of u v w θx θy θz"),
        ([[1]], 7, (), "no freedom 7"),
        ([[]], "", (), "no columns given"),
        ([[1, 2, 3]], PLANE, [[0, 0, 3]], "expected one number of its own, 4"),
        ([[1, 2, 4]], PLANE, [[0, 0, 3]], "expected one number of its own, 5"),
        ([[1, 2, 3]], PLANE, [[0, 4, 5]], "expected one number of its own"),
        ([[1, 2, 3]], PLANE, [[0, 0, 5], [0, 0, 4]], "source angle of drive 1"),
    ],
)
def test_wrong_tables_are_refused(rows, columns, drives, message):
    with pytest.raises(StructureError, match=message):
        fc.JoinTable.from_rows(rows, columns=columns, drives=drives)


def test_a_table_that_does_not_fit_the_parts_is_refused():
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e3)
    drive = fc.RotaryDrive("slew", beam.end, axis="z", stiffness=1.0)
    two = [(1, 2, 3, 4, 5, 6), (7, 8, 9, 10, 11, 12)]
    with pytest.raises(StructureError, match="has 1 nodes and 0 drives, the parts have 2 and 0"):
        fc.Structure([beam], fc.JoinTable.from_rows(two[:1]))
    with pytest.raises(StructureError, match="has 2 nodes and 0 drives, the parts have 2 and 1"):
        fc.Structure([beam], fc.JoinTable.from_rows(two), [drive])
    with pytest.raises(StructureError, match="row 1 of the join table numbers θx of node 0 of rope"):
        fc.Structure([rope], fc.JoinTable.from_rows(two))
    with pytest.raises(StructureError, match="drive 'slew': the join table has its source angle in"):
        fc.Structure([beam], fc.JoinTable.from_rows(two, drives=[(0, 0, 0, 13, 0, 0)]), [drive])
