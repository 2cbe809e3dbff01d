"""D2: freedoms without mass: a drive's source angle, from soft to stiff shafts, in frequency and in time.

A motor turns 5 kg m² through a shaft of k_θ from 10 to 10¹² N m/rad. The pencils are in tests/validation too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from recorder import Absolute
from scipy.integrate import solve_ivp
from turntable import LOAD, turntable

import flexctrl as fc

PAGE = "hard"
TORQUE = 2.0
SHAFTS = (1e1, 1e3, 1e6, 1e9, 1e12)


@pytest.mark.parametrize("stiffness", SHAFTS)
def test_no_mode_is_invented(record, stiffness):
    linear = fc.linearize(turntable(stiffness))
    modes = linear.modes()
    record(
        f"D2 motor without inertia, k_θ = {stiffness:g}: infinite eigenvalues, rigid modes, modes",
        ours=[modes.massless, modes.rigid, len(modes)],
        reference=[1, 1, 1],
        source="M = diag(0, 5)",
        tolerance=Absolute(0),
    )
    omega = np.array([0.01, 1.0, 100.0])
    table, angle = linear.frequency_response(omega).values[:, 0]
    exact = -1.0 / (LOAD * omega**2)
    worst = max(np.abs(table / exact - 1).max(), np.abs(angle / (exact + 1.0 / stiffness) - 1).max())
    record(
        f"D2 motor without inertia, k_θ = {stiffness:g}: torque → angles, relative error",
        ours=worst,
        reference=0,
        source="−1/(J ω²) and 1/k − 1/(J ω²)",
        tolerance=Absolute(1e-10),
    )


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(1e-2), fc.AdaptiveAlpha()], ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("stiffness", SHAFTS)
def test_a_massless_angle_in_time(record, stiffness, method):
    """Under a torque that is there at once the shaft is twisted at once, by M/k."""
    run = fc.simulate(turntable(stiffness), until=2.0, inputs={"torque": TORQUE}, method=method)
    exact = 0.5 * TORQUE / LOAD * run.t**2
    error = [np.abs(run["table"] - exact).max(), np.abs(run["angle"] - exact - TORQUE / stiffness)[1:].max(initial=0.0)]
    record(
        f"D2 motor without inertia, k_θ = {stiffness:g}, {type(method).__name__}: errors of both angles over 2 s [rad]",
        ours=error,
        reference=[0, 0],
        source="M t²/2J, and M/k more",
        tolerance=Absolute(1e-6),
    )


@dataclass(frozen=True)
class Jolts:
    """A torque that jumps at every sample: an open-loop controller."""

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ("torque",)
    sample_time: float = 0.1

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([-0.2 if round(t / self.sample_time) % 2 == 0 else 0.3])


def arm(damping: float = 0.0) -> fc.Model:
    """An arm that gravity pulls at, moved by a motor without inertia through a soft shaft and a gear of 50."""
    body = fc.RigidBody("arm", (1, 0, 0), 2.0, (1, 1, 1), points={"hub": (0, 0, 0)})
    hub = body.point("hub")
    motor = fc.RotaryDrive("motor", hub, axis="y", stiffness=10.0, ratio=50.0, inertia=0.0, damping=damping)
    structure = fc.Structure(
        [body],
        [fc.Support(hub, "u v w rx rz")],
        [motor],
        inputs=[fc.MotorTorque("torque", "motor")],
        outputs=[fc.Rotation("arm", body.node, "y"), fc.DriveAngle("angle", "motor")],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()])


IMPLICIT = {
    "AdaptiveAlpha": (fc.AdaptiveAlpha(), fc.Tolerance(1e-7, 1e-9)),
    "GeneralizedAlpha": (fc.GeneralizedAlpha(1e-3), None),
    "ConservingMidpoint": (fc.ConservingMidpoint(1e-3), None),
    "Richardson": (fc.Richardson(fc.GeneralizedAlpha(2e-3, rho=1.0)), None),
}


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_massless_motor_under_torques_that_jump(record, name):
    """With nothing to accelerate, the shaft's twist is M/k at once, and the arm feels R M: J θ̈ = R M + m g r cos θ."""
    method, tolerance = IMPLICIT[name]
    run = fc.simulate(arm(), Jolts(), until=1.0, method=method, tolerance=tolerance)

    def slope(t: float, y: np.ndarray) -> list[float]:
        torque = -0.2 if int(t / 0.1 + 1e-9) % 2 == 0 else 0.3
        return [y[1], (50.0 * torque + 2.0 * 9.81 * np.cos(y[0])) / 3.0]

    y = np.zeros(2)
    for k in range(10):
        y = solve_ivp(slope, (0.1 * k, 0.1 * (k + 0.9999999999)), y, rtol=1e-12, atol=1e-12).y[:, -1]
    record(
        f"D2 arm on a massless motor, torques that jump, {name}: angle after 1 s [rad]",
        ours=run["arm"][-1],
        reference=y[0],
        source="one freedom, scipy",
        tolerance=1e-5,
    )
    record(
        f"D2 arm on a massless motor, torques that jump, {name}: error of the twist over M/k",
        ours=np.abs((run["angle"] - 50.0 * run["arm"] - run["torque"] / 10.0)[:-1]).max() / 0.03,
        reference=0,
        source="statics of the motor",
        tolerance=Absolute(1e-4),
    )
    record(
        f"D2 arm on a massless motor, torques that jump, {name}: energy lost or made",
        ours=run.report.energy_residual,
        reference=0,
        source="what springs do not store of a jump is lost",
        tolerance=Absolute(1e-4),
    )
    lost = 5 * 0.5**2 / 2 / 10 + 4 * 0.5**2 / 2 / 10
    assert run.report.energy.dissipated == pytest.approx(lost, rel=1e-6)
    assert any("motor_source" in note and "without mass" in note for note in run.report.notes)


