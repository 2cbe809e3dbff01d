"""The join tables of the paper, number for number (its Tables 1 to 4)."""

from __future__ import annotations

import flexctrl as fc
from flexctrl.cranes import ceiling_crane

WIRE = fc.Section(EA=1e6, EI_y=100.0, EI_z=100.0, GJ=80.0, rhoA=1.0, rhoJ=1e-3)

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


def support_frame(drives=()) -> fc.Structure:
    """The elastic pendulum support frame of the paper's Fig. 3 and 5: two struts meet, a pendulum hangs from them."""
    strut = fc.Beam("strut", (0, 0, 0), (1, 1, 0), WIRE)
    stay = fc.Beam("stay", (2, 0, 0), (1, 1, 0), WIRE)
    pendulum = fc.Beam("pendulum", (1, 1, 0), (1, 0, 0), WIRE)
    joints = [
        fc.Support(strut.start),
        fc.Support(stay.start),
        fc.Weld(strut.end, stay.end),
        fc.Pin(stay.end, pendulum.start),
    ]
    return fc.planar(fc.Structure([strut, stay, pendulum], joints, drives))


def test_table_1_two_beams_in_a_row():
    first, second = fc.Beam("first", (0, 0, 0), (1, 0, 0), WIRE), fc.Beam("second", (1, 0, 0), (2, 0, 0), WIRE)
    joints = [fc.Support(first.start), fc.Weld(first.end, second.start)]
    table = fc.planar(fc.Structure([first, second], joints)).join_table
    assert table.columns("u v θz") == TABLE_1
    assert table.rows == fc.JoinTable.from_rows(TABLE_1, columns="u v θz").rows


def test_table_2_a_pin_keeps_its_own_rotation():
    table = support_frame().join_table
    assert table.columns("u v θz") == TABLE_2
    assert table.rows == fc.JoinTable.from_rows(TABLE_2, columns="u v θz").rows


def test_table_3_the_drive_source_angle_comes_last():
    frame = support_frame()
    stay, pendulum = frame.elements[1:]
    drive = fc.RotaryDrive("motor", pendulum.start, stay.end, axis="z", stiffness=10.0, ratio=5.0)
    table = support_frame([drive]).join_table
    assert table.columns("u v θz") == TABLE_2
    assert [(row[0], row[1], row[5]) for row in table.drives] == [(0, 0, 8)]
    assert table.free == 8


def test_table_4_the_ceiling_crane():
    table = ceiling_crane().join_table
    assert table.rows == TABLE_4
    assert table.free == 65
    assert table.rows == fc.JoinTable.from_rows(TABLE_4).rows
    assert not table.relative
