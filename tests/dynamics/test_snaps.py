"""Small differences that grow in machines that go no farther than a fraction of their size."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

HALF, RISE, STIFFNESS = 10.0, 1.0, 1e4


def truss() -> fc.Model:
    """Two springs that meet above their feet, with a mass there that moves up and down."""
    left = fc.Spring("left", (-HALF, 0, 0), (0, 0, RISE), stiffness=STIFFNESS)
    right = fc.Spring("right", (HALF, 0, 0), (0, 0, RISE), stiffness=STIFFNESS)
    mass = fc.PointMass("mass", (0, 0, RISE), 1.0)
    joints = [fc.Support(left.start), fc.Support(right.start), fc.Support(mass.node, "u v")]
    joints += [fc.Pin(left.end, mass.node), fc.Pin(right.end, mass.node)]
    inputs, outputs = [fc.Force("load", mass.node, "z")], [fc.Position("z", mass.node, "z")]
    return fc.assemble(fc.Structure([left, right, mass], joints, inputs=inputs, outputs=outputs), [fc.LargeRotation()])


@pytest.mark.parametrize("share", [0.76, 0.7686, 0.7693, 0.77, 0.79])
def test_a_load_near_the_one_that_snaps_through_is_told_where_it_is_off(share):
    """0.7693 of the static limit does not snap, and did at the default tolerance, without a word."""
    length = np.hypot(HALF, RISE)

    def pull(z):
        now = np.hypot(HALF, z)
        return -2.0 * STIFFNESS * (now - length) * z / now

    flat = np.linspace(0.0, RISE, 20001)
    limit = float(np.abs(pull(flat)).max())
    run = fc.simulate(truss(), until=6.0, inputs={"load": -share * limit})
    found = solve_ivp(
        lambda t, y: [y[1], pull(y[0]) - share * limit], (0.0, 6.0), [RISE, 0.0], rtol=1e-11, atol=1e-13, t_eval=run.t
    )
    off = float(np.abs(run["z"] - found.y[0]).max() / np.ptp(found.y[0]))
    said = any("by a coarser run" in note or "added up" in note for note in run.report.notes)
    assert said or off < 0.05
    assert run.report.error > 0.2 * min(off, 1.0)


@pytest.mark.parametrize(("speed", "until"), [(30.0, 15.0), (30.0, 30.0)])
@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()])
def test_what_goes_round_is_told_as_much_as_sums_tell(method, speed, until):
    """A coarser run has the same wrong speed: it said a tenth of what the run was off by."""
    body = fc.RigidBody("body", (0, 0, -1.0), 1.0, (0.05, 0.05, 0.05), {"top": (0, 0, 0)})
    joints = [fc.Support(body.point("top"), "u v w rx rz")]
    model = fc.assemble(fc.Structure([body], joints), [fc.Gravity(), fc.LargeRotation()])
    run = fc.simulate(model, until=until, start=model.rest.with_(v=np.array([speed])), method=method)
    true = solve_ivp(
        lambda t, y: [y[1], -9.81 * np.sin(y[0]) / 1.05],
        (0.0, until),
        [0.0, speed],
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    )
    off = abs(abs(float(run.final.q[0])) - true.y[0, -1])
    assert run.report.error > 0.5 * off
    assert run.report.notes or off < 0.03
