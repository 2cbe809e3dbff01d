"""B6, elastic pendulum: resonance two to one, and a stiff spring.

A point mass on a spring without mass. The reference is DOP853 at 1e-13 on the two equations of motion.
"""

from __future__ import annotations

from functools import cache

import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "dynamics"
SOURCE = "equations of motion by DOP853, 1e-13"
EXPLICIT, TIGHT = fc.Unchecked(fc.ExplicitRungeKutta()), fc.Tolerance(1e-10, 1e-10)
RESONANCE = {10: (0.1108781327, -1.0375867561), 20: (0.0541440255, -0.9285313402), 50: (-0.0362655572, -1.0656328355)}
STIFF = {1: (-0.9862907428, -0.1650463117), 5: (0.9423839197, -0.3345627589)}


@cache
def pendulum(stiffness: float, length: float, at: tuple[float, float]) -> fc.Model:
    spring = fc.Spring("spring", (0, 0, 0), (at[0], 0, at[1]), stiffness=stiffness, length=length)
    mass = fc.PointMass("mass", spring.end, 1.0)
    joints = [fc.Support(spring.start, "u v w"), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v")]
    outputs = [fc.Position(axis, mass.node, axis) for axis in "xz"]
    return fc.assemble(fc.Structure([spring, mass], joints, outputs=outputs), [fc.Gravity(), fc.LargeRotation()])


def places(run: fc.Run, times) -> list[float]:
    return [run.at(t)[axis] for t in times for axis in "xz"]


def numbers(reference: dict[int, tuple[float, float]]) -> list[float]:
    return [value for pair in reference.values() for value in pair]


def test_resonance(record):
    run = fc.simulate(pendulum(39.24, 0.75, (0.04, -1.08)), until=50.0, method=EXPLICIT, tolerance=TIGHT)
    record(
        "B6 resonance, x and z at 10, 20, 50 s",
        ours=places(run, RESONANCE),
        reference=numbers(RESONANCE),
        source=SOURCE,
        tolerance=Absolute(1e-8),
    )
    assert run.report.energy_residual < 1e-7


@pytest.mark.slow
def test_stiff_spring(record):
    run = fc.simulate(pendulum(1e6, 1.0, (1.0, 0.0)), until=5.0, method=EXPLICIT, tolerance=fc.Tolerance(1e-8, 1e-8))
    record(
        "B6 stiff, explicit, x and z at 1, 5 s",
        ours=places(run, STIFF),
        reference=numbers(STIFF),
        source=SOURCE,
        tolerance=Absolute(1e-8),
    )


def test_stiff_spring_with_steps_that_do_not_resolve_it(record):
    """Steps of 2 ms: a third of the spring's period."""
    run = fc.simulate(pendulum(1e6, 1.0, (1.0, 0.0)), until=5.0, method=fc.GeneralizedAlpha(2e-3))
    record(
        "B6 stiff, generalised alpha of 2 ms, x and z at 1, 5 s",
        ours=places(run, STIFF),
        reference=numbers(STIFF),
        source=SOURCE,
        tolerance=Absolute(1e-3),
    )
