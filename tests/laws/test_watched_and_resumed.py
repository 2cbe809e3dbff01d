"""Runs that are watched, and runs stopped anywhere and gone on with, are the very runs that they would have been.

Bit for bit: rows, inputs, steps taken and rejected, Newton iterations.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import astuple
from functools import cache
from typing import Any

import control
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha import method as alpha

END, PERIOD = 0.3, 0.02


def structure(*elements: fc.Element, joints: list[Any], drives: tuple[Any, ...] = ()) -> fc.Structure:
    """A machine whose last part is pushed along x, and whose motion that way is seen."""
    node = elements[-1].node
    return fc.Structure(
        list(elements),
        joints,
        list(drives),
        [fc.Force("push", node, "x"), *(fc.MotorTorque("torque", d) for d in drives)],
        [fc.Position("x", node, "x"), fc.Velocity("v", node, "x")],
    )


def swung() -> fc.Model:
    """A load on a rope that goes slack and taut."""
    rope = fc.Rope("rope", (0, 0, 0), (0.3, 0, -1.0), EA=2e3)
    load = fc.PointMass("load", rope.end, 1.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    return fc.assemble(structure(rope, load, joints=joints), [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])


def driven(*effects: fc.Effect) -> fc.Model:
    """A cart on a rail, with a motor."""
    cart = fc.PointMass("cart", (0, 0, 0), 2.0)
    drive = fc.LinearDrive(
        "drive", cart.node, direction="x", radius=0.1, ratio=5.0, stiffness=400.0, inertia=3e-3, damping=0.05
    )
    machine = structure(cart, joints=[fc.Support(cart.node, "v w")], drives=(drive,))
    return fc.assemble(machine, [fc.LargeRotation(), fc.Flexible(), *effects])


def linear() -> fc.Model:
    """Two masses on springs."""
    near, far = fc.PointMass("near", (0, 0, 0), 1.0), fc.PointMass("far", (1, 0, 0), 0.3)
    first = fc.Spring("first", (-1, 0, 0), near.node, stiffness=400.0, damping=1.0)
    second = fc.Spring("second", near.node, far.node, stiffness=200.0)
    joints = [fc.Support(first.start), fc.Pin(first.end, near.node), fc.Pin(second.start, near.node)]
    joints += [fc.Pin(second.end, far.node), fc.Support(near.node, "v w"), fc.Support(far.node, "v w")]
    return fc.assemble(structure(first, near, second, far, joints=joints), [])


MACHINES = {
    "rope": swung,
    "play": lambda: driven(fc.Backlash({"drive": 0.02})),
    "dry": lambda: driven(fc.CoulombFriction({"cart.u": fc.Coulomb(1.0, static=1.5)})),
    "lag": lambda: driven(fc.MotorLag({"drive": 0.01})),
    "linear": linear,
}


class Own:
    """A law of one's own, which begins by pushing."""

    inputs, outputs, sample_time = ("x", "v"), ("push",), PERIOD

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([20.0 * np.sin(9.0 * t) - 2.0 * y[0] - 0.1 * y[1]])


NAMES = {"inputs": ["x", "v"], "outputs": ["push"]}
LAWS: dict[str, Any] = {
    "none": None,
    "sampled": control.ss([], [], [], [[-80.0, -0.5]], PERIOD, **NAMES),
    "own": Own(),
    "continuous": control.ss([[-30.0]], [[1.0, 0.0]], [[500.0]], [[-80.0, -0.5]], **NAMES),
}
METHODS = {
    "adaptive": fc.AdaptiveAlpha(),
    "alpha": fc.GeneralizedAlpha(2.3e-3),
    "explicit": fc.ExplicitRungeKutta(),
    "midpoint": fc.ConservingMidpoint(2.3e-3),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(2.3e-3)),
    "exact": fc.Exact(2.3e-3),
}
NEVER = (fc.Event("never", "x", at=100.0),)
MET = (fc.Event("there", "x", at=0.303), fc.Event("here", "x", at=0.01), fc.Event("turns", lambda s: s["v"]))
EVENTS = {"no": (), "never": NEVER, "met": MET}
QUICK = ("adaptive", "alpha", "exact")
IN_PYTHON = {("rope", "explicit"), ("play", "midpoint"), ("dry", "extrapolated"), ("lag", "extrapolated")}
NO_RULE = {("dry", "midpoint"), ("lag", "midpoint"), ("lag", "explicit")}


def marks(machine: str, law: str, method: str) -> tuple[pytest.MarkDecorator, ...]:
    """What takes long: steps in Python, of which each method takes some in CI; play under a law asked at corners."""
    if method in QUICK and (machine, law) != ("play", "continuous"):
        return ()
    return (pytest.mark.slow,) if law == "sampled" and (machine, method) in IN_PYTHON else (pytest.mark.long,)


CASES = [
    pytest.param(machine, law, method, marks=marks(machine, law, method))
    for machine, law, method in itertools.product(MACHINES, LAWS, METHODS)
    if (method == "exact") == (machine == "linear") and (machine, method) not in NO_RULE
]


def told(run: fc.Run) -> tuple[Any, ...]:
    """What a run cost."""
    r = run.report
    return r.steps, r.rejected_steps, r.newton_iterations


