"""D8: machines that stand on their heads: rates of falling, a controller that holds, and Kapitza's pendulum."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import lqr

PAGE = "hard"
G = 9.81
RATES = (0.51338126, 1.18886629, 1.89642447, 2.66094637, 3.55539039)
ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=0.0, rhoJ=0.0)


def standing(count: int = 5, drives: bool = False) -> fc.Model:
    """Equal masses on massless rods of a metre, one upon the other."""
    rods = [fc.Beam(f"rod{i}", (0, 0, i), (0, 0, i + 1), ROD) for i in range(count)]
    masses = [fc.PointMass(f"mass{i}", rod.end, 1.0) for i, rod in enumerate(rods)]
    joints = [fc.Support(rods[0].start, "u v w"), *(fc.Pin(a.end, b.start) for a, b in pairwise(rods))]
    joints += [fc.Pin(rod.end, mass.node) for rod, mass in zip(rods, masses, strict=True)]
    inputs = [fc.Torque("hip", rods[0].start, "y")] if drives else []
    outputs = [fc.Position("top", masses[-1].node, "x")]
    if drives:
        outputs = [fc.Rotation(f"lean{i}", rod.start, "y") for i, rod in enumerate(rods)]
        outputs += [fc.AngularVelocity(f"rate{i}", rod.start, "y") for i, rod in enumerate(rods)]
    structure = fc.Structure([*rods, *masses], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation(), fc.Gravity()])


def test_rates_of_falling(record):
    found = fc.linearize(standing()).modes()
    exact = np.sqrt(np.polynomial.laguerre.lagroots([0.0] * 5 + [1.0]))
    assert exact[[0, 1, 2, 4]] == pytest.approx([RATES[i] for i in (0, 1, 2, 4)], abs=5e-9)
    record(
        "D8 five masses standing: growth rates/√(g/l)",
        ours=np.sort(found.growth) / math.sqrt(G),
        reference=exact,
        source="roots of the Laguerre polynomial",
        tolerance=1e-8,
    )
    record(
        "D8 five masses standing: unstable poles",
        ours=found.unstable,
        reference=5,
        source="one a link",
        tolerance=Absolute(0),
    )


def test_it_falls_as_the_linear_model_says(record):
    """From 1e-5 rad of the lowest link until a link has leant by 1e-2 rad."""
    model = standing()
    linear = fc.linearize(model)
    modes = linear.modes()
    until = math.acosh(3e3) / float(modes.growth.max())
    q = np.zeros(model.n)
    q[0] = 1e-5
    run = fc.simulate(model, start=model.displace(q), until=until, tolerance=fc.Tolerance(1e-7, 1e-13))
    shapes, growth = modes.shapes, np.sqrt(-modes.omega_squared)
    exact = shapes @ (np.cosh(growth * until) * (shapes.T @ (linear.M @ q)))
    assert 5e-3 < np.abs(exact).max() < 2e-2
    record(
        "D8 five masses standing: angles when one has leant by 0.01 rad, less the linear model's, over their largest",
        ours=np.abs(run.final.q - exact).max() / np.abs(exact).max(),
        reference=0,
        source="cosh of the linear rates",
        tolerance=Absolute(0.01),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("count", "first"), [(2, 1e-2), (3, 1e-2), (5, 1e-5)])
def test_a_regulator_holds_it(record, count, first):
    """A torque at the foot from all angles and rates: the linear loop is stable, and so is the machine that leans.

    Five links have gains of 5000: what may lean without falling is that much less.
    """
    import control

    model = standing(count, drives=True)
    plant = fc.linearize(model).to_ss()
    regulator = lqr(plant, plant.C.T @ plant.C, np.eye(1))
    record(
        f"D8 {count} masses standing: poles of the regulated machine in the right half plane",
        ours=np.count_nonzero(regulator.poles.real >= 0.0),
        reference=0,
        source="optimal regulators are stable",
        tolerance=Absolute(0),
    )
    record(
        f"D8 {count} masses standing: residual of the Riccati equation",
        ours=regulator.residual,
        reference=0,
        source="CARE",
        tolerance=Absolute(1e-8),
    )
    gain = -regulator.gain @ np.linalg.inv(plant.C)
    law = control.ss([], [], [], gain, inputs=list(plant.output_labels), outputs=["hip"])
    lean = np.zeros(model.n)
    lean[0] = first
    slowest = -1.0 / regulator.poles.real.max()
    run = fc.simulate(
        model, law, start=model.displace(lean), until=12.0 * slowest, tolerance=fc.Tolerance(1e-6, 1e-7 * first)
    )
    leans = np.array([run[f"lean{i}"] for i in range(count)])
    record(
        f"D8 {count} masses standing: lean after 12 time constants of the regulator, from {first:g} rad, over that",
        ours=np.abs(leans[:, -1]).max() / first,
        reference=0,
        source="it comes back",
        tolerance=Absolute(1e-3),
    )
    exact = plant_motion(plant, regulator.gain, plant.C, leans[:, 0], run.t)
    record(
        f"D8 {count} masses standing: lean of the regulated machine less the linear model's, over the largest",
        ours=np.abs(leans - exact).max() / np.abs(exact).max(),
        reference=0,
        source="matrix exponential of A − B K",
        tolerance=Absolute(0.02),
    )


def plant_motion(plant, gain: np.ndarray, C: np.ndarray, leans: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Angles of the linear loop, let go from some at rest."""
    count = len(leans)
    A = C @ (plant.A - plant.B @ gain) @ np.linalg.inv(C)
    values, vectors = np.linalg.eig(A)
    shares = np.linalg.solve(vectors, np.concatenate([leans, np.zeros(count)]))
    return ((vectors * shares) @ np.exp(np.outer(values, t))).real[:count]


def kapitza(share: float) -> fc.Run:
    """A pendulum upright on a heavy pivot that vibrates up and down on a spring; share of the critical speed."""
    reach, heavy = 0.02, 1e9
    speed = share * math.sqrt(2.0 * G)
    rate = speed / reach
    pivot, bob = fc.PointMass("pivot", (0, 0, 0), heavy), fc.PointMass("bob", (0, 0, 1), 1.0)
    shaker = fc.Spring("shaker", (0, 0, -1), (0, 0, 0), stiffness=heavy * rate**2)
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, 1), ROD)
    structure = fc.Structure(
        [pivot, shaker, rod, bob],
        [
            fc.Support(shaker.start),
            fc.Pin(shaker.end, pivot.node),
            fc.Pin(pivot.node, rod.start),
            fc.Pin(rod.end, bob.node),
            fc.Support(pivot.node, "u v"),
        ],
        outputs=[fc.Rotation("lean", rod.start, "y")],
    )
    model = fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation(), fc.Gravity()])
    v = np.zeros(model.n)
    v[model.coordinate("pivot_0_w")] = speed
    start = model.displace({"rod_0_ry": 1e-3}).with_(v=v)
    return fc.simulate(model, start=start, until=6.0, method=fc.GeneralizedAlpha(2.0 * math.pi / rate / 60, rho=1.0))


@pytest.mark.slow
def test_kapitzas_pendulum(record):
    """Upright it is stable where a Ω > √(2 g l) = 4.42945 m/s: tried 5 % below and above, from 1 mrad."""
    below, above = (np.abs(kapitza(share)["lean"]) for share in (0.95, 1.05))
    record(
        "D8 Kapitza's pendulum: falls at −5 %, stands at +5 % of √(2 g l)",
        ours=[below.max() > 0.02, above.max() < 0.005],
        reference=[1, 1],
        source="averaged motion",
        tolerance=1e-12,
    )
