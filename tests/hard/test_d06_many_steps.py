"""D6: a hundred thousand steps: no drift of energy, phase or joints.

A double pendulum from (0.5, 0.5) rad and an oscillator, under steps without numerical damping (ρ = 1: the trapezoidal
rule on linear machines). A drift of the energy is what Newton's method leaves over, not the steps: the runs ask for it
to be small.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
COUNT = 100_000


def pendulum() -> fc.Model:
    middle = np.array([np.sin(0.5), 0.0, -np.cos(0.5)])
    ropes = [fc.Rope("upper", (0, 0, 0), middle, EA=1.0), fc.Rope("lower", middle, 2 * middle, EA=1.0)]
    masses = [fc.PointMass(f"mass{i}", rope.end, 1.0) for i, rope in enumerate(ropes)]
    joints = [fc.Support(ropes[0].start, "u v w"), fc.Pin(ropes[0].end, ropes[1].start)]
    joints += [fc.Pin(rope.end, mass.node) for rope, mass in zip(ropes, masses, strict=True)]
    outputs = [fc.Position(f"{axis}{i}", m.node, axis) for i, m in enumerate(masses) for axis in "xyz"]
    outputs += [fc.Velocity(f"v{axis}{i}", m.node, axis) for i, m in enumerate(masses) for axis in "xyz"]
    structure = fc.Structure([*ropes, *masses], joints, outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.slow
def test_double_pendulum(record):
    method, tight = fc.GeneralizedAlpha(1e-3, rho=1.0), fc.Tolerance(absolute=1e-10)
    run = fc.simulate(pendulum(), until=1e-3 * COUNT, method=method, tolerance=tight)
    assert run.report.steps == COUNT
    x, v = (np.array([[run[f"{k}{axis}{i}"] for axis in "xyz"] for i in (0, 1)]) for k in ("", "v"))
    energy = 0.5 * (v**2).sum(axis=(0, 1)) + 9.81 * x[:, 2].sum(axis=0)
    scale = abs(energy[0])
    record(
        "D6 double pendulum, 10⁵ steps of 1 ms: slope of the energy over E [1/s]",
        ours=np.polyfit(run.t, energy / scale, 1)[0],
        reference=0,
        source="constant",
        tolerance=Absolute(1e-9),
    )
    record(
        "D6 double pendulum, 10⁵ steps of 1 ms: largest change of the energy over E",
        ours=np.abs(energy - energy[0]).max() / scale,
        reference=0,
        source="constant",
        tolerance=Absolute(1e-5),
    )
    links = np.array([np.linalg.norm(x[0], axis=0), np.linalg.norm(x[1] - x[0], axis=0)])
    record(
        "D6 double pendulum, 10⁵ steps of 1 ms: change of the links' lengths [m]",
        ours=np.abs(links - 1).max(),
        reference=0,
        source="they are rigid",
        tolerance=Absolute(1e-10),
    )


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.1, 0.5, 1.0])
def test_oscillator(record, x):
    """Steps of x = ω h: no damping, and the frequency (2/x) atan(x/2) of the trapezoidal rule, no other."""
    spring, mass = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=1.0), fc.PointMass("mass", (0, 0, 0), 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    start = model.displace({model.coordinates[0]: 0.01})
    run = fc.simulate(model, start=start, until=COUNT * x, method=fc.GeneralizedAlpha(x, rho=1.0))
    assert run.report.steps == COUNT
    size = np.hypot(run["x"], run["v"])
    record(
        f"D6 oscillator, ω h = {x:g}, 10⁵ steps: change of the amplitude",
        ours=size[-1] / size[0] - 1,
        reference=0,
        source="trapezoidal rule",
        tolerance=Absolute(1e-10),
    )
    phase = np.unwrap(-np.arctan2(run["v"], run["x"]))
    record(
        f"D6 oscillator, ω h = {x:g}, 10⁵ steps: phase per ω t",
        ours=phase[-1] / (COUNT * x),
        reference=2.0 / x * np.arctan(x / 2),
        source="(2/x) atan(x/2)",
        tolerance=1e-9,
    )
