"""A linear model runs by every method under every kind of controller, and goes on from its checkpoints bit for bit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import Constant, FilteredRate, OpenLoop, Step, Tracking, pd, pid
from flexctrl.design.controller import as_controller

UNTIL = 0.1
START = np.array([0.1, 0.0]), np.array([0.0, 0.4])


@cache
def chain() -> fc.LinearModel:
    """Two masses on springs; the force is on the first one."""
    near = fc.Spring("near", (0, 0, 0), (1, 0, 0), stiffness=100.0, damping=0.8)
    far = fc.Spring("far", near.end, (2, 0, 0), stiffness=400.0, damping=0.2)
    one, two = fc.PointMass("one", near.end, 1.0), fc.PointMass("two", far.end, 0.5)
    joints = [fc.Support(near.start), fc.Pin(near.end, far.start), fc.Pin(near.end, one.node)]
    joints += [fc.Pin(far.end, two.node), fc.Support(one.node, "v w"), fc.Support(two.node, "v w")]
    inputs = [fc.Force("push", one.node, "x")]
    outputs = [fc.Position("x", one.node, "x"), fc.Velocity("v", one.node, "x"), fc.Position("end", two.node, "x")]
    return fc.linearize(fc.assemble(fc.Structure([near, far, one, two], joints, inputs=inputs, outputs=outputs), []))


class Stiffening:
    """A law in Python whose command is no linear function, with a state of its own."""

    inputs, outputs = ("x", "v"), ("push",)

    def __init__(self, sample_time: float) -> None:
        self.sample_time = sample_time

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([-8.0 * y[0] - 60.0 * y[0] ** 3 - 0.9 * y[1] - 5.0 * x[0] + 0.5 * np.sin(3.0 * t)])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return y[:1] - 2.0 * x

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + self.sample_time * (y[:1] - 2.0 * x)


FEEDBACK = pid(8.0, 5.0, 0.9, measured="x", rate=FilteredRate(0.05), command="push")
LAWS: dict[str, Any] = {
    "none": None,
    "sampled in Python": Stiffening(7e-3),
    "sampled pid": fc.Sampled(Tracking(FEEDBACK, {"x": Constant(0.05)}), 0.01),
    "sampled control.TransferFunction": control.tf([-20.0, 12.0], [1.0, -0.3], 0.02, inputs="x", outputs="push"),
    "continuous pd": Tracking(pd(8.0, 0.9, measured="x", rate="v", command="push"), {"x": Constant(0.05)}),
    "continuous in Python": Stiffening(0.0),
    "control.StateSpace": control.ss([[-3.0]], [[1.0]], [[-9.0]], [[-6.0]], inputs="x", outputs="push"),
    "a step": OpenLoop({"push": Step(4.0, at=0.0423)}),
}
"""Beside a constant push."""

PUSH, STEP = 1.5, 2e-3
METHODS: dict[fc.Integrator | None, tuple[float, float]] = {
    None: (1e-10, 1e-9),
    fc.Exact(0.005): (1e-10, 1e-9),
    fc.GeneralizedAlpha(STEP): (5e-4, 1e-2),
    fc.AdaptiveAlpha(): (5e-4, 1e-2),
    fc.ConservingMidpoint(STEP): (5e-4, 1e-2),
    fc.ExplicitRungeKutta(): (1e-5, 1e-4),
    fc.ExplicitRungeKutta(STEP): (1e-10, 1e-9),
    fc.Richardson(fc.GeneralizedAlpha(STEP)): (1e-6, 5e-5),
    fc.Richardson(fc.AdaptiveAlpha()): (1e-5, 1e-3),
    fc.Richardson(fc.ConservingMidpoint(STEP)): (1e-6, 5e-5),
}
"""Methods, and what they may err by at the end [m, m/s]."""

CHOSEN = [pytest.param(m, marks=pytest.mark.slow) if isinstance(m, fc.Richardson) else m for m in METHODS]


@cache
def _reference(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Places and rates at the end: the equations written out, by an integrator of others, from jump to jump."""
    linear = chain()
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    law = None if LAWS[name] is None else as_controller(LAWS[name], linear.inputs, linear.outputs)
    reads = [] if law is None else [linear.outputs.index(signal) for signal in law.inputs]
    sample = 0.0 if law is None else law.sample_time
    jumps = np.arange(sample, UNTIL - 1e-9, sample) if sample else getattr(law, "breaks", ())
    own = np.zeros(0) if law is None else np.asarray(law.initial(), float)

    def read(z: np.ndarray) -> np.ndarray:
        return (linear.Cq @ z[:2] + linear.Cv @ z[2:4])[reads]

    def accelerated(z: np.ndarray, u: float) -> np.ndarray:
        return np.linalg.solve(M, linear.B[:, 0] * (PUSH + u) - C @ z[2:4] - K @ z[:2])

    z, held = np.concatenate([*START, own]), 0.0
    for t0, t1 in pairwise((0.0, *jumps, UNTIL)):
        if sample:
            y, x = read(z), z[4:].copy()
            held = float(np.ravel(law.command(t0, x, y))[0])
            z[4:] = law.update(t0, x, y) if x.size else x

        def rate(t: float, z: np.ndarray, held: float = held, t0: float = t0, t1: float = t1) -> np.ndarray:
            if law is None or sample:
                return np.concatenate([z[2:4], accelerated(z, held), np.zeros(z.size - 4)])
            t, y = min(max(t, t0 + 1e-9), t1 - 1e-9), read(z)  # on this side of a jump
            u = float(np.ravel(law.command(t, z[4:], y))[0])
            return np.concatenate([z[2:4], accelerated(z, u), law.rate(t, z[4:], y) if z.size > 4 else z[4:]])

        z = solve_ivp(rate, (t0, t1), z, method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.02).y[:, -1]
    return z[:2], z[2:4]


