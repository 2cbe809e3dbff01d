"""A fast ripple on a slow motion, extrapolated of two runs that lag behind it: told by how far these are apart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import flexctrl as fc

HEAVY, LIGHT, SOFT, FAST = 10.0, 0.01, 10.0, 500.0
STIFF = LIGHT * FAST**2
UNTIL = 1.0


def machine() -> tuple[fc.Model, fc.State]:
    """Ten kilograms on a soft spring, ten grams on a stiff one on them, which set out 0.3 m/s faster."""
    ground = fc.Spring("ground", (0, 0, 0), (50, 0, 0), stiffness=SOFT)
    cart = fc.PointMass("cart", (50, 0, 0), HEAVY)
    spring = fc.Spring("spring", (50, 0, 0), (51, 0, 0), stiffness=STIFF)
    bob = fc.PointMass("bob", (51, 0, 0), LIGHT)
    joints = [fc.Support(ground.start), fc.Pin(ground.end, cart.node), fc.Support(cart.node, "v w")]
    joints += [fc.Pin(spring.start, cart.node), fc.Pin(spring.end, bob.node), fc.Support(bob.node, "v w")]
    outputs = [fc.Position("cart_x", cart.node, "x"), fc.Position("apart", bob.node, "x", minus=cart.node)]
    plan = fc.Structure([ground, cart, spring, bob], joints, outputs=outputs)
    model = fc.assemble(plan, [fc.Flexible(), fc.LargeRotation()])
    start = fc.project(model, {}, velocities={cart.node: (1, 0, 0), bob.node: (1.3, 0, 0)}).state
    return model, start


def exactly_apart(times: np.ndarray) -> np.ndarray:
    pull = np.array([[-(SOFT + STIFF) / HEAVY, STIFF / HEAVY], [STIFF / LIGHT, -STIFF / LIGHT]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [pull, np.zeros((2, 2))]])
    x = np.array([expm(A * t) @ [0.0, 0.0, 1.0, 1.3] for t in times])
    return 1.0 + x[:, 1] - x[:, 0]


@pytest.mark.parametrize("steps", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)])
def test_ripples_that_both_runs_lag_behind_are_told(steps):
    """More than their whole range off; told as 0.01 to 0.04 %, as little against what the machine moves by."""
    model, start = machine()
    run = fc.simulate(model, until=UNTIL, start=start, every=UNTIL / 2000, method=fc.Richardson(steps))
    right = exactly_apart(run.t)
    assert np.abs(run["apart"] - right).max() > 0.5 * np.ptp(right)
    assert run.report.output_errors["apart"] > 0.3
    assert any("apart" in note for note in run.report.notes)
    assert run.report.error < 0.01


def test_what_both_follow_is_told_as_little():
    model, start = machine()
    method = fc.Richardson(fc.GeneralizedAlpha(5e-5))
    run = fc.simulate(model, until=0.2, start=start, every=1e-3, method=method)
    off = np.abs(run["apart"] - exactly_apart(run.t)).max() / 1.2e-3
    assert off < 2e-3
    assert run.report.output_errors["apart"] < 0.01
    assert not run.report.notes
