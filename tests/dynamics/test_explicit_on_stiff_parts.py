"""An explicit method on a rope that it cannot resolve: the run fails, and says which methods do."""

from __future__ import annotations

import numpy as np

import flexctrl as fc


def test_the_methods_that_do_are_named():
    ball, rope = fc.PointMass("ball", (0, 0, -1), 1.0), fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e12)
    structure = fc.Structure([ball, rope], [fc.Support(rope.start), fc.Pin(rope.end, ball.node)])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])
    start = fc.equilibrium(model).state.with_(v=np.array([0.5, 0.0, 0.0]))
    run = fc.simulate(model, start=start, until=0.3, method=fc.ExplicitRungeKutta())
    assert run.status is fc.Status.FAILED
    assert "stiff parts are for implicit methods: take AdaptiveAlpha" in run.report.message
