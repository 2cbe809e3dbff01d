"""What is light is not massless: neither units nor heavy parts elsewhere make a freedom settle at once."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc

METHODS = {"alpha": fc.GeneralizedAlpha(2e-3), "adaptive": fc.AdaptiveAlpha(), "midpoint": fc.ConservingMidpoint(2e-3)}
BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}


def _beam_on_a_motor(length: float, mass: float, backend: str) -> fc.Model:
    force = mass * length
    bent, heavy = force * length**2, mass / length
    section = fc.Section(1e5 * force, 40 * bent, 40 * bent, 30 * bent, 0.8 * heavy, 1e-3 * mass * length)
    beam = fc.Beam("beam", (0, 0, 0), (1.5 * length, 0, 0), section, elements=2)
    drive = fc.RotaryDrive(
        "motor", beam.start, axis="y", stiffness=0.4 * force * length, ratio=30.0, inertia=1e-3 * mass * length**2
    )
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start, "u v w rx rz")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Position("z", beam.end, "z"), fc.DriveAngle("angle", drive)],
    )
    effects = [fc.LargeRotation(), fc.Flexible(), fc.Gravity((0, 0, -9.81 * length))]
    return fc.assemble(structure, effects, BACKENDS[backend])


@cache
def _swung(length: float, mass: float, name: str, backend: str = "compiled") -> tuple[np.ndarray, tuple[int, int]]:
    torque = {"torque": -0.2 * mass * length**2}
    model = _beam_on_a_motor(length, mass, backend)
    run = fc.simulate(model, until=0.1, every=0.05, inputs=torque, method=METHODS[name])
    assert run.status is fc.Status.FINISHED
    assert not run.report.notes
    return run.y / [length, 1.0], (run.report.steps, run.report.newton_iterations)


@pytest.mark.parametrize(("length", "mass"), [(1e-6, 1.0), (1e-4, 1.0), (1e6, 1.0), (1e-6, 1e-12), (1e6, 1e9)])
@pytest.mark.parametrize("name", ["alpha", "adaptive"])
def test_units_do_not_matter(name, length, mass):
    (one, counts), (other, same) = _swung(1.0, 1.0, name), _swung(length, mass, name)
    assert other == pytest.approx(one, abs=1e-12)
    assert same == counts


@pytest.mark.parametrize(("name", "backend"), [("midpoint", "compiled"), ("alpha", "plain")])
def test_nor_do_they_in_plain_steps(name, backend):
    (one, _), (other, _) = _swung(1.0, 1.0, name, backend), _swung(1e-6, 1.0, name, backend)
    assert other == pytest.approx(one, abs=1e-10)


def _pushed(light: float, backend: str) -> fc.Model:
    """1e6 kg on rollers, and beside it a light mass on a spring to the ground: 10 rad/s."""
    heavy, mass = fc.PointMass("heavy", (0, 0, 0), 1e6), fc.PointMass("light", (1, 0, 0), light)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0 * light)
    joints = [fc.Pin(heavy.node, spring.start), fc.Pin(spring.end, mass.node)]
    held = [fc.Support(body.node, "v w") for body in (heavy, mass)]
    push, place = fc.Force("push", mass.node, "x"), fc.Position("x", mass.node, "x")
    structure = fc.Structure([heavy, spring, mass], [*joints, *held], inputs=[push], outputs=[place])
    return fc.assemble(structure, [fc.LargeRotation()], BACKENDS[backend])


@pytest.mark.parametrize("light", [1e-7, 1e-9, 1e-15])
@pytest.mark.parametrize(("name", "backend"), [("adaptive", "compiled"), ("midpoint", "compiled"), ("alpha", "plain")])
def test_a_light_mass_swings_beside_a_heavy_one(name, backend, light):
    """x = F/k (1 − cos 10 t)."""
    inputs = {"push": 0.1 * 100.0 * light}
    run = fc.simulate(_pushed(light, backend), until=1.0, every=0.1, inputs=inputs, method=METHODS[name])
    assert run["x"] == pytest.approx(1.1 - 0.1 * np.cos(10.0 * run.t), abs=1.5e-3)
    assert run.report.energy_residual < 1e-4
    assert not run.report.notes
