"""Small motion is linear, outputs too, and what it leaves out of every output is of second order in the motion."""

from __future__ import annotations

import numpy as np
import pytest
from machines import machine

import flexctrl as fc

E = fc.Section(EA=2e6, EI_y=4e4, EI_z=3e4, GJ=2e4, rhoA=4.0, rhoJ=0.05)
BASE = [fc.Gravity(), fc.RayleighDamping(0.01, 1e-3)]
STRETCHING = [fc.BeamFlexibility(), fc.RopeStretch()]
HOLD = {"travel_source": 0.0, "slew_source": 0.0, "hoist_source": 0.0}
KINDS = (
    fc.Position,
    fc.Velocity,
    fc.Rotation,
    fc.AngularVelocity,
    fc.DriveAngle,
    fc.DriveSpeed,
    fc.SwayAngle,
    fc.Tension,
)


def crane() -> fc.Structure:
    """A slewing jib on a carriage: a winch at its tip, a rope and a spring half way along."""
    carriage = fc.RigidBody("carriage", (0, 0, 0), 200.0, (20, 20, 20), {"top": (0, 0, 1)})
    mast = fc.RigidBody("mast", (0, 0, 3), 100.0, (60, 60, 9), {"foot": (0, 0, 1), "head": (0, 0, 5)})
    jib = fc.Beam("jib", (0, 0, 5), (6, 0, 5), E, elements=2, up="z")
    load = fc.PointMass("load", (6, 0, 1), 50.0)
    lamp = fc.PointMass("lamp", (3, 0, 2), 20.0)
    rope = fc.Rope("rope", jib.node(1), lamp.node, EA=4e5, damping=200.0)
    spring = fc.Spring("spring", load.node, lamp.node, stiffness=300.0, damping=5.0)
    drives = [
        fc.LinearDrive("travel", carriage.node, direction="x", radius=0.2, ratio=10.0, stiffness=900.0, inertia=0.1),
        fc.RotaryDrive(
            "slew", mast.point("foot"), carriage.point("top"), axis="z", ratio=20.0, stiffness=50.0, inertia=0.1
        ),
        fc.Winch("hoist", load.node, jib.end, EA=3e5, radius=0.3, ratio=15.0, inertia=0.05, damping=300.0),
    ]
    joints = [
        fc.Support(carriage.node, "v w rx ry rz"),
        fc.Hinge(carriage.point("top"), mast.point("foot"), "z"),
        fc.Weld(mast.point("head"), jib.start),
        fc.Pin(rope.start, jib.node(1)),
        fc.Pin(rope.end, lamp.node),
        fc.Pin(spring.start, load.node),
        fc.Pin(spring.end, lamp.node),
    ]
    outputs = [
        fc.Position("place", load.node, (0.6, 0.0, 0.8), minus=mast.node),
        fc.Velocity("speed", lamp.node, (0.6, 0.8, 0.0)),
        fc.Rotation("turn", jib.end, "x", minus=mast.node),
        fc.Rotation("slewed", jib.end, "z"),
        fc.AngularVelocity("spin", jib.end, "y", minus=mast.node),
        *(fc.DriveAngle(f"{d.name}_angle", d) for d in drives),
        *(fc.DriveSpeed(f"{d.name}_speed", d) for d in drives),
        fc.SwayAngle("sway", jib.end, load.node, (0.8, 0.6, 0.0)),
        *(fc.Tension(f"{part.name}_pull", part) for part in (drives[2], rope, spring)),
    ]
    inputs = [*(fc.MotorTorque(f"{d.name}_torque", d) for d in drives), fc.Force("push", lamp.node, (0.6, 0.8, 0.0))]
    return fc.Structure([carriage, mast, jib, load, lamp, rope, spring], joints, drives, inputs, outputs)


def pair(more: list) -> tuple[fc.Model, fc.Model]:
    """Where parts move far, and in small motion about the equilibrium that motors' torques keep."""
    machine = crane()
    hold = HOLD if fc.ShaftElasticity() in more else {"hoist_source": 0.0}
    large = fc.assemble(machine, [*BASE, *more, fc.LargeRotation()])
    rest = fc.equilibrium(large, hold=hold)
    still = np.zeros(large.n)
    missing = large.balance(rest.state, still, still)
    torques = {f"{name[:-7]}_torque": -float(missing[large.coordinate(name)]) for name in hold}
    return large, fc.assemble(machine, [*BASE, *more, fc.GeometricStiffness(hold, torques)])


@pytest.fixture(scope="module", params=[[*STRETCHING, fc.ShaftElasticity()], STRETCHING], ids=["elastic", "rigid"])
def models(request):
    return pair(request.param)


def moved(model: fc.Model, way: np.ndarray, rate: np.ndarray, size: float) -> np.ndarray:
    """What outputs change by on a way of some size from rest."""
    rest = model.rest
    return model.measure(model.advance(rest, size * way, size * rate, 0.0)) - model.measure(rest)


def test_every_kind_of_output_is_looked_at():
    assert {type(output) for output in crane().outputs} == set(KINDS)


def test_what_outputs_leave_out_is_of_second_order(models):
    large, small = models
    rng = np.random.default_rng(3)
    way, rate = rng.normal(size=(2, small.n))
    at = small.rest
    errors = []
    for size in (2e-4, 1e-4):
        there = large.measure(large.advance(at, size * way, size * rate, 0.0)) - large.measure(at)
        errors.append(np.abs(there - moved(small, way, rate, size)))
        assert (errors[-1] <= 0.1 * np.abs(there)).all()
    np.testing.assert_array_less(3.9 * errors[1], errors[0] + 1e-9)


