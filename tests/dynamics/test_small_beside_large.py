"""What moves little beside what it is coupled to: its errors are relative to that, and a note says so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc


def hoisted(sway, until, tolerance=None, inertia=1e4, method=None):
    """A load hoisted at 1 m/s from 10 m by a motor too heavy to be slowed: its sway, and that of its equation."""
    at = (10.0 * np.sin(sway), 0.0, -10.0 * np.cos(sway))
    trolley, load = fc.PointMass("trolley", (0, 0, 0), 1.0), fc.PointMass("load", at, 1.0)
    winch = fc.Winch("winch", load.node, trolley.node, EA=1e7, radius=1.0, inertia=inertia)
    held = [fc.Support(trolley.node), fc.Support(load.node, "v")]
    outputs = [fc.SwayAngle("sway", trolley.node, load.node, "x")]
    structure = fc.Structure([trolley, load], held, [winch], [fc.MotorTorque("torque", winch)], outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])
    start = fc.project(model, model.rest, {load.node: (-np.sin(sway), 0.0, np.cos(sway))}).state
    run = fc.simulate(model, until=until, start=start, tolerance=tolerance, inputs={"torque": -9.81}, method=method)

    def slope(t, y):
        return [y[1], (2.0 * y[1] - 9.81 * np.sin(y[0])) / (10.0 - t)]

    return run, solve_ivp(slope, (0.0, until), [sway, 0.0], method="DOP853", rtol=1e-11, atol=1e-13).y[0, -1]


@pytest.mark.parametrize("until", [9.0, 9.9])
def test_a_sway_that_the_tolerance_does_not_tell_from_errors_is_named(until):
    run, exact = hoisted(1e-3, until)
    assert abs(run["sway"][-1] - exact) > 1e-3
    assert any(note.startswith("sway has moved by") and "give a smaller one" in note for note in run.report.notes)


def test_nothing_is_said_where_it_is_right():
    run, exact = hoisted(0.05, 9.0, fc.Tolerance(1e-6, 1e-9))
    assert run["sway"][-1] == pytest.approx(exact, abs=1e-3)
    assert not run.report.notes


@pytest.mark.parametrize("inertia", [1e4, 1e6, 1e8, 1e9, 1e12, 1e15])
def test_a_load_that_is_nothing_beside_its_motor_sways_all_the_same(inertia):
    """Tangents made where the rope pointed before would move the load by a share of what holds the motor."""
    run, exact = hoisted(0.05, 9.5, inertia=inertia)
    assert run.status is fc.Status.FINISHED
    assert run["sway"][-1] == pytest.approx(exact, abs=0.02)
    assert run.report.energy_residual < 0.05


@pytest.mark.parametrize("sway", [1e-3, 0.05, 0.3])
@pytest.mark.parametrize("inertia", [1e6, 1e7, 1e9, 1e12])
def test_it_takes_no_more_steps_however_heavy_the_motor(inertia, sway):
    """Nothing of the motion depends on it: 1e4 times the load hold the drum's speed already."""
    (light, _), (heavy, _) = hoisted(sway, 5.0), hoisted(sway, 5.0, inertia=inertia)
    assert heavy.status is fc.Status.FINISHED
    assert heavy.report.steps <= 1.2 * light.report.steps + 2
    assert heavy["sway"][-1] == pytest.approx(light["sway"][-1], abs=2e-3 * (sway + 0.05))


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.02), fc.GeneralizedAlpha(0.05)])
@pytest.mark.parametrize("inertia", [1e6, 1e9, 1e12])
def test_fixed_steps_do_as_well(inertia, method):
    (light, exact), (heavy, _) = (hoisted(0.05, 5.0, inertia=j, method=method) for j in (1e4, inertia))
    assert heavy.status is fc.Status.FINISHED
    assert abs(heavy["sway"][-1] - exact) <= abs(light["sway"][-1] - exact) + 1e-4


def beside_a_crane(way):
    """A mass on a spring of 20 rad/s that swings by ±way, a kilometre from a boom of that length that hangs."""
    mass, spring = fc.PointMass("mass", (1, 0, 0), 1.0), fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=400.0)
    ends = {"top": (1e3, 0, 0), "end": (1e3, 0, -1e3)}
    boom = fc.RigidBody("boom", (1e3, 0, -500), 1e3, (1e8,) * 3, ends)
    joints = [fc.Support(boom.point("top"), "u v w rx rz"), fc.Support(spring.start), fc.Pin(spring.end, mass.node)]
    outputs = [fc.Position("x", mass.node, "x"), fc.Position("far", boom.point("end"), "x")]
    plan = fc.Structure([mass, spring, boom], [*joints, fc.Support(mass.node, "v w")], outputs=outputs)
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Gravity()])
    speed = [20.0 * way if name.startswith("mass") else 0.05 for name in model.coordinates]
    return model, model.rest.with_(v=np.array(speed))


@pytest.mark.parametrize("way", [1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.02), fc.ConservingMidpoint(0.02)])
def test_what_moves_by_little_beside_what_is_large_is_told_of(way, method):
    """It moved by less than a ten-millionth of the machine, which is one of a kilometre: it was left out."""
    model, start = beside_a_crane(way)
    run = fc.simulate(model, until=2.0, every=0.01, start=start, method=method)
    off = np.abs(run["x"] - 1.0 - way * np.sin(20.0 * run.t)).max() / np.ptp(run["x"])
    assert off > 0.2
    assert run.report.output_errors["x"] > 0.1
    assert any(note.startswith("x has moved by") for note in run.report.notes)
    assert run.report.output_errors["far"] < 1e-3


@pytest.mark.parametrize("way", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()])
def test_what_moves_by_little_is_off_by_no_more_than_is_told(way, method):
    model, start = beside_a_crane(way)
    run = fc.simulate(model, until=2.0, every=0.01, start=start, method=method)
    off = np.abs(run["x"] - 1.0 - way * np.sin(20.0 * run.t)).max() / np.ptp(run["x"])
    assert off < run.report.output_errors["x"]
