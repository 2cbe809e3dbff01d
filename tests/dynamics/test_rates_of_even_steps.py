"""Rates of runs in steps of one length, and of many stages, of what vibrates faster than steps see."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc


@cache
def cantilever(stiffness: float, elements: int, tip: float) -> fc.Model:
    section = fc.Section(
        EA=1e3 * stiffness,
        EI_y=stiffness,
        EI_z=0.6 * stiffness,
        GJ=0.7 * stiffness,
        rhoA=1.0,
        rhoJ=1e-3,
    )
    beam = fc.Beam("beam", (0, 0, 0), (1.2, 0.9, -0.4), section, elements=elements)
    load = fc.PointMass("load", beam.end, tip)
    outputs = [fc.Velocity(f"v{axis}", beam.end, axis) for axis in "xyz"]
    machine = fc.Structure(
        [beam, load],
        [fc.Support(beam.start), fc.Pin(beam.end, load.node)],
        [],
        [fc.Force("push", beam.end, (0.3, -0.5, 0.8))],
        [fc.Position("z", beam.end, "z"), *outputs],
    )
    return fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])


CASES = [
    (200.0, 4, 3.0, 0.005),
    (200.0, 2, 3.0, 0.01),
    (200.0, 1, 3.0, 0.01),
    (1500.0, 4, 3.0, 0.002),
    (30.0, 4, 0.5, 0.005),
]


@pytest.mark.parametrize(("stiffness", "elements", "tip", "step"), CASES)
def test_velocities_under_a_load_put_on_at_once(stiffness, elements, tip, step):
    """They were 1.4 to 4.1 % off and told as a fifth to a half, as if errors went by the square of the step."""
    model, how = (
        cantilever(stiffness, elements, tip),
        {"until": 1.5, "inputs": {"push": 0.1 * stiffness}, "every": 0.01},
    )
    true = fc.simulate(model, method=fc.Unchecked(fc.AdaptiveAlpha()), tolerance=fc.Tolerance(1e-7, 1e-10), **how)
    run = fc.simulate(model, method=fc.GeneralizedAlpha(step), **how)
    for name in ("vx", "vy", "vz"):
        off = np.abs(run[name] - true[name]).max() / np.ptp(true[name])
        assert run.report.output_errors[name] > 0.5 * off or off < 0.01


def test_steps_of_many_stages_see_more_than_a_radian():
    """A body on a spring: its speed was told as 50 % off, of which nothing was."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), 50.0)
    load = fc.PointMass("load", spring.end, 2.0)
    machine = fc.Structure(
        [spring, load],
        [fc.Support(spring.start), fc.Pin(spring.end, load.node), fc.Support(load.node, "v w")],
        [],
        [fc.Force("push", load.node, "x")],
        [fc.Position("x", load.node, "x"), fc.Velocity("vx", load.node, "x")],
    )
    model = fc.assemble(machine, [fc.LargeRotation()])
    run = fc.simulate(model, until=4.0, every=0.05, inputs={"push": 20.0}, method=fc.ExplicitRungeKutta())
    true = 20.0 / np.sqrt(50.0 * 2.0) * np.sin(5.0 * run.t)
    off = np.abs(run["vx"] - true).max() / np.ptp(true)
    assert 5.0 * 4.0 / run.report.steps > 1.0
    assert not run.report.notes
    assert off < 1e-2
    assert run.report.output_errors["vx"] < 0.05
