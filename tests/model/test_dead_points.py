"""Positions from which a loop of rigid parts cannot be moved by its coordinate, and those it passes all the same."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.run import Status

ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.0)


def linkage(*points: tuple[float, float]) -> fc.Structure:
    """Rods from point to point, pinned, with fixed ends."""
    rods = [fc.Beam(f"rod{i}", (*a, 0), (*b, 0), ROD) for i, (a, b) in enumerate(pairwise(points))]
    joints = [fc.Pin(a.end, b.start) for a, b in pairwise(rods)]
    joints += [fc.Support(rods[0].start, "u v w"), fc.Support(rods[-1].end, "u v w")]
    return fc.planar(fc.Structure(rods, joints, outputs=[fc.Rotation("turn", rods[0].start, "z")]))


@pytest.mark.parametrize("step", [0.04, 1e-3, 2e-4])
def test_a_parallelogram_passes_the_line_with_any_step(step):
    """Equal bars, no weight: it turns at a constant rate through the line at 90°.

    A step that would end on the line goes 2e-6 further; near it a gap that is off by one digit, the last, makes
    accelerations of 1e-6.
    """
    model = fc.assemble(linkage((0, 0), (0, 1), (1, 1), (1, 0)), [fc.LargeRotation()])
    start = model.displace([-0.5 * np.pi + 0.05]).with_(v=np.array([-1.0]))
    run = fc.simulate(model, until=0.1, start=start, method=fc.GeneralizedAlpha(step))
    assert run.status is Status.FINISHED
    assert run["turn"][-1] == pytest.approx(-0.5 * np.pi - 0.05, abs=6e-6)
    assert run.report.closure_error < 1e-12


def test_a_rocker_stops_where_its_coupler_and_crank_are_in_line():
    """The rocker's angle cannot move the crank there: the run ends with what it has, and says so."""
    model = fc.assemble(linkage((0, 0), (0.3, 0), (1.2, 0.9), (1.2, 0)), [fc.LargeRotation()])
    run = fc.simulate(model, until=60.0, start=model.rest.with_(v=np.ones(1)), method=fc.GeneralizedAlpha(0.01))
    if run.status is Status.FAILED:
        assert "dead point" in run.report.message
    assert np.isfinite(run.y).all()
    assert run.report.closure_error < 1e-9


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.GeneralizedAlpha(1e-2)])
def test_a_loop_is_not_sent_back_from_a_dead_point(method):
    """A mass on two rigid ropes swings about the line of its supports as a pendulum: what cannot go on is told."""
    left, right = fc.Rope("left", (-1, 0, 0), (0, 0, -1), EA=1e5), fc.Rope("right", (1, 0, 0), (0, 0, -1), EA=1e5)
    mass = fc.PointMass("mass", (0, 0, -1), 1.0)
    s = fc.Structure(
        [left, right, mass],
        [fc.Support(left.start), fc.Support(right.start), fc.Pin(left.end, mass.node), fc.Pin(right.end, mass.node)],
        outputs=[fc.Position("y", mass.node, "y"), fc.Position("z", mass.node, "z")],
    )
    model = fc.assemble(s, [fc.Gravity(), fc.LargeRotation()])
    start = fc.project(model, model.rest, {mass.node: (0.0, 7.0, 0.0)}).state
    run = fc.simulate(model, until=1.0, start=start, every=0.02, method=method)
    if run.status is fc.Status.FINISHED:
        assert run.at(0.48)["y"] == pytest.approx(0.514, abs=0.02)  # DOP853 of the pendulum's equation
    else:
        assert "dead point" in run.report.message
        assert run.t[-1] < 0.4
