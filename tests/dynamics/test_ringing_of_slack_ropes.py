"""A rope that loads let go slack at once does not ring: nothing is told of it, and no steps of 0 s are asked for."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexctrl as fc

OMEGA, MASS, LENGTH = 10.0, 40.0, 3.0
METHODS = [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(2e-3), fc.Richardson(fc.AdaptiveAlpha())]


def between(method: fc.Integrator, stiffer: float, above: float = 0.0) -> fc.Run:
    """A load that is let go between two ropes that hang it from above and hold it from below, unstretched or nearly."""
    load = fc.PointMass("load", (0, 0, 0), MASS)
    EA = MASS * OMEGA**2 * LENGTH
    ropes = [
        fc.Rope("upper", (0, 0, LENGTH), load.node.position, EA=EA),
        fc.Rope("lower", (0, 0, -LENGTH), load.node.position, EA=stiffer * EA),
    ]
    joints = [fc.Support(load.node, "u v"), *(fc.Support(rope.start) for rope in ropes)]
    joints += [fc.Pin(rope.end, load.node) for rope in ropes]
    outputs = [fc.Tension(rope.name, rope) for rope in ropes]
    plan = fc.Structure([load, *ropes], joints, outputs=outputs)
    model = fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    start = model.advance(model.rest, np.full(model.n, above), np.zeros(model.n), 0.0) if above else model.rest
    return fc.simulate(model, until=1.0, every=0.01, start=start, method=method)


def asked(run: fc.Run) -> list[float]:
    return [float(found) for note in run.report.notes for found in re.findall(r"take steps of ([\d.e+-]+) s", note)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("stiffer", [1.0, 1e4])
def test_nothing_is_told_of_a_rope_that_is_slack_throughout(method, stiffer):
    """Whether or not steps would see it ring, were it taut."""
    run = between(method, stiffer)
    assert not run["lower"].any()
    assert not run.report.output_errors.get("lower", 0.0)
    assert not [note for note in run.report.notes if "lower" in note]
    assert np.allclose(run["upper"], MASS * 9.81 * (1.0 - np.cos(OMEGA * run.t)), atol=0.1 * MASS * 9.81)


@pytest.mark.parametrize("above", [1e-9, 1e-5, -1e-9, -1e-5])
def test_no_steps_of_no_length_are_asked_for_by_a_rope_that_is_taut_for_a_moment(above):
    """A hundred steps a turn of either rope see all of it."""
    run = between(METHODS[0], 1.0, above)
    assert all(step > 1e-4 for step in asked(run))
    assert not [note for note in run.report.notes if note.startswith("lower rings")]
