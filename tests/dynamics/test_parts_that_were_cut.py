"""Of parts that were interrupted, nobody has been laid beside: what goes on from there says so."""

from __future__ import annotations

import os
import re
import signal
from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc

FAST = {"until": 30.0, "every": 0.05}
RIGHT = re.compile(r"places are right to 3% until t = ([\d.]+) s")


def pendulum() -> fc.Model:
    """A double pendulum, which chaos leads astray within seconds."""
    upper = fc.RigidBody("upper", (0, 0, -0.5), 1.0, (0.05,) * 3, {"top": (0, 0, 0), "end": (0, 0, -1)})
    lower = fc.RigidBody("lower", (0, 0, -1.5), 1.0, (0.05,) * 3, {"top": (0, 0, -1), "end": (0, 0, -2)})
    joints = [
        fc.Support(upper.point("top"), "u v w rx rz"),
        fc.Hinge(upper.point("end"), lower.point("top"), axis="y"),
    ]
    places = [fc.Position(a, lower.point("end"), a) for a in "xz"]
    plan = fc.Structure([upper, lower], joints, outputs=places)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


def thrown(model: fc.Model, speed: float = 8.0) -> fc.State:
    return model.rest.with_(v=np.array([speed, 0.0]))


@pytest.fixture
def cut(monkeypatch):
    """A run in which Ctrl-C is pressed as soon as so much of it is done."""

    def run(*model_and_law, share: float, **how) -> fc.Run:
        left = [1]

        def pressing(done: float) -> None:
            if done > share and left:
                os.kill(os.getpid(), signal.SIGINT)
                left.clear()

        with monkeypatch.context() as often:
            often.setattr("flexctrl.dynamics.journey._SECONDS", 0.0)
            found = fc.simulate(*model_and_law, progress=pressing, **how)
        assert found.status is fc.Status.INTERRUPTED
        assert share < found.checkpoint.t / how["until"] < 0.98
        return found

    return run


def test_since_when_a_part_that_was_cut_was_wrong_is_told_by_others(cut, tmp_path):
    """It was called right until it was cut, where it had been wrong for long; runs beside part before."""
    model = pendulum()
    once = fc.simulate(model, start=thrown(model), **FAST)
    right = float(RIGHT.search("; ".join(once.report.notes)).group(1))
    first = cut(model, start=thrown(model), share=0.3, **FAST)
    assert any("not told by another run (interrupted)" in note for note in first.report.notes)
    first.checkpoint.save(tmp_path / "first")
    on = fc.simulate(model, start=fc.load_checkpoint(tmp_path / "first"), **FAST)
    later = fc.simulate(model, start=on.checkpoint, **{**FAST, "until": 35.0})
    at = f"t = {first.checkpoint.t:.3g} s"
    for run in (on, later):
        said = "; ".join(run.report.notes)
        assert run.report.error > 0.2
        late = f"off by more than 3% as it went on at {at}, as runs beside it are apart by so much since t = "
        assert 0.3 * right < float(said.partition(late)[2].partition(" s")[0]) < 1.2 * right
        assert f"what was run before {at}, cut off or unchecked, has not been laid beside another run" in said
        assert not RIGHT.search(said)


def test_since_when_a_part_that_finished_was_wrong_is_known():
    model = pendulum()
    first = fc.simulate(model, start=thrown(model), **{**FAST, "until": 20.0})
    on = fc.simulate(model, start=first.checkpoint, **FAST)
    told = [RIGHT.search("; ".join(run.report.notes)).group(1) for run in (first, on)]
    assert told[0] == told[1]
    assert not any("has not been laid" in note for note in on.report.notes)


def test_what_was_right_as_it_went_on_is_so_from_there_on(cut):
    """Cut before it went astray: right from there until it did."""
    model = pendulum()
    how = {"until": 12.0, "every": 0.05, "method": fc.ExplicitRungeKutta()}
    once = fc.simulate(model, start=thrown(model), **how)
    first = cut(model, start=thrown(model), share=0.1, **how)
    assert first.checkpoint.t < 2.0
    said = "; ".join(fc.simulate(model, start=first.checkpoint, **how).report.notes)
    found = re.search(r"right to 3% from t = ([\d.]+) s until t = ([\d.]+) s", said)
    right = float(RIGHT.search("; ".join(once.report.notes)).group(1))
    assert float(found.group(1)) == pytest.approx(first.checkpoint.t, rel=5e-3)
    assert 0.8 * right < float(found.group(2)) < right + 0.3


