"""Peaks of forces in steps of one length: a mass that falls into a rope, or hangs from one and is let go.

Closed forms: on a rope of stiffness k with ω² = k/m, T = k (g/ω² + √((g/ω²)² + v²/ω²)) after a fall to speed v (it is
caught at its free length), and T = 2 m g where it is let go without tension.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

G, LENGTH = 9.81, 1.0
METHODS = {"alpha": fc.GeneralizedAlpha, "midpoint": fc.ConservingMidpoint}


def hung(stiffness: float, slack: float) -> tuple[fc.Model, fc.State]:
    """A kilogram below a rope, let go a little higher than where it is caught."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -LENGTH), EA=stiffness * LENGTH, length=LENGTH)
    mass = fc.PointMass("mass", rope.end, 1.0)
    outputs = [fc.Position("z", mass.node, "z"), fc.Velocity("speed", mass.node, "z"), fc.Tension("tension", rope)]
    plan = fc.Structure([rope, mass], [fc.Support(rope.start), fc.Pin(rope.end, mass.node)], outputs=outputs)
    model = fc.assemble(plan, [fc.LargeRotation(), fc.RopeStretch(), fc.Gravity((0, 0, -G))])
    return model, fc.project(model, {mass.node: (0, 0, slack - LENGTH)}).state


def caught(stiffness: float, slack: float) -> float:
    sag, speed = G / stiffness, np.sqrt(2.0 * G * slack)
    return stiffness * (sag + np.hypot(sag, speed / np.sqrt(stiffness)))


def named(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if "tension" in note]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("stiffness", "step"), [(1e6, 3e-3), (1e7, 2e-3), (1e6, 1e-2), (1e8, 2e-3)])
def test_what_steps_miss_of_a_catch_is_told(stiffness, step, method):
    """8 to 80 % of it, with the place right to some percent: that was all that was told."""
    model, start = hung(stiffness, 0.5)
    run = fc.simulate(model, until=1.0, start=start, method=METHODS[method](step))
    off = 1.0 - run["tension"].max() / caught(stiffness, 0.5)
    assert off > 0.07
    assert len(named(run)) == 1
    assert 0.6 * off < run.report.output_errors["tension"] <= 1.0


@pytest.mark.parametrize("method", METHODS)
def test_what_they_see_is_right_and_not_told(method):
    model, start = hung(1e6, 0.5)
    run = fc.simulate(model, until=1.0, start=start, method=METHODS[method](1e-4))
    assert run["tension"].max() == pytest.approx(caught(1e6, 0.5), rel=1e-3)
    assert not named(run)
    assert run.report.output_errors["tension"] < 5e-3


def test_chosen_steps_see_it():
    model, start = hung(1e7, 0.5)
    run = fc.simulate(model, until=1.0, start=start)
    assert run["tension"].max() == pytest.approx(caught(1e7, 0.5), rel=1e-3)
    assert not named(run)


@pytest.mark.parametrize(("step", "told"), [(6e-3, True), (1e-4, False)])
def test_a_load_let_go_in_steps_that_do_not_see_it_bounce(step, told):
    """No corner is met: it stays taut, between nothing and twice its weight."""
    model, start = hung(1e6, 0.0)
    run = fc.simulate(model, until=0.1, start=start, method=fc.GeneralizedAlpha(step))
    off = abs(run["tension"].max() / (2.0 * G) - 1.0)
    assert (off > 0.05) == told
    assert bool(named(run)) == told


def test_rows_that_are_apart_are_not_compared_but_the_line_is_named():
    model, start = hung(1e7, 0.5)
    run = fc.simulate(model, until=1.0, start=start, method=fc.GeneralizedAlpha(2e-3), every=0.05)
    (note,) = named(run)
    assert note.startswith("rope is caught in steps that see little of how it vibrates (6.3 rad in each)")
