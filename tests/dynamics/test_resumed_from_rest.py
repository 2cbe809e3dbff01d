"""Runs that begin where nothing moves, or are gone on with to within the next step, have the bits of the whole run."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import OpenLoop, Ramp, Step, Table


def cart() -> fc.Model:
    """Nothing holds it."""
    mass = fc.PointMass("cart", (0, 0, 0), 2.0)
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")]
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], [], [fc.Force("f", mass.node, "x")], outputs)
    return fc.assemble(structure, [fc.LargeRotation()])


def drive() -> fc.Model:
    """A motor within its play."""
    arm = fc.RigidBody("arm", (0.1, 0, 0), 1.0, (0.7, 0.7, 1.0), {"hinge": (0, 0, 0)})
    hinge = arm.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=200.0, inertia=0.3, damping=0.5)
    outputs = [fc.DriveAngle("x", motor), fc.DriveSpeed("v", motor)]
    supports = [fc.Support(hinge, "u v w rx ry")]
    structure = fc.Structure([arm], supports, [motor], [fc.MotorTorque("f", motor)], outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.Backlash({"motor": 0.05})])


def same(one: fc.Run, other: fc.Run) -> bool:
    return all(np.array_equal(getattr(one.final, name), getattr(other.final, name)) for name in ("x", "q", "v"))


@pytest.mark.parametrize("machine", [cart, drive])
@pytest.mark.parametrize(
    "force",
    [
        pytest.param(lambda t: 5.0 * np.sin(6.0 * t), id="sine"),
        pytest.param(Ramp(3.0), id="ramp"),
        pytest.param(Table((0.0, 0.3, 0.7, 1.2, 1.6), (0.0, 6.0, -6.0, 9.0, 0.0)), id="table"),
        pytest.param(Step(3.0, at=0.4), id="step"),
    ],
)
def test_what_begins_where_nothing_moves(machine, force):
    """The first step knows nothing of when the run ends: 23 of 23 stops under a sine had other bits."""
    model, law = machine(), OpenLoop({"f": force})
    whole = fc.simulate(model, law, until=1.2)
    for stop in (0.07, 0.31, 0.55, 1.1):
        part = fc.simulate(model, law, until=stop)
        assert same(fc.simulate(model, law, until=1.2, start=part.checkpoint), whole), stop


def test_gone_on_with_to_within_the_next_step():
    """With an event watched and a break of the load ahead: 18 of 120 ended with a step of no length."""
    body = fc.RigidBody("body", (0, 0, -1), 1.0, (0.1, 0.1, 0.1), {"hinge": (0, 0, 0)})
    push, place = fc.Force("f", body.node, "x"), fc.Position("x", body.node, "x")
    structure = fc.Structure([body], [fc.Support(body.point("hinge"), "u v w rx rz")], [], [push], [place])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    law = OpenLoop({"f": Table((0.0, 0.5, 1.0, 1.5, 2.0), (0.0, 1.0, 0.0, 1.0, 0.0))})
    watched, method = [fc.Event("passed", "x", at=0.1)], fc.Unchecked(fc.AdaptiveAlpha())
    run = fc.simulate(model, law, until=0.01, events=watched, method=method)
    for k in range(2, 201):
        run = fc.simulate(model, law, until=0.01 * k, start=run.checkpoint, events=watched, method=method)
        assert run.status is fc.Status.FINISHED, k
    assert same(run, fc.simulate(model, law, until=2.0, events=watched, method=method))
