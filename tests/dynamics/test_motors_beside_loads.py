"""Loads on rigid ropes from motors of a million times their inertia, in steps that keep momenta."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

LENGTH, SPEED, SWAY = 10.0, -0.5, 0.05


def hoisted(inertia: float) -> tuple[fc.Model, fc.State]:
    """A load of 1 kg that a drum of radius 1 m hoists at 0.5 m/s, swaying from 0.05 rad."""
    at = (LENGTH * np.sin(SWAY), 0.0, -LENGTH * np.cos(SWAY))
    trolley, load = fc.PointMass("trolley", (0, 0, 0), 1.0), fc.PointMass("load", at, 1.0)
    winch = fc.Winch("winch", load.node, trolley.node, EA=1e9, radius=1.0, inertia=inertia)
    held = [fc.Support(trolley.node), fc.Support(load.node, "v")]
    outputs = [fc.SwayAngle("sway", trolley.node, load.node, "x"), fc.DriveSpeed("speed", winch)]
    model = fc.assemble(
        fc.Structure([trolley, load], held, [winch], [], outputs), [fc.LargeRotation(), fc.Gravity((0, 0, -9.81))]
    )
    return model, model.rest.with_(v=np.array([SPEED * np.sin(SWAY), -SPEED * np.cos(SWAY)]))


def exact(inertia: float, until: float) -> float:
    """The sway of its equations: (m + J) ℓ'' = m ℓ φ'² + m g cos φ, ℓ φ'' = −2 ℓ' φ' − g sin φ."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        phi, turn, length, speed = y
        pull = length * turn**2 + 9.81 * np.cos(phi)
        return [turn, -(2.0 * speed * turn + 9.81 * np.sin(phi)) / length, speed, pull / (1.0 + inertia)]

    begin = [SWAY, 0.0, LENGTH, SPEED]
    return float(solve_ivp(slope, (0.0, until), begin, method="DOP853", rtol=1e-12, atol=1e-14).y[0, -1])


def error(inertia: float, method: object, until: float = 2.0, lost: float = 1e-5) -> float:
    model, start = hoisted(inertia)
    run = fc.simulate(model, until=until, start=start, method=method, every=until)
    assert run.status is fc.Status.FINISHED
    assert run.report.energy_residual < lost
    return abs(float(run["sway"][-1]) - exact(inertia, until))


@pytest.mark.parametrize("inertia", [1.0, 1e2, 1e4, 1e6, 1e9, 1e12])
def test_a_load_sways_as_well_however_heavy_its_motor(inertia):
    """Taken in the middle of steps, a share h² of the drum's momentum would push the load: 5e-3 rad at 1e6."""
    coarse, fine = error(inertia, fc.ConservingMidpoint(0.04)), error(inertia, fc.ConservingMidpoint(0.02))
    assert fine < 5e-6
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("inertia", [1e2, 1e6, 1e9])
def test_extrapolated_it_has_two_orders_more(inertia):
    coarse, fine = (error(inertia, fc.Richardson(fc.ConservingMidpoint(h))) for h in (0.16, 0.08))
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)


def test_what_floats_keeps_its_momenta_whatever_a_motor_winds():
    """Two masses in space, the rope between them wound in: no force from outside."""
    one, two = fc.PointMass("one", (0, 0, 0), 1.0), fc.PointMass("two", (3.0, 0.4, 0.0), 2.0)
    winch = fc.Winch("winch", two.node, one.node, EA=1e9, radius=0.5, inertia=1e4)
    places = [fc.Position(f"{p.name}_{a}", p.node, a) for p in (one, two) for a in "xyz"]
    speeds = [fc.Velocity(f"v_{p.name}_{a}", p.node, a) for p in (one, two) for a in "xyz"]
    model = fc.assemble(fc.Structure([one, two], [], [winch], [], [*places, *speeds]), [fc.LargeRotation()])
    start = model.rest.with_(v=np.array([0.1, -0.5, 0.2, -0.3, 0.9, -0.4]))
    run = fc.simulate(model, until=3.0, start=start, method=fc.ConservingMidpoint(0.02))
    assert run.status is fc.Status.FINISHED
    x, v = run.y[:, :6].reshape(-1, 2, 3), run.y[:, 6:].reshape(-1, 2, 3)
    p = np.array([1.0, 2.0])[:, None] * v
    linear, angular = p.sum(axis=1), np.cross(x, p).sum(axis=1)
    assert np.abs(linear - linear[0]).max() < 1e-10
    assert np.abs(angular - angular[0]).max() < 1e-9
    assert np.ptp(x[:, 1, 0]) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [1e6, 1e7])
@pytest.mark.parametrize("step", [0.01, 0.005])
def test_damped_steps_do_not_lose_it_later(inertia, step):
    """Sways until the rope is short: with kept tangents a load went round, by 2.5 rad, and nothing said so."""
    assert error(inertia, fc.GeneralizedAlpha(step), until=16.0, lost=1e-4) < 2e-5
