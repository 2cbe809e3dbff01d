"""Drives, inputs and outputs: what they take and what they refuse."""

from __future__ import annotations

import math

import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

SECTION = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.0, rhoJ=1e-4)
BEAM = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION)
ROPE = fc.Rope("rope", (1, 0, 0), (1, 0, -1), EA=1e3)
MOTOR = fc.RotaryDrive("slew", BEAM.end, stiffness=1.0, ratio=5.0)


def rotary(**change):
    return fc.RotaryDrive(**({"name": "slew", "node": BEAM.end, "stiffness": 1.0} | change))


def linear(**change):
    return fc.LinearDrive(**({"name": "travel", "node": BEAM.end, "stiffness": 1.0, "radius": 0.5} | change))


def test_effective_ratio():
    assert rotary(ratio=-7.0).effective_ratio == -7.0
    assert linear(ratio=6.0, radius=0.5).effective_ratio == 12.0


@pytest.mark.parametrize("value", [math.nan, math.inf, "5", True, None, [1.0], 10**400])
@pytest.mark.parametrize("name", ["stiffness", "ratio", "inertia", "damping"])
def test_drive_data_are_numbers(name, value):
    for make in (rotary, linear):
        with pytest.raises(StructureError, match=rf"Drive '\w+': {name} = "):
            make(**{name: value})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rotary(stiffness=0.0), "RotaryDrive 'slew': stiffness = 0.0; expected a number > 0"),
        (lambda: rotary(stiffness=-1.0), "stiffness = -1.0"),
        (lambda: rotary(ratio=0), "ratio = 0; a reduction ratio is not zero"),
        (lambda: rotary(inertia=-1e-9), "inertia = -1e-09; expected a number ≥ 0"),
        (lambda: rotary(axis="w"), "no direction 'w'"),
        (lambda: rotary(node="beam"), "RotaryDrive 'slew': 'beam' is no node"),
        (lambda: rotary(against=3), "3 is no node"),
        (lambda: rotary(node=ROPE.end), "node 1 of rope has no rotations to drive"),
        (lambda: rotary(name="slew motor"), "RotaryDrive: name = 'slew motor'; expected ASCII letters"),
        (lambda: linear(radius=0.0), "LinearDrive 'travel': radius = 0.0; expected a number > 0"),
        (lambda: linear(radius="0.5"), "radius = '0.5'"),
        (lambda: linear(direction=()), "expected three finite numbers"),
    ],
)
def test_impossible_drives_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_a_force_may_act_on_several_nodes():
    assert fc.Force("push", [BEAM.start, BEAM.end], "x").at == (BEAM.start, BEAM.end)
    assert fc.Force("push", BEAM.end, "x").at == (BEAM.end,)


def test_drives_and_lines_may_be_named_or_given():
    assert fc.MotorTorque("torque", MOTOR) == fc.MotorTorque("torque", "slew")
    assert fc.Tension("pull", ROPE) == fc.Tension("pull", "rope")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Force("a.b", BEAM.end, "x"), r"Force: name = 'a.b'; expected ASCII letters"),
        (lambda: fc.Force("push", [], "x"), "Force 'push': names no node"),
        (lambda: fc.Force("push", 5, "x"), "Force 'push': 5 is no node"),
        (lambda: fc.Force("push", [BEAM.end, "tip"], "x"), "'tip' is no node"),
        (lambda: fc.Force("push", [BEAM.end, BEAM.end], "x"), "node 1 of beam is given twice"),
        (lambda: fc.Force("push", BEAM.end, None), "expected three finite numbers"),
        (lambda: fc.Torque("twist", ROPE.end, "x"), "Torque 'twist': node 1 of rope has no rotations"),
        (lambda: fc.MotorTorque("torque", BEAM), "expected a RotaryDrive or LinearDrive or Winch, or the name of one"),
        (lambda: fc.MotorTorque("torque", None), "MotorTorque 'torque': drive = None"),
        (lambda: fc.DriveAngle("angle", 5), "DriveAngle 'angle': drive = 5"),
        (lambda: fc.Tension("pull", MOTOR), "expected a Rope or Spring"),
        (lambda: fc.Position("p", [BEAM.end], "x"), r"Position 'p': \[Node.* is no node"),
        (lambda: fc.Position("p", BEAM.end, "x", minus="tip"), "'tip' is no node"),
        (lambda: fc.Position("p", BEAM.end, "x", minus=BEAM.end), "less itself is always zero"),
        (lambda: fc.Rotation("r", ROPE.end, "x"), "Rotation 'r': node 1 of rope has no rotations"),
        (lambda: fc.AngularVelocity("r", BEAM.end, "x", minus=ROPE.end), "has no rotations"),
        (lambda: fc.SwayAngle("s", BEAM.end, BEAM.end, "x"), "top and load are both node 1 of beam"),
        (lambda: fc.SwayAngle("s", ROPE.start, ROPE.end, "z"), "not square to down"),
        (lambda: fc.SwayAngle("s", ROPE.start, ROPE.end, (1, 0, 1)), "give a level one"),
        (lambda: fc.SwayAngle("s", "top", ROPE.end, "x"), "'top' is no node"),
    ],
)
def test_impossible_signals_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()
