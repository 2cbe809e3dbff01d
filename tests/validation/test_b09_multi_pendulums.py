"""B9, double pendulum: three starts, one of them chaotic.

Equal point masses on rigid ropes, m = l = 1, g = 9.81. Angles from the vertical; the references are a high-order
integration of the equations of motion in these angles.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "dynamics"
SOURCE = "equations in the angles by DOP853"
QUARTER = float(np.pi / 2)
CASES = {
    (0.5, 0.5): {5: (0.2618391969, 0.5089632156), 10: (0.0305165598, 0.0210633536)},
    (QUARTER, QUARTER): {5: (-0.6271867051, -1.3013155502), 10: (-0.568474664, -0.526393728)},
    (QUARTER, 0.0): {1: (-0.88369639, -0.47100445), 5: (-0.91712767, 0.78756785)},
}
DIGITS = {(0.5, 0.5): 1e-8, (QUARTER, QUARTER): 1e-6, (QUARTER, 0.0): 2e-7}


def pendulum(first: float, second: float) -> fc.Model:
    middle = np.array([np.sin(first), 0.0, -np.cos(first)])
    end = np.add(middle, [np.sin(second), 0.0, -np.cos(second)])
    ropes = [fc.Rope("upper", (0, 0, 0), middle, EA=1.0), fc.Rope("lower", middle, end, EA=1.0)]
    masses = [fc.PointMass("middle", middle, 1.0), fc.PointMass("end", end, 1.0)]
    joints = [fc.Support(ropes[0].start, "u v w"), fc.Pin(ropes[0].end, ropes[1].start)]
    joints += [fc.Pin(rope.end, mass.node) for rope, mass in zip(ropes, masses, strict=True)]
    outputs = [
        fc.SwayAngle("upper_angle", ropes[0].start, masses[0].node, "x"),
        fc.SwayAngle("lower_angle", masses[0].node, masses[1].node, "x"),
    ]
    structure = fc.Structure([*ropes, *masses], joints, outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.slow
@pytest.mark.parametrize("start", CASES, ids=lambda s: f"{s[0]:.4g},{s[1]:.4g}")
def test_angles(start, record):
    until = float(max(CASES[start]))
    run = fc.simulate(pendulum(*start), until=until, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0.0, 1e-10))
    found = [run.at(t)[name] for t in CASES[start] for name in ("upper_angle", "lower_angle")]
    record(
        f"B9 double pendulum from ({start[0]:.4g}, {start[1]:.4g}), angles at {' and '.join(map(str, CASES[start]))} s",
        ours=found,
        reference=[angle for pair in CASES[start].values() for angle in pair],
        source=SOURCE,
        tolerance=Absolute(DIGITS[start]),
    )
