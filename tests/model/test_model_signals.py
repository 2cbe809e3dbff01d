"""Outputs and inputs of a model: signs, turns, slackness; values from geometry."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

E = fc.Section(EA=2e5, EI_y=157, EI_z=157, GJ=157, rhoA=1.5, rhoJ=0.02)
RIGID = [fc.LargeRotation()]
FLEXIBLE = [fc.LargeRotation(), fc.Flexible()]


def measured(model: fc.Model, state: fc.State) -> dict[str, float]:
    return dict(zip(model.outputs, model.measure(state).tolist(), strict=True))


def driven(model: fc.Model, name: str, total: float, steps: int) -> fc.State:
    """Move one coordinate in equal steps."""
    state, step = model.rest, np.zeros(model.n)
    step[model.coordinate(name)] = total / steps
    for _ in range(steps):
        state = model.advance(state, step, np.zeros(model.n), 0.0)
    return state


def turntable(effects) -> fc.Model:
    """A post that turns about z, an arm hinged to it about z too; a motor at each."""
    post = fc.RigidBody("post", (0, 0, 0), 5.0, (1, 1, 1), {"top": (0, 0, 1)})
    arm = fc.RigidBody("arm", (1, 0, 1), 2.0, (0.1, 0.5, 0.5), {"root": (0, 0, 1)})
    slew = fc.RotaryDrive("slew", post.node, axis="z", stiffness=40.0, ratio=12.0, inertia=0.01)
    elbow = fc.RotaryDrive("elbow", arm.point("root"), post.point("top"), axis="z", stiffness=40.0, ratio=-5.0)
    outputs = [
        fc.Rotation("post_angle", post.node, "z"),
        fc.Rotation("arm_angle", arm.node, "z"),
        fc.Rotation("joint_angle", arm.point("root"), "z", minus=post.point("top")),
        fc.DriveAngle("slew_angle", slew),
        fc.DriveAngle("elbow_angle", elbow),
        fc.DriveSpeed("elbow_speed", elbow),
        fc.AngularVelocity("arm_spin", arm.node, "z"),
        fc.Position("arm_x", arm.node, "x", minus=post.node),
    ]
    joints = [fc.Support(post.node, "u v w rx ry"), fc.Hinge(post.point("top"), arm.point("root"), "z")]
    torques = [fc.MotorTorque("slew_torque", slew), fc.MotorTorque("elbow_torque", elbow)]
    structure = fc.Structure([post, arm], joints, [slew, elbow], torques, outputs)
    return fc.assemble(structure, effects, fc.CasadiVM())


@pytest.mark.parametrize("turns", [0.25, 1.0, -3.5, 40.0])
def test_angles_do_not_wrap(turns):
    """The arm turns against the post: its rows are absolute angles, the motor counts R times the joint's."""
    model = turntable(RIGID)
    angle = 2 * np.pi * turns
    out = measured(model, driven(model, "arm_0_rz", angle, 200))
    assert out["arm_angle"] == out["joint_angle"] == pytest.approx(angle, rel=1e-12)
    assert out["post_angle"] == pytest.approx(0.0, abs=1e-12)
    assert out["elbow_angle"] == pytest.approx(-5.0 * angle, rel=1e-12)
    assert out["slew_angle"] == pytest.approx(0.0, abs=1e-12)
    assert out["arm_x"] == pytest.approx(np.cos(angle), abs=1e-11)


def test_a_joint_that_rides_on_a_turning_post_counts_its_own_turns():
    model = turntable(RIGID)
    state = driven(model, "post_0_rz", 4 * np.pi, 100)
    out = measured(model, state)
    assert out["post_angle"] == pytest.approx(4 * np.pi)
    assert out["arm_angle"] == pytest.approx(0.0, abs=1e-12)
    assert out["joint_angle"] == pytest.approx(-4 * np.pi)
    assert out["slew_angle"] == pytest.approx(48 * np.pi)
    assert out["elbow_angle"] == pytest.approx(20 * np.pi)


def test_an_elastic_shaft_lets_the_motor_lead():
    """The source angle is a coordinate of its own; the twist stores ½ k (R s − θ_d)²."""
    model = turntable([*RIGID, fc.ShaftElasticity()])
    state = model.displace({"elbow_source": 0.3, "arm_0_rz": 0.1})
    out = measured(model, state)
    assert out["elbow_angle"] == pytest.approx(0.3)
    assert out["joint_angle"] == pytest.approx(0.1)
    assert model.energy(state)[1] == pytest.approx(0.5 * 40.0 * (-5.0 * 0.1 - 0.3) ** 2)


def test_many_turns_of_an_elastic_shaft_store_no_energy():
    model = turntable([*RIGID, fc.ShaftElasticity()])
    state, step = model.rest, np.zeros(model.n)
    step[model.coordinate("arm_0_rz")] = 0.5
    step[model.coordinate("elbow_source")] = -5.0 * 0.5
    for _ in range(100):
        state = model.advance(state, step, np.zeros(model.n), 0.0)
    assert measured(model, state)["joint_angle"] == pytest.approx(50.0)
    assert model.energy(state)[1] == pytest.approx(0.0, abs=1e-18)


