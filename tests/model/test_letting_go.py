"""What an equilibrium holds is borne by inputs, so that runs and loops about it are those of a machine let go of."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.braked import places_held, rest_held

TUBE = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)


def arm(*effects: fc.MotorLag) -> fc.Model:
    """A flexible arm that its motor holds against gravity."""
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), TUBE, elements=2)
    tip = fc.PointMass("tip", beam.end, 10.0)
    motor = fc.RotaryDrive("mot", beam.start, axis="-y", stiffness=20.0, ratio=100, inertia=4e-3)
    structure = fc.Structure(
        [beam, tip],
        [fc.Support(beam.start, "u v w rx rz"), fc.Pin(beam.end, tip.node)],
        [motor],
        [fc.MotorTorque("torque", motor), fc.Force("gust", tip.node, "z")],
        [fc.Position("height", tip.node, "z"), fc.DriveAngle("angle", motor)],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), *effects])


def hoist() -> fc.Model:
    """A load on a winch of a trolley that nothing holds."""
    trolley, load = fc.PointMass("trolley", (0, 0, 40), mass=50e3), fc.PointMass("load", (0, 0, 10), mass=30e3)
    winch = fc.Winch("hoist", load.node, trolley.node, EA=5e7, damping=30e3, radius=0.75, ratio=30.0, inertia=30.0)
    structure = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [winch],
        [fc.MotorTorque("torque", winch)],
        [fc.Position("height", load.node, "z")],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])


@pytest.mark.parametrize("effects", [(), (fc.MotorLag({"mot": 0.05}),)], ids=["at once", "lagging"])
@pytest.mark.parametrize("at", [0.0, 0.5, -30.0])
def test_a_motor_bears_what_was_held_and_the_machine_stays(effects: tuple[fc.MotorLag, ...], at: float) -> None:
    held = fc.equilibrium(arm(*effects), hold={"mot_source": at})
    free = held.let_go()
    assert free.held == ()
    assert free.inputs == pytest.approx([held.holding["mot_source"], 0.0])
    run = fc.simulate(held.model, start=free, until=0.5)
    assert np.ptp(run["height"]) < 1e-6


def test_the_linear_model_is_that_under_the_inputs_that_bear_it() -> None:
    held = fc.equilibrium(arm(), hold={"mot_source": 0.3})
    free = fc.linearize(held.model, at=held.let_go())
    same = fc.linearize(held.model, at=held.state, inputs={"torque": held.holding["mot_source"]})
    assert abs(free.K - same.K).max() == 0.0
    assert not free.certificate.idle


def test_a_force_bears_a_coordinate_and_inputs_given_before_stay() -> None:
    mass = fc.PointMass("mass", (0, 0, 0), 2.0)
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=50.0)
    structure = fc.Structure(
        [mass, spring],
        [fc.Support(mass.node, "v w"), fc.Support(spring.start), fc.Pin(spring.end, mass.node)],
        inputs=[fc.Force("pull", mass.node, "x")],
    )
    model = fc.assemble(structure, [fc.Flexible()])
    free = fc.equilibrium(model, hold={"mass_0_u": 0.2}, inputs={"pull": 3.0}).let_go()
    assert free.held == ()
    assert free.inputs == pytest.approx([10.0])


def test_what_no_input_bears_by_itself_is_held_still() -> None:
    held = fc.equilibrium(arm(), hold={"arm_1_w": 0.0})
    free = held.let_go()
    assert free.held == held.held
    assert free.holding == held.holding
    assert not free.inputs.any()


def test_nothing_held_is_left_as_it_is() -> None:
    rest = fc.equilibrium(hoist(), hold={"hoist_source": 0.0}).let_go()
    assert rest.let_go() is rest


@pytest.mark.parametrize("at", [0.0, 1e-6, 7.0632, -50.0])
def test_a_brake_of_the_rigid_twin_is_borne_by_its_motor(at: float) -> None:
    twin = fc.rigid(hoist())
    held = rest_held(twin, {"hoist_source": at}, {})
    assert places_held(held, ["hoist_source"])["hoist_source"] == pytest.approx(at, abs=1e-12)
    assert held.state.x[1, 2] == pytest.approx(10.0 - at * 0.75 / 30.0)
    free = held.let_go()
    assert free.inputs == pytest.approx([-30e3 * 9.81 * 0.75 / 30.0])
    assert not free.held
    assert not free.brakes
    assert np.ptp(fc.simulate(twin, start=free, until=1.0)["height"]) < 1e-9


@pytest.mark.parametrize("effects", [(), (fc.MotorLag({"mot": 0.05}),)], ids=["at once", "lagging"])
@pytest.mark.parametrize("held", ["mot_source", "arm_0_ry"])
def test_a_motor_behind_a_rigid_shaft_bears_its_joint(effects: tuple[fc.MotorLag, ...], held: str) -> None:
    twin = fc.rigid(arm(*effects))
    free = rest_held(twin, {held: 0.0}, {}).let_go()
    weight = 10.0 + TUBE.rhoA * 2.0 / 2.0
    assert not free.held
    assert free.inputs == pytest.approx([weight * 9.81 * 2.0 / 100.0, 0.0])
    assert np.ptp(fc.simulate(twin, start=free, until=0.5)["height"]) < 1e-6
    assert not fc.linearize(twin, at=free).certificate.idle
