"""D4: a rope that goes slack and taut: it never pushes, and the corner of its law costs no accuracy.

1000 kg fall 0.5 m until their rope of 1e6 N/m is taut, bounce, and are caught again, ten times.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
MASS, STIFFNESS, LENGTH, G = 1000.0, 1e6, 5.0, 9.81
PEAK, PERIOD = 109340.076, 0.744140559
METHODS = {
    "explicit Runge–Kutta": (fc.ExplicitRungeKutta(), fc.Tolerance(1e-9, 1e-9)),
    "adaptive alpha": (fc.AdaptiveAlpha(), fc.Tolerance(1e-6, 1e-9)),
}


def caught(fall: float) -> fc.Model:
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, fall - LENGTH), EA=STIFFNESS * LENGTH, length=LENGTH)
    mass = fc.PointMass("mass", rope.end, MASS)
    structure = fc.Structure(
        [rope, mass],
        [fc.Support(rope.start), fc.Pin(rope.end, mass.node), fc.Support(mass.node, "u v")],
        outputs=[fc.Velocity("speed", mass.node, "z"), fc.Tension("pull", rope)],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.RopeStretch(), fc.LargeRotation()])


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_rope_catch(record, name):
    method, tolerance = METHODS[name]
    lowest = fc.Event("lowest", "speed", direction=fc.Direction.RISING)
    run = fc.simulate(caught(0.5), until=7.9, method=method, tolerance=tolerance, events=[lowest])
    lows = [event for event in run.events if event.name == "lowest"]
    record(
        f"D4 caught by a rope, {name}: peaks of the pull [N]",
        ours=[low.signals["pull"] for low in lows],
        reference=[PEAK] * len(lows),
        source="m g (1 + √(1 + 2 h k/(m g)))",
        tolerance=1e-4,
    )
    record(
        f"D4 caught by a rope, {name}: period over ten bounces [s]",
        ours=(lows[10].t - lows[0].t) / 10,
        reference=PERIOD,
        source="fall and spring, closed form",
        tolerance=1e-4,
    )
    record(
        f"D4 caught by a rope, {name}: push of the rope [N]",
        ours=max(0.0, -run["pull"].min()),
        reference=0,
        source="a rope does not push",
        tolerance=Absolute(1e-6 * PEAK),
    )
    assert run.report.rejected_steps / (2 * len(lows)) < 50


@pytest.mark.parametrize("name", METHODS)
def test_energy(record, name):
    """What a method of second order dissipates falls with its steps: the default is asked for more."""
    tolerance = fc.Tolerance(1e-9, 1e-12)
    run = fc.simulate(caught(0.5), until=7.9, method=METHODS[name][0], tolerance=tolerance)
    record(
        f"D4 caught by a rope, {name}: energy lost or made",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-6),
    )


def test_a_load_let_go_on_a_taut_rope_pulls_twice_its_weight(record):
    run = fc.simulate(caught(0.0), until=0.3, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(1e-9, 1e-9))
    half = run.at(np.pi / np.sqrt(STIFFNESS / MASS))
    record(
        "D4 let go on a taut rope: pull over weight",
        ours=half["pull"] / (MASS * G),
        reference=2.0,
        source="suddenly applied load",
        tolerance=1e-6,
    )
