"""Events are looked for among marched steps: what is found is what steps one by one find, and few steps are such."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import ellipk

import flexctrl as fc
from flexctrl.dynamics.events.foresight import calm_steps
from flexctrl.dynamics.march import guarding
from flexctrl.dynamics.march.stepper import MarchingStepper

SPEED, UNTIL = 2.0, 12.0
BACKENDS = {"marched": None, "plain": fc.CasadiVM()}
EVENTS = (
    fc.Event("up", "angle", direction=fc.Direction.RISING),
    fc.Event("turned", lambda s: s["rate"], direction=fc.Direction.FALLING),
    fc.Event("both", "angle", 0.25),
    fc.Event("never", "angle", 2.0),
    fc.Event("bent", lambda s: abs(s["angle"]) - 0.3),
)
METHODS = {"even": fc.GeneralizedAlpha(4e-3), "chosen": fc.AdaptiveAlpha(), "exact": fc.Exact(4e-3)}


@cache
def pendulum(backend: str, method: str) -> tuple[fc.Model | fc.LinearModel, fc.State]:
    """A bob that swings through the lowest place at the start."""
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    seen = [fc.Rotation("angle", bob.node, "y"), fc.AngularVelocity("rate", bob.node, "y")]
    machine = fc.Structure(
        [bob], [fc.Support(bob.point("top"), "u v w rx rz")], inputs=[fc.Torque("push", bob.node, "y")], outputs=seen
    )
    whole = [fc.Gravity(), fc.GeometricStiffness()] if method == "exact" else [fc.Gravity(), fc.LargeRotation()]
    model = fc.assemble(machine, whole, BACKENDS[backend])
    v = np.zeros(model.n)
    v[model.coordinate("bob_0_ry")] = 1.0 if method == "exact" else SPEED
    return model, model.rest.with_(v=v)


def ran(backend: str, method: str, events: tuple[fc.Event, ...], until: float = UNTIL) -> fc.Run:
    model, start = pendulum(backend, method)
    run = fc.simulate(model, until=until, start=start, method=METHODS[method], events=events)
    return run


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
@pytest.mark.parametrize("method", METHODS)
def test_marched_and_plain_runs_tell_the_same(method):
    found, wanted = (ran(backend, method, EVENTS, 2.2) for backend in BACKENDS)
    assert [(e.name, e.rising) for e in found.events] == [(e.name, e.rising) for e in wanted.events]
    assert len(found.events) >= 7
    error = 3e-9 if method == "even" else 1e-7
    assert [e.t for e in found.events] == pytest.approx([e.t for e in wanted.events], abs=error)


def test_most_steps_stay_marched(plain_steps):
    run = ran("marched", "even", EVENTS)
    assert run.report.steps > 2900
    assert len(plain_steps) < 6 * len(run.events)


def test_a_pendulum_swings_through_with_its_period():
    """T = 4 √(L/g) K(k), k = sin(θ₀/2) = ω₀ √(L/g) / 2; L = (m ℓ² + I)/(m ℓ)."""
    run = ran("marched", "chosen", (EVENTS[0],))
    length, k = 1.001, 0.5 * SPEED * np.sqrt(1.001 / 9.80665)
    period = 4.0 * np.sqrt(length / 9.80665) * ellipk(k * k)
    times = [e.t for e in run.events]
    assert times == pytest.approx(period * np.arange(1, len(times) + 1), rel=2e-3)
    assert len(times) == int(UNTIL / period)


@pytest.mark.parametrize("method", ["even", "chosen"])
def test_looking_for_events_does_not_move_the_machine(method):
    seen, alone = (ran("marched", method, events) for events in (EVENTS, ()))
    if method == "even":
        assert np.array_equal(seen.t, alone.t)
        assert np.abs(seen.y - alone.y).max() < 1e-9
    assert seen.final.q == pytest.approx(alone.final.q, abs=1e-4)
    assert seen.report.energy_residual == pytest.approx(alone.report.energy_residual, rel=0.05)
    assert seen.at(3.21)["angle"] == pytest.approx(alone.at(3.21)["angle"], abs=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_terminal_event_ends_the_run_there(backend):
    run = ran(backend, "even", (*EVENTS[:2], fc.Event("far", "angle", 0.5, fc.Direction.FALLING, terminal=True)))
    assert run.status is fc.Status.STOPPED
    assert run["angle"][-1] == pytest.approx(0.5, abs=1e-9)
    assert run["rate"][-1] < 0.0
    assert [e.name for e in run.events] == ["turned", "far"]


def test_what_crosses_and_comes_back_within_a_step_is_found():
    """The peak lies between two steps; a value reached by its top only is passed twice within one of them."""
    model, start = pendulum("marched", "even")
    free = fc.simulate(model, until=1.0, start=start, method=METHODS["even"])
    top = int(np.argmax(free["angle"]))
    peak = max(free.at(t)["angle"] for t in np.linspace(free.t[top - 1], free.t[top + 1], 2001))
    assert peak > free["angle"][top]
    level = 0.5 * (peak + free["angle"][top])
    found = ran("marched", "even", (fc.Event("top", "angle", level),), 1.0).events
    assert [e.rising for e in found] == [True, False]
    assert found[1].t - found[0].t < 4e-3


def test_a_function_that_raises_ends_the_run_where_it_does():
    def late(signals):
        return 1.0 / (signals["angle"] > -0.1)

    for backend in BACKENDS:
        run = ran(backend, "even", (fc.Event("late", late),))
        assert run.status is fc.Status.FAILED
        assert "ZeroDivisionError" in run.report.message
        assert run["angle"][-1] == pytest.approx(-0.1, abs=2.0 * SPEED * 4e-3)


def test_legs_do_not_hide_events():
    """Whatever number of steps is taken at once."""
    whole = [e.t for e in ran("marched", "even", EVENTS, 4.0).events]
    for widest in (8, 13, 100):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(guarding, "_WIDEST", widest)
            assert [e.t for e in ran("marched", "even", EVENTS, 4.0).events] == pytest.approx(whole, abs=1e-12)


def test_every_touch_of_zero_is_in_doubt():
    """Curves that touch zero between two values, all of which are well above it: no such step is called calm."""
    rng, h = np.random.default_rng(0), 1e-2
    model, start = pendulum("marched", "even")

    class Held:
        events, sides = (fc.Event("e", "angle"),), np.ones(1)
        feed = type("Feed", (), {"model": model})()

        def __init__(self, first: float) -> None:
            self.first, self.sizes = first, np.ones(1)

        def asked(self, state, u):
            return [self.first]

        def dust_of(self, sizes):
            return 1e-13 * sizes

    for _ in range(200):
        at, w = rng.uniform(0.3, 0.7), rng.uniform(1.0, 30.0)
        t = h * np.arange(80)
        y = 1.0 - np.cos(w * (t - at))
        table = np.column_stack([t[1:], y[1:], 0.0 * t[1:]])
        touch = int(at / h)
        first = fc.dynamics.steps.Point(start, np.zeros(model.n), None)
        assert calm_steps(Held(y[0]), first, table, np.zeros((len(t), 1)), np.zeros(2)) <= touch


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-2)], ids=["adaptive", "fixed"])
@pytest.mark.parametrize("after", [1.0, 0.0, -1.0], ids=["turns back", "stays", "goes on"])
def test_what_comes_to_zero_just_where_an_input_jumps_is_found_once(after, method):
    """A mass at 0.5 m/s is braked by 1 m/s² for half a second."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    inputs, outputs = [fc.Force("push", mass.node, "x")], [fc.Velocity("speed", mass.node, "x")]
    model = fc.assemble(fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs), [])
    law = fc.OpenLoop({"push": lambda t: -1.0 if t < 0.5 else after}, sample_time=0.5)
    directions = {d.name: fc.Event(d.name, "speed", direction=d) for d in fc.Direction}
    start = model.rest.with_(v=np.array([0.5]))
    run = fc.simulate(model, law, until=0.9, start=start, method=method, events=list(directions.values()))
    assert sorted(e.name for e in run.events) == ["EITHER", "FALLING"]
    assert all(e.t == pytest.approx(0.5, abs=1e-12) and not e.rising for e in run.events)
    end = fc.Event("stands", "speed", terminal=True)
    run = fc.simulate(model, law, until=0.9, start=start, method=method, events=[end])
    assert run.status is fc.Status.STOPPED
    assert run.t[-1] == pytest.approx(0.5, abs=1e-12)
    rest = fc.simulate(model, law, until=0.9, start=run.checkpoint, method=method, events=[end])
    assert rest.status is fc.Status.FINISHED
    assert not rest.events