@pytest.mark.parametrize("effects", [RIGID, [*RIGID, fc.ShaftElasticity()]], ids=["rigid", "elastic"])
def test_motor_torque_acts_on_the_source_angle(effects):
    """Power: torque times motor speed."""
    model = turntable(effects)
    v = np.random.default_rng(0).normal(size=model.n)
    state = model.displace(0.2 * v).with_(v=v)
    power = model.loads(state, model.input_vector({"elbow_torque": 3.0})) @ v
    assert power == pytest.approx(3.0 * measured(model, state)["elbow_speed"])


def hanging(effects, length=None) -> fc.Model:
    rope = fc.Rope("rope", (0, 0, 2), (0, 0, 0), EA=600.0, length=length, damping=3.0)
    load = fc.PointMass("load", (0, 0, 0), 2.0)
    outputs = [
        fc.SwayAngle("sway_x", rope.start, load.node, "x"),
        fc.SwayAngle("sway_y", rope.start, load.node, "-y"),
        fc.Tension("pull", rope),
        fc.Velocity("speed", load.node, "z"),
    ]
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node)]
    inputs = [fc.Force("push", load.node, (3.0, 0.0, 4.0))]
    return fc.assemble(fc.Structure([rope, load], joints, inputs=inputs, outputs=outputs), effects, fc.CasadiVM())


def test_sway_is_positive_ahead_of_the_top():
    model = hanging(FLEXIBLE)
    out = measured(model, model.displace(np.array([0.5, 0.3, 0.0])))
    assert out["sway_x"] == pytest.approx(np.arctan2(0.5, 2.0))
    assert out["sway_y"] == pytest.approx(-np.arctan2(0.3, 2.0))


def test_a_rope_pulls_by_stretch_and_damping_and_never_pushes():
    model = hanging(FLEXIBLE)
    pulled = model.displace(np.array([0.0, 0.0, -0.1]))
    assert measured(model, pulled)["pull"] == pytest.approx(30.0)
    falling = pulled.with_(v=np.array([0.0, 0.0, -0.5]))
    assert measured(model, falling)["pull"] == pytest.approx(30.0 + 1.5)
    assert measured(model, falling)["speed"] == pytest.approx(-0.5)
    rising = pulled.with_(v=np.array([0.0, 0.0, 50.0]))
    assert measured(model, rising)["pull"] == 0.0
    assert measured(model, model.displace(np.array([0.0, 0.0, 0.1])))["pull"] == 0.0


@pytest.mark.parametrize("effects", [FLEXIBLE, [*FLEXIBLE, fc.RayleighDamping(0.0, 0.05)]], ids=["plain", "damped"])
def test_the_tension_measured_is_the_force_that_acts(effects):
    model = hanging(effects, length=1.8)
    state = model.displace(np.array([0.4, -0.2, 0.1])).with_(v=np.array([0.3, 0.1, -0.2]))
    force = model.balance(state, state.v, np.zeros(3))
    assert np.linalg.norm(force) == pytest.approx(measured(model, state)["pull"])


def test_a_force_acts_along_its_direction_with_its_full_size():
    model = hanging(FLEXIBLE)
    assert np.allclose(model.loads(model.rest, np.array([10.0])), [6.0, 0.0, 8.0])


def test_a_force_on_several_nodes_acts_on_each():
    """The paper's load case: 500 N at both ends of the girder."""
    girder = fc.Beam("girder", (0, -3, 0), (0, 3, 0), E, elements=6)
    joints = [fc.Support(girder.start, "v w"), fc.Support(girder.end, "v w")]
    push = fc.Force("push", [girder.start, girder.end], "x")
    model = fc.assemble(fc.Structure([girder], joints, inputs=[push]), FLEXIBLE, fc.CasadiVM())
    load = model.loads(model.rest, model.input_vector({"push": 500.0}))
    expected = np.zeros(model.n)
    expected[[model.coordinate("girder_0_u"), model.coordinate("girder_6_u")]] = 500.0
    assert np.array_equal(load, expected)


def test_a_torque_turns_about_a_fixed_axis():
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1, 2, 3))
    structure = fc.Structure([body], inputs=[fc.Torque("twist", body.node, (0, 3, 4))])
    model = fc.assemble(structure, RIGID, fc.CasadiVM())
    state = model.displace(np.array([1, 2, 3, 0.5, 0.6, -0.7]))
    assert np.allclose(model.loads(state, np.array([5.0])), [0, 0, 0, 0, 3, 4])


def test_inputs_by_name():
    model = turntable(RIGID)
    assert np.array_equal(model.input_vector({"elbow_torque": 2}), [0.0, 2.0])
    with pytest.raises(StructureError, match="no input 'elbow_tork'; did you mean 'elbow_torque'"):
        model.input_vector({"elbow_tork": 2.0})
    for value in ("2", None, float("nan"), True):
        with pytest.raises(StructureError, match="input 'elbow_torque' = "):
            model.input_vector({"elbow_torque": value})
    with pytest.raises(StructureError, match="expected a mapping of input names"):
        model.input_vector([1.0, 2.0])