def test_outputs_are_linear_with_the_slope_of_the_linearised_machine(models):
    large, small = models
    linear = fc.linearize(large, at=small.rest, inputs=dict(small.effects[-1].inputs))
    way, rate = np.random.default_rng(4).normal(size=(2, small.n))
    assert linear.coordinates == small.coordinates
    expected = linear.Cq @ way + linear.Cv @ rate
    for size in (1.0, 100.0):
        np.testing.assert_allclose(moved(small, way, rate, size), size * expected, rtol=1e-9, atol=1e-9 * size)
    np.testing.assert_allclose(small.measure(small.rest), large.measure(small.rest), rtol=1e-12, atol=1e-12)


def test_runs_tell_what_the_linear_model_tells(models):
    """By each method, compiled or not, and however large the motion is."""
    _, small = models
    torques = dict(small.effects[-1].inputs)
    linear = fc.linearize(small)
    plan = {"until": 1.0, "every": 0.1}
    exact = fc.simulate(linear, inputs={"push": 1e4}, method=fc.Exact(0.02), **plan)
    level = small.measure(small.rest)
    slow = small.with_(backend=fc.CasadiVM())
    for model, method, tolerance in (
        (small, fc.Exact(0.02), 1e-8),
        (slow, fc.Exact(0.02), 1e-8),
        (small, fc.GeneralizedAlpha(2e-4), 2e-3),
    ):
        run = fc.simulate(model, inputs=torques | {"push": 1e4}, method=method, **plan)
        for name, at_rest in zip(small.outputs, level, strict=True):
            scale = max(np.abs(exact[name]).max(), 1e-6)
            np.testing.assert_allclose(run[name] - at_rest, exact[name], rtol=0, atol=tolerance * scale, err_msg=name)


def test_a_run_of_the_machine_differs_by_the_square_of_what_pushes_it(models):
    large, small = models
    torques = dict(small.effects[-1].inputs)
    plan = {"until": 0.5, "every": 0.02, "method": fc.GeneralizedAlpha(1e-3), "start": small.rest}
    errors = []
    for push in (0.4, 0.2):
        runs = [fc.simulate(m, inputs=torques | {"push": push}, **plan) for m in (large, small)]
        errors.append(np.array([np.abs(runs[0][name] - runs[1][name]).max() for name in small.outputs]))
        spans = np.array([np.ptp(runs[0][name]) for name in small.outputs])
        assert (errors[-1] <= 0.05 * spans + 1e-7).all()
    np.testing.assert_array_less(3.7 * errors[1], errors[0] + 1e-7)


@pytest.mark.parametrize("method", [fc.Exact(0.01), fc.GeneralizedAlpha(0.01)])
def test_a_rope_that_swings_pulls_by_the_weight(method):
    """Not by EA times how much longer its straight picture is: 71.5 kN instead of 19.62 at 0.1 rad."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -8), EA=1e7, damping=2000.0)
    bob = fc.PointMass("bob", (0, 0, -8), 2000.0)
    outputs = [fc.Tension("force", rope), fc.SwayAngle("sway", rope.start, bob.node, "x")]
    joints = [fc.Support(rope.start), fc.Pin(rope.end, bob.node)]
    pendulum = fc.Structure([rope, bob], joints, inputs=[fc.Force("push", bob.node, "x")], outputs=outputs)
    model = fc.assemble(pendulum, [fc.Gravity(), fc.RopeStretch(), fc.GeometricStiffness()])
    run = fc.simulate(model, inputs={"push": 1000.0}, until=6.0, start=fc.equilibrium(model), method=method)
    assert np.abs(run["sway"]).max() == pytest.approx(2.0 * 1000.0 / (2000.0 * 9.81), rel=1e-3)
    np.testing.assert_allclose(run["force"], 2000.0 * 9.81, rtol=1e-9)


def test_a_rope_drawn_just_taut_takes_its_load_up():
    """Without prestress either: the tension follows K, from nothing to the weight."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -8), EA=1e7)
    bob = fc.PointMass("bob", (0, 0, -8), 2000.0)
    winch = fc.Winch("hoist", bob.node, rope.start, EA=1e7, radius=0.1)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, bob.node)]
    outputs = [fc.Tension("force", rope), fc.Tension("hoisted", winch)]
    both = fc.Structure([rope, bob], joints, [winch], outputs=outputs)
    model = fc.assemble(both, [fc.Gravity(), fc.RopeStretch()])
    rise = np.zeros(model.n)
    rise[model.coordinate("rope_1_w")] = -1e-3
    np.testing.assert_allclose(model.measure(model.advance(model.rest, rise, 0 * rise, 0.0)), 1e7 / 8 * 1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_random_machines_leave_out_second_order_alone(seed):
    machine_ = machine(seed)
    large, small = (fc.assemble(machine_, [fc.Flexible(), *more]) for more in ([fc.LargeRotation()], []))
    way, rate = np.random.default_rng(seed).normal(size=(2, small.n))
    errors = [np.abs(moved(large, way, rate, e) - moved(small, way, rate, e)) for e in (2e-4, 1e-4)]
    np.testing.assert_array_less(3.8 * errors[1], errors[0] + 1e-8)
