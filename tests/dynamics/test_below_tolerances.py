"""Motions smaller than what steps may err by are told of, and a tolerance that fits them is right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexctrl as fc

STIFFNESS, MASS = 400.0, 1.0


def oscillator() -> fc.Model:
    """A mass on a spring of one metre."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS)
    mass = fc.PointMass("mass", (1, 0, 0), MASS)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    inputs, outputs = [fc.Force("push", mass.node, "x")], [fc.Position("x", mass.node, "x")]
    return fc.assemble(fc.Structure([spring, mass], joints, [], inputs, outputs), [fc.LargeRotation()])


def off(run: fc.Run, push: float) -> float:
    right = push / STIFFNESS * (1.0 - np.cos(np.sqrt(STIFFNESS / MASS) * run.t))
    return float(np.abs(run["x"] - 1.0 - right).max() / np.ptp(right))


@pytest.mark.parametrize("push", [1e-6, 1e-5, 1e-4])
def test_what_is_smaller_than_errors_of_steps(push):
    run = fc.simulate(oscillator(), until=1.0, inputs={"push": push})
    (note,) = [note for note in run.report.notes if note.startswith("nothing moves by more than")]
    assert off(run, push) > 0.05
    relative, absolute = map(float, re.search(r"Tolerance\((\S+), (\S+)\)", note).groups())  # type: ignore[union-attr]
    fit = fc.simulate(oscillator(), until=1.0, inputs={"push": push}, tolerance=fc.Tolerance(relative, absolute))
    assert off(fit, push) < 0.03
    assert not any("nothing moves" in note for note in fit.report.notes)


@pytest.mark.parametrize("until", [1.0, 10.0, 60.0])
@pytest.mark.parametrize("push", [1e-6, 1e-5, 1e-4, 4e-4])
@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()])
def test_all_of_what_is_smaller_than_errors_of_steps_may_be_wrong(method, push, until):
    """Explicit steps that see nothing to resolve are unstable, and have it grow a hundred times."""
    run = fc.simulate(oscillator(), until=until, inputs={"push": push}, method=method)
    assert run.report.error >= min(off(run, push), 1.0)
    assert run.report.output_errors["x"] >= min(off(run, push), 1.0)


@pytest.mark.parametrize("push", [1e-5, 4e-4])
def test_what_steps_follow_is_not_called_wrong_for_being_small(push):
    """A push brought up in 100 radians of the spring's swing: 55 steps see all of that."""

    def brought_up(t):
        share = min(t / 5.0, 1.0)
        return push * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

    run = fc.simulate(oscillator(), fc.OpenLoop({"push": brought_up}), until=6.0)
    right = np.array([brought_up(t) for t in run.t]) / STIFFNESS
    assert np.abs(run["x"] - 1.0 - right).max() < 0.02 * push / STIFFNESS
    assert run.report.output_errors["x"] < 0.2


@pytest.mark.parametrize("push", [4e-3, 4e-2, 0.4])
def test_a_swing_in_opposition_is_all_wrong(push):
    """It was told as half of what it is: no more than its amplitude, which is half of the way to and fro."""
    run = fc.simulate(oscillator(), until=60.0, inputs={"push": push})
    assert off(run, push) > 0.8
    assert run.report.error == pytest.approx(1.0, abs=0.01)


def test_what_rests_or_moves_is_not_named():
    for inputs in ({}, {"push": 1.0}):
        assert not fc.simulate(oscillator(), until=1.0, inputs=inputs).report.notes


@pytest.mark.parametrize("absolute", [1e-3, 1e-2, 1.0])
def test_what_is_told_of_steps_of_one_length_does_not_hang_on_the_tolerance(absolute):
    """Which they have nothing to do with; an absolute one of a centimetre a metre excuses no errors of metres."""
    upper = fc.RigidBody("upper", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0), "end": (1, 0, 0)})
    lower = fc.RigidBody("lower", (1.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (1, 0, 0), "end": (2, 0, 0)})
    joints = [fc.Support(upper.point("hinge"), "u v w rx rz"), fc.Hinge(upper.point("end"), lower.point("hinge"), "y")]
    outputs = [fc.Velocity("speed", lower.point("end"), "x"), fc.Position("x", lower.point("end"), "x")]
    model = fc.assemble(fc.Structure([upper, lower], joints, outputs=outputs), [fc.LargeRotation(), fc.Gravity()])
    how = {"until": 6.0, "every": 0.1, "method": fc.GeneralizedAlpha(0.005)}
    usual, loose = (fc.simulate(model, tolerance=t, **how).report for t in (None, fc.Tolerance(1e-4, absolute)))
    assert usual.error > 0.05
    assert loose.error == pytest.approx(usual.error, rel=1e-3)
    assert loose.output_errors == pytest.approx(usual.output_errors, rel=1e-3)
    assert loose.notes == usual.notes
