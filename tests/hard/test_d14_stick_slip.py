"""D14: dry friction and play: events are located, nothing creeps, nothing chatters.

Coulomb's decaying oscillator, stick-slip on a belt, a mass between two stops.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from scipy.integrate import solve_ivp

import flexctrl as fc

PAGE = "hard"
TIGHT = fc.Tolerance(1e-6, 1e-9)


def block(stiffness: float, effects: list[fc.Effect], mass: float = 1.0) -> fc.Model:
    """A mass along x on a spring to the ground."""
    body = fc.PointMass("block", (0, 0, 0), mass)
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=stiffness)
    structure = fc.Structure(
        [body, spring],
        [fc.Support(spring.start), fc.Pin(spring.end, body.node), fc.Support(body.node, "v w")],
        outputs=[fc.Position("x", body.node, "x"), fc.Velocity("v", body.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation(), *effects])


@pytest.mark.parametrize(("first", "last", "halves"), [(0.3, -0.02, 7), (0.31, -0.01, 8), (0.095, 0.015, 2)])
def test_coulomb_decay(record, first, last, halves):
    """0.04 m less each half cycle; where the spring cannot overcome 2 N it stays for good."""
    model = block(100.0, [fc.CoulombFriction({"block.u": 2.0})])
    run = fc.simulate(model, start=model.displace({model.coordinates[0]: first}), until=4.0, tolerance=TIGHT)
    record(
        f"D14 Coulomb decay from {first:g} m: where it stops [m]",
        ours=run["x"][-1],
        reference=last,
        source="x₀ − 0.04 m a half cycle",
        tolerance=Absolute(1e-6),
    )
    stopped = run.t > run.events[-1].t + 1e-9
    record(
        f"D14 Coulomb decay from {first:g} m: creep afterwards [m/s]",
        ours=np.abs(run["v"][stopped]).max(),
        reference=0,
        source="it sticks",
        tolerance=Absolute(1e-9),
    )
    record(
        f"D14 Coulomb decay from {first:g} m: rejected steps a half cycle",
        ours=run.report.rejected_steps / halves,
        reference=0,
        source="fewer than 50",
        tolerance=Absolute(50),
    )


def test_stick_slip_on_a_belt(record):
    """m = k = 1 on a belt of 0.1 m/s, F_s = 1.5, F_k = 1, from the belt's speed and no tension."""
    carrier = fc.RigidBody("carrier", (0, 0, 0), 1e8, (1e8, 1e8, 1e8))
    rider = fc.RigidBody("rider", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=1.0)
    structure = fc.Structure(
        [carrier, rider, spring],
        [
            fc.Support(carrier.node, "v w rx ry rz"),
            fc.Slide(carrier.node, rider.node, "x"),
            fc.Support(spring.start),
            fc.Pin(spring.end, rider.node),
        ],
        outputs=[fc.Position("x", rider.node, "x"), fc.Velocity("v", rider.node, "x", minus=carrier.node)],
    )
    friction = fc.CoulombFriction({"rider": fc.Coulomb(1.0, static=1.5)})
    model = fc.assemble(structure, [fc.LargeRotation(), friction])
    start = model.rest.with_(v=np.full(model.n, 0.1))
    run = fc.simulate(model, start=start, until=60.0, tolerance=fc.Tolerance(1e-7, 1e-10))
    times = [event.t for event in run.events]
    slips, sticks = np.array(times[0::2]), np.array(times[1::2])
    count = min(len(slips), len(sticks)) - 1
    assert count >= 3
    record(
        "D14 belt: first slip, slip, stick, period [s]",
        ours=[
            slips[0],
            (sticks[:count] - slips[:count]).mean(),
            (slips[1 : count + 1] - sticks[:count]).mean(),
            np.diff(slips).mean(),
        ],
        reference=[15.0, 3.53638377, 10.0, 13.53638377],
        source="harmonic pieces",
        tolerance=1e-4,
    )
    held = [(run.t > a + 1e-9) & (run.t < b - 1e-9) for a, b in zip(sticks[:count], slips[1:], strict=False)]
    creep = run["v"][np.any(held, axis=0)]
    record(
        "D14 belt: creep against the belt while it sticks [m/s]",
        ours=np.abs(creep).max(),
        reference=0,
        source="it sticks",
        tolerance=Absolute(1e-9),
    )
    record(
        "D14 belt: rejected steps an event",
        ours=run.report.rejected_steps / len(times),
        reference=0,
        source="fewer than 50",
        tolerance=Absolute(50),
    )


def record_free_play(record, case, many, mean, period, run):
    record(
        f"{case} free play: mean period over {many} [s]",
        ours=mean,
        reference=period,
        source="2π/ω + 2 b/v₀",
        tolerance=1e-4,
    )
    record(
        f"{case} free play: energy lost or made over {many} periods",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-6),
    )