def _start() -> fc.State:
    return replace(fc.simulate(chain(), until=1e-3).final, q=START[0], v=START[1])


def _run(name: str, method: fc.Integrator | None, until: float, start: Any) -> fc.Run:
    how = {"inputs": None if isinstance(start, fc.Checkpoint) else {"push": PUSH}, "every": 0.004, "method": method}
    events = [fc.Event("half way", "x", 0.05), fc.Event("never", "end", 50.0)]
    return fc.simulate(
        chain(), LAWS[name], until=until, start=start, events=events, tolerance=fc.Tolerance(1e-5, 1e-8), **how
    )


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("method", CHOSEN, ids=repr)
def test_every_method_runs_it_under_every_controller(name, method):
    once = _run(name, method, UNTIL, _start())
    assert once.status is fc.Status.FINISHED
    for found, true, allowed in zip((once.final.q, once.final.v), _reference(name), METHODS[method], strict=True):
        assert np.abs(found - true).max() < allowed
    assert once.report.energy_residual < 1e-3

    half = _run(name, method, 0.0673, _start())
    rest = _run(name, method, UNTIL, half.checkpoint)
    for signals in ("t", "y", "u"):
        assert np.array_equal(getattr(rest, signals), getattr(once, signals)[-len(rest.t) :])
    assert np.array_equal(rest.final.q, once.final.q)
    assert np.array_equal(rest.final.v, once.final.v)
    assert rest.report.energy == once.report.energy
    assert [e.t for e in once.events] == [e.t for e in (*half.events, *rest.events)]
    assert len(once.events) == 1


def test_a_run_of_the_default_method_goes_on_to_another_end(tmp_path):
    half = fc.simulate(chain(), until=0.5, inputs={"push": PUSH})
    half.checkpoint.save(tmp_path / "half")
    rest = fc.simulate(chain(), until=1.0, start=fc.load_checkpoint(tmp_path / "half"))
    whole = fc.simulate(chain(), until=1.0, inputs={"push": PUSH}, method=fc.Exact(0.5 / 1000))
    assert rest.report.steps == 2000
    assert np.array_equal(rest.final.q, whole.final.q)
