"""Steps that damp all fast vibration at once: coarser runs lack it as the first does, and tell nothing of that."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def crane() -> tuple[fc.Model, fc.State]:
    """A trolley on a girder, a load on a stiff rope; at rest while the trolley is held."""
    section = fc.Section(EA=1e8, EI_y=4e5, EI_z=4e5, GJ=1e5, rhoA=20.0, rhoJ=1.0)
    girder = fc.Beam("girder", (0, 0, 0), (10, 0, 0), section, elements=6)
    trolley, load = fc.Trolley("trolley", girder, at=1.0, mass=50.0), fc.PointMass("load", (1, 0, -2), 80.0)
    rope = fc.Rope("rope", (1, 0, 0), (1, 0, -2), EA=1e6)
    supports = [fc.Support(girder.start, "u w"), fc.Support(girder.end, "w")]
    structure = fc.Structure(
        [girder, trolley, load, rope],
        [*supports, fc.Pin(trolley.node, rope.start), fc.Pin(load.node, rope.end)],
        inputs=[fc.Force("push", trolley.travel, "x")],
        outputs=[fc.Tension("tension", rope), fc.Position("middle", girder.node(3), "z")],
    )
    model = fc.assemble(fc.planar(structure, "y"), [fc.Flexible(), fc.LargeRotation(), fc.Gravity()])
    return model, fc.equilibrium(model, hold={"trolley_slide": 0.0}, inputs={}).state


@pytest.mark.parametrize("rho", [0.0, 0.2])
@pytest.mark.parametrize("push", [85.0, 140.0])
def test_what_is_damped_away_is_told(rho, push):
    model, start = crane()
    how = {"start": start, "inputs": {"push": push}, "until": 2.0, "every": 0.013}
    run = fc.simulate(model, method=fc.AdaptiveAlpha(rho=rho), **how)
    right = fc.simulate(model, method=fc.Unchecked(fc.AdaptiveAlpha()), tolerance=fc.Tolerance(1e-8, 1e-11), **how)
    off = {name: np.abs(run[name] - right[name]).max() / np.ptp(right[name]) for name in run.outputs}
    assert off["middle"] > 0.008  # there is something to be told
    assert all(run.report.output_errors[name] > 0.5 * off[name] for name in run.outputs)
