"""D10: motors without inertia behind shafts whose torque is less than the last digit of an angle.

Such a motor bears on its shaft what it is given. However stiff the shaft is, from 10⁶ N m/rad on the motion is that
behind a rigid one.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.swift.light_motors import giving_way

STIFF = [1e6, 1e9, 1e12, 1e16, 1e21]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
RATIO, G = 100.0, 9.81
METHODS = [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)]
TIGHT = fc.Tolerance(1e-6, 1e-9)
FLEXIBLE = (fc.Flexible(), fc.LargeRotation())
BEHIND_RIGID_SHAFTS = (fc.BeamFlexibility(), fc.LargeRotation())


def arm(k, effects=FLEXIBLE, EI=1.0, damping=0.0, inertia=0.0) -> fc.Model:
    """Two beams of 1 m in line, clamped at the left, with a motor on the hinge between them."""
    section = fc.Section(EA=1e6 * EI, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=1e-3)
    a, b = (fc.Beam(name, start, end, section, up=Z) for name, start, end in (("a", (0, 0, 0), X), ("b", X, (2, 0, 0))))
    of_motor = {"stiffness": k / RATIO**2, "damping": damping * k / RATIO**2, "ratio": RATIO, "inertia": inertia}
    drive = fc.RotaryDrive("d", b.start, a.end, axis=Z, **of_motor)
    inputs = [fc.Force("F", b.end, Y), fc.MotorTorque("m", drive)]
    outputs = [fc.Position("tip", b.end, Y), fc.Position("middle", a.end, Y), fc.DriveAngle("motor", drive)]
    joints = [fc.Support(a.start), fc.Hinge(a.end, b.start, axis=Z)]
    return fc.assemble(fc.Structure([a, b], joints, [drive], inputs, outputs), effects)


def pendulums(k, n=2) -> fc.Model:
    """Rigid ones in a row, of 1 m and 1 kg each, a motor on each hinge."""
    ground = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1))
    bodies, joints, drives, above = [], [fc.Support(ground.node)], [], ground.node
    for i in range(n):
        ends = {"top": (0.0, 0.0, -i), "end": (0.0, 0.0, -i - 1.0)}
        body = fc.RigidBody(f"b{i}", (0.0, 0.0, -i - 0.5), 1.0, (0.02,) * 3, ends)
        joints.append(fc.Hinge(above, body.point("top"), axis=Y))
        motor = {"stiffness": k / RATIO**2, "ratio": RATIO}
        drives.append(fc.RotaryDrive(f"d{i}", body.point("top"), above, axis=Y, **motor))
        bodies, above = [*bodies, body], body.point("end")
    inputs = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives)]
    outputs = [fc.Rotation(f"turn{i}", body.node, Y) for i, body in enumerate(bodies)]
    machine = fc.Structure([ground, *bodies], joints, drives, inputs, outputs)
    return fc.assemble(machine, [fc.Gravity((0.0, 0.0, -G)), fc.LargeRotation(), fc.ShaftElasticity()])


def moved(run: fc.Run) -> float:
    """How far its outputs have gone from where they began."""
    return float(np.abs(run.y - run.y[0]).max())


@pytest.mark.parametrize("k", STIFF)
def test_an_arm_at_rest_under_torque_stays(k):
    model, loads = arm(k), {"F": 0.05, "m": -0.045 / RATIO}
    rest = fc.equilibrium(model, inputs=loads)
    run = fc.simulate(model, start=rest, until=1.0)
    assert (run.status, run.report.notes) == (fc.Status.FINISHED, ())
    assert moved(run) < 1e-7
    again = fc.simulate(model, start=run.final, inputs=loads, until=1.0)
    assert moved(again) < 1e-7


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("k", STIFF)
def test_pendulums_that_torques_hold_stay(k, n):
    model, torques = pendulums(k, n), 1.5 - 0.4 * np.arange(n)
    rest = fc.equilibrium(model, inputs={f"t{i}": torque / RATIO for i, torque in enumerate(torques)})
    run = fc.simulate(model, start=rest, until=2.0)
    assert (run.status, run.report.notes) == (fc.Status.FINISHED, ())
    assert moved(run) < 1e-7


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("damping", [0.0, 1e-3])
@pytest.mark.parametrize("k", [1e6, 1e12, 1e21])
def test_a_torque_moves_an_arm_as_behind_a_rigid_shaft(k, damping, method):
    given = {"inputs": {"F": 0.02, "m": -0.4 / RATIO}, "until": 0.1, "every": 0.01, "tolerance": TIGHT}
    run = fc.simulate(arm(k, damping=damping), method=method, **given)
    rigid = fc.simulate(arm(k, BEHIND_RIGID_SHAFTS), method=method, **given)
    assert run.status is fc.Status.FINISHED
    for name, unit in (("tip", 1.0), ("middle", 1.0), ("motor", RATIO)):
        assert np.abs(run[name] - rigid[name]).max() < 1e-4 * unit


@pytest.mark.parametrize("k", [1e9, 1e16, 1e21])
@pytest.mark.parametrize("law", [fc.CoulombFriction({"d": 0.0}), fc.Backlash({"d": 0.0})], ids=["dry", "play"])
def test_friction_and_play_of_none_leave_it_at_rest(k, law):
    model, loads = arm(k, (*FLEXIBLE, law)), {"F": 0.05, "m": -0.045 / RATIO}
    run = fc.simulate(model, start=fc.equilibrium(arm(k), inputs=loads).state, inputs=loads, until=1.0)
    assert moved(run) < 1e-7


def test_a_run_goes_on_bit_for_bit():
    model, given = arm(1e18), {"inputs": {"F": 0.02, "m": -0.4 / RATIO}}
    whole = fc.simulate(model, **given, until=0.4, every=0.01, method=fc.GeneralizedAlpha(1e-3))
    half = fc.simulate(model, **given, until=0.2, every=0.01, method=fc.GeneralizedAlpha(1e-3))
    rest = fc.simulate(arm(1e18), start=half.checkpoint, until=0.4, every=0.01, method=fc.GeneralizedAlpha(1e-3))
    assert np.array_equal(rest.final.q, whole.final.q)
    assert np.array_equal(rest.final.v, whole.final.v)


def test_shafts_that_doubles_hold_are_left_as_they_are():
    for model in (arm(1e6), arm(1e18, inertia=1e-6), arm(1e18, BEHIND_RIGID_SHAFTS)):
        assert giving_way(model) is model
