"""A command that jumps acts until its jump and from its jump on, not half a step beside it."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Step, Sum


@pytest.mark.parametrize("step", [0.1, 0.03])
@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_a_pulse_gives_its_impulse(step, rho):
    """8 N on 2 kg from 0.3 s to 0.8 s: 2 m/s, and ½ a T² + v t of way."""
    mass = fc.PointMass("mass", (0, 0, 0), 2.0)
    slide = fc.Support(mass.node, "v w")
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")]
    model = fc.assemble(
        fc.Structure([mass], [slide], inputs=[fc.Force("push", mass.node, "x")], outputs=outputs), [fc.LargeRotation()]
    )
    pulse = fc.OpenLoop({"push": Sum((Step(8.0, at=0.3), Step(-8.0, at=0.8)))})
    run = fc.simulate(model, pulse, until=1.3, method=fc.GeneralizedAlpha(step, rho))
    assert run["v"][-1] == pytest.approx(2.0, rel=1e-10)
    assert run["x"][-1] == pytest.approx(0.5 * 4.0 * 0.25 + 2.0 * 0.5, rel=1e-3)
    assert np.isfinite(run.y).all()
