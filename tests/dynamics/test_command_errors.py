"""What a law commands by what it reads is as far off as that makes it, and is told."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Table, pd


def crane():
    """A trolley with a load on a rope that rings at 10 Hz."""
    trolley = fc.PointMass("trolley", (0, 0, 0), 100.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -4), EA=8e5)
    load = fc.PointMass("load", (0, 0, -4), 50.0)
    joints = [fc.Support(trolley.node, "v w"), fc.Pin(trolley.node, rope.start), fc.Pin(rope.end, load.node)]
    inputs = [fc.Force("push", trolley.node, "x"), fc.Force("lift", load.node, "z")]
    outputs = [fc.Position("x", trolley.node, "x"), fc.Velocity("rate", load.node, "x")]
    outputs += [fc.Position("z", load.node, "z"), fc.Velocity("speed", load.node, "z")]
    structure = fc.Structure([trolley, rope, load], [*joints, fc.Support(load.node, "v")], (), inputs, outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.RopeStretch(), fc.LargeRotation()])


def law(sample_time):
    """The trolley follows a path and the load's swing; the other force damps what the rope does."""
    along = pd(kp=400.0, kd=300.0, measured="x", rate="rate", command="push")
    along = fc.Tracking(along, {"x": Table([0.0, 0.5, 1.0, 4.0], [0.0, 1.0, 1.5, 1.5])})
    up = pd(kp=0.0, kd=40.0, measured="z", rate="speed", command="lift")
    both = fc.design.Together(along, up)
    return fc.Sampled(both, sample_time) if sample_time else both


@pytest.mark.parametrize("sample_time", [0.0, 0.02])
def test_commands_are_told_of_as_outputs_are(sample_time):
    model, how = crane(), {"until": 4.0, "every": 0.02}
    start = fc.equilibrium(model)
    run = fc.simulate(model, law(sample_time), start=start, tolerance=fc.Tolerance(1e-3, 1e-5), **how)
    near = fc.simulate(model, law(sample_time), start=start, tolerance=fc.Tolerance(1e-8, 1e-10), **how)
    assert set(run.report.command_errors) == {"push", "lift"}
    for name, told in run.report.command_errors.items():
        off = np.abs(run[name] - near[name]).max() / np.ptp(near[name])
        assert 0.5 * off < told < max(10.0 * off, 0.01), name
    assert run.report.command_errors["lift"] > 1e-3
    assert "of the commands lift is off by" in str(run.report)


def test_nothing_is_told_of_commands_that_go_by_time_alone():
    model = crane()
    law = fc.OpenLoop({"push": Table([0.0, 1.0, 2.0], [0.0, 100.0, 0.0])})
    run = fc.simulate(model, law, until=2.0, start=fc.equilibrium(model))
    assert not run.report.command_errors
