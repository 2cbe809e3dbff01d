"""D22: twenty masses on springs of 1e8 N/m let go from the horizontal: steps longer than the springs' period.

The data are cardillo's elastic chain (m = 1, l = 1, g = 10). The whip of its end makes the motion chaotic; what can be
asked for is the energy. Steps of one length of 10 ms make energy from nothing, and the run says so instead of finishing
(test_every_run.py); steps chosen from the error keep it. The stiff pendulum B6 is in tests/validation.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"


@pytest.mark.slow
def test_energy(record):
    springs = [fc.Spring(f"s{i}", (i, 0, 0), (i + 1, 0, 0), stiffness=1e8) for i in range(20)]
    masses = [fc.PointMass(f"m{i}", spring.end, 1.0) for i, spring in enumerate(springs)]
    joints = [fc.Support(springs[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(springs))]
    joints += [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    outputs = [fc.Position(axis, masses[0].node, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([*springs, *masses], joints, outputs=outputs), "y")
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity((0, 0, -10))])
    run = fc.simulate(model, until=20.0, tolerance=fc.Tolerance(1e-8, 1e-10))
    record(
        "D22 stiff chain, 20 s: energy lost or made, of the energy turned over",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-3),
    )
    record(
        "D22 stiff chain, 20 s: stretch of the first spring [m]",
        ours=np.abs(np.hypot(run["x"], run["z"]) - 1).max(),
        reference=0,
        source="rigid limit",
        tolerance=Absolute(1e-3),
    )
