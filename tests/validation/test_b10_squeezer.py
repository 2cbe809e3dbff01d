"""B10, A03: Andrews' squeezing mechanism: seven rigid bodies, three loops, one freedom (IVP Test Set).

Data and angles are those of Hairer & Wanner: β of the crank, β + θ of its rod, γ of the body on the spring, and two
pairs that meet the rod at the same pin: δ with φ + δ, and ε with Ω + ε. A motor turns the crank with 0.033 N m from
rest: two and a half turns in 30 ms.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "dynamics"
SOURCE = "IVP Test Set, index-3 equations by PSIDE"
OMEGA, EPSILON = -0.222668390165886, 1.23054744454982
START = (-0.0617138900142764, 0.0, 0.455279819163070, 0.222668390165886, 0.487364979543843, OMEGA, EPSILON)
END = (
    *(15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304),
    *(0.5347301163226948, 1.048080741042263),
)
A, B, C = np.array([-0.06934, -0.00227]), np.array([-0.03635, 0.03273]), np.array([0.014, 0.072])


def body(
    name: str, pivot: np.ndarray, out: np.ndarray, mass: float, inertia: float, **points: np.ndarray
) -> fc.RigidBody:
    """A body with its centre of mass at ``out`` from its pivot, and points from there too."""
    centre = pivot + out
    named = {key: (*(pivot + arm), 0.0) for key, arm in {"pivot": np.zeros(2), **points}.items()}
    return fc.RigidBody(name, (*centre, 0.0), mass, (inertia,) * 3, points=named)


def along(angle: float, length: float) -> np.ndarray:
    return length * np.array([np.cos(angle), np.sin(angle)])


def across(angle: float, length: float) -> np.ndarray:
    return length * np.array([np.sin(angle), -np.cos(angle)])


def squeezer() -> fc.Model:
    beta, theta, gamma, phi, delta, omega, eps = START
    origin = np.zeros(2)
    crank_end = along(beta, 7e-3)
    swing = np.array([2.308e-2, 9.16e-3]), np.array([1.228e-2, 4.49e-3])
    parts = [
        body("crank", origin, along(beta, 9.2e-4), 0.04325, 2.194e-6, end=crank_end),
        body("rod", crank_end, -along(beta + theta, 1.15e-2), 0.00365, 4.410e-7, end=-along(beta + theta, 2.8e-2)),
        body(
            "sprung",
            B,
            np.array([1.874e-2, 1.043e-2]),
            0.02373,
            5.255e-6,
            end=across(gamma, 3.5e-2),
            spring=along(gamma, 2e-2) + across(gamma, 1.8e-2),
        ),
        body(
            "upper",
            A + along(delta, 4e-2),
            across(phi + delta, 2e-2 - 1.421e-2),
            0.00706,
            5.667e-7,
            end=across(phi + delta, 2e-2),
        ),
        body("left", A, swing[0], 0.07050, 1.169e-5, end=along(delta, 4e-2)),
        body(
            "lower",
            A + across(eps, 4e-2),
            along(omega + eps, 2e-2 - 1.421e-2),
            0.00706,
            5.667e-7,
            end=along(omega + eps, 2e-2),
        ),
        body("right", A, swing[1], 0.05498, 1.912e-5, end=across(eps, 4e-2)),
    ]
    crank, rod, sprung, upper, left, lower, right = parts
    spring = fc.Spring("spring", (*C, 0.0), sprung.points["spring"], stiffness=4530.0, length=0.07785)
    joints = [fc.Support(part.point("pivot"), "u v w") for part in (crank, sprung, left, right)]
    joints += [fc.Pin(crank.point("end"), rod.point("pivot"))]
    joints += [fc.Pin(rod.point("end"), part.point("end")) for part in (sprung, upper, lower)]
    joints += [fc.Pin(left.point("end"), upper.point("pivot")), fc.Pin(right.point("end"), lower.point("pivot"))]
    joints += [fc.Support(spring.start), fc.Pin(sprung.point("spring"), spring.end)]
    structure = fc.Structure(
        [*parts, spring],
        joints,
        inputs=[fc.Torque("motor", crank.node, "z")],
        outputs=[fc.Rotation(part.name, part.node, "z") for part in parts],
    )
    return fc.assemble(fc.planar(structure, "z"), [fc.LargeRotation()])


@pytest.mark.slow
def test_angles(record):
    model = squeezer()
    assert model.n == 1
    run = fc.simulate(
        model,
        until=0.03,
        inputs={"motor": 0.033},
        method=fc.ExplicitRungeKutta(),
        tolerance=fc.Tolerance(1e-11, 1e-12),
    )
    crank, rod, sprung, upper, left, lower, right = (run[name][-1] for name in model.outputs)
    turned = np.array([crank, rod - crank, sprung, upper - left, left, lower - right, right])
    record(
        "B10 Andrews' squeezer: β, θ, γ, φ, δ, Ω, ε after 30 ms [rad]",
        ours=np.array(START) + turned,
        reference=END,
        source=SOURCE,
        tolerance=Absolute(1e-6),
    )
    record(
        "B10 Andrews' squeezer: energy lost or made",
        ours=run.report.energy_residual,
        reference=0,
        source="work of the motor and of the spring",
        tolerance=Absolute(1e-8),
    )
    record(
        "B10 Andrews' squeezer: loops open by [rad, or shares of what they span]",
        ours=run.report.closure_error,
        reference=0,
        source="conditions of the loops",
        tolerance=Absolute(1e-12),
    )
