"""Equilibria of machines whose motors lag: found with any of them held, and left standing by the torque that holds."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.braked import rest_held

MASS, OUT, TURNS = 10.0, 0.5, 3.0
WEIGHT = MASS * 9.81 * OUT / TURNS
"""What holds the arm level, at its motor [N m]."""


def arms(*effects, stiffness=2.0) -> fc.Model:
    """A heavy arm in the plane of its weight, and a wheel beside it that is free to turn; both on motors that lag."""
    arm = fc.RigidBody("arm", (OUT, 0, 0), MASS, (0.1, 1.0, 1.0), {"hub": (0, 0, 0)})
    wheel = fc.RigidBody("wheel", (0, 5, 0), 1.0, (1.0, 1.0, 2.0))
    drives = [
        fc.RotaryDrive(name, node, axis="z", stiffness=stiffness, ratio=TURNS, inertia=0.05)
        for name, node in (("lift", arm.point("hub")), ("spin", wheel.node))
    ]
    structure = fc.Structure(
        [arm, wheel],
        [fc.Support(node, "u v w rx ry") for node in (arm.point("hub"), wheel.node)],
        drives,
        [fc.MotorTorque(f"{drive.name}_torque", drive) for drive in drives],
        [fc.Rotation("angle", arm.point("hub"), "z")],
    )
    lag = fc.MotorLag({"lift": 0.05, "spin": 0.02})
    return fc.assemble(structure, [fc.Gravity((0, -9.81, 0)), fc.LargeRotation(), lag, *effects])


@pytest.mark.parametrize("stiffness", [1e-2, 50.0])
@pytest.mark.parametrize("both", [True, False])
def test_a_torque_on_a_held_motor_adds_to_what_holds_it(stiffness, both):
    """τ_hold + M = τ; the wheel's torque was to build up by turns of a soft shaft, and was given up."""
    model = arms(fc.Flexible(), stiffness=stiffness)
    hold = {"lift_source": 0.0} | ({"spin_source": 0.0} if both else {})
    given = {"lift_torque": 3.0} | ({"spin_torque": 2.0} if both else {})
    still, pushed = (fc.equilibrium(model, hold=hold, inputs=inputs) for inputs in ({}, given))
    assert pushed.residual < 1e-9
    assert pushed.outputs == pytest.approx(still.outputs, abs=1e-9)
    for name, torque in given.items():
        motor = name.replace("torque", "source")
        assert pushed.holding[motor] == pytest.approx(still.holding[motor] - torque, rel=1e-9)


def standing() -> dict[str, fc.Rest]:
    """With a coordinate that is held, and with a motor that follows from one."""
    soft, rigid = arms(fc.Flexible()), arms()
    return {
        "soft": fc.equilibrium(soft, hold={"lift_source": 0.0}, inputs={"lift_torque": 1.0}),
        "rigid": rest_held(rigid, {"lift_source": 0.0}, {"lift_torque": 1.0}),
    }


@pytest.mark.parametrize("kind", ["soft", "rigid"])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01)])
def test_let_go_under_the_torque_that_held_it_a_machine_stands_still(kind, method):
    """The torque that lags began at what was commanded, and the arm fell by 0.05 s of its weight."""
    rest = standing()[kind]
    torque = 1.0 + rest.holding["lift_source"]
    assert rest.state.q[rest.model.coordinate("lift_lag")] == pytest.approx(torque, rel=1e-9)
    if kind == "rigid":
        assert torque == pytest.approx(WEIGHT, rel=1e-9)
    laws = {"inputs": {"lift_torque": torque}}, {"controller": fc.OpenLoop({"lift_torque": lambda t: torque})}
    for law in laws:
        run = fc.simulate(rest.model, until=0.2, start=rest.state, method=method, **law)
        assert run.status is fc.Status.FINISHED
        assert np.abs(run["angle"] - rest.outputs["angle"]).max() < 1e-9


def test_linear_models_hold_it_or_let_it_go():
    """Held, there is the lag itself, −1/T; let go, all is linear about the torque that bears it."""
    rest = standing()["soft"]
    held = fc.linearize(rest.model, at=rest)
    assert np.abs(held.to_ss().poles() + 1.0 / 0.05).min() < 1e-9
    assert held.certificate.idle == ("lift_torque",)
    torque = 1.0 + rest.holding["lift_source"]
    free = fc.linearize(rest.model, at=rest.state, inputs={"lift_torque": torque})
    assert free.coordinates == rest.model.coordinates
    assert fc.equilibrium(rest.model, hold={"lift_source": 0.0}, start=rest.state).holding == pytest.approx(
        {"lift_source": torque}
    )


def test_paths_begin_in_balance():
    rest = standing()["soft"]
    path = fc.equilibrium_path(rest.model, {"lift_torque": 1.0}, until=2.0, hold={"lift_source": 0.0, "spin_source": 0})
    assert path.points[-1].rest.holding["lift_source"] == pytest.approx(1.0 + rest.holding["lift_source"] - 2.0)


@pytest.mark.parametrize("lag", [True, False])
def test_from_a_rest_a_motor_is_held_elsewhere_beside_a_wheel_that_is_free(lag):
    """The last digits of forces in balance were taken for loads: τ = m g l cos φ/R + what twists the shaft no more."""
    model = arms(fc.Flexible(), stiffness=50.0)
    if not lag:
        model = fc.assemble(
            model.structure, [effect for effect in model.effects if not isinstance(effect, fc.MotorLag)]
        )
    rest = fc.equilibrium(model, hold={"lift_source": 0.0}, inputs={"lift_torque": 1.0})
    moved = fc.equilibrium(model, hold={"lift_source": 0.2}, inputs={"lift_torque": -3.0}, start=rest.state)
    assert moved.holding["lift_source"] - 3.0 == pytest.approx(WEIGHT * np.cos(moved.outputs["angle"]), rel=1e-9)
