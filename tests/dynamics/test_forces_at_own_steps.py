"""Forces in rows at the run's own steps: what other runs tell of them must not hide between two rows."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def end_stop(stiffness: float, damping: float, gap: float, push: float) -> tuple[fc.Model, fc.design.Controller]:
    """A cart pushed to and fro between the flanks of a stop with a damper, whose force jumps as a flank is met."""
    cart = fc.PointMass("cart", (0, 0, 0), 20.0)
    stop = fc.Spring("stop", (-1, 0, 0), (0, 0, 0), stiffness=stiffness, damping=damping)
    joints = [fc.Support(cart.node, "v w"), fc.Support(stop.start), fc.Pin(stop.end, cart.node)]
    outputs = [fc.Position("x", cart.node, "x"), fc.Tension("force", stop)]
    plan = fc.Structure([cart, stop], joints, [], [fc.Force("push", cart.node, "x")], outputs)
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Flexible(), fc.Backlash({"stop": gap})])
    return model, fc.design.OpenLoop({"push": lambda t: push * np.sin(3.1 * t)})


@pytest.mark.parametrize("seed", [0, 3, 8])
def test_jumps_at_events_are_told(seed):
    """A row at the instant of contact was 9 to 18 % off, told as 0.1 to 0.9 %, and nothing was said."""
    rng = np.random.default_rng(seed)
    spring, gap = (10 ** rng.uniform(4.3, 5.2), rng.uniform(50, 400)), rng.uniform(0.1, 0.3)
    model, law = end_stop(*spring, gap, rng.uniform(30, 200))
    run = fc.simulate(model, law, until=1.2, tolerance=fc.Tolerance(3e-5, 3e-8))
    alone = fc.Unchecked(fc.AdaptiveAlpha())
    fine = fc.simulate(model, law, until=1.2, tolerance=fc.Tolerance(1e-6, 1e-9), method=alone)
    off = np.abs(run["force"] - [fine.at(t)["force"] for t in run.t]) / np.ptp(run["force"])
    at_events = np.array([min(abs(event.t - t) for event in run.events) < 1e-8 for t in run.t])
    assert off[~at_events].max() < 2.0 * run.report.output_errors["force"] + 1e-3
    assert off[at_events].max() < 0.01 or any("force may jump by" in note for note in run.report.notes)


def test_a_tension_that_hardly_varies_is_told_of():
    """By 6e-4 of its size, which is less than stretching by the absolute tolerance makes: nothing was told of it."""
    weight, angle = 98.1, 0.02
    long, stretched = 4.0, 1.0 + weight * np.cos(angle) / 4e6
    below = (long * np.sin(angle), 0, -long * np.cos(angle))
    rope = fc.Rope("rope", (0, 0, 0), below, EA=4e6, length=long / stretched)
    load = fc.PointMass("load", rope.end, 10.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    plan = fc.Structure([rope, load], joints, outputs=[fc.Position("x", load.node, "x"), fc.Tension("T", rope)])
    model = fc.assemble(plan, [fc.LargeRotation(), fc.RopeStretch(), fc.Gravity((0, 0, -9.81))])
    run = fc.simulate(model, until=6.0)
    swing = angle * np.cos(np.sqrt(9.81 / long) * run.t)
    true = weight * (1.0 + angle**2 - 1.5 * swing**2)
    off = np.abs(run["T"] - true).max() / np.ptp(true)
    assert 0.5 * off < run.report.output_errors["T"] < 0.3


class Pushes:
    """Pushes the cart of `end_stop` to and fro, from sample to sample."""

    sample_time = 0.02
    inputs = ("x",)
    outputs = ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([100.0 * np.sin(3.1 * t)])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def test_jumps_at_events_are_told_under_a_sampled_law():
    """A row at the instant of contact was 10 % off, told as 1 %: jumps were looked for under continuous laws alone."""
    model, _ = end_stop(5e4, 300.0, 0.2, 100.0)
    run = fc.simulate(model, Pushes(), until=1.2)
    event = run.events[0]
    row, beyond = int(np.argmin(np.abs(run.t - event.t))), run.at(event.t + 1e-7)["force"]
    assert abs(run["force"][row] - beyond) > 0.05 * np.ptp(run["force"])
    assert any("force may jump by" in note for note in run.report.notes)


@pytest.mark.parametrize("tolerance", [fc.Tolerance(), fc.Tolerance(1e-3, 1e-6)])
def test_jumps_are_told_where_all_runs_are_late(tolerance):
    """A mass thrown up by its damped rope came back late in this run and beside it: a row was 17 % off, told as 0.2."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1.2), EA=8e5, length=2.0, damping=12e3)
    load = fc.PointMass("load", rope.end, 350.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "u v")]
    plan = fc.Structure([rope, load], joints, outputs=[fc.Tension("T", rope)])
    model = fc.assemble(plan, [fc.LargeRotation(), fc.RopeStretch(), fc.Gravity()])
    alone = fc.Unchecked(fc.ExplicitRungeKutta())
    fine = fc.simulate(model, until=1.0, method=alone, tolerance=fc.Tolerance(1e-10, 1e-13))
    caught = fine.events[2].t
    run = fc.simulate(model, until=1.0, tolerance=tolerance, every=caught * (1.0 + 1e-5) / 50)
    missed = abs(run["T"][50] - fine.at(run.t[50])["T"]) / np.ptp(run["T"])
    assert caught < run.t[50] < run.events[2].t
    assert missed > 0.1 > 2.0 * run.report.output_errors["T"]
    assert any("T may jump by" in note for note in run.report.notes)
