"""A motor's angle without inertia, behind torque that builds up or with friction: what its rates are after a jump."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import Step, Sum, pd
from flexctrl.errors import MechanismError

SHAFT, RATIO, SAMPLE, UNTIL = 50.0, 3.0, 0.02, 1.0


class Swell:
    """A torque sampled from a sine."""

    inputs, outputs, sample_time = ("angle",), ("torque",), SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([np.sin(4.0 * t)])


def machine(effect: fc.effects.effect.Effect) -> fc.Model:
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1, 1, 1.0))
    drive = fc.RotaryDrive("drive", body.node, axis="z", stiffness=SHAFT, ratio=RATIO, inertia=0)
    outputs = [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive), fc.Rotation("turn", body.node, "z")]
    held = [fc.Support(body.node, "u v w rx ry")]
    structure = fc.Structure([body], held, [drive], [fc.MotorTorque("torque", drive)], outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), effect])


def integrated(slope, first: list[float]) -> np.ndarray:
    """Another integrator's end, sample by sample."""
    z = np.array(first)
    for k in range(round(UNTIL / SAMPLE)):
        torque = float(np.sin(4.0 * k * SAMPLE))
        z = solve_ivp(slope, (0, SAMPLE), z, args=(torque,), method="Radau", rtol=1e-11, atol=1e-13).y[:, -1]
    return z


def lagging(T: float) -> np.ndarray:
    """J r'' = 3τ, T τ' + τ = u, a = 3 r + τ / k."""
    r, w, torque = integrated(lambda t, z, u: [z[1], RATIO * z[2], (u - z[2]) / T], [0.0, 0.0, 0.0])
    u = np.sin(4.0 * (UNTIL - SAMPLE))
    return np.array([RATIO * r + torque / SHAFT, RATIO * w + (u - torque) / T / SHAFT, r])


def rubbing(c: float) -> np.ndarray:
    """c a' = u + k (3 r − a), J r'' = −3 k (3 r − a)."""

    def slope(t: float, z: np.ndarray, u: float) -> list[float]:
        shaft = SHAFT * (RATIO * z[1] - z[0])
        return [(u + shaft) / c, z[2], -RATIO * shaft]

    a, r, w = integrated(slope, [0.0, 0.0, 0.0])
    return np.array([a, slope(0.0, np.array([a, r, w]), np.sin(4.0 * (UNTIL - SAMPLE)))[0], r])


CASES = {
    "lag": (fc.MotorLag({"drive": 0.02}), lagging(0.02)),
    "friction": (fc.ViscousFriction({"drive": 0.1}), rubbing(0.1)),
}


@pytest.mark.parametrize("case", CASES)
def test_its_angle_and_speed_are_of_second_order_after_jumps_of_the_torque(case):
    effect, exact = CASES[case]
    methods = (fc.GeneralizedAlpha(h) for h in (2e-3, 1e-3, 5e-4))
    runs = [fc.simulate(machine(effect), Swell(), until=UNTIL, method=method) for method in methods]
    errors = [np.abs(run.y[-1] - exact) for run in runs]
    assert (errors[0] <= [2e-5, 2e-4, 1e-5]).all()
    assert (errors[1] <= errors[0] / 3.0 + 1e-9).all()
    assert runs[1].report.energy_residual > 3.0 * runs[2].report.energy_residual


def test_the_midpoint_rule_takes_it_with_friction_at_any_step():
    """Its rates are those that forces push it with; a step of four time constants still comes near the angle."""
    effect, exact = CASES["friction"]
    methods = (fc.ConservingMidpoint(h) for h in (8e-3, 4e-3, 2e-3))
    runs = [fc.simulate(machine(effect), Swell(), until=UNTIL, method=method) for method in methods]
    assert all(run.status is fc.Status.FINISHED for run in runs)
    errors = [np.abs(run.y[-1] - exact) for run in runs]
    assert (errors[0] <= [1e-4, 2e-2, 1e-5]).all()
    assert (errors[1] <= [2e-6, 1e-4, 1e-6]).all()
    assert errors[2][2] == pytest.approx(errors[1][2] / 4.0, rel=0.1)
    assert max(run.report.energy_residual for run in runs) < 1e-12


