"""What is said to be in no linear model is what adds no stiffness to it: play that is open, ropes that are slack."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.laws.idle import idle

FLEXIBLE = (fc.Flexible(), fc.LargeRotation())


@pytest.mark.parametrize("stretch", [1e-4, -1e-4, 1e-8, -1e-8])
@pytest.mark.parametrize("seed", range(3))
def test_a_rope_is_slack_where_it_is_longer_than_the_way(seed, stretch):
    rng = np.random.default_rng(seed)
    tube = fc.Section.tube(fc.STEEL, 0.02, 0.002)
    mast = fc.Beam("mast", (0, 0, 0), (*rng.normal(size=2), 1.5), tube, elements=2)
    anchor = np.array(mast.end.position) + rng.normal(size=3)
    length = float(np.linalg.norm(anchor - np.array(mast.end.position))) * (1.0 - stretch)
    stay = fc.Rope("stay", mast.end, anchor, EA=1e5, length=length)
    joints = [fc.Support(mast.start), fc.Pin(mast.end, stay.start), fc.Support(stay.end, "u v w")]
    model = fc.assemble(fc.Structure([mast, stay], joints), FLEXIBLE)
    rest = fc.equilibrium(model)
    stiffness = abs(fc.linearize(model, at=rest).parts["stay"].stiffness).max()
    said = any("stay is slack" in note for note in idle(model, rest.state))
    assert said == (stiffness == 0.0) == (stretch < 0.0)


@pytest.mark.parametrize("moved", [-0.3, -0.126, -0.124, 0.0, 0.1, 0.124, 0.126, 0.3])
def test_the_play_of_a_spring_is_open_between_its_flanks(moved):
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), 1e4)
    joints = [fc.Support(mass.node, "v w"), fc.Support(spring.start), fc.Pin(mass.node, spring.end)]
    structure = fc.Structure([mass, spring], joints, inputs=[fc.Force("push", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"spring": 0.25})])
    place, push = model.displace({"mass_0_u": moved}), 1e4 * np.sign(moved) * max(abs(moved) - 0.125, 0.0)
    stiffness = fc.linearize(model, at=place, inputs={"push": push}).K.toarray()[0, 0]
    said = any("the play of spring is open" in note for note in idle(model, place))
    assert said == (stiffness == 0.0) == (abs(moved) < 0.125)


@pytest.mark.parametrize("torque", [0.0, 0.05, -0.05])
def test_the_play_of_a_shaft_is_open_where_no_load_presses_it(torque):
    """A wheel on a held motor: turned by a torque it rests on a flank, without one in between."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), mass=1.0, inertia=(0.1, 0.1, 0.1))
    motor = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=2.0, ratio=10.0, inertia=1e-3)
    turn = fc.Torque("turn", wheel.node, "z")
    joints = [fc.Support(wheel.node, "u v w rx ry")]
    structure = fc.Structure([wheel], joints, [motor], inputs=[turn])
    model = fc.assemble(structure, [*FLEXIBLE, fc.Backlash({"motor": 0.2})])
    rest = fc.equilibrium(model, hold={"motor_source": 0.0}, inputs={"turn": torque}) if torque else None
    state = rest.state if rest else model.rest
    said = any("the play of motor is open" in note for note in idle(model, state))
    assert said == (torque == 0.0)
    assert abs(fc.linearize(model, at=rest or state).K).max() == pytest.approx(0.0 if said else 200.0)


def test_a_machine_without_play_and_ropes_has_nothing_to_say():
    tube = fc.Section.tube(fc.STEEL, 0.02, 0.002)
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 1), tube)
    model = fc.assemble(fc.Structure([mast], [fc.Support(mast.start)]), FLEXIBLE)
    assert idle(model, model.rest) == ()
