"""A machine drawn in coordinates of its site is told to be drawn about an origin of its own."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def pendulum(x: float, *effects: fc.Effect) -> fc.Model:
    rod = fc.RigidBody("rod", (x, 0, -1), 5.0, (2, 2, 0.1), {"pivot": (x, 0, 0), "tip": (x, 0, -2)})
    plan = fc.Structure([rod], [fc.Support(rod.point("pivot"), "u v w rx rz")])
    return fc.assemble(plan, [fc.Gravity(), *effects])


@pytest.mark.parametrize(("x", "told"), [(0.0, 0), (1e5, 0), (1e6, 1), (-5e6, 1)])
def test_what_is_drawn_far_away_is_told_so(x, told):
    notes = [note for note in pendulum(x, fc.LargeRotation()).notes if "origin" in note]
    assert len(notes) == told
    assert all(f"({x:g}, 0, -1)" in note for note in notes)


def test_small_motion_has_displacements_of_its_own():
    assert pendulum(1e7).notes == ()


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (4e5, 5e6, 0.0)])
def test_what_travels_has_no_place_that_machines_are_measured_by(origin):
    """Where a trolley has come to along its rail was taken for a place: far away, tolerances were of what lies between.

    Errors of rates were not told then, and notes were wrong.
    """
    at, box = np.array(origin), fc.Section.box(fc.STEEL, 1.0, 1.5, 0.012, 0.02)
    girder = fc.Beam("girder", tuple(at), tuple(at + np.array((50, 0, 0))), box)
    trolley = fc.Trolley("trolley", girder, at=10.0, mass=2e4)
    load = fc.PointMass("load", tuple(at + np.array((10, 0, -30))), 3e4)
    rope = fc.Rope("rope", trolley.node.position, load.node, EA=5e7, damping=3e4)
    joints = [fc.Support(girder.start, "u v w rx"), fc.Support(girder.end, "v w rx"), fc.Pin(rope.start, trolley.node)]
    plan = fc.Structure([girder, trolley, load, rope], [*joints, fc.Pin(rope.end, load.node)])
    assert plan.size == pytest.approx(50.0)