def test_a_junction_that_nothing_holds_is_named_by_every_method():
    """Two ropes in line, not taut, and nothing where they meet."""
    ropes = fc.Rope("one", (0, 0, 0), (1, 0, 0), EA=1e3), fc.Rope("two", (1, 0, 0), (2, 0, 0), EA=1e3)
    mass = fc.PointMass("mass", ropes[1].end, 1.0)
    pins = [fc.Pin(ropes[0].end, ropes[1].start), fc.Pin(ropes[1].end, mass.node)]
    structure = fc.Structure([*ropes, mass], [fc.Support(ropes[0].start, "u v w"), *pins])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    for method in (fc.ConservingMidpoint(1e-3), fc.GeneralizedAlpha(1e-3), fc.AdaptiveAlpha()):
        with pytest.raises(MechanismError, match=r"one_1_v has neither mass nor stiffness; hold it with a Support"):
            fc.simulate(model, until=0.5, method=method)


@pytest.mark.parametrize("case", CASES)
def test_controlled_steps_come_near_it_too(case):
    effect, exact = CASES[case]
    run = fc.simulate(machine(effect), Swell(), until=UNTIL, tolerance=fc.Tolerance(1e-6, 1e-8))
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - exact)[[0, 2]].max() <= (1e-3 if case == "lag" else 1e-5)


@pytest.mark.parametrize("c", [0.1, 0.02, 4e-3])
def test_controlled_steps_see_time_constants_far_below_a_sample(c):
    """Of 2 ms, 0.4 ms and 0.08 ms, fifty jumps of the torque 20 ms apart, and the tolerance as it is by default."""
    run = fc.simulate(machine(fc.ViscousFriction({"drive": c})), Swell(), until=UNTIL)
    assert np.abs(run.y[-1] - rubbing(c))[[0, 2]].max() <= 5e-5
    assert run.report.steps < 1000


@pytest.mark.parametrize("T", [1e-3, 1e-5])
def test_a_lag_that_steps_do_not_see_leaves_speeds_as_they_are(T):
    """The angle is late by half a step at most, the speed no other than that of the body it turns, but for as much."""
    run = fc.simulate(machine(fc.MotorLag({"drive": T})), Swell(), until=UNTIL, method=fc.GeneralizedAlpha(4e-3))
    assert np.abs(run.y[-1] - lagging(T)).max() <= 0.03


def test_the_start_is_where_torque_that_is_yet_to_build_up_leaves_it():
    run = fc.simulate(machine(fc.MotorLag({"drive": 0.02})), until=1.0, inputs={"torque": 1.0})
    assert run.status is fc.Status.FINISHED
    assert np.allclose(run.y[0], [0.0, 1.0 / (0.02 * SHAFT), 0.0], atol=1e-9)


class Following:
    """A continuous law with a state: P times the gap of the angle, and five times the gap, filtered."""

    inputs, outputs, sample_time = ("angle",), ("torque",), 0.0
    P, T = 10.0, 0.05

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([self.P * (1.0 - y[0]) + 5.0 * x[0]])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([(1.0 - y[0] - x[0]) / self.T])


def followed(c: float, until: float) -> np.ndarray:
    """The angle, its rate and the turn under it; c = 0: the angle is where forces balance."""
    P, T = Following.P, Following.T

    def slope(t: float, z: np.ndarray) -> list[float]:
        r, w, x = z[:3]
        a = z[3] if c else (P + 5.0 * x + SHAFT * RATIO * r) / (P + SHAFT)
        shaft = SHAFT * (RATIO * r - a)
        return [w, -RATIO * shaft, (1.0 - a - x) / T, (P * (1.0 - a) + 5.0 * x + shaft) / c if c else 0.0]

    z = solve_ivp(slope, (0.0, until), [0.0] * 4, method="Radau", rtol=1e-11, atol=1e-13).y[:, -1]
    rates = slope(until, z)
    if c:
        return np.array([z[3], rates[3], z[0]])
    return np.array([P + 5.0 * z[2] + SHAFT * RATIO * z[0], 5.0 * rates[2] + SHAFT * RATIO * z[1], 0.0]) / (
        P + SHAFT
    ) + np.array([0.0, 0.0, z[0]])


