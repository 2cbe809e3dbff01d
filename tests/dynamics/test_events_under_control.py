"""Events under sampled controllers are looked for behind the march: the same are told, and few steps are plain."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.dynamics.march import guarding
from flexctrl.dynamics.march.stepper import MarchingStepper

BACKENDS = {"marched": None, "plain": fc.CasadiVM()}
METHODS = {"even": fc.GeneralizedAlpha(1e-3), "quarters": fc.GeneralizedAlpha(2.5e-4), "chosen": fc.AdaptiveAlpha()}
EVENTS = (
    fc.Event("up", "angle", 0.1, fc.Direction.RISING),
    fc.Event("turned", lambda s: s["speed"], direction=fc.Direction.FALLING),
    fc.Event("both", "angle", 0.4),
    fc.Event("never", "angle", 50.0),
    fc.Event("pushed", "torque", -1.0),
    fc.Event("bent", lambda s: abs(s["angle"]) - 0.3),
)


class Own:
    """A law that cannot be lowered, and counts its calls."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 2e-3

    def __init__(self) -> None:
        self.asked: list[float] = []

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        self.asked.append(t)
        return np.array([-4.0 * y[0] - 0.1 * y[1]])


def law(kind: str):
    if kind == "own":
        return Own()
    return fc.Sampled(pd(kp=4.0, kd=0.1, measured="angle", rate="speed", command="torque"), 2e-3)


@cache
def arm(backend: str) -> fc.Model:
    bar = fc.RigidBody("bar", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hub": (0, 0, 0)})
    hub = bar.point("hub")
    motor = fc.RotaryDrive("motor", hub, axis="z", stiffness=2e3, inertia=0.05, damping=1.0)
    machine = fc.Structure(
        [bar],
        [fc.Support(hub, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity()], BACKENDS[backend])


def ran(kind, method, events=EVENTS, until=3.0, backend="marched", start=None, every=None, controller=None):
    model = arm(backend)
    start = start or model.rest.with_(v=np.full(model.n, 2.0))
    controller = controller or law(kind)
    return fc.simulate(model, controller, until=until, start=start, method=METHODS[method], events=events, every=every)


@pytest.fixture
def plain_steps(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The steps that a marching stepper takes one by one."""
    taken: list[float] = []
    step = MarchingStepper.step

    def noted(self, point, h):
        taken.append(h)
        return step(self, point, h)

    monkeypatch.setattr(MarchingStepper, "step", noted)
    return taken


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lowered", "own"])
@pytest.mark.parametrize("method", METHODS)
def test_marched_and_plain_runs_tell_the_same(kind, method):
    found, wanted = (ran(kind, method, until=1.0, backend=backend) for backend in BACKENDS)
    assert len(found.events) >= 4
    assert [(e.name, e.rising) for e in found.events] == [(e.name, e.rising) for e in wanted.events]
    assert [e.t for e in found.events] == pytest.approx([e.t for e in wanted.events], abs=1e-6)
    assert {e.name for e in found.events} >= {"up", "turned", "pushed", "bent"}


@pytest.mark.parametrize(
    ("kind", "method"), [(k, m) for k in ("lowered", "own") for m in METHODS if (k, m) != ("own", "chosen")]
)
def test_most_steps_stay_marched(plain_steps, kind, method):
    run = ran(kind, method)
    assert run.report.steps > 1400
    assert len(run.events) > 5
    assert len(plain_steps) < 10 * len(run.events)


@pytest.mark.parametrize("kind", ["lowered", "own"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("every", [None, 7e-3])
def test_looking_for_events_does_not_move_the_machine(kind, method, every):
    seen, alone = (ran(kind, method, events, every=every) for events in (EVENTS, ()))
    assert np.array_equal(seen.t, alone.t)
    assert seen.y == pytest.approx(alone.y, abs=0.0 if every is None else 1e-13)
    assert np.array_equal(seen.u, alone.u)
    assert np.array_equal(seen.final.q, alone.final.q)
    assert seen.at(0.777)["angle"] == pytest.approx(alone.at(0.777)["angle"], abs=1e-12)


@pytest.mark.parametrize("kind", ["lowered", "own"])
@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_goes_on_has_the_same_bits(kind, method):
    whole = ran(kind, method)
    for until in (0.3137, 1.2, whole.events[3].t + 1e-4):
        first = ran(kind, method, until=until)
        rest = ran(kind, method, start=first.checkpoint)
        assert np.array_equal(rest.final.q, whole.final.q)
        assert np.array_equal(rest.final.v, whole.final.v)
        told = [*first.events, *rest.events]
        assert [(e.name, e.t) for e in told] == [(e.name, e.t) for e in whole.events]
        assert rest.report.energy_residual == whole.report.energy_residual


@pytest.mark.parametrize("kind", ["lowered", "own"])
def test_legs_do_not_hide_events(kind):
    whole = [(e.name, e.t) for e in ran(kind, "even").events]
    for widest in (8, 13, 100):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(guarding, "_WIDEST", widest)
            assert [(e.name, e.t) for e in ran(kind, "even").events] == whole


@pytest.mark.parametrize("method", METHODS)
def test_a_law_is_asked_once_a_sample_and_not_beyond_the_end(method):
    own = Own()
    stop = fc.Event("far", "angle", 0.2, fc.Direction.FALLING, terminal=True)
    run = ran("own", method, (*EVENTS, stop), controller=own)
    assert run.status is fc.Status.STOPPED
    assert run["angle"][-1] == pytest.approx(0.2, abs=1e-9)
    assert own.asked == pytest.approx(2e-3 * np.arange(len(own.asked)), abs=1e-12)
    assert own.asked[-1] <= run.t[-1] < own.asked[-1] + 2e-3


@pytest.mark.parametrize("kind", ["lowered", "own"])
def test_an_input_that_jumps_over_a_value_is_told_where_it_does(kind):
    run = ran(kind, "even", (fc.Event("pushed", "torque", -0.5, fc.Direction.FALLING),), until=0.5)
    first = run.t[np.argmax(run["torque"] < -0.5)]
    assert [e.t for e in run.events] == [pytest.approx(first, abs=1e-12)]


def test_what_rests_at_a_value_is_marched(plain_steps):
    """A speed that is zero until a push sets in has not left zero."""
    pushed = fc.OpenLoop({"torque": lambda t: 1.0 if t > 0.9 else 0.0}, sample_time=2e-3)
    at_rest = arm("marched").rest
    run = ran("", "even", (fc.Event("moves", "speed", 0.0),), 1.0, start=at_rest, controller=pushed)
    assert len(plain_steps) < 10
    assert run["speed"][-1] > 0.0


@pytest.mark.parametrize("kind", ["lowered", "own"])
def test_a_function_that_raises_ends_the_run_where_it_does(kind):
    late = fc.Event("late", lambda s: 1.0 / (s["angle"] < 0.2))
    run = ran(kind, "even", (late,))
    assert run.status is fc.Status.FAILED
    assert "ZeroDivisionError" in run.report.message
    assert run["angle"][-1] == pytest.approx(0.2, abs=5e-3)
