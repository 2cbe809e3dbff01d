"""Corners of laws of force met in compiled loops: the same runs as by plain steps, without plain ones."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Step, Tracking, pd
from flexctrl.dynamics.alpha import method as alpha
from flexctrl.dynamics.events import watching


def geared(*effects: fc.Effect, stiffness: float = 30.0, damping: float = 0.05) -> fc.Model:
    """A wheel on a motor with play."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    shaft = {"stiffness": stiffness, "ratio": 2.0, "damping": damping}
    drive = fc.RotaryDrive("motor", wheel.node, axis="z", inertia=0.05, **shaft)
    structure = fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)],
    )
    play = fc.Backlash({"motor": 0.1})
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), play, *effects])


def chain() -> fc.Model:
    """Three masses on ropes that catch them one by one."""
    ropes = [fc.Rope(f"rope{i}", (0, 0, -i), (0, 0, -i - 1), EA=1e4, length=1.1) for i in range(3)]
    masses = [fc.PointMass(f"mass{i}", rope.end, 1.0) for i, rope in enumerate(ropes)]
    joints = [fc.Support(ropes[0].start), *(fc.Support(mass.node, "v") for mass in masses)]
    joints += [fc.Pin(rope.end, mass.node) for rope, mass in zip(ropes, masses, strict=True)]
    joints += [fc.Pin(one.node, rope.start) for one, rope in zip(masses, ropes[1:], strict=False)]
    outputs = [fc.Position("z", masses[-1].node, "z")]
    effects = [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()]
    return fc.assemble(fc.Structure([*ropes, *masses], joints, outputs=outputs), effects)


def sampled(model: fc.Model) -> dict:
    law = Tracking(pd(20.0, 2.0, measured="angle", rate="speed", command="torque"), {"angle": Step(1.0)})
    return {"model": model, "until": 0.5, "controller": fc.Sampled(law, 0.01)}


CASES = {
    "play": lambda: {"model": geared(), "until": 0.5, "inputs": {"torque": 1.9}},
    "play under control": lambda: sampled(geared()),
    "play behind a lag": lambda: sampled(geared(fc.MotorLag({"motor": 0.02}))),
    "ropes": lambda: {"model": chain(), "until": 0.35},
}


@pytest.fixture
def plainly(monkeypatch):
    """Runs by plain steps."""

    def run(**asked: object) -> fc.Run:
        with monkeypatch.context() as patch:
            patch.setattr(alpha, "_quickest", lambda plain: plain)
            return fc.simulate(**asked)

    return run