@pytest.mark.parametrize("c", [0.1, 0.0], ids=["friction", "stiffness alone"])
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha, fc.ConservingMidpoint])
def test_under_a_continuous_controller_it_moves_as_its_forces_say(method, c):
    model, exact = machine(fc.ViscousFriction({"drive": c}) if c else fc.Gravity()), followed(c, 0.5)
    runs = [fc.simulate(model, Following(), until=0.5, method=method(h)) for h in (2e-3, 1e-3)]
    first = [0.0, (Following.P * 1.0) / c, 0.0] if c else [1 / 6, 5.0 * (5 / 6) / Following.T / 60.0, 0.0]
    assert runs[0].y[0] == pytest.approx(first, rel=1e-6, abs=1e-12)
    errors = [np.abs(run.y[-1] - exact) for run in runs]
    assert (errors[0] <= [2e-4, 5e-4, 1e-4]).all()
    assert errors[0] / errors[1] == pytest.approx([4.0] * 3, rel=0.05)


METHODS = {
    "fixed": (fc.GeneralizedAlpha(1e-3), 2e-4),
    "controlled": (fc.AdaptiveAlpha(), 3e-4),
    "conserving": (fc.ConservingMidpoint(1e-3), 2e-4),
    "exact": (fc.Exact(1e-3), 1e-6),
}


@pytest.mark.parametrize("jump", [0.0, 0.05])
@pytest.mark.parametrize("method", METHODS)
def test_under_a_continuous_law_that_damps_it_it_keeps_its_place_as_the_reference_jumps(method, jump):
    """a' = 8 (r − a) − k (a − 3 q), J q'' = 3 k (a − 3 q): the law's damping alone makes it of first order."""
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1, 1, 1.0))
    drive = fc.RotaryDrive("drive", body.node, axis="z", stiffness=SHAFT, ratio=RATIO, inertia=0)
    outputs = [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)]
    held = [fc.Support(body.node, "u v w rx ry")]
    model = fc.assemble(
        fc.Structure([body], held, [drive], [fc.MotorTorque("torque", drive)], outputs), [fc.ShaftElasticity()]
    )
    law = fc.Tracking(pd(8.0, 1.0, measured="angle", rate="speed", command="torque"), {"angle": Step(1.0, at=jump)})
    how, tolerance = METHODS[method]
    run = fc.simulate(model, law, until=0.25, method=how, every=0.05)

    def slope(t: float, z: np.ndarray) -> list[float]:
        shaft = SHAFT * (z[0] - RATIO * z[1])
        return [8.0 * (1.0 - z[0]) - shaft, z[2], RATIO * shaft]

    found = solve_ivp(slope, (0, 0.25), np.zeros(3), t_eval=run.t, method="Radau", rtol=1e-11, atol=1e-14).y[0]
    expected = found if jump == 0.0 else np.append(0.0, found[:-1])
    assert np.abs(run["angle"] - expected).max() <= tolerance * np.abs(expected).max()


def test_a_motor_in_its_play_needs_inertia():
    """It is told so, not what a beam would need."""
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1, 1, 1.0))
    drive = fc.RotaryDrive("drive", body.node, axis="z", stiffness=SHAFT)
    structure = fc.Structure([body], [fc.Support(body.node, "u v w rx ry")], [drive])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), fc.Backlash({"drive": 0.1})])
    with pytest.raises(MechanismError, match=r"drive_source has neither mass nor stiffness; .*'drive'.*inertia="):
        fc.simulate(model, until=1.0)


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_a_winch_without_inertia_ends_where_its_rope_goes_slack(damping):
    """After half a second that hold the load its torque pays out: the run says what the winch needs."""
    top, load = fc.PointMass("top", (0, 0, 0), 1.0), fc.PointMass("load", (0, 0, -2.0), 5.0)
    winch = fc.Winch("winch", load.node, top.node, EA=1e5, radius=0.1, ratio=20.0, damping=damping)
    structure = fc.Structure(
        [top, load], [fc.Support(top.node)], [winch], [fc.MotorTorque("torque", winch)], [fc.Tension("pull", winch)]
    )
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])
    pull = fc.OpenLoop({"torque": Sum((Step(-0.25), Step(0.3, at=0.5)))})
    run = fc.simulate(model, pull, until=1.0)
    assert run.status is fc.Status.FAILED
    assert run.t[-1] == pytest.approx(0.5, abs=0.1)
    assert "nothing holds the motor of 'winch'" in run.report.message
    assert "inertia=" in run.report.message
