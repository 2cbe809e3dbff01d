"""What a drive turns by more than half a turn a step keeps its whole turns: a free rotor turns ω t."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc

SPEED, UNTIL = 1000.0, 0.2
STEPS = {
    "adaptive": fc.AdaptiveAlpha(),
    "half turns": fc.GeneralizedAlpha(3.7e-3),
    "turns": fc.GeneralizedAlpha(2.0 * np.pi / SPEED),
    "many turns": fc.GeneralizedAlpha(2e-2),
    "explicit": fc.ExplicitRungeKutta(),
    "explicit, even": fc.ExplicitRungeKutta(5e-3),
    "midpoint": fc.ConservingMidpoint(3.7e-3),
    "extrapolated": fc.Richardson(fc.AdaptiveAlpha(rho=1.0)),
}
BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}
WHOLE = [fc.LargeRotation(), fc.ShaftElasticity()]
KINDS = {
    "elastic": WHOLE,
    "rigid": [fc.LargeRotation()],
    "small": [fc.ShaftElasticity()],
    "hinged": WHOLE,
    "pinned": WHOLE,
}


SPINS = {"hinged": ("wheel_0_turn", 1.0), "pinned": ("wheel_0_ry", -1.0)}


def machine(kind: str) -> fc.Structure:
    """A wheel and its drive, on the ground or on a carrier that can be slewed."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    if kind not in SPINS:
        drive = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=1e4, ratio=2.0, inertia=0.05)
        seen = [fc.DriveAngle("angle", drive), fc.Rotation("turn", wheel.node, "z")]
        return fc.Structure([wheel], [fc.Support(wheel.node, "u v w rx ry")], [drive], outputs=seen)
    carrier = fc.RigidBody("carrier", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    base, hub = carrier.node, wheel.node
    drive = fc.RotaryDrive("motor", hub, axis="z", against=base, stiffness=1e4, ratio=2.0, inertia=0.05)
    joint = fc.Hinge(base, hub, "z") if kind == "hinged" else fc.Pin(base, hub)
    seen = [fc.DriveAngle("angle", drive)]
    if kind == "hinged":
        seen.append(fc.Rotation("turn", hub, "z", minus=base))
    return fc.Structure([carrier, wheel], [fc.Support(base, "u v w ry rz"), joint], [drive], outputs=seen)


@cache
def begun(kind: str, backend: str) -> tuple[fc.Model, fc.State]:
    """The wheel at speed, about an axis that has been slewed by a right angle where something carries it."""
    model = fc.assemble(machine(kind), KINDS[kind], BACKENDS[backend])
    spun, way = SPINS.get(kind, ("wheel_0_rz", 1.0))
    slewed, rates = {"carrier_0_rx", "wheel_0_rx"}, {spun: way * SPEED, "motor_source": 2.0 * SPEED}
    step = np.array([0.5 * np.pi * (name in slewed) for name in model.coordinates])
    v = np.array([rates.get(name, 0.0) for name in model.coordinates])
    return model, model.advance(model.rest, step, v, 0.0)


def _right(kind: str, name: str, backend: str) -> None:
    model, start = begun(kind, backend)
    run = fc.simulate(model, until=UNTIL, start=start, method=STEPS[name], every=0.05)
    assert run.status is fc.Status.FINISHED, run.report.message
    assert run.report.energy_residual < 1e-7
    assert run["angle"] == pytest.approx(2.0 * SPEED * run.t, abs=1e-3)
    assert kind == "pinned" or run["turn"] == pytest.approx(SPEED * run.t, abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", STEPS)
def test_a_free_rotor_turns_as_fast_as_it_does(name, kind):
    if kind != "pinned" or not name.startswith("explicit"):  # rotation vectors of more than a turn are no coordinates
        _right(kind, name, "compiled")


@pytest.mark.parametrize("kind", KINDS)
def test_plain_steps_count_the_same_turns(kind):
    _right(kind, "half turns", "plain")


def test_a_torque_brings_a_rotor_over_the_speed_that_a_step_can_tell():
    """Rigid shaft: (J + R² I) θ̈ = R M."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    drive = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=1e4, ratio=2.0, inertia=0.05)
    machine = fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Rotation("turn", wheel.node, "z"), fc.DriveAngle("angle", drive)],
    )
    model = fc.assemble(machine, [fc.LargeRotation()])
    run = fc.simulate(model, until=4.0, inputs={"torque": 75.0}, method=fc.GeneralizedAlpha(1e-2), every=0.1)
    turned = 0.5 * 2.0 * 75.0 / (0.1 + 4.0 * 0.05) * run.t**2
    assert run["turn"] == pytest.approx(turned, rel=1e-9, abs=1e-9)
    assert run["angle"] == pytest.approx(2.0 * turned, rel=1e-9, abs=1e-9)
    assert run.report.energy_residual < 1e-9
