"""Runs over corners and switches of laws of force: retried where a landing fails, resumed where they were stopped."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def sling(slack: float, damping: float) -> fc.Model:
    """A heavy rope of three elements with a load, drawn with some slack."""
    rope = fc.Rope("sling", (0, 0, 0), (0, 0, slack - 3), EA=2e5, damping=damping, rhoA=0.5, elements=3, length=3.0)
    load = fc.PointMass("load", rope.end, 10.0)
    s = fc.Structure(
        [rope, load],
        [fc.Support(rope.start), fc.Pin(rope.end, load.node)],
        outputs=[fc.Position("z", load.node, "z")],
    )
    effects = [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch(), fc.RopeMass(), fc.RayleighDamping(beta=1e-4)]
    return fc.assemble(s, effects)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slack", "damping", "method"),
    [(0.0, 20.0, fc.AdaptiveAlpha()), (0.5, 0.0, fc.GeneralizedAlpha(5e-4)), (0.5, 0.0, fc.AdaptiveAlpha())],
)
def test_a_landing_that_fails_is_tried_with_shorter_steps(slack, damping, method):
    run = fc.simulate(sling(slack, damping), until=1.0, method=method)
    assert run.status is fc.Status.FINISHED
    assert run.report.energy_residual < 0.1
    assert np.isfinite(run["z"]).all()


def bouncing() -> fc.Model:
    """A mass that falls into its rope."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1.3), EA=4e3, length=2.0)
    bob = fc.PointMass("bob", (0, 0, -1.3), 3.0)
    s = fc.Structure(
        [rope, bob],
        [fc.Support(rope.start), fc.Support(bob.node, "u v"), fc.Pin(rope.end, bob.node)],
        outputs=[fc.Position("z", bob.node, "z")],
    )
    return fc.assemble(s, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])


def sliding() -> fc.Model:
    """A block that is pulled against dry friction."""
    block = fc.PointMass("block", (0, 0, 0), 2.0)
    s = fc.Structure(
        [block],
        [fc.Support(block.node, "v w")],
        inputs=[fc.Force("pull", block.node, "x")],
        outputs=[fc.Position("z", block.node, "x")],
    )
    return fc.assemble(s, [fc.LargeRotation(), fc.CoulombFriction({"block.u": 2.0})])


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(2e-3)], ids=["adaptive", "fixed"])
@pytest.mark.parametrize("model", [bouncing, sliding])
@pytest.mark.parametrize("events", [(), (fc.Event("passes", "z", at=-1.5),)], ids=["", "event"])
def test_a_run_with_switches_goes_on_bit_for_bit(model, method, events):
    machine = model()
    pull = fc.OpenLoop({"pull": lambda t: 5.0 if t < 0.3 else 0.0}, sample_time=0.1) if model is sliding else None
    runs = {}
    for name, until in (("whole", 1.0), ("half", 0.5)):
        runs[name] = fc.simulate(machine, pull, until=until, method=method, events=events)
    rest = fc.simulate(machine, pull, until=1.0, method=method, events=events, start=runs["half"].checkpoint)
    assert np.array_equal(rest.final.q, runs["whole"].final.q)
    assert np.array_equal(rest.final.v, runs["whole"].final.v)


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(5e-3)], ids=["adaptive", "fixed"])
def test_events_on_a_command_happen_where_it_jumps(method, terminal):
    block = fc.PointMass("block", (0, 0, 0), 1.0)
    s = fc.Structure(
        [block],
        [fc.Support(block.node, "v w")],
        inputs=[fc.Force("push", block.node, "x")],
        outputs=[fc.Position("x", block.node, "x")],
    )
    model = fc.assemble(s, [fc.LargeRotation()])
    steps = fc.OpenLoop({"push": lambda t: 0.0 if t < 0.25 else 2.0 if t < 0.55 else -1.0}, sample_time=0.1)
    event = fc.Event("hard", "push", at=1.0, terminal=terminal)
    run = fc.simulate(model, steps, until=1.0, events=[event], method=method)
    times = [0.3] if terminal else [0.3, 0.6]
    assert [e.t for e in run.events] == pytest.approx(times, abs=1e-12)
    assert run.status is (fc.Status.STOPPED if terminal else fc.Status.FINISHED)


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
def test_a_command_that_is_no_number_ends_the_run_and_nothing_is_lost(sample_time):
    block = fc.PointMass("block", (0, 0, 0), 1.0)
    s = fc.Structure(
        [block],
        [fc.Support(block.node, "v w")],
        inputs=[fc.Force("push", block.node, "x")],
        outputs=[fc.Position("x", block.node, "x")],
    )
    model = fc.assemble(s, [fc.LargeRotation()])
    broken = fc.OpenLoop({"push": lambda t: 1.0 if t < 0.45 else np.nan}, sample_time=sample_time)
    run = fc.simulate(model, broken, until=1.0, method=fc.GeneralizedAlpha(0.01))
    assert run.status is fc.Status.FAILED
    assert "commands nan for 'push'" in run.report.message
    assert 0.4 < run.t[-1] <= 0.5
    assert np.isfinite(run.y).all()
    assert np.isfinite(run.u).all()
