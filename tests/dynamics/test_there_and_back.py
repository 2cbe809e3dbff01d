"""A rope goes slack just before friction stops its cart: a step as long as those before would be back on the rope."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

RK = fc.ExplicitRungeKutta()


def cart(mass: float, friction: float, stiffness: float, length: float, gap: float | None = None) -> fc.Model:
    """A cart with dry friction on a rope, or on a spring with play."""
    body = fc.PointMass("cart", (0, 0, 0), mass)
    ends = (-length, 0, 0), (0, 0, 0)
    line = fc.Rope("line", *ends, EA=stiffness * length, length=length)
    play: list[fc.Effect] = []
    if gap is not None:
        line, play = fc.Spring("line", *ends, stiffness=stiffness), [fc.Backlash({"line": gap})]
    joints = [fc.Support(body.node, "v w"), fc.Support(line.start, "u v w"), fc.Pin(line.end, body.node)]
    outputs = [fc.Position("x", body.node, "x"), fc.Velocity("v", body.node, "x")]
    dry = fc.CoulombFriction({"cart.u": friction})
    return fc.assemble(
        fc.Structure([body, line], joints, outputs=outputs), [fc.LargeRotation(), fc.Flexible(), dry, *play]
    )


@pytest.mark.parametrize("gap", [None, 0.2])
@pytest.mark.parametrize("method", [RK, fc.AdaptiveAlpha(), fc.Richardson(fc.AdaptiveAlpha())])
@pytest.mark.parametrize(
    ("machine", "beyond", "tolerance"),
    [
        ((0.37, 1.8, 2600.0, 1.4), 1e-4, 1e-3),
        ((0.184, 9.15, 5.9e5, 0.42), 1.6e-6, 1e-3),
        ((2.28, 4.09, 6.6e5, 1.24), 1.5e-4, 1e-4),
        ((2.0, 5.0, 400.0, 3.0), 1e-5, 1e-4),
    ],
)
def test_a_cart_that_is_let_go_stops_where_friction_has_taken_all(machine, beyond, tolerance, method, gap):
    """F x = k x₀²/2: explicit steps met the rope again and again at one instant, and then went over friction's stop."""
    mass, friction, stiffness, _ = machine
    start = 2.0 * friction / stiffness * (1.0 + beyond)
    way = 0.5 * stiffness * start**2 / friction
    model = cart(*machine, gap)
    run = fc.simulate(
        model,
        until=6.0 * np.sqrt(mass / stiffness),
        start=model.displace([0.5 * (gap or 0.0) + start]),
        method=method,
        tolerance=fc.Tolerance(tolerance, 1e-3 * tolerance),
    )
    assert run["x"][0] - run["x"][-1] == pytest.approx(way, rel=2e-3)
    assert run["v"].max() < 1e-9
    assert len(run.events) <= 2
