"""Ctrl-C while steps are tried again and again to end at a corner of a law of force."""

from __future__ import annotations

import os
import signal

import numpy as np

import flexctrl as fc


def arm() -> fc.Model:
    """An arm on a geared motor with play and dry friction."""
    section = fc.Section.tube(fc.STEEL, radius=0.01, thickness=0.001)
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), section, elements=2)
    tip = fc.PointMass("tip", beam.end, 0.5)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=1.0, ratio=20, inertia=2e-3, damping=1e-3)
    joints = [fc.Support(beam.start, "u v w rx ry"), fc.Pin(beam.end, tip.node)]
    outputs = [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor), fc.Position("y", tip.node, "y")]
    plan = fc.Structure([beam, tip], joints, [motor], [fc.MotorTorque("torque", motor)], outputs)
    effects = [fc.Gravity((0, -9.81, 0)), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-4)]
    effects += [fc.Backlash({"motor": 0.3}), fc.CoulombFriction({"motor": fc.Coulomb(0.05, 0.08, 0.2)})]
    return fc.assemble(plan, effects)


class Law:
    """Turns the motor by 20 rad in a second; presses Ctrl-C once, and counts how often it is asked from then on."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 0.0

    def __init__(self, press_at):
        self.press_at, self.asked = press_at, 0

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        if t > self.press_at:
            self.press_at = np.inf
            os.kill(os.getpid(), signal.SIGINT)
        self.asked += self.press_at == np.inf
        s = min(t, 1.0)
        way, rate = 20.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 600.0 * s**2 * (1.0 - s) ** 2
        return np.array([0.5 * (way - y[0]) + 0.06 * (rate - y[1])])


METHOD = fc.Unchecked(fc.Richardson(fc.GeneralizedAlpha(4e-3)))


def test_it_ends_at_once_and_keeps_what_there_is():
    """A corner that no step ends at is looked for by thousands of tries: it went on for minutes."""
    law = Law(0.0365)
    run = fc.simulate(arm(), law, until=0.15, method=METHOD)
    assert run.status is fc.Status.INTERRUPTED
    assert law.asked < 3000
    assert 0.03 < run.final.t < 0.0365
    assert run.t[-1] <= run.final.t
    assert np.isfinite(run.y).all()


def test_it_goes_on_from_there_bit_for_bit():
    model = arm()
    whole = fc.simulate(model, Law(np.inf), until=0.034, method=METHOD)
    run = fc.simulate(model, Law(0.0325), until=0.034, method=METHOD)
    assert run.status is fc.Status.INTERRUPTED
    rest = fc.simulate(model, Law(np.inf), until=0.034, method=METHOD, start=run.checkpoint)
    np.testing.assert_array_equal(rest.y[-1], whole.y[-1])
    np.testing.assert_array_equal(rest.final.v, whole.final.v)