def same(one: fc.Run, other: fc.Run, after: float = 0.0) -> bool:
    """Whether rows after a time are the same, where runs have ended, and what that has cost."""
    rows = [np.column_stack([run.t, run.y, run.u])[run.t > after] for run in (one, other)]
    ends = [np.append(run.final.x, run.final.v) for run in (one, other)]
    alike = np.array_equal(*rows)
    return alike and np.array_equal(*ends) and told(one) == told(other)


@cache
def model_of(machine: str) -> fc.Model:
    return MACHINES[machine]()


def ran(case: tuple[str, str, str], events: str, **how: Any) -> fc.Run:
    machine, law, method = case
    model = model_of(machine)
    start = model.rest if machine == "rope" else model.rest.with_(v=np.append(0.3, np.zeros(model.n - 1)))
    how = {"until": END, "start": start, "every": 0.0137, **how}
    return fc.simulate(model, LAWS[law], method=METHODS[method], events=EVENTS[events], **how)


@pytest.mark.parametrize(("machine", "law", "method"), CASES)
def test_events_that_are_only_watched_change_no_bit(machine, law, method):
    case = machine, law, method
    for every in (0.0137, None):
        free = ran(case, "no", every=every)
        for events in ("never", "met"):
            assert same(free, ran(case, events, every=every)), (events, every)


@pytest.mark.parametrize("events", ["no", pytest.param("never", marks=pytest.mark.long), "met"])
@pytest.mark.parametrize(("machine", "law", "method"), CASES)
def test_a_run_stopped_anywhere_goes_on_with_the_same_bits(machine, law, method, events):
    """At a random time, and at a sample."""
    case = machine, law, method
    whole = ran(case, events)
    for cut in (np.random.default_rng(len("".join(case))).uniform(0.02, 0.28), 6 * PERIOD):
        half = ran(case, events, until=cut)
        rest = ran(case, events, start=half.checkpoint)
        assert same(whole, rest, half.t[-1] + 1e-9)
        assert [(e.name, e.t) for e in (*half.events, *rest.events)] == [(e.name, e.t) for e in whole.events]


@pytest.mark.parametrize(("law", "method"), [("none", "alpha"), ("sampled", "adaptive")])
def test_no_bit_hangs_on_the_clock_on_the_wall(law, method, monkeypatch):
    """Which ends rides over many steps now and then, beyond corners of play, too."""
    case = "play", law, method
    free, ticks = ran(case, "no"), itertools.count()
    monkeypatch.setattr(time, "perf_counter", lambda: 0.07 * next(ticks))
    assert same(free, ran(case, "no"))


@pytest.mark.parametrize("method", ["adaptive", "alpha"])
@pytest.mark.parametrize(
    "effects",
    [(), (fc.CoulombFriction({"drive": 1.0}),), (fc.Backlash({"drive": 0.02}),)],
    ids=["alone", "beside dry friction", "beside play"],
)
def test_a_run_of_a_lagging_motor_stopped_at_a_sample_goes_on_with_the_same_books(effects, method):
    """What is dissipated jumps with the command, which the motor follows within a step or two."""
    model = driven(fc.MotorLag({"drive": 3e-3}), *effects)
    servo = control.ss([], [], [], [[-80.0, -0.5]], PERIOD, inputs=["x", "v"], outputs=["torque"])
    how = {"method": METHODS[method], "start": model.rest.with_(v=np.append(0.3, np.zeros(model.n - 1)))}
    whole = fc.simulate(model, servo, until=END, **how).report.energy
    for cut in (PERIOD, 6 * PERIOD):
        half = fc.simulate(model, servo, until=cut, **how)
        rest = fc.simulate(model, servo, until=END, method=METHODS[method], start=half.checkpoint)
        assert astuple(rest.report.energy) == pytest.approx(astuple(whole), rel=1e-12)  # a last digit may differ


def happened(run: fc.Run, until: float = np.inf) -> tuple[list[Any], list[float]]:
    """What has happened up to a time, in one order at any instant, and when."""
    found = sorted((round(e.t, 6), e.name, e.rising) for e in run.events if e.t <= until)
    return [e[1:] for e in found], [e[0] for e in found]


@pytest.mark.parametrize("method", ["adaptive", "alpha"])
@pytest.mark.parametrize("law", ["none", "sampled"])
@pytest.mark.parametrize("machine", ["rope", "play", "dry", "lag"])
def test_events_are_those_of_plain_steps_and_of_longer_runs(machine, law, method, monkeypatch):
    """Signals that stand still up to a corner, and ones that a step would see pass if it went on over it."""
    case = machine, law, method
    run = ran(case, "met", until=0.1)
    cuts = {cut: happened(ran(case, "met", until=cut)) for cut in (0.031, 0.06, 0.0887)}
    monkeypatch.setattr(alpha, "_quickest", lambda plain: plain)
    told, times = happened(ran(case, "met", until=0.1))
    assert happened(run)[0] == told
    assert happened(run)[1] == pytest.approx(times, abs=1e-5)
    for cut, (what, when) in cuts.items():
        assert what == happened(run, cut)[0]
        assert when == pytest.approx(happened(run, cut)[1], abs=1e-6)
