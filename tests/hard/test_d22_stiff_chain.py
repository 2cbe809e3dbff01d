"""D22: twenty masses on springs of 1e8 N/m let go from the horizontal: steps longer than the springs' period.

The data are cardillo's elastic chain (m = 1, l = 1, g = 10). The whip of its end makes the motion chaotic; what can be
asked for is the energy, and the length of the links. `ConservingMidpoint` keeps both at steps of 10 ms, 22 periods of
a mass on two springs, and takes the few steps in halves in which the end of the chain turns by radians. The default
method finds its steps from the error. Steps of 10 ms of generalised alpha make energy from nothing, and the run says so
instead of finishing (test_every_run.py). The stiff pendulum B6 is in tests/validation.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"


RUNS = {
    "steps of 10 ms": (fc.Unchecked(fc.ConservingMidpoint(1e-2)), None),
    "default method": (fc.AdaptiveAlpha(), fc.Tolerance(1e-8, 1e-10)),
}


def chain() -> fc.Model:
    springs = [fc.Spring(f"s{i}", (i, 0, 0), (i + 1, 0, 0), stiffness=1e8) for i in range(20)]
    masses = [fc.PointMass(f"m{i}", spring.end, 1.0) for i, spring in enumerate(springs)]
    joints = [fc.Support(springs[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(springs))]
    joints += [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    outputs = [fc.Position(axis, masses[0].node, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([*springs, *masses], joints, outputs=outputs), "y")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity((0, 0, -10))])


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_energy(record, name):
    method, tolerance = RUNS[name]
    run = fc.simulate(chain(), until=20.0, method=method, tolerance=tolerance, every=0.01)
    record(
        f"D22 stiff chain, 20 s, {name}: energy lost or made, of the energy turned over",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-3),
    )
    record(
        f"D22 stiff chain, 20 s, {name}: stretch of the first spring [m]",
        ours=np.abs(np.hypot(run["x"], run["z"]) - 1).max(),
        reference=0,
        source="rigid limit",
        tolerance=Absolute(1e-3),
    )
    assert run.report.rejected_steps < 0.3 * run.report.steps
