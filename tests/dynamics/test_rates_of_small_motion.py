"""Forces and rates of what moves little: a line that rings after a load brought on within its period is told of.

Errors of steps that add up are known for places only, and what moves little was not run again: the tension was 79 % of
its range off, and nothing was told.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import Table

TIP, LOAD, G = 5000.0, 500.0, 9.81  # kg, kg, m/s²


def hook(boom: float, rope: float) -> fc.Model:
    """A boom's tip on a spring, a load on 20 m of rope below it; both move up and down."""
    spring = fc.Spring("boom", (0, 0, 0), (0, 0, 30), stiffness=boom)
    tip = fc.PointMass("tip", spring.end, TIP)
    line = fc.Rope("rope", (0, 0, 30), (0, 0, 10), EA=20.0 * rope)
    load = fc.PointMass("load", line.end, LOAD)
    plan = fc.Structure(
        [spring, tip, line, load],
        [
            fc.Support(spring.start, "u v w"),
            fc.Pin(spring.end, tip.node),
            fc.Pin(spring.end, line.start),
            fc.Pin(line.end, load.node),
            fc.Support(tip.node, "u v"),
            fc.Support(load.node, "u v"),
        ],
        inputs=[fc.Force("lift", load.node, "z")],
        outputs=[
            fc.Position("tip", tip.node, "z"),
            fc.Velocity("sinking", load.node, "z"),
            fc.Tension("pull", line),
        ],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])


def exact(boom: float, rope: float, ramp: float, t: np.ndarray) -> dict[str, np.ndarray]:
    """The two masses by an independent integration."""

    def rate(t, y):
        pull = rope * (y[2] - y[0])
        return [y[1], (pull - boom * y[0]) / TIP, y[3], (1000.0 * min(t / ramp, 1.0) - pull) / LOAD]

    y = solve_ivp(rate, (0, t[-1]), np.zeros(4), "DOP853", t, rtol=1e-9, atol=1e-13, max_step=0.01).y
    return {"sinking": y[3], "pull": LOAD * G - rope * (y[2] - y[0])}


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01)])
@pytest.mark.parametrize(("boom", "ramp", "until"), [(2e4, 0.05, 5.0), (2e5, 0.1, 5.0), (5e4, 0.1, 3.0)])
def test_a_line_that_rings_is_told_of(boom, ramp, until, method):
    model, rope = hook(boom, 1e6), 1e6
    lift = fc.OpenLoop({"lift": Table((0, ramp), (0.0, 1000.0))})
    run = fc.simulate(model, lift, until=until, start=fc.equilibrium(model), method=method)
    truth = exact(boom, rope, ramp, run.t)
    for name, values in truth.items():
        off = np.abs(run[name] - values).max() / np.ptp(values)
        told = run.report.output_errors[name]
        assert off < 1.5 * told < 3.0 * off + 0.15, (name, off, told)
    assert any("pull" in note for note in run.report.notes)


def test_a_small_model_is_laid_beside_as_well():
    """Not only models whose parts may turn: a frame that is struck, in small motion."""
    tube = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.005)
    post = fc.Beam("post", (0, 0, 0), (0, 0, 4), tube, elements=2)
    arm = fc.Beam("arm", (0, 0, 4), (3, 0, 4), tube, elements=2)
    plan = fc.Structure(
        [post, arm],
        [fc.Support(post.start), fc.Weld(post.end, arm.start)],
        inputs=[fc.Force("blow", arm.end, "z")],
        outputs=[fc.Position("z", arm.end, "z"), fc.Velocity("vz", arm.end, "z")],
    )
    model = fc.assemble(fc.planar(plan, normal="y"), [fc.Flexible()])
    blow = fc.OpenLoop({"blow": lambda t: 1000.0 * np.sin(np.pi * t / 0.02) * (t < 0.02)})
    run = fc.simulate(model, blow, until=1.0, every=2e-3)
    linear = fc.simulate(fc.linearize(model), blow, until=1.0, every=2e-3, method=fc.Exact(1e-4))
    off = np.abs(run["vz"] - linear["vz"]).max() / np.ptp(linear["vz"])
    assert off > 0.02
    assert off < 1.5 * run.report.output_errors["vz"]


def test_places_alone_are_not_run_again():
    """Sums of errors tell of these."""
    tube = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.005)
    post = fc.Beam("post", (0, 0, 0), (0, 0, 4), tube, elements=2)
    plan = fc.Structure(
        [post],
        [fc.Support(post.start)],
        inputs=[fc.Force("blow", post.end, "x")],
        outputs=[fc.Position("x", post.end, "x")],
    )
    model = fc.assemble(fc.planar(plan, normal="y"), [fc.Flexible()])
    run = fc.simulate(model, inputs={"blow": 10.0}, until=0.2, every=2e-3)
    assert run.report.error == run.report.drift
