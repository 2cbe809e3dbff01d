"""Sampled laws that round, or meet limits: a hair decides, and a finer run is laid beside to see whether it has.

Two links behind elastic gears, held by a law sampled every 5 ms; the motion that is right is that of
`ExplicitRungeKutta` at 1e-9.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.notes.answers import Manner, _kind, answers
from flexctrl.errors import FlexctrlError

SAMPLE = 5e-3
WEIGHTS = 9.81 * np.array([8.0 * 0.5 + 4.0 * 1.48, 4.0 * 0.48]) / np.array([60.0, 40.0])


def said(law) -> Manner:
    return _kind(lambda share: np.atleast_1d(np.asarray(law(share), dtype=float)))


@pytest.mark.parametrize("law", [lambda s: 3.0 * s, lambda s: np.sin(3.0 * s), lambda s: s**3, lambda s: 2.0])
def test_what_answers_in_proportion_or_along_a_curve_is_smooth(law):
    assert said(law) is Manner.SMOOTH


@pytest.mark.parametrize("limit", [0.1, 0.5, 0.93])
def test_a_limit_anywhere_along_the_line_is_a_corner(limit):
    for law in (lambda s: min(s, limit), lambda s: max(s - limit, 0.0), lambda s: [7.0, abs(s - limit)]):
        assert said(law) is Manner.LIMITED


@pytest.mark.parametrize("quantum", [0.011, 0.1, 0.4])
def test_what_rounds_or_switches_jumps(quantum):
    for law in (
        lambda s: quantum * round(s / quantum),
        lambda s: s + quantum * (s > 0.3),
        lambda s: float(s > quantum),
    ):
        assert said(law) is Manner.ABRUPT


def test_an_encoder_that_is_fine_beside_the_motion_is_smooth():
    assert said(lambda s: 1e-4 * round(s / 1e-4)) is Manner.SMOOTH


def test_a_steep_slope_is_no_jump():
    assert said(lambda s: np.clip(1e3 * (s - 0.4), -1.0, 1.0)) is Manner.LIMITED


def test_a_law_that_says_nothing_elsewhere_is_not_asked():
    class Narrow:
        inputs, outputs, sample_time = ("turn",), ("torque0",), SAMPLE

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            if self.over:
                raise ValueError("asked where it has never been")
            return np.zeros(1)

        def update(self, t, x, y):
            return x

        over = False

    law, model = Narrow(), arm()
    run = fc.simulate(model, law, until=0.1, every=SAMPLE)
    law.over = True
    feed = feed_of(model, law, np.zeros(2))
    with pytest.raises(FlexctrlError):
        feed.told(0.0, np.zeros(0), np.zeros(1))
    assert answers(run, type("End", (), {"point": run.checkpoint.point}), feed) is Manner.SMOOTH


def arm(*effects: fc.Effect) -> fc.Model:
    """Links of 1 m and 0.8 m that lie, motors of 2 and 1 g m² behind 60 : 1 and 40 : 1."""
    upper = fc.RigidBody("upper", (0.5, 0, 0), 8.0, (0.01, 0.7, 0.7), {"root": (0, 0, 0), "elbow": (1, 0, 0)})
    lower = fc.RigidBody("lower", (1.48, 0, 0), 4.0, (0.01, 0.2, 0.2), {"elbow": (1, 0, 0), "hand": (1.8, 0, 0)})
    root, elbow = upper.point("root"), lower.point("elbow")
    gears = [(root, None, 60.0, 2e-3, 25.0), (elbow, upper.point("elbow"), 40.0, 1e-3, 45.0)]
    drives = [
        fc.RotaryDrive(f"d{i}", to, base, axis="y", ratio=ratio, inertia=J, stiffness=J * w**2, damping=0.06 * J * w)
        for i, (to, base, ratio, J, w) in enumerate(gears)
    ]
    joints = [fc.Support(root, "u v w rx rz"), fc.Hinge(upper.point("elbow"), elbow, axis="y")]
    inputs = [fc.MotorTorque(f"torque{i}", drive) for i, drive in enumerate(drives)]
    outputs = [fc.DriveAngle(f"angle{i}", drive) for i, drive in enumerate(drives)]
    outputs += [fc.DriveSpeed(f"speed{i}", drive) for i, drive in enumerate(drives)]
    outputs += [fc.Rotation("turn", root, "y"), fc.Position("hand", lower.point("hand"), "z")]
    machine = fc.Structure([upper, lower], joints, drives, inputs, outputs)
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation(), *effects])


class Following:
    """Each motor follows R A sin ωt, the second one −0.7 times as far: u = kp (r − y) − kd ẏ − weights as drawn."""

    inputs, outputs, sample_time = ("angle0", "angle1", "speed0", "speed1"), ("torque0", "torque1"), SAMPLE

    def __init__(self, far: float, pace: float, stiff: float, damped: float):
        self.way, self.pace = np.array([60.0, -28.0]) * far, pace
        inertia = np.array([2e-3, 1e-3])
        self.gains = inertia * stiff**2, inertia * damped

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        kp, kd = self.gains
        return kp * (self.way * np.sin(self.pace * t) - y[:2]) - kd * y[2:] - WEIGHTS

    def update(self, t, x, y):
        return x


ROUNDED = fc.Quantised(Following(0.056, 2.1, 13.0, 8.8), {"angle0": 2.6, "angle1": 0.79})
LAWS = {
    "rounded": fc.Quantised(Following(0.3, 1.3, 29.0, 8.9), {"angle0": 2.6, "angle1": 0.94}),
    "rounded, and slow to follow": fc.Delayed(fc.RateLimited(ROUNDED, {"torque0": 8.0, "torque1": 8.0}), 1),
    "hunting": fc.Delayed(fc.RateLimited(Following(0.16, 3.4, 28.0, 730.0), {"torque0": 48.0, "torque1": 53.0}), 1),
    "hunting little": fc.RateLimited(Following(0.13, 2.7, 9.8, 820.0), {"torque0": 180.0, "torque1": 79.0}),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_what_a_hair_decides_is_told(law):
    """In steps of a sample 6 to 73 % off; told as 0.1 to 1.7 % by sums of what steps err by, and runs like it."""
    model = arm(fc.Gravity())
    how = {"until": 2.0, "every": SAMPLE}
    tight = {"method": fc.Unchecked(fc.ExplicitRungeKutta()), "tolerance": fc.Tolerance(1e-9, 1e-12)}
    true, run = (
        fc.simulate(model, law, **tight, **how),
        fc.simulate(model, law, method=fc.GeneralizedAlpha(SAMPLE), **how),
    )
    off = max(np.abs(run[name] - true[name]).max() / np.ptp(true[name]) for name in ("turn", "hand"))
    assert off > 0.05
    assert any("by a finer run" in note for note in run.report.notes)
    assert max(run.report.error, *run.report.output_errors.values()) > 0.5 * off


def test_one_that_stays_within_its_limits_is_run_again_for_its_rates_alone():
    law = fc.Saturated(Following(0.01, 1.3, 10.0, 20.0), {"torque0": 1e3, "torque1": 1e3})
    how = {"until": 1.0, "every": SAMPLE, "method": fc.GeneralizedAlpha(SAMPLE)}
    model = arm(fc.Gravity())
    run = fc.simulate(model, law, **how)
    assert {"speed0", "speed1"} <= set(run.report.output_errors)
    assert not run.report.notes


def test_a_loop_with_motors_that_lag_is_asked_whether_it_grows():
    """Where links are bent a lag's torque is no symmetric part of K."""
    model = arm(fc.Gravity(), fc.MotorLag({"d0": 0.01, "d1": 0.01}))
    run = fc.simulate(model, Following(0.3, 1.3, 10.0, 20.0), until=1.0, method=fc.GeneralizedAlpha(SAMPLE))
    assert not any("could not be told" in note for note in run.report.notes)
