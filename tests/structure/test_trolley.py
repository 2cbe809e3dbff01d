"""What a trolley is and on what it can travel."""

from __future__ import annotations

import pytest

import flexctrl as fc

SECTION = fc.Section(EA=1e6, EI_y=900.0, EI_z=900.0, GJ=700.0, rhoA=2.0, rhoJ=0.05)
FIRST = fc.Beam("first", (0, 0, 1), (0, 3, 1), SECTION, 3)
SECOND = fc.Beam("second", FIRST.end, (0, 5, 1), SECTION, 4)
SUPPORT = fc.Support(FIRST.start)


def test_nodes():
    trolley = fc.Trolley("trolley", [FIRST, SECOND], at=3.5, mass=2.0)
    assert trolley.node.position == pytest.approx((0, 3.5, 1))
    assert trolley.travel.position == (3.5, 0, 0)
    assert trolley.travel.freedoms == {0}
    machine = fc.Structure([FIRST, SECOND, trolley], [SUPPORT, fc.Weld(FIRST.end, SECOND.start)])
    table = machine.join_table
    assert table.rows[-1] == (table.free, 0, 0, 0, 0, 0)
    assert {(len(table.rows) - 2, k) for k in range(3)} <= table.relative
    track = machine.tracks[0]
    assert track.places == pytest.approx((0, 1, 2, 3, 3.5, 4, 4.5, 5))
    assert [machine.nodes[n].position[1] for n in track.rail] == pytest.approx(track.places)


def test_names():
    from flexctrl.structure.naming import node_of

    trolley = fc.Trolley("trolley", FIRST, at=1.0, mass=2.0)
    assert node_of([FIRST, trolley], "trolley") == trolley.node
    assert node_of([FIRST, trolley], "trolley.travel") == trolley.travel
    model = fc.assemble(fc.Structure([FIRST, trolley], [SUPPORT]), [fc.LargeRotation()])
    assert model.coordinates == ("trolley_slide",)


def test_finer_and_plane_machines_keep_it():
    trolley = fc.Trolley("trolley", FIRST, at=1.0, mass=2.0)
    machine = fc.Structure([FIRST, trolley], [SUPPORT])
    assert len(fc.refine(machine, 2).tracks[0].rail) == 7
    assert fc.planar(machine, "x").join_table.rows[-1][0] > 0


@pytest.mark.parametrize(
    ("along", "at", "match"),
    [
        (FIRST, 3.1, "at = 3.1 m is beyond the end of its rail, 3 m long"),
        (FIRST, -0.1, "at = -0.1"),
        ("first", 1.0, "expected a Beam"),
        ([], 1.0, "expected a Beam"),
        ([FIRST, fc.Beam("up", FIRST.end, (0, 3, 4), SECTION)], 1.0, "'up' does not go on straight"),
        ([SECOND, FIRST], 1.0, "'first' does not go on straight"),
    ],
)
def test_rails_that_are_none(along, at, match):
    with pytest.raises(fc.errors.StructureError, match=match):
        fc.Trolley("trolley", along, at=at, mass=1.0)


def test_rails_that_the_structure_does_not_have():
    trolley = fc.Trolley("trolley", [FIRST, SECOND], at=1.0, mass=2.0)
    with pytest.raises(fc.errors.StructureError, match="there is no beam 'second'"):
        fc.Structure([FIRST, trolley], [SUPPORT])
    with pytest.raises(fc.errors.StructureError, match="'first' and 'second' are not welded"):
        fc.Structure([FIRST, SECOND, trolley], [SUPPORT, fc.Pin(FIRST.end, SECOND.start)])
    moved = fc.Beam("first", (1, 0, 1), (1, 3, 1), SECTION)
    with pytest.raises(fc.errors.StructureError, match="its rail lies elsewhere"):
        fc.Structure([moved, fc.Trolley("trolley", FIRST, at=1.0, mass=2.0)], [fc.Support(moved.start)])
    table = fc.JoinTable.from_rows([(0,) * 6, (1, 2, 3, 4, 5, 6), (1, 2, 3, 0, 0, 0), (7, 0, 0, 0, 0, 0)])
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION)
    with pytest.raises(fc.errors.StructureError, match="needs joints"):
        fc.Structure([beam, fc.Trolley("trolley", beam, at=0.5, mass=2.0)], table)


def test_how_far_is_no_place():
    """Here it even coincides with where the trolley is drawn."""
    girder = fc.Beam("girder", (0, 0, 0), (3, 0, 0), SECTION, 3)
    trolley = fc.Trolley("trolley", girder, at=1.0, mass=2.0)
    load = fc.PointMass("load", (1, 0, -1), 1.0)
    rope = fc.Rope("rope", trolley.node, load.node, EA=1e3)
    parts, hung = [girder, trolley, load, rope], fc.Pin(rope.end, load.node)
    joints = [fc.Support(girder.start), fc.Pin(rope.start, trolley.node), hung]
    fc.Structure(parts, joints, inputs=[fc.Force("push", trolley.travel, "-x")])
    for change in (
        {"joints": [fc.Support(girder.start), fc.Pin(rope.start, trolley.travel), hung]},
        {"inputs": [fc.Force("push", trolley.travel, "z")]},
        {"outputs": [fc.Position("place", trolley.travel, "x", minus=load.node)]},
        {"outputs": [fc.SwayAngle("sway", trolley.travel, load.node, "x")]},
        {"drives": [fc.Winch("winch", load.node, trolley.travel, EA=1e3, radius=0.1)]},
        {"drives": [fc.LinearDrive("drive", trolley.travel, girder.end, radius=0.1, stiffness=1.0)]},
    ):
        with pytest.raises(fc.errors.StructureError, match=r"trolley.travel is no place in space.*take trolley.node"):
            fc.Structure(parts, **{"joints": joints, **change})
