"""Corners of laws of force: runs that begin on one go on; extrapolated runs meet them together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

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


@pytest.mark.parametrize(
    "inner",
    [fc.GeneralizedAlpha(5e-3), fc.GeneralizedAlpha(5e-3, rho=1.0), fc.ConservingMidpoint(5e-3), fc.AdaptiveAlpha()],
    ids=["damped", "undamped", "conserving", "chosen"],
)
def test_extrapolation_is_no_worse_where_steps_do_not_see_a_rope_go_slack(inner):
    """Let go at its natural length, a load bounces on a rope of 316 rad/s as it swings: at 5 ms nothing sees that."""
    at = (10.0 * np.sin(1.2), 0.0, -10.0 * np.cos(1.2))
    rope, load = fc.Rope("rope", (0, 0, 0), at, EA=1e6), fc.PointMass("load", at, 1.0)
    held = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    structure = fc.Structure([rope, load], held, outputs=[fc.Position(axis, load.node, axis) for axis in "xz"])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])

    def slope(_, y):
        far = np.hypot(y[0], y[1])
        pull = max(1e5 * (far - 10.0), 0.0) / far
        return [y[2], y[3], -pull * y[0], -pull * y[1] - 9.81]

    exact = solve_ivp(slope, (0.0, 1.5), [at[0], at[2], 0, 0], method="DOP853", rtol=1e-10, atol=1e-11, max_step=2e-3)
    once, twice = (fc.simulate(model, until=1.5, method=how) for how in (inner, fc.Richardson(inner)))
    assert twice.status is fc.Status.FINISHED
    assert not twice.events
    off, further = (np.hypot(*(run.y[-1] - exact.y[:2, -1])) for run in (twice, once))
    assert off <= 1.2 * further
    assert off <= 2e-4
