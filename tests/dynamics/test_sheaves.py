"""What a winch hauls up stops at the sheave, however long the steps and short the last piece of rope."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

METHODS = (
    fc.AdaptiveAlpha(),
    fc.GeneralizedAlpha(1e-3),
    fc.ExplicitRungeKutta(),
    fc.ConservingMidpoint(1e-3),
    fc.Richardson(fc.GeneralizedAlpha(1e-3)),
)


def hoist(stretches: bool) -> fc.Model:
    trolley, load = fc.PointMass("trolley", (0, 0, 5), 5.0), fc.PointMass("load", (0, 0, 0), 10.0)
    winch = fc.Winch("winch", load.node, trolley.node, EA=1e5, radius=0.1, inertia=0.02)
    outputs = [fc.Position("z", load.node, "z")]
    structure = fc.Structure(
        [trolley, load], [fc.Support(trolley.node)], [winch], [fc.MotorTorque("torque", winch)], outputs
    )
    effects = [fc.LargeRotation(), fc.Gravity(), *([fc.RopeStretch()] if stretches else [])]
    return fc.assemble(structure, effects)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("stretches", [False, True])
def test_a_load_hauled_up_stops_at_the_sheave(stretches, method):
    run = fc.simulate(hoist(stretches), until=1.5, inputs={"torque": -40.0}, method=method)
    lifted = 40.0 / 0.1 - 10.0 * 9.81
    rigid = (2.0 * 4.9995 * (10.0 + 0.02 / 0.1**2) / lifted) ** 0.5
    assert run.status is fc.Status.STOPPED
    assert "the rope of winch is down to its shortest" in run.report.message
    assert run.final.x[1, 2] == pytest.approx(4.9995, abs=1e-8)
    assert run.final.t == pytest.approx(rigid, abs=2e-3 if stretches else 1e-8)


def test_a_load_that_swings_by_far_from_the_sheave_goes_on():
    model = hoist(stretches=False)
    start = model.rest.with_(v=np.array([25.0, 0.0, 0.0]))
    run = fc.simulate(model, until=2.0, start=start, inputs={"torque": -100.0}, method=fc.AdaptiveAlpha())
    assert run.status is fc.Status.FINISHED
    assert run["z"].max() > 5.0
