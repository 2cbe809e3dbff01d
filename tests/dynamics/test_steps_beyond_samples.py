"""No step of one length goes beyond a sample: what is told of a run is the same, however long steps were asked for."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import MinimumJerk, OpenLoop, Table, Together, pd
from flexctrl.dynamics.notes.beside import agreeing

SAMPLE = 2e-3


def crane() -> fc.Model:
    """A cart on a drive, whose load is lifted off its rope and let fall into it six times."""
    cart, load = fc.PointMass("cart", (0, 0, 0), 50.0), fc.PointMass("load", (0, 0, -1.5), 30.0)
    rope = fc.Rope("rope", cart.node, load.node.position, EA=30 * 9.81 * 300, damping=20.0)
    drive = fc.LinearDrive(
        "drive", cart.node, direction="x", radius=0.1, ratio=10.0, stiffness=50.0, inertia=5e-3, damping=0.05
    )
    joints = [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, load.node)]
    plan = fc.Structure(
        [cart, load, rope],
        [*joints, fc.Support(load.node, "v")],
        [drive],
        [fc.MotorTorque("torque", drive), fc.Force("lift", load.node, "z")],
        [
            *(fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)),
            *(fc.Position("z", load.node, "z"), fc.Velocity("vz", load.node, "z"), fc.Tension("tension", rope)),
        ],
    )
    return fc.assemble(plan, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def law() -> fc.design.Controller:
    own, move = pd(kp=1.0, kd=0.15, measured="angle", rate="speed", command="torque"), MinimumJerk(50.0, 1.0)
    lift = Table(tuple(np.arange(13) * 0.2), tuple(30 * 9.81 * 1.4 * (k % 2) for k in range(13)))
    tracking = fc.Tracking(own, {"angle": move, "speed": move.derivative})
    return fc.Sampled(Together(tracking, OpenLoop({"lift": lift})), SAMPLE)


@pytest.fixture(scope="module")
def runs() -> tuple[fc.Model, dict]:
    model = crane()
    return model, {"until": 2.4, "start": fc.equilibrium(model, hold={"drive_source": 0.0}), "every": 0.01}


def test_what_is_told_does_not_hang_on_how_long_steps_could_be(runs):
    """Tension is 2.3 % off: in steps of 8 ms a run beside was the same one again, and told 0."""
    model, how = runs
    told = [fc.simulate(model, law(), method=fc.GeneralizedAlpha(k * SAMPLE), **how) for k in (1, 2, 4, 10)]
    sharp = fc.simulate(model, law(), method=fc.Unchecked(fc.GeneralizedAlpha(SAMPLE / 50)), **how)
    off = np.abs(told[0]["tension"] - sharp["tension"]).max() / np.ptp(sharp["tension"])
    assert 0.01 < off < 0.05
    for run in told:
        assert np.array_equal(run.y, told[0].y)
        assert run.report.output_errors == told[0].report.output_errors
        assert run.report.notes == told[0].report.notes
        assert run.report.output_errors["tension"] > 0.5 * off


def test_steps_that_samples_even_out_are_told_of_alike(runs):
    """Two steps a sample, whether half or 0.7 of one was asked for."""
    model, how = runs
    one, other = (fc.simulate(model, law(), method=fc.GeneralizedAlpha(share * SAMPLE), **how) for share in (0.5, 0.7))
    assert np.array_equal(one.y, other.y)
    assert one.report.output_errors == other.report.output_errors
    assert one.report.notes == other.report.notes


@pytest.mark.parametrize(
    ("share", "taken"), [(20.0, 1.0), (1.0, 1.0), (0.99, 0.5), (0.5, 0.5), (0.3, 0.25), (0.1, 0.1)]
)
def test_what_is_advised_goes_by_the_steps_that_are_taken(share, taken):
    """A step of a quarter of what was asked for was the same run again, wherever that was four samples or more."""
    plan = SimpleNamespace(
        tolerance=fc.Tolerance(),
        method=fc.GeneralizedAlpha(share * SAMPLE),
        feed=SimpleNamespace(sample_time=SAMPLE, breaks=()),
    )
    for length in (taken, share):
        until = SimpleNamespace(state=SimpleNamespace(t=100.0 * SAMPLE))
        journey = SimpleNamespace(plan=plan, point=until, mark=SimpleNamespace(steps=100.0 / length))
        assert agreeing(journey) == f"a step of {0.25 * length * SAMPLE:.1g} s"
        plan.feed.sample_time = 0.0