METHODS = {"fixed": fc.GeneralizedAlpha(2e-3), "adaptive": fc.AdaptiveAlpha()}


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_marched_corners_are_those_of_plain_steps(case, method, plainly, monkeypatch):
    asked = {**case(), "method": method}
    plain = plainly(**asked)
    monkeypatch.setattr(watching, "landed", None)  # no corner is met in a plain step
    run = fc.simulate(**asked)
    assert len(run.events) == len(plain.events) > 1
    assert [(e.name, e.rising) for e in run.events] == [(e.name, e.rising) for e in plain.events]
    assert [e.t for e in run.events] == pytest.approx([e.t for e in plain.events], abs=1e-8)
    for one, other in zip(run.events, plain.events, strict=True):
        assert one.signals == pytest.approx(other.signals, rel=1e-5, abs=1e-8)
    for number in ("steps", "rejected_steps"):
        assert getattr(run.report, number) == getattr(plain.report, number)
    assert run.report.energy_residual == pytest.approx(plain.report.energy_residual, rel=1e-3, abs=1e-9)
    scale = np.abs(plain.final.v).max()
    assert run.final.v == pytest.approx(plain.final.v, abs=1e-5 * scale)
    for name in run.outputs:
        assert run[name] == pytest.approx(plain[name], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_states_on_the_way_are_those_of_the_run(case, method):
    """Made again when asked for: corners are met again, to round-off."""
    run = fc.simulate(**case(), method=method)
    met = np.array([event.t for event in run.events])
    for name in run.outputs:
        for t, value in zip(run.t.tolist(), run[name].tolist(), strict=True):
            if np.abs(met - t).min() > 1e-6:  # where a step ends at a corner, the next one starts just beyond
                assert run.at(t)[name] == pytest.approx(value, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("step", [1e-3, 4e-3])
@pytest.mark.parametrize("damping", [1.0, 30.0])
def test_a_stiff_flank_is_met_when_it_is(damping, step, plainly):
    """A motor driven through half its play of 0.1 rad by 1.9 N m, to a flank that throws back what ends beyond it."""
    asked = {"model": geared(stiffness=1e8, damping=damping), "until": 0.06, "inputs": {"torque": 1.9}}
    runs = [take(**asked, method=fc.GeneralizedAlpha(step)) for take in (fc.simulate, plainly)]
    for run in runs:
        assert run.events[0].t == pytest.approx((0.1 * 0.05 / 1.9) ** 0.5, abs=1e-9)


@pytest.mark.parametrize(("stiffness", "damping"), [(1e3, 0.3), (3.2e3, 0.71), (2.7e4, 1.3)])
def test_a_step_onto_a_flank_that_uses_up_its_iterations_is_tried_again(stiffness, damping, plainly):
    """With the tangent of the gap, and with ones made anew: whether it is too long is for its error to say."""
    asked = sampled(geared(stiffness=stiffness, damping=damping))
    run, plain = (take(**asked) for take in (fc.simulate, plainly))
    assert (run.report.steps, run.report.rejected_steps) == (plain.report.steps, plain.report.rejected_steps)
    assert run.final.v == pytest.approx(plain.final.v, abs=1e-6 * np.abs(plain.final.v).max())


@pytest.mark.parametrize("controlled", [False, True])
def test_a_run_whose_method_makes_energy_ends_at_a_balance(controlled, plainly):
    """Which comes after so many steps, however many are taken at once: here after 32, in the damped flank's throes."""
    model = geared(stiffness=1e6, damping=20.0)
    asked = sampled(model) if controlled else {"model": model, "until": 0.5, "inputs": {"torque": 6.0}}
    runs = [take(**asked, method=fc.GeneralizedAlpha(1e-3)) for take in (fc.simulate, plainly)]
    for run in runs:
        assert run.status is fc.Status.FAILED
        assert "has made" in run.report.message
        assert run.report.steps % 32 == 0
    assert runs[0].final.t == pytest.approx(runs[1].final.t, abs=1e-12)


def test_steps_are_of_second_order_through_a_corner():
    """A mass thrown over its play into a spring and back: x = −b − v/ω sin ω(t − 2b/v) while it is there."""
    body, spring = fc.PointMass("block", (1, 0, 0), 1.0), fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0)
    held = [fc.Support(spring.start), fc.Pin(spring.end, body.node), fc.Support(body.node, "v w")]
    structure = fc.Structure([body, spring], held, outputs=[fc.Position("x", body.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"spring": 0.02})])
    start, until = model.rest.with_(v=np.ones(1)), 0.2
    exact = 1.0 + 0.01 + 0.1 * np.sin(10.0 * (until - 0.01))
    errors = [
        abs(fc.simulate(model, start=start, until=until, method=fc.GeneralizedAlpha(h))["x"][-1] - exact)
        for h in (4e-3, 2e-3, 1e-3)
    ]
    assert all(3.0 < coarse / fine < 5.5 for coarse, fine in pairwise(errors))


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_speed_that_stays_the_same_up_to_a_corner_is_not_zero_there(method):
    """A block flies through its play, into a spring, and turns after a quarter of a period."""
    body, spring = fc.PointMass("block", (1, 0, 0), 1.0), fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0)
    held = [fc.Support(spring.start), fc.Pin(spring.end, body.node), fc.Support(body.node, "v w")]
    structure = fc.Structure([body, spring], held, outputs=[fc.Velocity("v", body.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"spring": 0.02})])
    how = {"start": model.rest.with_(v=np.ones(1)), "until": 0.2, "method": method}
    run = fc.simulate(model, events=[fc.Event("turns", "v")], **how)
    assert [event.name for event in run.events] == ["spring", "turns"]
    assert [event.t for event in run.events] == pytest.approx([0.01, 0.01 + np.pi / 20.0], abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_model_runs_as_often_as_one_likes_through_damped_play(seed):
    """A rigid pendulum is solved with its mass alone: no tangent of a run before has a say in where its steps end."""
    gap, stiffness, damping, speed = np.random.default_rng(seed).uniform((0.05, 1e3, 0.2, 0.5), (0.2, 1e4, 20.0, 2.0))
    body = fc.RigidBody("body", (0, 0, -0.5), 3.0, (0.2, 0.2, 0.1), {"hinge": (0, 0, 0), "tip": (0, 0, -1)})
    spring = fc.Spring("spring", (0.8, 0, -1), (0, 0, -1), stiffness=stiffness, damping=damping)
    joints = [fc.Support(body.point("hinge"), "u v w rx rz"), fc.Support(spring.start)]
    joints += [fc.Pin(spring.end, body.point("tip"))]
    structure = fc.Structure([body, spring], joints, outputs=[fc.Rotation("angle", body.node, "y")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Backlash({"spring": gap})])
    start = model.rest.with_(v=np.array([speed]))
    runs = [
        fc.simulate(model, until=0.5, start=start, tolerance=fc.Tolerance(t, 1e-3 * t))
        for t in (1e-5, 1e-4, 1e-6, 1e-5)
    ]
    assert [run.status for run in runs] == [fc.Status.FINISHED] * 4
    assert all(run.events for run in runs)
    first, _, finer, last = (run["angle"] for run in runs)
    assert first.tolist() == last.tolist()
    assert first[-1] == pytest.approx(finer[-1], abs=2e-3)