def test_a_massless_motor_with_a_damped_shaft_creeps_to_its_twist():
    """c (R θ̇ − θ̇_d) + k (R θ − θ_d) + M = 0 is of first order: nothing jumps but the rate."""
    run = fc.simulate(arm(damping=2.0), until=1.0, inputs={"torque": -0.2}, tolerance=fc.Tolerance(1e-6, 1e-9))
    twist = -0.02 * (1.0 - np.exp(-run.t * 10.0 / 2.0))
    assert np.abs(run["angle"] - 50.0 * run["arm"] - twist).max() < 1e-4


@pytest.mark.parametrize("stiffness", SHAFTS)
@pytest.mark.parametrize("ratio", [1.0, 1000.0])
def test_stiff_shafts_with_inertia_in_time(record, stiffness, ratio):
    """Where steps do not resolve the shaft the machine moves as one: (J + R² J_m) α = R M."""
    inertia = 1.0 / ratio**2
    model = turntable(stiffness / ratio**2, inertia, ratio)
    run = fc.simulate(model, until=4.0, inputs={"torque": TORQUE / ratio}, tolerance=fc.Tolerance(1e-6, 1e-9))
    whole = 0.5 * TORQUE / (LOAD + 1.0) * run.t**2
    omega = np.sqrt(stiffness * (1.0 / LOAD + 1.0))
    swing = TORQUE / (stiffness * (1.0 + 1.0 / LOAD)) / (1.0 + LOAD)
    resolved = run.report.steps > 10 * 4.0 * omega / (2.0 * np.pi)
    exact = whole - (swing * (1.0 - np.cos(omega * run.t)) if resolved else 0.0)
    record(
        f"D2 motor of 1 kg m², R = {ratio:g}, k_θ R² = {stiffness:g}: table's angle over 4 s, error [rad]",
        ours=np.abs(run["table"] - exact).max(),
        reference=0,
        source="rigid motion and the shaft's swing",
        tolerance=Absolute(1e-4 + (0.0 if resolved else 2.0 * swing)),
    )


@pytest.mark.parametrize("backend", [None, fc.CasadiVM()])
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3)])
def test_a_machine_without_any_mass_is_where_forces_balance(backend, method):
    """A lever on a spring, pushed by a motor without inertia."""
    lever = fc.RigidBody("lever", (0, 0, 0), 0.0, (0.0, 0.0, 0.0), {"hub": (0, 0, 0), "tip": (1, 0, 0)})
    spring = fc.Spring("spring", lever.point("tip"), (1, 0, -1), stiffness=100.0)
    motor = fc.RotaryDrive("motor", lever.point("hub"), axis="y", stiffness=10.0, ratio=10.0)
    joints = [
        fc.Support(lever.point("hub"), "u v w rx rz"),
        fc.Pin(lever.point("tip"), spring.start),
        fc.Support(spring.end),
    ]
    torque, angle = fc.MotorTorque("torque", motor), fc.Rotation("angle", lever.point("hub"), "y")
    structure = fc.Structure([lever, spring], joints, [motor], [torque], [angle])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity()], backend)
    run = fc.simulate(model, until=0.1, inputs={"torque": 0.1}, every=0.05, method=method)
    assert run.status is fc.Status.FINISHED
    assert run["angle"][-1] == pytest.approx(fc.equilibrium(model, inputs={"torque": 0.1}).outputs["angle"], abs=1e-9)
