"""Two runs may be off alike: where they tell little, one far coarser is asked whether it goes elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd

ELSEWHERE = "goes elsewhere"
FINE = {"method": fc.Unchecked(fc.AdaptiveAlpha()), "tolerance": fc.Tolerance(1e-8, 1e-11)}


def said(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if ELSEWHERE in note]


def pendulum(second: bool = True) -> fc.Model:
    """Two bodies on hinges, or one alone, with a motor's torque on the upper one."""
    inertia = (0.05, 0.05, 0.05)
    upper = fc.RigidBody("upper", (0, 0, -0.5), 1.0, inertia, {"top": (0, 0, 0), "end": (0, 0, -1)})
    lower = fc.RigidBody("lower", (0, 0, -1.5), 1.0, inertia, {"top": (0, 0, -1), "end": (0, 0, -2)})
    joints = [fc.Support(upper.point("top"), "u v w rx rz")]
    joints += [fc.Hinge(upper.point("end"), lower.point("top"), axis="y")] if second else []
    last = (lower if second else upper).point("end")
    outputs = [fc.Position("x", last, "x"), fc.Position("z", last, "z")]
    outputs += [fc.AngularVelocity("rate", upper.point("end"), "y")]
    inputs = [fc.Torque("torque", upper.point("end"), "y")]
    bodies = [upper, lower] if second else [upper]
    return fc.assemble(fc.Structure(bodies, joints, inputs=inputs, outputs=outputs), [fc.Gravity(), fc.LargeRotation()])


def test_runs_at_1_5_and_27_times_the_tolerance_are_off_alike():
    """By a fifth of the motion on the way, and agree to 3 %: there is no telling it from them, but from a finer one."""
    model = pendulum()
    law = fc.Sampled(pd(kp=0.2, kd=0.02, measured="x", rate="rate", command="torque"), 0.05)
    how = {"until": 4.0, "start": model.rest.with_(v=np.array([5.625082529694051, 0.3]))}
    run, true = fc.simulate(model, law, **how), fc.simulate(model, law, **how, **FINE)
    assert np.linalg.norm(run.final.x - true.final.x, axis=1).max() > 0.05
    assert 0.1 < run.report.error < 0.3
    note = said(run)[0]
    assert "under 243 times the tolerance" in note
    assert "see whether Tolerance(1e-06, 1e-09) agrees" in note
    again = fc.simulate(model, law, tolerance=fc.Tolerance(1e-6, 1e-9), **how)
    assert np.linalg.norm(again.final.x - true.final.x, axis=1).max() < 0.02
    assert not said(again)


def test_a_motor_that_lags_before_a_gear_with_play():
    """A torque to and fro: 0.2 rad of 2.6 late, and told as 0.4 %."""
    load = fc.RigidBody("load", (0, 0, 0), 1.0, (1, 1, 2))
    motor = fc.RotaryDrive("motor", load.node, axis="z", stiffness=5.0, ratio=2.0, inertia=0.1)
    outputs, inputs = [fc.DriveAngle("angle", motor)], [fc.MotorTorque("torque", motor)]
    plan = fc.Structure([load], [fc.Support(load.node, "u v w rx ry")], [motor], inputs, outputs)
    effects = [fc.LargeRotation(), fc.ShaftElasticity(), fc.MotorLag({"motor": 0.3}), fc.Backlash({"motor": 0.4})]
    law = fc.OpenLoop({"torque": lambda t: 1.5 * np.cos(1.3 * t)})
    run = fc.simulate(fc.assemble(plan, effects), law, until=20.0, every=0.5, tolerance=fc.Tolerance(1e-5, 1e-8))
    assert run.report.error > 0.03 or said(run)


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5])
def test_where_nothing_grows_nothing_is_said(tolerance, speed):
    """One pendulum is late by what its steps err, however coarse they are."""
    model = pendulum(second=False)
    how = {"until": 12.0, "start": model.rest.with_(v=np.array([speed]))}
    run = fc.simulate(model, tolerance=fc.Tolerance(tolerance, 1e-3 * tolerance), **how)
    assert 1e-3 < run.report.error < 1.0
    assert not said(run)


def test_what_goes_on_from_a_checkpoint_says_it_too():
    """The far run goes on from where it stood, as the others do."""
    model = pendulum()
    how = {"start": model.rest.with_(v=np.array([5.0 + 0.625082529694051, 0.3]))}
    law = fc.Sampled(pd(kp=0.2, kd=0.02, measured="x", rate="rate", command="torque"), 0.05)
    part = fc.simulate(model, law, until=2.0, **how)
    assert not said(part)
    assert said(fc.simulate(model, law, until=4.0, start=part.checkpoint))
