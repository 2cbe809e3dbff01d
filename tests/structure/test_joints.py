"""Joints and the freedoms they name."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

SECTION = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.0, rhoJ=1e-4)
A = fc.Beam("a", (0, 0, 0), (1, 0, 0), SECTION)
B = fc.Beam("b", (1, 0, 0), (2, 0, 0), SECTION)
ROPE = fc.Rope("rope", (1, 0, 0), (1, 0, -1), EA=1e3)


@pytest.mark.parametrize(
    ("held", "freedoms"),
    [
        ("all", {0, 1, 2, 3, 4, 5}),
        (["all"], {0, 1, 2, 3, 4, 5}),
        ("v w", {1, 2}),
        ("v,w", {1, 2}),
        (["u", "rz"], {0, 5}),
        ("θx ry θz", {3, 4, 5}),
        ("u u", {0}),
    ],
)
def test_a_support_holds_what_it_names(held, freedoms):
    assert fc.Support(A.start, held).held == freedoms


def test_all_of_a_rope_node_are_its_displacements():
    assert fc.Support(ROPE.start).held == fc.Support(ROPE.start, ["all"]).held == {0, 1, 2}


def test_directions_may_be_words_or_vectors_of_any_length():
    assert fc.Hinge(A.end, B.start, "-z").axis == (0, 0, -1)
    assert fc.Hinge(A.end, B.start, np.array([0, 0, -5])).axis == (0, 0, -1)
    assert fc.Slide(A.end, B.start, (3, 4, 0)).along == pytest.approx((0.6, 0.8, 0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Support(A.start, "x"), "Support of node 0 of a: no freedom 'x'"),
        (lambda: fc.Support(A.start, "uvw"), "no freedom 'uvw'"),
        (lambda: fc.Support(A.start, "alll"), "no freedom 'alll'; did you mean 'all'"),
        (lambda: fc.Support(A.start, ""), "names no freedom; give some of u v w"),
        (lambda: fc.Support(A.start, []), "names no freedom"),
        (lambda: fc.Support(A.start, 5), "held = 5; expected a list"),
        (lambda: fc.Support(A.start, [5]), "no freedom 5"),
        (lambda: fc.Support(A.start, [["u"]]), r"no freedom \['u'\]"),
        (lambda: fc.Support(ROPE.start, "u rx"), "holds θx, which this node does not have; hold only u v w"),
        (lambda: fc.Support((0, 0, 0)), r"Support: \(0, 0, 0\) is no node; give e.g. beam.start"),
        (lambda: fc.Support(A), "is no node"),
        (lambda: fc.Weld(A.end, None), "Weld: None is no node"),
        (lambda: fc.Weld(A.end, A.end), "Weld: ties node 1 of a to node 1 of a; give nodes of two different parts"),
        (lambda: fc.Pin(A.start, A.end), "Pin: ties node 0 of a to node 1 of a"),
        (lambda: fc.Pin("a", B.start), "Pin: 'a' is no node"),
        (lambda: fc.Hinge(A.end, ROPE.start, "x"), "node 0 of rope has no rotations; use Pin"),
        (lambda: fc.Hinge(A.end, B.start, (0, 0, 0)), "has no length"),
        (lambda: fc.Hinge(A.end, B.start, "q"), "no direction 'q'"),
        (lambda: fc.Hinge(A.end, B.start, 3), "expected three finite numbers"),
        (lambda: fc.Slide(A.end, B.start, "xy"), "no direction 'xy'"),
    ],
)
def test_impossible_joints_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()
