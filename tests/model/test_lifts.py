"""Lifts on upright rails rest on the shafts of their motors: nothing else holds them, in whichever element they are."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flexctrl as fc

G, HEIGHT, GEAR = 9.81, 12.0, 100.0
BOX = fc.Section.box(fc.STEEL, width=0.25, height=0.35, web=0.006, flange=0.008)
STIFF = fc.Section(EA=1e13, EI_y=1e11, EI_z=1e11, GJ=1e11, rhoA=40.0, rhoJ=1.0)


def lifts(carried, k, angle=90.0, elements=5, section=BOX) -> fc.Model:
    """A clamped mast with lifts, each by its place, its mass and that of a load on a rope, and by its shaft."""
    up = np.array([np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])
    mast = fc.Beam("mast", (0, 0, 0), tuple(HEIGHT * up), section, elements=elements, up=(0, 1, 0))
    parts, drives, joints = [mast], [], [fc.Support(mast.start)]
    for i, ((at, mass, load), shaft) in enumerate(zip(carried, k, strict=True)):
        lift, top = fc.Trolley(f"lift{i}", mast, at=at, mass=mass), at * up
        motor = {"radius": 0.1, "ratio": 10.0, "inertia": 0.04, "damping": 5.0}
        drives.append(fc.LinearDrive(f"d{i}", lift.travel, direction="x", stiffness=shaft, **motor))
        parts.append(lift)
        if load:
            hook = fc.RigidBody(f"hook{i}", tuple(top - [0, 0, 2]), load, (1, 1, 1))
            rope = fc.Rope(f"rope{i}", tuple(top), tuple(top - [0, 0, 2]), EA=1e6)
            parts += [hook, rope]
            joints += [fc.Pin(lift.node, rope.start), fc.Pin(hook.node, rope.end)]
    inputs = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives)]
    outputs = [fc.Position(f"h{i}", drive.node, "x") for i, drive in enumerate(drives)]
    machine = fc.Structure(parts, joints, drives, inputs, outputs)
    return fc.assemble(machine, [fc.LargeRotation(), fc.Gravity(), fc.Flexible()])


def sunk_as_shafts_have_it(carried, k, turned, **mast) -> fc.Rest:
    """Motors hold the weights; lifts are where these have turned them to, less what their shafts give."""
    model = lifts(carried, k, **mast)
    rest = fc.equilibrium(model, hold={f"d{i}_source": turn for i, turn in enumerate(turned)})
    upward = np.sin(np.radians(mast.get("angle", 90.0)))
    for i, ((at, mass, load), shaft, turn) in enumerate(zip(carried, k, turned, strict=True)):
        torque = (mass + load) * G * upward / GEAR
        assert rest.holding[f"d{i}_source"] == pytest.approx(torque, rel=1e-4)
        assert rest.outputs[f"h{i}"] == pytest.approx(
            at + (turn - rest.holding[f"d{i}_source"] / shaft) / GEAR, abs=1e-9
        )
    assert rest.unstable == 0
    return rest


@pytest.mark.parametrize(("angle", "elements"), [(90.0, 5), (90.0, 1), (-90.0, 8), (89.9, 5), (90.0001, 5)])
def test_a_lift_sinks_by_what_its_shaft_gives(angle, elements):
    """Inside elements and on their ends, near those of the rail, however heavy and however stiff the shaft."""
    for at, (mass, k) in product((0.01, 2.4, 7.0, 11.99), ((6.0, 3e3), (600.0, 3e5), (6000.0, 1e9))):
        sunk_as_shafts_have_it([(at, mass, 0.0)], [k], [0.0], angle=angle, elements=elements)


@pytest.mark.parametrize(("turn", "k"), [(5.0, 3e5), (-100.0, 3e3), (300.0, 30.0), (300.0, 3e9)])
def test_it_goes_along_with_its_motor_from_element_to_element(turn, k):
    there = sunk_as_shafts_have_it([(3.0, 600.0, 0.0)], [k], [turn])
    again = fc.equilibrium(there.model, hold={"d0_source": turn}, start=there.state)
    assert again.outputs == pytest.approx(there.outputs, abs=1e-10)


@pytest.mark.parametrize("k", [(3e3, 3e3, 3e3), (1e3, 1e5, 1e8), (1e8, 3e5, 3e3)])
def test_several_on_one_mast_with_loads_on_ropes_sink_each_by_itself(k):
    carried = [(3.0, 600.0, 0.0), (6.0, 6.0, 900.0), (9.5, 60.0, 10.0)]
    sunk_as_shafts_have_it(carried, k, [0.0, 5.0, -50.0])


@pytest.mark.parametrize("k", [3e3, 3e5])
def test_a_held_lift_swings_on_its_shaft(k):
    """k R²/m, on a mast that gives way by next to nothing."""
    rest = sunk_as_shafts_have_it([(7.0, 600.0, 0.0)], [k], [0.0], section=STIFF)
    omega = fc.linearize(rest.model, rest).modes().omega
    assert np.abs(omega / np.sqrt(k * GEAR**2 / 600.0) - 1.0).min() < 2e-3
