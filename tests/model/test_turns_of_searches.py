"""Whole turns that a search for an equilibrium adds, and those that something counts."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.balance import Balance
from flexctrl.model.recounted import recounted

TURN = 2.0 * np.pi
AROUND = 3.0 * TURN + 0.3


def double_girder() -> fc.Model:
    """A carriage on two trolleys that may skew, its load off the middle."""
    box = fc.Section.box(fc.STEEL, width=0.4, height=0.8, web=0.008, flange=0.012)
    girders = [fc.Beam(f"g{i}", (0, y, 0), (20, y, 0), box, elements=6) for i, y in ((1, -1), (2, 1))]
    trolleys = [fc.Trolley(f"t{i}", girder, at=4.0, mass=200.0) for i, girder in enumerate(girders, 1)]
    points = {"l": (4, -1, 0), "r": (4, 1, 0), "h": (4, 0.5, 0)}
    carriage = fc.RigidBody("carriage", (4, 0, 0), 1000.0, (300.0, 300.0, 500.0), points)
    shoe = fc.RigidBody("shoe", (4, 1, 0), 5.0, (1.0, 1.0, 1.0), {"a": (4, 1, 0)})
    load = fc.PointMass("load", (4, 0.5, -6), 8000.0)
    rope = fc.Rope("rope", (4, 0.5, 0), (4, 0.5, -6), EA=2e7, damping=2e4)
    held = [fc.Support(girder.start, "u v w rx") for girder in girders]
    held += [fc.Support(girder.end, "v w rx") for girder in girders]
    joints = [*held, fc.Pin(trolleys[0].node, carriage.point("l"))]
    joints += [fc.Slide(carriage.point("r"), shoe.point("a"), "y"), fc.Pin(shoe.node, trolleys[1].node)]
    joints += [fc.Pin(rope.start, carriage.point("h")), fc.Pin(rope.end, load.node)]
    parts = [*girders, *trolleys, carriage, shoe, load, rope]
    structure = fc.Structure(parts, joints, outputs=[fc.Rotation("skew", carriage.node, "z")])
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def test_a_carriage_that_the_search_takes_round_shows_its_pose():
    """It skews by 1.3 rad; 20.14 rad were shown, and by all runs from there."""
    model = double_girder()
    rest = fc.equilibrium(model, hold={"t2_slide": 0.0})
    assert abs(rest.outputs["skew"]) < np.pi
    assert rest.state.shown == pytest.approx(model.motion.twists.next_to(np.zeros(1), rest.state.R), abs=1e-12)
    assert abs(fc.simulate(model, until=0.01, start=rest)["skew"][0]) < np.pi


def pendulum(*, driven: bool = False, shaft: bool = False) -> fc.Model:
    """On a hinge about y, that a drive may turn; or at the end of a shaft in bearings."""
    bob = fc.RigidBody("bob", (0, 0, -1), 2.0, (0.1, 0.1, 0.1), {"top": (0, 0, 0)})
    parts: list = [bob]
    drives = [fc.RotaryDrive("motor", bob.point("top"), axis="y", stiffness=50.0, inertia=0.1)] if driven else []
    joints: list = [fc.Support(bob.point("top"), "u v w rx rz")]
    if shaft:
        rod = fc.Beam("rod", (0, -1, 0), (0, 0, 0), fc.Section.circular(fc.STEEL, radius=0.01), elements=40)
        parts, joints = [rod, bob], [fc.Support(rod.start), fc.Weld(rod.end, bob.point("top"))]
    outputs = [fc.Rotation("angle", bob.node, "y"), fc.Rotation("top", bob.point("top"), "y")]
    structure = fc.Structure(parts, joints, drives, outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def gone_round(model: fc.Model) -> fc.State:
    """Where it is after three turns and a bit of all that turns about y, each node by its share."""
    turning = [i for i, name in enumerate(model.coordinates) if name.endswith("_ry")]
    step, state = np.zeros(model.n), model.rest
    step[turning] = AROUND / 100.0 * np.linspace(1.0 / len(turning), 1.0, len(turning))
    for _ in range(100):
        state = model.motion.advance(state, step, np.zeros(model.n), 0.0)
    assert state.shown == pytest.approx([AROUND, AROUND])
    return state


def searched(model: fc.Model, start: fc.State, hold: dict[int, float] | None = None) -> np.ndarray:
    return recounted(Balance(model, np.zeros(0), hold or {}), start, gone_round(model)).shown


def test_what_merely_shows_is_next_to_where_the_search_began():
    model = pendulum()
    assert searched(model, model.rest) == pytest.approx([0.3, 0.3])
    begun = model.displace({"bob_0_ry": -1.0 - 2.0 * TURN})
    assert searched(model, begun) == pytest.approx([0.3 - 2.0 * TURN] * 2)


@pytest.mark.parametrize("parts", [{"driven": True}, {"shaft": True}])
def test_turns_that_drives_and_shafts_bear_are_kept(parts):
    model = pendulum(**parts)
    assert searched(model, model.rest) == pytest.approx([AROUND, AROUND])


def test_turns_through_which_something_is_held_are_kept():
    model = pendulum()
    assert searched(model, model.rest, {0: AROUND}) == pytest.approx([AROUND, AROUND])
    rest = fc.equilibrium(model, hold={"bob_0_ry": AROUND})
    assert rest.outputs == pytest.approx({"angle": AROUND, "top": AROUND})
    again = fc.equilibrium(model, hold={"bob_0_ry": AROUND + 0.5}, start=rest.state)
    assert again.outputs["angle"] == pytest.approx(AROUND + 0.5)
    assert fc.equilibrium(model, start=again.state).outputs["angle"] == pytest.approx(3.0 * TURN)


@pytest.mark.parametrize("turns", [0.0, 10.0])
def test_a_motor_held_at_some_turns_keeps_them(turns):
    model = pendulum(driven=True)
    rest = fc.equilibrium(model, hold={"motor_source": turns * TURN})
    assert rest.outputs["angle"] == pytest.approx(turns * TURN, abs=1e-9)
    assert rest.state.driven == pytest.approx([turns * TURN], abs=1e-9)
