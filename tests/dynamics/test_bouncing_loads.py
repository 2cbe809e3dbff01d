"""Loads that bounce on ropes without damping come back late; shorter steps follow their impacts more closely."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

GRAVITY, DEEP, MASS = 9.81, 5.0, 300.0
UNTIL = 6.0


def bounce(frequency: float) -> tuple[fc.Model, fc.State]:
    """A load that hangs at rest on a rope, and is thrown up."""
    stiffness = MASS * frequency**2
    hung = -DEEP - GRAVITY / frequency**2
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, hung), EA=stiffness * DEEP, length=DEEP)
    load = fc.PointMass("load", (0, 0, hung), MASS)
    joints = [fc.Support(rope.start, "u v w"), fc.Support(load.node, "u v"), fc.Pin(rope.end, load.node)]
    outputs = [fc.Position("z", load.node, "z"), fc.Velocity("w", load.node, "z"), fc.Tension("T", rope)]
    effects = [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()]
    model = fc.assemble(fc.Structure([rope, load], joints, outputs=outputs), effects)
    return model, model.drawn


def exact(times: np.ndarray, frequency: float, thrown: float) -> np.ndarray:
    """Its height above the end of the slack rope, speed and pull: arcs of a vibration about rest, and parabolas."""
    rest = -GRAVITY / frequency**2
    swing = thrown / frequency
    caught = np.arcsin(-rest / swing)  # phase at which it leaves the rope, from rest upwards
    speed = swing * frequency * np.cos(caught)
    taut, free = (np.pi + 2.0 * caught) / frequency, 2.0 * speed / GRAVITY
    since = np.mod(times - caught / frequency, taut + free)  # since it left the rope
    flown = np.minimum(since, free)
    height, rate = speed * flown - 0.5 * GRAVITY * flown**2, speed - GRAVITY * flown
    phase = np.pi - caught + frequency * (since - free)
    held = since > free
    height[held], rate[held] = rest + swing * np.sin(phase[held]), swing * frequency * np.cos(phase[held])
    return np.array([height, rate, MASS * frequency**2 * np.maximum(-height, 0.0)])


CASES = [(12.0, 2.0), (20.0, 1.2), (30.0, 0.9), (45.0, 1.5), (60.0, 0.4), (100.0, 0.7)]


def thrown_up(frequency: float, speed: float, tolerance: fc.Tolerance, method: fc.Unchecked | None = None) -> fc.Run:
    model, start = bounce(frequency)
    v = np.full(model.n, speed)
    return fc.simulate(model, start=start.with_(v=v), until=UNTIL, every=0.015, tolerance=tolerance, method=method)


def off(run: fc.Run, frequency: float, speed: float) -> dict[str, float]:
    height, rate, pull = exact(run.t, frequency, speed)
    true = {"z": height, "w": rate, "T": pull}
    return {name: float(np.abs(run[name] - run[name][0] - (y - y[0])).max() / np.ptp(y)) for name, y in true.items()}


@pytest.mark.parametrize(("frequency", "speed"), CASES)
def test_what_is_told_of_a_load_that_bounces(frequency, speed):
    """A run laid beside it in half the steps took as long ones in each impact: 45 % of a tension was told as 8 %."""
    run = thrown_up(frequency, speed, fc.Tolerance())
    assert run.status is fc.Status.FINISHED
    for name, share in off(run, frequency, speed).items():
        assert share < max(0.01, 2.0 * run.report.output_errors[name]), name


@pytest.mark.parametrize(("frequency", "speed"), CASES)
def test_impacts_are_followed_as_closely_as_the_tolerance_says(frequency, speed):
    """Of second order: a hundredth of the tolerance leaves a tenth of the error, or it is little."""
    usual, tight = (
        thrown_up(frequency, speed, tolerance, fc.Unchecked(fc.AdaptiveAlpha()))
        for tolerance in (fc.Tolerance(1e-4, 1e-7), fc.Tolerance(1e-6, 1e-9))
    )
    before, after = (max(off(run, frequency, speed).values()) for run in (usual, tight))
    assert after < max(0.2 * before, 1e-3)
