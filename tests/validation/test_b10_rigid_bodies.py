"""B10 and D23, rigid bodies that spin: pendulum of the IFToMM, heavy top, Dzhanibekov's wing nut.

The top is to be right to 5e-4 m with steps of 0.2 ms. `ConservingMidpoint` is, and so is generalised alpha
extrapolated; alone it needs 0.16 ms (7e-4 m with 0.2): increments of rotation along the mean spin leave out
h³/12 ω × ω̇, which moves the top's axis under its spin of 150 rad/s.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from recorder import Absolute
from scipy.spatial.transform import Rotation

import flexctrl as fc

PAGE = "dynamics"
EXPLICIT, TIGHT = fc.ExplicitRungeKutta(), fc.Tolerance(0.0, 1e-11)
TOP = {
    0.2: (0.6055505614, 0.5989576818, -0.5239830274),
    2.0: (-0.1504168227, -0.7241655916, -0.6730222696),
}
TURNED = (0.1229471, -0.4910799, 0.3504300, -0.7879869)
"""The top's quaternion at 2 s, scalar first."""

FLIPS = (8.0532570, 23.0192521, 37.9852472, 52.9512424)


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


METHODS = {
    "ConservingMidpoint": (fc.ConservingMidpoint, 2e-4, 2.0),
    "GeneralizedAlpha": (fc.GeneralizedAlpha, 1.6e-4, 2.0),
    "Richardson of GeneralizedAlpha": (lambda h: fc.Richardson(fc.GeneralizedAlpha(h, rho=1.0)), 2e-4, 4.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_heavy_top_without_artificial_precession(name, record):
    (model, start), (method, step, order) = top(), METHODS[name]
    runs = [fc.simulate(model, until=0.2, start=start, method=method(h)) for h in (2.0 * step, step)]
    coarse, fine = (np.abs(np.array([run[axis][-1] for axis in "xyz"]) - TOP[0.2]).max() for run in runs)
    record(
        f"D23 heavy top, mass centre at 0.2 s, {name} of {1e3 * step:g} ms",
        ours=[runs[1][axis][-1] for axis in "xyz"],
        reference=TOP[0.2],
        source="Brüls, Cardona and Arnold 2012; quaternions by DOP853",
        tolerance=Absolute(5e-4),
    )
    record(
        f"D23 heavy top, order of {name}",
        ours=np.log2(coarse / fine),
        reference=order,
        source="theory",
        tolerance=Absolute(0.1),
    )


def wing_nut() -> tuple[fc.Model, fc.State]:
    body = fc.RigidBody("nut", (0, 0, 0), 1.0, (1.0, 2.0, 3.0))
    outputs = [fc.Rotation("along", body.node, "y"), fc.AngularVelocity("spin", body.node, "y")]
    model = fc.assemble(fc.Structure([body], outputs=outputs), [fc.LargeRotation()])
    return model, model.rest.with_(v=np.array([0.0, 0.0, 0.0, 1e-3, 2.0, 1e-3]))


@pytest.mark.slow
def test_dzhanibekov(record):
    """The middle axis turns over when its component of the spin, in the body, goes through zero."""
    model, start = wing_nut()
    run = fc.simulate(model, until=60.0, start=start, method=EXPLICIT, tolerance=fc.Tolerance(0.0, 1e-12))

    def spin(t: float) -> float:
        state = run.at(t).state
        return float(state.R[0][:, 1] @ state.v[3:])

    from scipy.optimize import brentq

    found = [brentq(spin, t - 1.0, t + 1.0, xtol=1e-10) for t in FLIPS]
    record(
        "D23 Dzhanibekov, times of the flips", ours=found, reference=FLIPS, source="Euler's equations", tolerance=1e-6
    )
    J, final = np.diag([1.0, 2.0, 3.0]), run.final
    momentum = final.R[0] @ J @ final.R[0].T @ final.v[3:]
    record(
        "D23 Dzhanibekov, angular momentum after 60 s",
        ours=momentum,
        reference=[1e-3, 4.0, 3e-3],
        source="constant",
        tolerance=Absolute(1e-8),
    )
    record(
        "D23 Dzhanibekov, energy after 60 s",
        ours=sum(model.energy(final)[:2]),
        reference=0.5 * (1e-6 + 2 * 4.0 + 3e-6),
        source="constant",
        tolerance=1e-8,
    )
