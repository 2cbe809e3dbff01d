"""The first step of a run that chooses its steps comes of how the machine sets out."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from test_any_units import arm, frame, linkage
from units import SI, Units

METHODS = [fc.AdaptiveAlpha(), fc.ExplicitRungeKutta()]


def free() -> fc.Model:
    block = fc.PointMass("block", (0, 0, 0), 2.0)
    pull = fc.Force("pull", block.node, "x")
    machine = fc.Structure(
        [block], [fc.Support(block.node, "v w")], inputs=[pull], outputs=[fc.Position("x", block.node, "x")]
    )
    return fc.assemble(machine, [])


@pytest.mark.parametrize("method", METHODS, ids=["implicit", "explicit"])
@pytest.mark.parametrize("omega", [0.1, 30.0, 1e4])
def test_what_nothing_sets_going_but_the_clock_is_not_missed(omega, method):
    """A free mass at rest under a pull that begins at nothing: 2 ẍ = sin ω t."""
    until = 20.0 / omega
    law = fc.OpenLoop({"pull": lambda t: np.sin(omega * t)})
    run = fc.simulate(free(), law, until=until, method=method, tolerance=fc.Tolerance(1e-6, 1e-9 / omega**2))
    expected = (omega * run.t - np.sin(omega * run.t)) / (2.0 * omega**2)
    assert run["x"] == pytest.approx(expected, abs=1e-3 * expected.max())


@pytest.mark.parametrize("method", METHODS, ids=["implicit", "explicit"])
def test_a_spinning_rotor_at_rest_otherwise_does_not_turn_far(method):
    body = fc.RigidBody("rotor", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    model = fc.assemble(fc.Structure([body], [fc.Support(body.node, "u v w rx ry")]), [fc.LargeRotation()])
    run = fc.simulate(model, until=1.0, start=model.rest.with_(v=np.array([50.0])), method=method)
    assert run.t[1] == pytest.approx(0.1 / 50.0)


@pytest.mark.parametrize("powers", [(-30, 20, -20), (20, -30, 30)], ids=str)
@pytest.mark.parametrize("machine", [arm, frame, linkage], ids=lambda f: f.__name__)
def test_it_is_the_same_bits_in_any_units(machine, powers):
    first = []
    for u in (SI, Units(*(2.0**p for p in powers))):
        model, _, inputs = machine(u)
        first.append(fc.simulate(model, until=0.01 * u.time, inputs=inputs).t[1] / u.time)
    assert first[0] == first[1]


@pytest.mark.parametrize("tolerance", [fc.Tolerance(), fc.Tolerance(1e-6, 1e-9)], ids=["default", "tight"])
def test_it_is_neither_much_too_long_nor_much_too_short(tolerance):
    """Of the paper's crane: among those that follow."""
    model = fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    run = fc.simulate(model, until=5e-3, inputs={"push": 500.0}, tolerance=tolerance)
    steps = np.diff(run.t)
    assert 0.1 < steps[0] / np.median(steps[:20]) < 5.0
