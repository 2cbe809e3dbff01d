"""Runs that begin exactly on a corner of a law of force go on."""

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
