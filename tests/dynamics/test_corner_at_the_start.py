"""Corners of laws of force: runs that begin on one go on; extrapolated runs meet them together."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


@pytest.mark.parametrize(
    "inner", [fc.GeneralizedAlpha(1e-3, rho=1.0), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)]
)
def test_a_rope_that_starts_at_its_natural_length(inner):
    rope, bob = fc.Rope("rope", (0, 3, 0), (0, 3, -1), EA=1e4, length=1.0), fc.PointMass("bob", (0, 3, -1), 1.0)
    held = [fc.Support(rope.start), fc.Pin(rope.end, bob.node)]
    structure = fc.Structure([rope, bob], held, outputs=[fc.Position("z", bob.node, "z")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    run = fc.simulate(model, until=0.2, method=fc.Richardson(inner))
    assert run.status is fc.Status.FINISHED
    sag = 9.81 / 1e4 * (1.0 - np.cos(100.0 * run.t))
    assert np.abs(run["z"] + 1.0 + sag).max() <= 1e-6


def test_extrapolation_gains_where_damped_corners_are_met():
    """A mass against a spring with play and a damper: extrapolated, steps have a fraction of their error."""
    spring, mass = fc.Spring("s", (0, 0, 0), (1, 0, 0), stiffness=400.0, damping=8.0), fc.PointMass("m", (1, 0, 0), 1.0)
    held = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([spring, mass], held, outputs=[fc.Velocity("v", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Flexible(), fc.Backlash({"s": 0.1})])
    start = model.rest.with_(v=np.array([1.0]))
    inner = fc.GeneralizedAlpha(2e-3, rho=1.0)
    once, twice = (fc.simulate(model, until=0.1, start=start, method=how) for how in (inner, fc.Richardson(inner)))
    t, w = 0.1 - 0.05, (400.0 - 16.0) ** 0.5
    exact = np.exp(-4.0 * t) * (np.cos(w * t) - 4.0 / w * np.sin(w * t))
    assert abs(twice["v"][-1] - exact) <= 1e-5
    assert abs(twice["v"][-1] - exact) <= 0.2 * abs(once["v"][-1] - exact)
