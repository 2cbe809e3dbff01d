"""A loaded flexible machine that rests: its accelerations are what the rounding of its forces moves its masses by.

Each of its forces is large and their sum is their last digits. Explicit and conserving steps ask for accelerations
there all the time: of those as well, rows between steps and the energy that dampers take are made.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Sampled, pd
from flexctrl.dynamics.methods.masses import Masses
from flexctrl.dynamics.steps import Counts
from flexctrl.model.momenta import inertia, momenta_of

UNITS = {"SI": (1.0, 1.0, 1.0), "mm": (1e3, 1e-3, 1.0), "micro": (1e6, 1e9, 1e3), "km": (1e-3, 1e-6, 1.0)}
"""Numbers of a metre, a kilogram and a second: in mm, t, s; in µm, µg, ms; in km, Gg, s."""


def jib(units: tuple[float, float, float] = UNITS["SI"], damping: float = 20.0) -> fc.Model:
    """A driven jib from whose end a load of 2 kg hangs on a rope."""
    m, kg, s = units
    force = kg * m / s**2
    bent, heavy = 300.0 * force * m**2, 1.5 * kg / m
    section = fc.Section(2e6 * force, bent, bent, 0.7 * bent, heavy, 2e-3 * kg * m)
    beam = fc.Beam("beam", (0, 0, 0), (1.5 * m, 0, 0), section, elements=2)
    load = fc.PointMass("load", (1.5 * m, 0, -0.8 * m), 2.0 * kg)
    rope = fc.Rope("rope", beam.end, load.node, EA=4e4 * force, damping=damping * force * s / m)
    drive = fc.RotaryDrive(
        "drive",
        beam.start,
        axis="z",
        stiffness=0.2 * force * m,
        ratio=50,
        inertia=3e-4 * kg * m**2,
        damping=2e-4 * force * m * s,
    )
    structure = fc.Structure(
        [beam, load, rope],
        [fc.Support(beam.start, "u v w rx ry"), fc.Pin(rope.start, beam.end), fc.Pin(rope.end, load.node)],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive), fc.Tension("tension", rope)],
    )
    return fc.assemble(structure, [fc.Gravity((0, 0, -9.81 * m / s**2)), fc.LargeRotation(), fc.Flexible()])


def resting(model: fc.Model) -> fc.State:
    return fc.equilibrium(model, hold={"drive_source": 0.0}).state


def mass(model: fc.Model, state: fc.State) -> np.ndarray:
    still = np.zeros(model.n)
    return -model.slope(state, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs))).toarray()


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_accelerations_are_those_of_what_is_left_of_the_forces(units):
    """M a = f, solved at once: what rounding leaves of f is no more than some last digits of the forces at work."""
    model, rng = jib(units), np.random.default_rng(3)
    rest, u, still = resting(model), np.zeros(len(model.inputs)), np.zeros(model.n)
    masses, second = Masses(model, Counts()), units[2]
    masses.make(model.rest)
    largest = 0.0
    for _ in range(300):
        state = model.advance(rest, 1e-15 * rng.standard_normal(model.n), still, 0.0)
        guess = 1e-9 / second**2 * rng.standard_normal(model.n)
        exact = np.linalg.solve(mass(model, state), model.balance(state, still, still))
        off = (masses.accelerations(state, u, guess) - exact) * masses._weight * second**2
        largest = max(largest, float(np.abs(off).max()))
    assert largest < 1e-10


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_masses_times_however_small_accelerations_are_free_of_forces(units):
    model, rng = jib(units), np.random.default_rng(4)
    state = model.advance(resting(model), 0.01 * rng.standard_normal(model.n), np.zeros(model.n), 0.0)
    M = mass(model, state)
    for size in (0.0, 1e-200, 1e-15, 1.0, 1e15):
        a = size * rng.standard_normal(model.n)
        np.testing.assert_array_less(np.abs(inertia(model, state, a) - M @ a), 1e-13 * (abs(M) @ abs(a)) + 1e-290)


def test_momenta_of_small_motion_are_free_of_forces():
    """M v, whatever the springs of a stretched machine make of last digits beside it."""
    tube = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), tube, elements=3)
    model = fc.assemble(fc.Structure([beam], [fc.Support(beam.start)]), [fc.Flexible()])
    rng = np.random.default_rng(5)
    state, v, M = model.displace(rng.standard_normal(model.n)), 1e-9 * rng.standard_normal(model.n), model.mass()
    off = np.abs(momenta_of(model).of(state, v) - M @ v)
    assert (off <= 1e-13 * (abs(M) @ np.abs(v))).all()


@pytest.mark.parametrize("period", [0.006, 0.007, 0.008])
def test_a_loop_at_rest_hangs_still_between_its_steps(period):
    """The tension is m g in every row, and nothing moves that a damper could take energy from."""
    model = jib()
    law = Sampled(pd(0.05, 0.008, measured="angle", rate="speed", command="torque"), period)
    start, method = resting(model), fc.Unchecked(fc.ExplicitRungeKutta())
    run = fc.simulate(model, law, until=0.03, start=start, method=method, every=0.0005)
    assert run.status is fc.Status.FINISHED
    np.testing.assert_allclose(run["tension"], 2.0 * 9.81, rtol=1e-3)
    assert abs(run.report.energy.dissipated) < 1e-6
