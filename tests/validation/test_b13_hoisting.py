"""B13, hoisting: a pendulum whose rope is wound up or paid out at a constant speed.

A winch whose motor is too heavy to be slowed, its load balanced. The reference is an equation with Bessel functions for
small angles, θ̈ l + 2 l̇ θ̇ + g sin θ = 0 by DOP853 for all.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

PAGE = "dynamics"
G, MASS = 9.81, 1000.0
SOURCE = "equation of motion by DOP853"
TABLED = {(10.0, -0.5, 16.0): -0.16700024, (4.0, 0.5, 12.0): -0.00881964, (10.0, -1.0, 9.5): -0.45266701}
"""Length [m], speed [m/s], time [s] → angle from 0.05 rad."""
LINEAR = {(10.0, -0.5, 16.0): -0.16703573, (4.0, 0.5, 12.0): -0.00884831, (10.0, -1.0, 9.5): -0.45454887}
"""The same by Bessel functions, for small angles."""
SHORT = {1.0: 0.0029932618, 0.1: 0.0149308028, 0.01: 0.2211650066}
"""Length → angle from 0.001 rad at 10 m."""


def hoisted(length: float, speed: float, angle: float, until: float, tolerance: float = 1e-9) -> fc.Run:
    top = fc.PointMass("top", (0, 0, 0), 0.0)
    load = fc.PointMass("load", (0, 0, -length), MASS)
    winch = fc.Winch("winch", load.node, top.node, EA=1e8, radius=0.5, ratio=20.0, inertia=1e7, shortest=1e-3)
    structure = fc.Structure(
        [top, load],
        [fc.Support(top.node), fc.Support(load.node, "v")],
        [winch],
        [fc.MotorTorque("torque", winch)],
        [fc.SwayAngle("sway", top.node, load.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])
    start = model.displace({"load_0_u": length * np.sin(angle), "load_0_w": length * (1.0 - np.cos(angle))})
    start = start.with_(v=speed * np.array([np.sin(angle), -np.cos(angle)]))
    balance = {"torque": -MASS * G * 0.5 / 20.0}
    return fc.simulate(
        model,
        until=until,
        start=start,
        inputs=balance,
        method=fc.Unchecked(fc.ExplicitRungeKutta()),
        tolerance=fc.Tolerance(tolerance, tolerance),
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", TABLED, ids=str)
def test_angle(case, record):
    length, speed, until = case
    record(
        f"B13 pendulum of {length:g} m at {speed:g} m/s, angle after {until:g} s [rad]",
        ours=hoisted(length, speed, 0.05, until)["sway"][-1],
        reference=TABLED[case],
        source=SOURCE,
        tolerance=1e-5,
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", LINEAR, ids=str)
def test_small_angle(case, record):
    """From 0.1 mrad, times 500."""
    length, speed, until = case
    record(
        f"B13 pendulum of {length:g} m at {speed:g} m/s, small angle after {until:g} s, from 0.05 by scale [rad]",
        ours=hoisted(length, speed, 1e-4, until, 1e-11)["sway"][-1] * 500.0,
        reference=LINEAR[case],
        source="Bessel functions J₁, Y₁ of 2 √(g l)/v",
        tolerance=1e-5,
    )


@pytest.mark.slow
@pytest.mark.parametrize("left", SHORT)
def test_nearly_no_rope_left(left, record):
    record(
        f"B13 pendulum hoisted at 1 m/s from 10 m to {left:g} m, angle [rad]",
        ours=hoisted(10.0, -1.0, 1e-3, 10.0 - left)["sway"][-1],
        reference=SHORT[left],
        source=SOURCE,
        tolerance=1e-5,
    )


@pytest.mark.slow
def test_slow_hoist(record):
    """10 m to 2.5 m at 1 cm/s: the energy over the frequency stays, so the amplitude grows as l to the power −3/4."""
    run = hoisted(10.0, -0.01, 1e-3, 750.0, 1e-10)
    angle, left = run["sway"][-1], 2.5
    rate = (run.final.v[0] / np.cos(angle) + 0.01 * np.tan(angle)) / left
    record(
        "B13 slow hoist from 10 m to 2.5 m at 0.01 m/s: growth of the amplitude",
        ours=np.hypot(angle, rate * np.sqrt(left / G)) / 1e-3,
        reference=2.8263067,
        source="equation of motion by DOP853; 4^0.75 = 2.8284 without end",
        tolerance=1e-5,
    )
