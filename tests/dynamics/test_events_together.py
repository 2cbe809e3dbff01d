"""Events at one instant are all told, whichever of them ends the run."""

from __future__ import annotations

import json
from functools import cache
from itertools import permutations

import pytest

import flexctrl as fc
from flexctrl.design.trajectories import Ramp, Step

METHODS = {
    "chosen": fc.AdaptiveAlpha(),
    "even": fc.GeneralizedAlpha(1e-2),
    "explicit": fc.ExplicitRungeKutta(),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(1e-2)),
}
LOG, STOP = fc.Event("log", "z", 5.0), fc.Event("stop", "z", 5.0, terminal=True)
HALT = fc.Event("halt", lambda s: 2.0 * s["z"] - 10.0, terminal=True)
EARLY, LATE = fc.Event("early", "z", 5.001), fc.Event("late", "z", 4.999)


@cache
def falling(backend: str) -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 10), 1.0)
    machine = fc.Structure([mass], [fc.Support(mass.node, "u v")], outputs=[fc.Position("z", mass.node, "z")])
    return fc.assemble(machine, [fc.Gravity()], {"compiled": None, "plain": fc.CasadiVM()}[backend])


def fallen(events, method, backend="compiled", start=None) -> fc.Run:
    return fc.simulate(falling(backend), until=2.0, method=METHODS[method], events=events, start=start)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("backend", ["compiled", "plain"])
def test_all_events_at_the_end_are_told(method, backend):
    run = fallen([LATE, STOP, EARLY, LOG, HALT], method, backend)
    assert run.status is fc.Status.STOPPED
    assert [e.name for e in run.events] == ["early", "stop", "log", "halt"]
    assert {e.t for e in run.events[1:]} == {run.t[-1]}
    assert run.report.message == f"stop and halt at t = {run.t[-1]:.6g} s"
    assert run["z"][-1] == pytest.approx(5.0, abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("backend", ["compiled", "plain"])
def test_what_is_told_can_be_written_as_json(method, backend):
    run = fallen([EARLY, STOP], method, backend)
    told = [(e.name, e.t, e.rising, dict(e.signals)) for e in run.events]
    assert json.loads(json.dumps(told)) == [list(item) for item in told]
    assert all(type(e.t) is float and e.rising is False for e in run.events)


def test_their_order_is_that_of_the_list():
    for events in permutations([LOG, STOP, HALT]):
        assert [e.name for e in fallen(events, "chosen").events] == [e.name for e in events]


@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_goes_on_tells_none_of_them_again(method):
    events = [LATE, STOP, LOG, HALT, EARLY]
    rest = fallen(events, method, start=fallen(events, method).checkpoint)
    assert [e.name for e in rest.events] == ["late"]
    assert rest.status is fc.Status.FINISHED


def pushed(*effects: fc.Effect) -> fc.Model:
    block = fc.PointMass("block", (0, 0, 0), 2.0)
    joints, push = [fc.Support(block.node, "v w")], fc.Force("pull", block.node, "x")
    machine = fc.Structure([block], joints, inputs=[push], outputs=[fc.Position("x", block.node, "x")])
    return fc.assemble(machine, effects)


@pytest.mark.parametrize("method", METHODS)
def test_a_jump_of_the_inputs_names_all_that_it_ends_a_run_by(method):
    events = [fc.Event(name, "pull", 1.0, terminal=True) for name in ("first", "second")]
    law = fc.OpenLoop({"pull": Step(2.0, at=0.1)}, 0.05)
    run = fc.simulate(pushed(), law, until=1.0, method=METHODS[method], events=events)
    assert run.status is fc.Status.STOPPED
    assert run.report.message == "first and second at t = 0.1 s"


@pytest.mark.parametrize("method", METHODS)
def test_what_ends_a_run_does_so_where_a_contact_breaks_loose(method):
    """A pull of 2 N/s breaks 5 N of static friction at 2.5 s; 3 N of the kinetic one are left against it."""
    model = pushed(fc.LargeRotation(), fc.CoulombFriction({"block.u": fc.Coulomb(3.0, static=5.0)}))
    law = fc.OpenLoop({"pull": Ramp(2.0, 10.0)})
    events = [fc.Event("full", "pull", 5.0, terminal=True)]
    how = {"until": 3.0, "method": METHODS[method], "events": events}
    run = fc.simulate(model, law, **how)
    assert (run.status, run.report.message) == (fc.Status.STOPPED, "full at t = 2.5 s")
    rest = fc.simulate(model, law, start=run.checkpoint, **how)
    assert rest.status is fc.Status.FINISHED
    assert rest["x"][-1] == pytest.approx(0.5**2 / 2.0 + 0.5**3 / 6.0, rel=1e-3)
