"""B10, rigid bodies: pendulum of the IFToMM, heavy top.

How methods of fixed order follow the top, and Dzhanibekov's wing nut, is told in D23.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from recorder import Absolute
from scipy.spatial.transform import Rotation

import flexctrl as fc

PAGE = "dynamics"
EXPLICIT, TIGHT = fc.Unchecked(fc.ExplicitRungeKutta()), fc.Tolerance(0.0, 1e-11)
TOP = {
    0.2: (0.6055505614, 0.5989576818, -0.5239830274),
    2.0: (-0.1504168227, -0.7241655916, -0.6730222696),
}
TURNED = (0.1229471, -0.4910799, 0.3504300, -0.7879869)
"""The top's quaternion at 2 s, scalar first."""


def test_pendulum_a01(record):
    rope = fc.Rope("rope", (0, 0, 0), (-1, 0, 0), EA=1.0)
    mass = fc.PointMass("mass", rope.end, 1.0)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, mass.node), fc.Support(mass.node, "v")]
    outputs = [fc.Position(axis, mass.node, axis) for axis in "xz"]
    model = fc.assemble(fc.Structure([rope, mass], joints, outputs=outputs), [fc.Gravity(), fc.LargeRotation()])
    passing = fc.Event("passing", "x", direction=fc.Direction.RISING)
    run = fc.simulate(model, until=10.0, method=EXPLICIT, tolerance=TIGHT, events=[passing])
    record(
        "B10 pendulum A01, x and z at 10 s",
        ours=[run["x"][-1], run["z"][-1]],
        reference=[-0.2750874626, -0.9614192051],
        source="IFToMM benchmark; elliptic functions",
        tolerance=Absolute(1e-8),
    )
    times = [event.t for event in run.events]
    record(
        "B10 pendulum A01, period between events",
        ours=np.diff(times).mean(),
        reference=2.3678419476,
        source="elliptic integral",
        tolerance=1e-9,
    )


@cache
def top() -> tuple[fc.Model, fc.State]:
    """The mass centre at (0, 1, 0) from the point it is held at."""
    body = fc.RigidBody("top", (0, 1, 0), 15.0, (0.234375, 0.46875, 0.234375), {"tip": (0, 0, 0)})
    outputs = [fc.Position(axis, body.node, axis) for axis in "xyz"]
    structure = fc.Structure([body], [fc.Support(body.point("tip"), "u v w")], outputs=outputs)
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    return model, model.rest.with_(v=np.array([0.0, 150.0, -4.61538]))


@pytest.mark.slow
def test_heavy_top(record):
    model, start = top()
    run = fc.simulate(model, until=2.0, start=start, method=EXPLICIT, tolerance=TIGHT)
    record(
        "B10 heavy top, mass centre at 0.2 and 2 s",
        ours=[run.at(t)[axis] for t in TOP for axis in "xyz"],
        reference=[value for place in TOP.values() for value in place],
        source="Brüls, Cardona and Arnold 2012; quaternions by DOP853",
        tolerance=Absolute(1e-8),
    )
    record(
        "B10 heavy top, quaternion at 2 s",
        ours=Rotation.from_matrix(run.final.R[0]).as_quat(canonical=True, scalar_first=True),
        reference=TURNED,
        source="Brüls, Cardona and Arnold 2012; quaternions by DOP853",
        tolerance=Absolute(1e-7),
    )