@pytest.mark.parametrize("cut_at", [1.25, 2.5, 2.75])
def test_what_is_near_a_run_beside_by_chance_is_not_right(cut_at):
    """Of a part that nobody had checked: 14 % off as it went on, it was called right to 3 % from there until 3.04 s."""
    model, method = pendulum(), fc.ConservingMidpoint(1e-2)
    how = {"start": thrown(model, 6.5), "every": 0.05}
    exact = {"method": fc.Unchecked(fc.ExplicitRungeKutta()), "tolerance": fc.Tolerance(0.0, 1e-12)}
    true = fc.simulate(model, until=3.1, **how, **exact)
    off = np.abs(fc.simulate(model, until=3.1, method=fc.Unchecked(method), **how).y - true.y).max(axis=1) / 2.0
    part = fc.simulate(model, until=cut_at, method=fc.Unchecked(method), **how)
    on = fc.simulate(model, start=part.checkpoint, until=12.0, every=0.05, method=fc.Checked(method))
    said = "; ".join(on.report.notes)
    late = r"as it went on at t = [\d.]+ s, as runs beside it are apart by so much since"
    found = re.search(rf"(right to 3% from t = [\d.]+ s until|{late}) t = ([\d.]+) s", said)
    assert 1.0 < float(found.group(2)) < true.t[np.argmax(off > 0.03)]


def test_a_part_that_needed_none_beside_it_is_no_part_that_was_cut():
    model = pendulum()
    first = fc.simulate(model, start=thrown(model, 0.02), until=2.0, every=0.05)
    on = fc.simulate(model, start=first.checkpoint, until=4.0, every=0.05, method=fc.Checked(fc.AdaptiveAlpha()))
    assert not any("has not been laid" in note for note in on.report.notes)
    unchecked = fc.simulate(
        model, start=thrown(model, 0.02), until=2.0, every=0.05, method=fc.Unchecked(fc.AdaptiveAlpha())
    )
    on = fc.simulate(model, start=unchecked.checkpoint, until=4.0, every=0.05, method=fc.Checked(fc.AdaptiveAlpha()))
    assert any("cut off or unchecked, has not been laid" in note for note in on.report.notes)


def test_until_when_a_long_run_is_right_is_looked_for():
    """Wrong at the first of sixteen instants, it was called right until t = 0 s."""
    model = pendulum()
    how = {"start": thrown(model), "every": 0.05, "until": 25.0}
    true = fc.simulate(
        model, method=fc.Unchecked(fc.ExplicitRungeKutta()), tolerance=fc.Tolerance(0.0, 1e-12), **{**how, "until": 4.0}
    )
    run = fc.simulate(model, method=fc.GeneralizedAlpha(2e-2), **how)
    off = np.abs(run.y[: len(true.y)] - true.y).max(axis=1) / 2.0
    told = float(RIGHT.search("; ".join(run.report.notes)).group(1))
    assert 0.2 < told < true.t[np.argmax(off > 0.03)]


class Servo:
    """A law that remembers what is left to go."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 1e-2

    def initial(self):
        return np.zeros(1)

    def command(self, t, x, y):
        return np.array([4.0 * (0.5 * np.sin(0.7 * t) - y[0]) - 0.8 * y[1] + 0.3 * x[0]])

    def update(self, t, x, y):
        return np.array([0.999 * x[0] + 1e-3 * (0.5 * np.sin(0.7 * t) - y[0])])


def arm_with_play() -> fc.Model:
    link = fc.RigidBody("link", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=2000.0, inertia=0.05, damping=1.0)
    outputs = [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor), fc.Rotation("tip", link.node, "z")]
    plan = fc.Structure([link], [fc.Support(hinge, "u v w rx ry")], [motor], [fc.MotorTorque("torque", motor)], outputs)
    return fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity(), fc.Backlash({"motor": 0.02})])


def test_peaks_before_a_cut_are_not_those_of_what_goes_on(cut):
    """The largest speed of all was laid beside the largest of the rest, which was said to be 48 % off."""
    model, how = arm_with_play(), {"until": 8.0, "method": fc.GeneralizedAlpha(2e-3)}
    once = fc.simulate(model, Servo(), **how)
    first = cut(model, Servo(), share=0.4, **how)
    on = fc.simulate(model, Servo(), start=first.checkpoint, **how)
    assert np.array_equal(on.final.x, once.final.x)
    assert np.abs(once["speed"]).max() > 1.1 * np.abs(on["speed"]).max()
    assert on.report.output_errors["speed"] < 2.0 * once.report.output_errors["speed"]
    assert not any("largest speed" in note or "the law reads speed" in note for note in on.report.notes)


def test_a_checkpoint_knows_what_nobody_has_seen(cut):
    model = pendulum()
    first = cut(model, start=thrown(model), share=0.3, **FAST).checkpoint
    assert first.origin.seen == 0.0
    seen = replace(first.origin, seen=first.t)
    assert seen.gone_on(first.t).unseen == (0.0, 0.0)
    assert seen.gone_on(20.0).unseen == (first.t, 20.0)
    assert seen.gone_on(20.0).seen_until(25.0).gone_on(28.0).unseen == (first.t, 28.0)
