"""Motors whose torque takes time to build up."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

T = 0.02


def arm() -> fc.Structure:
    """A motor that turns a wheel through an elastic shaft, both braked a little."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, 2.0))
    return fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=500.0, ratio=3.0, inertia=0.3)],
        [fc.MotorTorque("torque", "motor")],
        [fc.DriveAngle("angle", "motor"), fc.DriveSpeed("speed", "motor")],
    )


def assembled(*more: fc.MotorLag, large: bool = True) -> fc.Model:
    brakes = fc.ViscousFriction({"motor": 0.5, "wheel.rz": 0.7})
    motion = [fc.LargeRotation()] if large else []
    return fc.assemble(arm(), [fc.Flexible(), *motion, brakes, *more])


@pytest.mark.parametrize("large", [True, False])
def test_the_linear_model_has_the_lag_exactly(large):
    """H(s) = H₀(s)/(1 + sT), in the second-order form and as a state space."""
    lagging, prompt = (fc.linearize(assembled(*lag, large=large)) for lag in ([fc.MotorLag({"motor": T})], []))
    omega = np.array([0.5, 10.0, 50.0, 62.6, 200.0])
    expected = prompt.frequency_response(omega).values / (1.0 + 1j * omega * T)
    assert lagging.frequency_response(omega).values == pytest.approx(expected, rel=1e-12)
    system = lagging.to_ss()
    assert np.array([system(1j * w) for w in omega]).transpose(1, 2, 0) == pytest.approx(expected, rel=1e-9)
    poles = np.append(prompt.to_ss().poles(), -1.0 / T)
    assert np.sort_complex(system.poles()) == pytest.approx(np.sort_complex(poles), abs=1e-9)


def test_the_simulated_torque_builds_up_with_second_order():
    """A held command: against the exact motion of the linear model."""
    model = assembled(fc.MotorLag({"motor": T}))
    system = fc.linearize(model).to_ss()
    t = np.linspace(0.0, 0.3, 31)
    expected = step_response(system, t)
    errors = []
    for step in (2e-3, 1e-3):
        run = fc.simulate(
            model, until=0.3, inputs={"torque": 2.0}, method=fc.GeneralizedAlpha(step, rho=1.0), every=0.01
        )
        errors.append(np.abs(run["angle"] - 2.0 * expected).max())
        assert run.report.energy_residual < 1e-3
    assert errors[1] < 1e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert run.final.q[model.coordinate("motor_lag")] == pytest.approx(2.0 * (1.0 - np.exp(-0.3 / T)), rel=1e-4)


def step_response(system, t: np.ndarray) -> np.ndarray:
    """The first output's, by the matrix exponential."""
    from scipy.linalg import expm

    A, B, C = system.A, system.B[:, 0], system.C[0]
    wide = np.block([[A, B[:, None]], [np.zeros((1, len(A) + 1))]])
    return np.array([(C @ expm(wide * s)[:-1, -1]) for s in t])


def test_a_sampled_torque_is_exact_between_samples_too():
    """Torque jumps at every sample: the error stays of second order."""
    model = assembled(fc.MotorLag({"motor": T}))
    push = fc.OpenLoop({"torque": np.cos}, sample_time=0.05)
    finals = []
    for step in (0.01, 0.005, 0.0025):
        run = fc.simulate(model, push, until=0.5, method=fc.GeneralizedAlpha(step, rho=1.0))
        finals.append(run["angle"][-1])
    assert np.log2((finals[0] - finals[1]) / (finals[1] - finals[2])) == pytest.approx(2.0, abs=0.3)


def test_without_lag_the_torque_acts_at_once():
    lagging, prompt = assembled(fc.MotorLag({"motor": 0.0})), assembled()
    runs = [fc.simulate(m, until=0.1, inputs={"torque": 2.0}) for m in (lagging, prompt)]
    assert runs[0].final.q[:2] == pytest.approx(runs[1].final.q, abs=1e-13)
    responses = [fc.linearize(m).frequency_response(np.array([1.0, 40.0])).values for m in (lagging, prompt)]
    assert responses[0] == pytest.approx(responses[1], rel=1e-12)


def test_the_rigid_twin_keeps_its_motors():
    twin = fc.rigid(assembled(fc.MotorLag({"motor": T})))
    assert twin.coordinates == ("wheel_0_rz", "motor_lag")
    response = fc.linearize(twin).frequency_response(np.array([5.0])).values[0, 0, 0]
    inertia, drag = 2.0 + 9.0 * 0.3, 0.7 + 9.0 * 0.5
    assert response == pytest.approx(9.0 / (5j * (5j * inertia + drag)) / (1.0 + 5j * T))


def test_a_machine_at_rest_under_a_torque_has_it_built_up():
    wheel = arm().part("wheel")
    spring = fc.Spring("spring", (1, 0, 0), (1, 1, 0), stiffness=40.0)
    held = arm().with_(
        elements=[fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, 2.0), {"rim": (1, 0, 0)}), spring],
        joints=[fc.Support(wheel.node, "u v w rx ry"), fc.Support(spring.end)],
    )
    body = held.part("wheel")
    held = held.with_(joints=[*held.joints, fc.Pin(body.point("rim"), spring.start)])
    model = fc.assemble(held, [fc.Flexible(), fc.LargeRotation(), fc.MotorLag({"motor": T})])
    rest = fc.equilibrium(model, inputs={"torque": 1.5})
    assert rest.state.q[model.coordinate("motor_lag")] == pytest.approx(1.5)
    run = fc.simulate(model, until=0.05, start=rest)
    assert np.abs(run["angle"] - run["angle"][0]).max() < 1e-9


@pytest.mark.parametrize(
    ("lag", "message"),
    [
        (lambda: fc.MotorLag({"motor": -0.1}), "MotorLag: time constant of 'motor' = -0.1"),
        (lambda: fc.MotorLag(0.1), "expected a mapping"),
        (lambda: fc.assemble(arm(), [fc.MotorLag({"moter": 0.1})]), "MotorLag: there is no drive 'moter'.*motor"),
    ],
)
def test_impossible_lags_are_refused(lag, message):
    with pytest.raises(StructureError, match=message):
        lag()
