"""A step that passes two corners: steps jump over the one from where the other switches, and never end near it."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

SAMPLE, LATE = 5e-3, 0.0152661713


def crane() -> fc.Model:
    """A trolley whose wheels' gear has play, a load on a winch with dry friction; the wheels' motor lags."""
    trolley, load = fc.PointMass("trolley", (0, 0, 12), 23.235), fc.PointMass("load", (0, 0, 9.8548825), 129.475827)
    line = {"EA": 613275.933, "damping": 751.503}
    hoist = fc.Winch("hoist", load.node, trolley.node, radius=0.1, ratio=11.02429, inertia=5.3639127e-3, **line)
    gear = {"radius": 0.0722168, "ratio": 14.719229, "stiffness": 40.822138, "damping": 0.0437009}
    wheels = fc.LinearDrive("wheels", trolley.node, direction="x", inertia=2.5393034e-3, **gear)
    outputs = [fc.Position("x", trolley.node, "x"), fc.DriveAngle("roll", wheels), fc.DriveSpeed("rolling", wheels)]
    machine = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [hoist, wheels],
        [fc.MotorTorque("pull", wheels), fc.MotorTorque("lift", hoist)],
        [*outputs, fc.DriveAngle("hoisted", hoist), fc.DriveSpeed("hoisting", hoist)],
    )
    dry = fc.CoulombFriction({"hoist": fc.Coulomb(0.230471508, static=0.26754432)})
    effects = [fc.LargeRotation(), fc.Gravity(), fc.Flexible(), dry, fc.Backlash({"wheels": 0.580808839})]
    return fc.assemble(machine, [*effects, fc.MotorLag({"wheels": LATE})])


class Law:
    """Both motors along smooth ways, a sample late, the wheels' torque limited in rate."""

    inputs, outputs, sample_time = ("roll", "rolling", "hoisted", "hoisting"), ("pull", "lift"), SAMPLE

    def initial(self):
        return np.array([0.0, -11.533378757])

    def command(self, t, x, y):
        return x

    def update(self, t, x, y):
        s = min(t / 0.571016287, 1.0)
        way, most = s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 1620.764917 * SAMPLE
        pull = np.clip(0.540475451 * (378.827345 * way - y[0]) - 0.0385982072 * y[1], -60.8238, 60.8238)
        lift = 0.198331189 * (-39.2262926 * way - y[2]) - 0.0789074653 * y[3]
        return np.array([np.clip(pull, x[0] - most, x[0] + most), -11.533378757 + np.clip(lift, -8.044286, 8.044286)])


@pytest.fixture(scope="module")
def true() -> tuple[fc.Model, fc.State, fc.Run]:
    model = crane()
    start = fc.equilibrium(model, hold={"hoist_source": 0.0, "wheels_source": 0.0}).state
    tight = {"method": fc.Unchecked(fc.AdaptiveAlpha()), "tolerance": fc.Tolerance(1e-7, 1e-10)}
    return model, start, fc.simulate(model, Law(), until=0.8, start=start, every=1e-3, **tight)


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(SAMPLE)], ids=["chosen", "fixed"])
def test_the_clock_goes_on_and_nothing_jumps(true, method):
    """Friction stops the hoist 1.3 ms before play is used up; 13 ms of motion were put in, and the clock set back."""
    model, start, right = true
    run = fc.simulate(model, Law(), until=0.8, start=start, every=1e-3, method=fc.Unchecked(method))
    times = [event.t for event in run.events]
    assert times == sorted(times)
    for place, rate in (("roll", "rolling"), ("hoisted", "hoisting")):
        moved = np.diff(run[place]) - 5e-4 * (run[rate][1:] + run[rate][:-1])
        assert np.abs(moved).max() < 2e-3 * np.ptp(run[place])
        assert np.abs(run[place] - right[place]).max() < 5e-3 * np.ptp(right[place])
