"""Sway jumps from π to −π: rows as near to that as steps err by may be a whole turn off, and a note says so."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

LENGTH = 1.3


def pendulum(rate: float) -> tuple[fc.Model, fc.State]:
    post = fc.PointMass("post", (0, 0, 0), 1.0)
    bob = fc.RigidBody("bob", (0, 0, -LENGTH), 2.0, (0.05, 0.05, 0.05), {"top": (0, 0, 0)})
    plan = fc.Structure(
        [post, bob],
        [fc.Support(post.node), fc.Support(bob.point("top"), "u v w rx rz")],
        outputs=[fc.SwayAngle("sway", post.node, bob.node, "x"), fc.Rotation("turn", bob.node, "y")],
    )
    model = fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])
    return model, model.rest.with_(v=np.array([rate]))


def over_the_top(run: fc.dynamics.run.Run) -> list[str]:
    return [note for note in run.report.notes if "over the top" in note]


def test_a_row_that_may_be_on_the_other_side_is_told_of():
    """Rows are spaced so that one stands within 1e-4 rad of the top in truth, where steps err by 1e-3."""
    model, start = pendulum(3.0 * np.sqrt(9.81 / LENGTH))
    sharp = fc.simulate(model, until=3.0, start=start, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0, 1e-12))
    top = fc.simulate(
        model,
        until=3.0,
        start=start,
        method=fc.ExplicitRungeKutta(),
        tolerance=fc.Tolerance(0, 1e-12),
        events=[fc.Event("top", "turn", at=3.0 * np.pi * np.sign(sharp["turn"][-1]), terminal=True)],
    ).final.t
    run = fc.simulate(model, until=3.0, start=start, every=(top + 1e-5) / 100)
    true = np.interp(run.t, sharp.t, sharp["turn"])
    assert np.abs(np.abs(run["sway"]) - np.abs((true + np.pi) % (2 * np.pi) - np.pi)).max() < 0.02
    (note,) = over_the_top(run)
    assert f"sway goes over the top at t = {top:.3g}" in note


@pytest.mark.parametrize("rate", [1.2, 1.9])
def test_sway_that_stays_below_has_none(rate):
    model, start = pendulum(rate * np.sqrt(9.81 / LENGTH))
    run = fc.simulate(model, until=3.0, start=start, every=0.01)
    assert np.abs(run["sway"]).max() < np.pi - 0.3
    assert not over_the_top(run)


def test_rows_that_stand_far_from_the_top_have_none():
    model, start = pendulum(3.0 * np.sqrt(9.81 / LENGTH))
    run = fc.simulate(model, until=3.0, start=start, every=0.21, tolerance=fc.Tolerance(1e-8, 1e-11))
    assert np.abs(np.diff(run["sway"])).max() > np.pi
    assert not over_the_top(run)