@pytest.mark.slow
def test_free_play(record):
    """m = 1 at 1 m/s in a gap of 0.02 m between springs of 1e4 N/m: 2π/ω + 2 b/v, ten times"""
    model = block(1e4, [fc.Backlash({"spring": 0.02})])
    period = 2.0 * np.pi / 100.0 + 2.0 * 0.02
    centre = fc.Event("centre", "x", direction=fc.Direction.RISING)
    run = fc.simulate(
        model,
        start=model.rest.with_(v=np.ones(model.n)),
        until=10.5 * period,
        method=fc.ExplicitRungeKutta(),
        tolerance=fc.Tolerance(1e-8, 1e-10),
        events=[centre],
    )
    passing = [event.t for event in run.events if event.name == "centre"]
    record_free_play(record, "D14", "ten", np.diff(passing).mean(), period, run)


@pytest.mark.slow
def test_a_hundred_periods_of_free_play(record):
    """The same for as long as B18 asks: four corners a period, told by the run itself; steps keep the energy."""
    model = block(1e4, [fc.Backlash({"spring": 0.02})])
    period, start = 2.0 * np.pi / 100.0 + 2.0 * 0.02, model.rest.with_(v=np.ones(model.n))
    run = fc.simulate(model, start=start, until=100.6 * period, method=fc.GeneralizedAlpha(2e-4, rho=1.0), every=0.01)
    corners = [event.t for event in run.events]
    record_free_play(record, "B18", "a hundred", (corners[400] - corners[0]) / 100.0, period, run)


LIFT, LOAD, LIMIT, MOTOR, GEAR = 5.0, 10.0, 1.5, 0.02, 100.0


def hoist() -> fc.Model:
    """A load let go on a damped rope whose drum the motor's friction holds, but for the first swing."""
    top, load = fc.PointMass("top", (0, 0, LIFT), 1.0), fc.PointMass("load", (0, 0, 0), LOAD)
    winch = fc.Winch("winch", load.node, top.node, EA=1e5, radius=0.1, ratio=0.1 * GEAR, inertia=MOTOR, damping=200.0)
    structure = fc.Structure(
        [top, load],
        [fc.Support(top.node, "u v w"), fc.Support(load.node, "u v")],
        drives=[winch],
        outputs=[fc.DriveAngle("angle", winch), fc.Position("height", load.node, "z")],
    )
    effects = [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch(), fc.CoulombFriction({"winch": LIMIT})]
    return fc.assemble(structure, effects)


def slipped() -> tuple[float, float, float]:
    """When the drum breaks loose, when it sticks again, and how far the motor has turned: by DOP853, phase by phase."""

    def pulls(y: np.ndarray) -> tuple[float, float]:
        z, a, vz, va = y
        out = LIFT + a / GEAR
        stretch = LIFT - z - out
        pull = 1e5 / out * stretch + 200.0 * (-vz - va / GEAR)
        return pull, (pull + 0.5 * 1e5 / out**2 * stretch**2) / GEAR

    def slope(t: float, y: np.ndarray, slides: bool) -> list[float]:
        pull, torque = pulls(y)
        return [y[2], y[3], pull / LOAD - 9.81, (torque - LIMIT) / MOTOR if slides else 0.0]

    def loose(t: float, y: np.ndarray, slides: bool) -> float:
        return pulls(y)[1] - LIMIT

    def stops(t: float, y: np.ndarray, slides: bool) -> float:
        return y[3] if t > first.t[-1] + 1e-4 else 1.0

    loose.terminal = stops.terminal = True  # type: ignore[attr-defined]
    how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    first = solve_ivp(slope, (0, 1), [0.0] * 4, args=(False,), events=loose, **how)
    second = solve_ivp(slope, (first.t[-1], 1), first.y[:, -1], args=(True,), events=stops, **how)
    return first.t[-1], second.t[-1], second.y[1, -1]


HOISTED = {
    "explicit Runge–Kutta": (fc.ExplicitRungeKutta(), fc.Tolerance(1e-8, 1e-11), 1e-6),
    "adaptive alpha": (fc.AdaptiveAlpha(), fc.Tolerance(1e-8, 1e-11), 5e-3),
    "generalised alpha": (fc.GeneralizedAlpha(2e-4), None, 5e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOISTED)
def test_a_hoist_held_by_friction_slips_once(record, name):
    """The drum breaks loose and sticks again within a step that the load's swing alone would allow."""
    method, tolerance, share = HOISTED[name]
    loose, stuck, angle = slipped()
    run = fc.simulate(hoist(), until=0.2, method=method, tolerance=tolerance)
    assert run.status is fc.Status.FINISHED
    assert len(run.events) == 2
    record(
        f"D14 hoist held by friction, {name}: drum loose and stuck again [s], motor angle [rad]",
        ours=[*(event.t for event in run.events), run["angle"][-1]],
        reference=[loose, stuck, angle],
        source="scipy's DOP853, phase by phase",
        tolerance=share,
    )
    late = run["angle"][run.t > stuck + 0.02]
    assert np.ptp(late) <= 1e-12
    assert run.report.rejected_steps < 50
