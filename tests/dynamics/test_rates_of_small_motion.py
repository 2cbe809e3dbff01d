"""Forces and rates of what moves little: a line that rings after a load brought on within its period is told of.

Errors of steps that add up are known for places only, and what moves little was not run again: the tension was 79 % of
its range off, and nothing was told.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import MinimumJerk, Table, pd

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


class Servo:
    """Moves a cart by 2 mm within a fifth of a second."""

    inputs, outputs = ("place", "speed"), ("push",)

    def __init__(self, sample_time: float) -> None:
        self.sample_time = sample_time

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        share = min(t / 0.2, 1.0)
        aim = 2e-3 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        return np.array([26.3 * (400.0 * (aim - y[0]) - 30.0 * y[1])])


def stage() -> fc.Model:
    """A cart of 25 kg on a guide, with 1.3 kg on a spring of 12 Hz: ten metres long, so that all of it moves little."""
    cart = fc.PointMass("cart", (0, 0, 0), 25.0)
    spring = fc.Spring("spring", (0, 0, 0), (10, 0, 0), stiffness=1.3 * (2.0 * np.pi * 12.0) ** 2)
    tip = fc.PointMass("tip", spring.end, 1.3)
    joints = [fc.Support(cart.node, "v w"), fc.Support(tip.node, "v w")]
    joints += [fc.Pin(cart.node, spring.start), fc.Pin(spring.end, tip.node)]
    outputs = [
        fc.Position("place", cart.node, "x"),
        fc.Velocity("speed", cart.node, "x"),
        fc.Velocity("swing", tip.node, "x", minus=cart.node),
        fc.Tension("pull", spring),
    ]
    plan = fc.Structure([cart, spring, tip], joints, inputs=[fc.Force("push", cart.node, "x")], outputs=outputs)
    return fc.assemble(plan, [fc.Flexible()])


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01), fc.GeneralizedAlpha(0.005)])
def test_samples_that_keep_steps_short_do_not_hide_what_rings(method):
    """Nothing was told where samples do, nor where a run in longer steps came out in the same ones."""
    model, law = stage(), Servo(0.01)
    how = {"until": 1.2, "every": 5e-3}
    run = fc.simulate(model, law, method=method, **how)
    true = fc.simulate(model, law, method=fc.Unchecked(fc.GeneralizedAlpha(1e-4)), **how)
    for name in ("swing", "pull"):
        off = np.abs(run[name] - true[name]).max() / np.ptp(true[name])
        told = run.report.output_errors[name]
        assert off > 0.02
        assert 0.6 * off < told, (name, off, told)


@pytest.mark.parametrize(("rubbing", "bristle", "EA"), [(1.0, 100.0, 5e5), (0.3, 10.0, 2.3e5)])
def test_bristles_after_samples_do_not_hide_what_rings_between_them(rubbing, bristle, EA):
    """A coarser run had half the steps, and the same ones while the rope rang: 25 % off was told as 4 %."""
    top, load = fc.PointMass("top", (0, 0, 0), 100.0), fc.PointMass("load", (0, 0, -2), 30.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=EA, damping=4.0)
    travel = fc.LinearDrive(
        "travel", top.node, direction="x", radius=0.1, stiffness=24.0, ratio=10.0, inertia=0.006, damping=0.01
    )
    plan = fc.Structure(
        [top, load, rope],
        [
            fc.Support(top.node, "v w"),
            fc.Support(load.node, "v"),
            fc.Pin(top.node, rope.start),
            fc.Pin(load.node, rope.end),
        ],
        [travel],
        [fc.MotorTorque("torque", travel)],
        [fc.DriveAngle("angle", travel), fc.DriveSpeed("speed", travel), fc.Tension("pull", rope)],
    )
    damping = 0.2 * np.sqrt(0.019 * bristle)
    law = fc.LuGre(stiffness=bristle, kinetic=rubbing, static=1.3 * rubbing, stribeck=1.0, damping=damping)
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.LuGreFriction({"travel": law})]
    model = fc.assemble(plan, effects)
    move = MinimumJerk(30.0, 0.5, at=0.05)
    servo = pd(0.7, 0.16, measured="angle", rate="speed", command="torque")
    tracking = fc.Sampled(fc.Tracking(servo, {"angle": move, "speed": move.derivative}), 0.01)
    how = {"until": 1.5, "every": 5e-3, "start": fc.equilibrium(model, hold={"travel_source": 0.0})}
    run = fc.simulate(model, tracking, **how)
    fine = {"method": fc.Unchecked(fc.AdaptiveAlpha()), "tolerance": fc.Tolerance(1e-7, 1e-10)}
    true = fc.simulate(model, tracking, **fine, **how)
    off = np.abs(run["pull"] - true["pull"]).max() / np.ptp(true["pull"])
    assert off > 0.05
    assert 0.8 * off < run.report.output_errors["pull"] < 2.0 * off


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_exact_motion_is_told_alike_whatever_it_is_of(step):
    """A model in small motion and its linear model: rows are exact in both, and nothing rings unseen between them."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=2e3, damping=1.0)
    mass = fc.PointMass("mass", spring.end, 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    outputs = [fc.Velocity("v", mass.node, "x"), fc.Tension("pull", spring)]
    plan = fc.Structure([mass, spring], joints, inputs=[fc.Force("push", mass.node, "x")], outputs=outputs)
    model = fc.assemble(plan, [])
    runs = [
        fc.simulate(m, inputs={"push": 20.0}, until=3.0, method=fc.Exact(step)) for m in (model, fc.linearize(model))
    ]
    for run in runs:
        assert not run.report.notes
        assert not run.report.output_errors
    assert np.abs(runs[0].y - runs[1].y).max() < 1e-9
