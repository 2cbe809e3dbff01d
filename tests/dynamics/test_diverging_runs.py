"""Runs that diverge end as failed, with the reason, the worst freedom and all that was computed before."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model

BACKENDS = {"compiled": fc.Compiled(), "plain": fc.CasadiVM()}
STEP = 2e-3
METHODS = {
    "alpha": fc.GeneralizedAlpha(STEP),
    "undamped": fc.GeneralizedAlpha(STEP, rho=1.0),
    "chosen": fc.AdaptiveAlpha(most_steps=1e4),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(STEP)),
    "midpoint": fc.ConservingMidpoint(STEP),
    "explicit": fc.ExplicitRungeKutta(STEP),
}


@cache
def arm(backend: str, inertia: float, *effects: fc.Effect) -> fc.Model:
    """An arm with a load pinned to its end, slewed by a motor."""
    tube = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), tube, elements=2)
    load = fc.PointMass("load", beam.end, 10.0)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=2.0, ratio=100.0, inertia=inertia)
    structure = fc.Structure(
        [beam, load],
        [fc.Support(beam.start, "u v w rx ry"), fc.Pin(beam.end, load.node)],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(structure, [fc.Gravity(), *effects], BACKENDS[backend])


def slewing(backend: str, method: str) -> fc.Model:
    """An arm for a method: it bends, and its motor has no inertia, where steps need not resolve all there is."""
    if method == "explicit":
        return arm(backend, 4e-3, fc.ShaftElasticity(), fc.LargeRotation())
    return arm(backend, 0.0, fc.Flexible(), fc.LargeRotation())


@cache
def hoist(backend: str, *effects: fc.Effect) -> fc.Model:
    """A load on the rope of a winch whose motor has no inertia: nothing holds that where the rope is slack."""
    top, load = fc.PointMass("top", (0, 0, 0), 1.0), fc.PointMass("load", (0, 0, -3), 20.0)
    winch = fc.Winch("motor", load.node, top.node, EA=1e5, radius=0.1, ratio=10.0)
    structure = fc.Structure(
        [top, load],
        [fc.Support(top.node)],
        [winch],
        [fc.MotorTorque("torque", winch)],
        [fc.DriveAngle("angle", winch), fc.DriveSpeed("speed", winch)],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), *effects], BACKENDS[backend])


def law(kp: float, kd: float, sample: float = 0.01) -> fc.Sampled:
    return fc.Sampled(pd(kp=kp, kd=kd, measured="angle", rate="speed", command="torque"), sample)


def fails(model: fc.Model | fc.LinearModel, controller: object, method: fc.Integrator, until: float = 2.0) -> fc.Run:
    """Return a run that has failed, every number of it finite, whatever the caller wants of floating-point errors."""
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        run = fc.simulate(model, controller, until=until, inputs={"torque": 0.1}, method=method, every=1e-3)
    assert run.status is fc.Status.FAILED
    assert any(f"worst freedom: {name}" in run.report.message for name in model.coordinates), run.report.message
    for numbers in (run.t, run.y, run.u, run.final.q, run.final.v, run.final.x):
        assert np.isfinite(numbers).all()
    assert run.t[0] == 0.0
    assert (np.diff(run.t) > 0.0).all()
    assert run.t[-1] == pytest.approx(run.final.t, abs=1e-9)
    return run


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("kp", "kd"), [(-1e12, -1e9), (1e12, 1e9)], ids=["wrong sign", "too high"])
def test_loops_that_throw_an_arm_away(backend, method, kp, kd):
    run = fails(slewing(backend, method), law(kp, kd), METHODS[method])
    assert run.t[-1] >= 0.01 - 1e-9  # until the first command that counts nothing is wrong


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("effects", "method", "kp", "kd", "sample"),
    [
        ((), "undamped", 5e11, -380.0, 0.01),
        ((fc.MotorLag({"motor": 1e-3}),), "alpha", -3e12, -3e5, 1e-3),
        ((), "extrapolated", -3e12, 0.0, 1e-3),
    ],
    ids=["undamped", "lagging", "extrapolated"],
)
def test_loops_that_leave_a_rope_slack(backend, effects, method, kp, kd, sample):
    fails(hoist(backend, *effects), law(kp, kd, sample), METHODS[method])


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_motor_that_nothing_holds_any_more(backend):
    """Driven by its own speed it throws the rope slack; the run died of a singular matrix there."""
    driven = pd(kp=0.0, kd=-10.0, measured="angle", rate="speed", command="torque")
    run = fails(hoist(backend), driven, METHODS["alpha"])
    assert run.t[-1] > 0.0
    assert "singular" in run.report.message
    assert "worst freedom: motor_source" in run.report.message
    assert "give the drive its inertia=" in run.report.message


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "effect",
    [
        fc.MotorLag({"motor": 1e-5}),
        fc.ViscousFriction({"motor": 1e-2}),
        fc.CoulombFriction({"motor": 0.01}),
        fc.LuGreFriction({"motor": fc.LuGre(1e3, kinetic=0.5, static=0.6, stribeck=0.1, damping=1.0)}),
        pytest.param(fc.Backlash({"motor": 1e-3}), marks=pytest.mark.slow),
    ],
    ids=lambda effect: type(effect).__name__,
)
def test_loops_with_friction_lag_and_play(backend, effect):
    fails(arm(backend, 4e-3, fc.Flexible(), fc.LargeRotation(), effect), law(-1e6, -1e3), METHODS["alpha"])


@pytest.mark.parametrize(
    ("method", "grown"), [(fc.Exact(STEP), 1e100), (METHODS["alpha"], 1e9)], ids=["exact", "alpha"]
)
def test_linear_loops_end_where_numbers_do(method, grown):
    """They grow by the same factor from sample to sample, for ever; steps that are solved for end with their digits."""
    run = fails(fc.linearize(arm("compiled", 4e-3, fc.Flexible())), law(-1e9, -1e7), method)
    assert abs(run["angle"]).max() > grown


ERRORS = [
    SingularMatrixError(0),
    FloatingPointError("overflow"),
    OverflowError("math range error"),
    ZeroDivisionError("division by zero"),
    np.linalg.LinAlgError("SVD did not converge"),
    ValueError("array must not contain infs or NaNs"),
]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_what_arithmetic_raises_ends_a_run_and_nothing_is_lost(monkeypatch, method, error):
    """In a step, at a jump or in the books: wherever forces of inputs are asked for after 0.02 s."""
    machine, controller = slewing("plain", method), law(1e-3, 0.0)
    whole = fc.simulate(machine, controller, until=0.03, inputs={"torque": 0.1}, method=METHODS[method], every=1e-3)
    loads = Model.loads

    def failing(self: Model, state: fc.State, u: np.ndarray) -> np.ndarray:
        if state.t > 0.02 - 1e-9:
            raise error
        return loads(self, state, u)

    monkeypatch.setattr(Model, "loads", failing)
    run = fails(machine, controller, METHODS[method], 0.03)
    assert 0.016 <= run.t[-1] <= 0.02
    there = run.t < 0.018 + 1e-9  # beyond, steps were tried in halves
    assert run["angle"][there] == pytest.approx(whole["angle"][: there.sum()], abs=1e-6)


def test_what_is_no_error_of_arithmetic_is_not_taken_for_one(monkeypatch):
    machine = slewing("plain", "alpha")

    def broken(self: Model, state: fc.State, u: np.ndarray) -> np.ndarray:
        raise AttributeError("no such thing")

    monkeypatch.setattr(Model, "loads", broken)
    with pytest.raises(AttributeError):
        fc.simulate(machine, law(1.0, 0.1), until=0.1, method=METHODS["alpha"])


@pytest.mark.parametrize("method", [fc.ExplicitRungeKutta(), fc.ConservingMidpoint(2e-3), None], ids=str)
@pytest.mark.parametrize("torque", [1e160, 1e200, 1e290])
def test_a_torque_too_large_to_be_squared_is_not_left_out(torque, method):
    """What accelerations are found by squares forces: where these overflowed, the arm went on as if nothing pushed."""

    class Pushing:
        inputs, outputs, sample_time = (), ("torque",), 0.01

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            return np.array([torque if t > 0.05 else 1.0])

    model = arm("plain", 4e-3, fc.ShaftElasticity(), fc.LargeRotation())
    run = fc.simulate(model, Pushing(), until=0.1, method=method, every=1e-3)
    assert run.status is fc.Status.FAILED
    assert run.t[-1] == pytest.approx(0.06, abs=2e-3)
    assert np.isfinite(run.y).all()
