"""Events within long steps: what turns many times in one of them is seen each time."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc

SPEED = 20.0 * np.pi
METHODS = {
    "chosen": fc.AdaptiveAlpha(),
    "even": fc.GeneralizedAlpha(0.07),
    "explicit": fc.ExplicitRungeKutta(),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(0.07)),
}
BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}
INDEX = fc.Event("index", "y", 0.01)
STOP = fc.Event("stop", "y", 0.9, fc.Direction.FALLING, terminal=True)


@cache
def rotor(backend: str) -> tuple[fc.Model, fc.State]:
    """A mark one metre from the axis of what spins freely, ten times a second."""
    body = fc.RigidBody("body", (0, 0, 0), 2.0, (1, 1, 1), {"mark": (1, 0, 0)})
    seen = [fc.Position("y", body.point("mark"), "y")]
    machine = fc.Structure([body], [fc.Support(body.node, "u v w rx ry")], outputs=seen)
    model = fc.assemble(machine, [fc.LargeRotation()], BACKENDS[backend])
    return model, model.rest.with_(v=np.array([SPEED]))


def spun(method, events, until=1.96, backend="compiled", start=None, every=None) -> fc.Run:
    model, at_rest = rotor(backend)
    method = METHODS[method]
    return fc.simulate(model, until=until, start=start or at_rest, method=method, events=events, every=every)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_every_pass_is_told_when_it_is(method, backend):
    """sin(2π 10 t) = 0.01 twice a turn."""
    run = spun(method, [INDEX], backend=backend)
    first = np.arcsin(0.01) / SPEED
    turns = np.arange(20) / 10.0
    wanted = np.sort(np.concatenate([turns + first, turns + 0.05 - first]))
    found = [e.t for e in run.events]
    assert found == pytest.approx(wanted[wanted < 1.96], abs=1e-9)
    assert [e.rising for e in run.events] == [i % 2 == 0 for i in range(len(found))]
    assert run.report.steps < 60


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_run_ends_at_the_first_of_many_passes(method, backend):
    """Going down through 0.9 once within a step that goes on for turns; a log of the same value is told there too."""
    run = spun(method, [INDEX, fc.Event("log", "y", 0.9), STOP], backend=backend)
    assert run.status is fc.Status.STOPPED
    assert run.t[-1] == pytest.approx((np.pi - np.arcsin(0.9)) / SPEED, abs=1e-9)
    assert [e.name for e in run.events] == ["index", "log", "log", "stop"]
    assert run.events[2].t == run.events[3].t


@pytest.mark.parametrize("method", METHODS)
def test_what_rows_show_is_told(method):
    run = spun(method, [INDEX], every=1e-3)
    changes = np.count_nonzero(np.diff(np.sign(run["y"] - 0.01)))
    assert len(run.events) == changes == 40


@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_goes_on_has_the_same_bits(method):
    whole = spun(method, [INDEX])
    first = spun(method, [INDEX], until=0.8303)
    rest = spun(method, [INDEX], start=first.checkpoint)
    assert [e.t for e in (*first.events, *rest.events)] == [e.t for e in whole.events]
    assert np.array_equal(rest.final.q, whole.final.q)
    assert rest.report.energy_residual == whole.report.energy_residual


def test_an_oscillator_under_long_explicit_steps_passes_zero_each_time():
    """x = 1 + v/ω sin(ω t) in steps of a good part of a period."""
    omega, until = 4.0, 20.0
    bob = fc.PointMass("bob", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", bob.node, (0, 0, 0), stiffness=omega**2)
    held = [fc.Pin(bob.node, spring.start), fc.Support(spring.end, "u v w"), fc.Support(bob.node, "v w")]
    machine = fc.Structure([bob, spring], held, outputs=[fc.Position("x", bob.node, "x")])
    model = fc.assemble(machine, [fc.LargeRotation()])
    run = fc.simulate(
        model,
        until=until,
        start=model.rest.with_(v=np.array([1.0])),
        method=fc.ExplicitRungeKutta(),
        tolerance=fc.Tolerance(1e-3),
        events=[fc.Event("through", "x", 1.0)],
    )
    assert run.report.steps < until * omega
    assert [e.t for e in run.events] == pytest.approx(np.arange(1, 26) * np.pi / omega, abs=0.05)


@pytest.mark.parametrize("flown", [0.005, 0.01, 0.03, 0.09])
@pytest.mark.parametrize(
    "method", [fc.GeneralizedAlpha(0.1), fc.ConservingMidpoint(0.1), fc.ExplicitRungeKutta(), None]
)
def test_what_sets_out_from_zero_and_is_soon_back_is_told(method, flown):
    """A ball thrown up from the very height that is asked for: back within a twentieth of a step it was passed over."""
    ball = fc.PointMass("ball", (0, 0, 0), 1.0)
    structure = fc.Structure([ball], [fc.Support(ball.node, "u v")], outputs=[fc.Position("z", ball.node, "z")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    thrown = model.drawn.with_(v=np.array([0.5 * 9.81 * flown]))
    run = fc.simulate(model, start=thrown, until=0.5, method=method, events=[fc.Event("back", "z", 0.0)])
    assert [event.t for event in run.events] == pytest.approx([flown], rel=1e-6)
