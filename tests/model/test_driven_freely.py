"""Machines that loads drive freely: what is told is the motion that nothing resists, and the motor to hold."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import EquilibriumError
from flexctrl.model.balance import Balance
from flexctrl.model.driven import driven_freely

EFFECTS = [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]
TUBE = fc.Section.tube(fc.STEEL, 0.03, 0.002)


def arm(ratio: float = 100.0) -> fc.Structure:
    """README's: a load at the end of an arm that a motor turns about the vertical."""
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), TUBE, elements=2)
    load = fc.PointMass("load", beam.end, 10.0)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=2.0, ratio=ratio, inertia=4e-3)
    joints = [fc.Support(beam.start, "u v w rx ry"), fc.Pin(beam.end, load.node)]
    return fc.Structure([beam, load], joints, [motor], [fc.MotorTorque("torque", motor)])


def crane() -> fc.Model:
    """A load on a winch below a trolley that a motor moves along a rail."""
    trolley, load = fc.PointMass("trolley", (0, 0, 12), 500.0), fc.PointMass("load", (0, 0, 4), 2000.0)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=2e7, damping=2e3, radius=0.15, ratio=20, inertia=0.3)
    travel = fc.LinearDrive("travel", trolley.node, direction="x", radius=0.1, ratio=10, stiffness=500, inertia=0.1)
    inputs = [fc.MotorTorque("drive", travel), fc.MotorTorque("lift", hoist), fc.Force("wind", load.node, "x")]
    joints = [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")]
    return fc.assemble(fc.Structure([trolley, load], joints, [travel, hoist], inputs), EFFECTS)


def driven(model: fc.Model, hold: dict[str, float] | None = None, **inputs: float) -> dict[str, float]:
    held = {model.coordinate(name): value for name, value in (hold or {}).items()}
    found = driven_freely(Balance(model, model.input_vector(inputs), held), model.rest, 1e-9)
    return {motion.lead: motion.push for motion in found}


def test_a_crane_whose_winch_nobody_holds_names_it():
    with pytest.raises(EquilibriumError, match=r"motion of hoist_source \(with load_0_w\).* 147\.2 N m: hold it"):
        fc.equilibrium(crane())


def test_an_arm_that_a_motor_turns_names_the_motor():
    model = fc.assemble(fc.planar(arm(), "z"), EFFECTS[1:])
    with pytest.raises(EquilibriumError, match=r"motion of motor_source .* 0\.001 N m: hold it") as failure:
        fc.equilibrium(model, inputs={"torque": 1e-3})
    assert failure.value.state is not None
    assert fc.equilibrium(model, {"motor_source": 0.0}, {"torque": 1e-3}).holding["motor_source"] == pytest.approx(
        -1e-3
    )


@pytest.mark.parametrize("torque", [1e-6, 1e-3, 1.0, -100.0])
@pytest.mark.parametrize("ratio", [1.0, 100.0])
def test_an_arm_is_driven_by_the_torque_of_its_motor(torque, ratio):
    """However small beside the weight; behind a rigid shaft the arm itself, by the torque times the ratio."""
    model = fc.assemble(arm(ratio), EFFECTS)
    assert driven(model, torque=torque) == {"motor_source": pytest.approx(torque)}
    assert driven(fc.rigid(model), torque=torque) == {"arm_0_rz": pytest.approx(ratio * torque)}
    assert driven(model, hold={"motor_source": 0.0}, torque=torque) == {}


def test_a_crane_is_driven_by_what_its_motors_would_have_to_hold():
    """r T (1 + T/2EA)/R on a winch whose rope stretches; on the rail by what torque and wind come to."""
    model, T = crane(), 2000.0 * 9.81
    lift = 0.15 * T * (1.0 + T / 4e7) / 20.0
    assert driven(model) == {"hoist_source": pytest.approx(lift, rel=1e-9)}
    assert driven(model, drive=1.0) == {"hoist_source": pytest.approx(lift), "travel_source": pytest.approx(1.0)}
    assert driven(model, {"hoist_source": 0.0}, drive=1.0, wind=-50.0) == {"travel_source": pytest.approx(0.5)}
    assert driven(model, {"hoist_source": 0.0}, drive=1.0, wind=-100.0) == {}  # 1 N m · 10/0.1 m


def test_a_mass_on_a_plane_is_driven_along_both_ways():
    mass = fc.PointMass("mass", (1, 2, 3), 5.0)
    pushes = [fc.Force("east", mass.node, "x"), fc.Force("north", mass.node, "y")]
    model = fc.assemble(fc.Structure([mass], [fc.Support(mass.node, "w")], inputs=pushes), EFFECTS)
    assert driven(model, east=3.0, north=4.0) == {"mass_0_u": pytest.approx(3.0), "mass_0_v": pytest.approx(4.0)}
    assert driven(model, north=4.0) == {"mass_0_v": pytest.approx(4.0)}


def test_what_only_begins_without_stiffness_is_not_driven_freely():
    """A pendulum drawn level swings down, a load on a slack rope falls as far as that is long."""
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), TUBE, elements=2)
    level = fc.assemble(fc.Structure([beam], [fc.Support(beam.start, "u v w rx rz")]), EFFECTS)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=1e5, length=2.5, elements=2)
    load = fc.PointMass("load", rope.end, 10.0)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)]
    slack = fc.assemble(fc.Structure([rope, load], joints), EFFECTS)
    for model in (level, slack):
        assert driven(model) == {}
        assert np.isfinite(fc.equilibrium(model).residual)
