"""An emergency stop as a second run: the state that one machine has come to is the start of the same with a brake."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError


def table(*effects: fc.Effect) -> fc.Model:
    """A disc turned by a motor through a gear: one inertia of 3 kg m² where the shaft does not bend."""
    disc = fc.RigidBody("disc", (0, 0, 0), 10.0, (1.0, 1.0, 2.0))
    motor = fc.RotaryDrive("motor", disc.node, axis="z", stiffness=500.0, ratio=10.0, inertia=0.01, damping=0.1)
    outputs = [fc.Rotation("angle", disc.node, axis="z")]
    joints = [fc.Support(disc.node, "u v w rx ry")]
    plan = fc.Structure([disc], joints, [motor], [fc.MotorTorque("torque", motor)], outputs)
    return fc.assemble(plan, [fc.LargeRotation(), *effects])


def test_a_run_is_braked_from_where_it_has_come():
    """10 N m for a second, then 20 N m against it; it was a ValueError of numpy."""
    run = fc.simulate(table(), until=2.0, inputs={"torque": 1.0})
    speed = 10.0 / 3.0 * 2.0
    braked = table(fc.CoulombFriction({"motor": 2.0}))
    stopped = fc.simulate(braked, until=2.0, start=run.final)
    assert stopped["angle"][-1] - run["angle"][-1] == pytest.approx(speed**2 / (2.0 * 20.0 / 3.0), rel=1e-6)
    assert np.abs(stopped.final.v).max() < 1e-12
    again = fc.simulate(table(), until=1.0, start=stopped.final)
    assert again["angle"][-1] == pytest.approx(stopped["angle"][-1])


def test_an_equilibrium_is_sought_from_a_state_without_a_brake():
    run = fc.simulate(table(), until=0.1, inputs={"torque": 1.0})
    rest = fc.equilibrium(table(fc.CoulombFriction({"motor": 2.0})), start=run.final)
    assert rest.state.dry.phase.size == 1


def test_a_state_under_other_effects_is_refused_by_name():
    """With as many freedoms, a lag's torque was taken for a motor's angle."""
    lagging, bending = (table(fc.Flexible()) if bends else rigid_with_lag() for bends in (False, True))
    run = fc.simulate(lagging, until=1.0, inputs={"torque": 0.3})
    assert run.final.q.size == bending.n
    for begin in (run.final, run.at(0.5).state):
        with pytest.raises(StructureError, match=r"motor_lag.*under other effects"):
            fc.simulate(bending, until=1.0, start=begin)
    assert fc.simulate(lagging, until=2.0, start=run.final).status is fc.Status.FINISHED


def test_an_equilibrium_is_a_start_as_its_state_is():
    """A Rest went unchecked but for the number of its freedoms."""
    braked, bending = table(fc.CoulombFriction({"motor": 2.0})), table(fc.Flexible())
    assert fc.simulate(braked, until=0.5, start=fc.equilibrium(table())).status is fc.Status.FINISHED
    lagging = fc.equilibrium(rigid_with_lag(), hold={"disc_0_rz": 0.3})
    with pytest.raises(StructureError, match=r"motor_lag.*under other effects"):
        fc.simulate(bending, until=0.5, start=lagging)
    with pytest.raises(StructureError, match=r"motor_lag.*under other effects"):
        fc.project(bending, lagging.state)


def rigid_with_lag() -> fc.Model:
    model = table(fc.MotorLag({"motor": 0.1}))
    assert "motor_lag" in model.coordinates
    return model
