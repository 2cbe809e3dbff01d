"""What buckles, snaps, falls over or flutters while little moves: small differences grow there, and are told of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import flexctrl as fc
from flexctrl.design import Sampled, pd

STIFFNESS, HALF, RISE = 1e7, 1.0, 0.01
G, DISTURBED = 9.81, 1e-6


def told(run: fc.Run, name: str) -> float:
    return max(run.report.error, run.report.output_errors.get(name, 0.0))


def off(run: fc.Run, name: str, right: np.ndarray) -> float:
    return float(np.abs(run[name] - right).max() / np.ptp(right))


def shallow() -> fc.Model:
    """Two springs that rise by a hundredth of their length: they snap through within a fiftieth of the truss's size."""
    first = fc.Spring("first", (-HALF, 0, 0), (0, RISE, 0), stiffness=STIFFNESS)
    second = fc.Spring("second", (HALF, 0, 0), (0, RISE, 0), stiffness=STIFFNESS)
    top = fc.PointMass("top", (0, RISE, 0), 1.0)
    joints = [fc.Support(s.start, "u v w") for s in (first, second)] + [fc.Support(top.node, "u w")]
    joints += [fc.Pin(s.end, top.node) for s in (first, second)]
    inputs, outputs = [fc.Force("push", top.node, "y")], [fc.Position("y", top.node, "y")]
    return fc.assemble(fc.Structure([first, second, top], joints, [], inputs, outputs), [fc.LargeRotation()])


def critical() -> float:
    """The step of load under which the truss comes to rest at the top of its potential: it has no way to turn back."""
    drawn, y = np.hypot(HALF, RISE), np.linspace(-RISE, 0.99 * RISE, 100_001)

    def top(load: float) -> float:
        return float((STIFFNESS * (np.hypot(HALF, y) - drawn) ** 2 - load * (y - RISE)).max())

    return float(brentq(top, -10.0, -0.1))


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(2e-3)], ids=["chosen steps", "fixed steps"])
@pytest.mark.parametrize(("share", "until"), [(0.999, 1.0), (1.001, 1.0), (1.3, 3.0)])
def test_a_snap_through_smaller_than_a_fiftieth_of_the_machine(share, until, method):
    """Default runs were 25 … 67 % off, told as 0.4 … 2.7 %."""
    load, drawn = share * critical(), np.hypot(HALF, RISE)
    run = fc.simulate(shallow(), until=until, inputs={"push": load}, method=method)
    right = solve_ivp(
        lambda _, s: [s[1], load - 2.0 * STIFFNESS * (1.0 - drawn / np.hypot(HALF, s[0])) * s[0]],
        (0.0, until), [RISE, 0.0], "DOP853", np.minimum(run.t, until), rtol=1e-12, atol=1e-15,
    ).y[0]  # fmt: skip
    assert told(run, "y") > off(run, "y", right) / 3.0


def inverted() -> fc.Model:
    rod = fc.Spring("rod", (0, 0, 0), (0, 0, 1), stiffness=1e6)
    mass = fc.PointMass("mass", (0, 0, 1), 1.0)
    joints = [fc.Support(rod.start, "u v w"), fc.Pin(rod.end, mass.node), fc.Support(mass.node, "v")]
    inputs, outputs = [fc.Force("push", mass.node, "x")], [fc.Position("x", mass.node, "x")]
    plan = fc.Structure([rod, mass], joints, [], inputs, outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.parametrize(("push", "until"), [(1e-5, 2.8), (1e-6, 3.5)])
def test_an_inverted_pendulum_pushed_by_little(push, until):
    """It falls as cosh: what it errs by at first grows alike; 9 and 37 % off were told as 0.2 %."""
    model = inverted()
    run = fc.simulate(model, until=until, start=fc.equilibrium(model).state, inputs={"push": push})
    rate = np.sqrt(G)
    right = push / rate**2 * (np.cosh(rate * run.t) - 1.0)
    assert off(run, "x", right) > 0.05
    assert any("by a coarser run" in note for note in run.report.notes)


def column(load: float) -> tuple[fc.Model, fc.Rest]:
    """Beck's column: a load at its tip that follows it (EI = 1000, one metre); it flutters beyond 20.05 EI/l²."""
    section = fc.Section(EA=1e6, EI_y=1e3, EI_z=1e3, GJ=800.0, rhoA=1.0, rhoJ=1e-6)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=6)
    inputs = [fc.FollowerForce("load", beam.end, "-x"), fc.Force("side", beam.end, "y")]
    outputs = [fc.Position("y", beam.end, "y")]
    plan = fc.planar(fc.Structure([beam], [fc.Support(beam.start)], [], inputs, outputs))
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Flexible()])
    return model, fc.equilibrium(model, inputs={"load": load})


def disturbed(load: float, method: fc.GeneralizedAlpha | fc.Unchecked | None, until: float = 0.8) -> fc.Run:
    model, rest = column(load)
    inputs = {"load": load, "side": DISTURBED}
    return fc.simulate(model, until=until, start=rest.state, inputs=inputs, method=method)


def test_flutter_that_steps_damp_away_is_a_failure():
    """Steps of 40 ms map 51 ± 354i 1/s into the unit circle: 7e-11 m, finished, for 0.3 m."""
    run = disturbed(21e3, None)
    assert run.status is fc.Status.FAILED
    assert "the machine under load is unstable, with a pole at 50" in run.report.message
    fine = disturbed(21e3, fc.Unchecked(fc.GeneralizedAlpha(2e-4)), 0.4)
    assert fine.status is fc.Status.FINISHED
    early, late = (np.abs(fine["y"][(fine.t > a) & (fine.t < a + 0.05)]).max() for a in (0.25, 0.3))
    assert np.log(late / early) / 0.05 == pytest.approx(50.6, rel=0.05)


def test_below_the_load_of_flutter_nothing_is_said():
    run = disturbed(19e3, None)
    assert run.status is fc.Status.FINISHED
    assert not any("unstable" in note for note in run.report.notes)


def test_a_sampled_loop_that_grows_while_little_moves():
    """11 % off, told as 1.6 and 2.9 %."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=100.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("vx", mass.node, "x")]
    plan = fc.Structure([mass, spring], joints, [], [fc.Force("push", mass.node, "x")], outputs)
    model = fc.assemble(plan, [fc.LargeRotation()])
    law, sample = pd(kp=0.0, kd=-1.0, measured="x", rate="vx", command="push"), 0.02
    start = model.rest.with_(v=np.array([1e-4]))
    run = fc.simulate(model, Sampled(law, sample), until=10.0, start=start)
    moves, state = expm(np.array([[0, 1, 0], [-100, 0, 1], [0, 0, 0]]) * sample), np.array([0.0, 1e-4, 1e-4])
    for _ in range(500):
        state = moves @ state
        state[2] = state[1]
    wrong = abs(run["x"][-1] - run["x"][0] - state[0]) / np.ptp(run["x"])
    assert told(run, "x") > wrong / 3.0
    assert any("by a finer run" in note or "by a coarser run" in note for note in run.report.notes)
