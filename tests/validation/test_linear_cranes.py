"""Cranes, drives and pendulums on carts.

Transfer functions of assembled machines against those written down by hand: the overhead crane with its poles and
zeros, flexible joints, massless source angles, carts with inverted pendulums.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from geared import linear, turntable
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import lqr

PAGE = "linear"
G = 9.81
RIGID = [fc.LargeRotation(), fc.Gravity()]


# -- overhead crane

CRANES = {
    "3DCrane, rail axis": (3.355, 1.0, 0.5, 5.046582, 4.429447),
    "3DCrane, cart axis": (1.155, 1.0, 0.5, 6.050373, 4.429447),
    "STS quay crane, 65 t": (59008.0, 65000.0, 25.0, 0.908100, 0.626418),
    "STS quay crane, 15 t": (59008.0, 15000.0, 25.0, 0.701533, 0.626418),
    "32 t bridge crane, 10 m": (11000.0, 32000.0, 10.0, 1.958269, 0.990454),
}


def crane(trolley: float, load: float, length: float, more: Sequence[fc.Effect] = ()) -> fc.LinearModel:
    """A trolley on a straight rail and a load on a rope that does not stretch; a force pushes the trolley."""
    cart = fc.PointMass("trolley", (0, 0, 0), trolley)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -length), EA=1.0)
    body = fc.PointMass("load", rope.end, load)
    outputs = [fc.Position("x", cart.node, "x"), fc.SwayAngle("sway", cart.node, body.node, "x")]
    structure = fc.Structure(
        [cart, rope, body],
        [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, body.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=outputs,
    )
    return linear(fc.planar(structure, "y"), [*RIGID, *more])


@pytest.mark.parametrize("name", CRANES)
def test_overhead_crane(record, name):
    M, m, l, pole, zero = CRANES[name]
    model = crane(M, m, l)
    found = np.abs(model.damped_poles())[-1]
    record(
        f"{name}: pole of force → position [rad/s]",
        ours=found,
        reference=pole,
        source="√((M + m)g/(Ml))",
        tolerance=1e-6,
    )
    zeros = fc.zeros(model, ["push"], ["x"])
    record(
        f"{name}: zero of force → position [rad/s]",
        ours=abs(zeros.finite[0]),
        reference=zero,
        source="√(g/l)",
        tolerance=1e-6,
    )
    integrators = np.count_nonzero(model.damped_poles() == 0.0)
    record(
        f"{name}: poles exactly at 0", ours=integrators, reference=2, source="the free trolley", tolerance=Absolute(0)
    )


@pytest.mark.parametrize("name", CRANES)
def test_transfer_functions_of_the_overhead_crane(record, name):
    M, m, l, pole, _ = CRANES[name]
    omega = pole * np.array([0.05, 0.4, 0.99, 1.3, 20.0])
    position, sway = crane(M, m, l).frequency_response(omega).values[:, 0]
    s2 = -(omega**2)
    exact = (l * s2 + G) / (s2 * (M * l * s2 + (M + m) * G))
    worst = np.abs(position / exact - 1).max()
    record(
        f"{name}: force → position at five frequencies, relative error",
        ours=worst,
        reference=0,
        source="(l s² + g)/(s²(M l s² + (M + m) g))",
        tolerance=Absolute(1e-9),
    )
    worst = np.abs(sway / (-1 / (M * l * s2 + (M + m) * G)) - 1).max()
    record(f"{name}: force → sway", ours=worst, reference=0, source="−1/(M l s² + (M + m) g)", tolerance=Absolute(1e-9))
    worst = np.abs(sway / (s2 * position) / (-1 / (l * s2 + G)) - 1).max()
    record(
        f"{name}: trolley acceleration → sway",
        ours=worst,
        reference=0,
        source="−1/(l s² + g)",
        tolerance=Absolute(1e-9),
    )


def test_design_copes_with_two_poles_at_zero(record):
    model = crane(3.355, 1.0, 0.5)
    plant = model.to_ss()
    regulator = lqr(plant, np.eye(4), np.eye(1))
    record(
        "crane with free trolley: residual of the Riccati equation",
        ours=regulator.residual,
        reference=0,
        source="CARE",
        tolerance=Absolute(1e-8),
    )
    assert regulator.poles.real.max() < 0.0
    record(
        "crane with free trolley: 1/H∞ norm",
        ours=1 / fc.peak_gain(model).value,
        reference=0,
        source="poles on the imaginary axis",
        tolerance=Absolute(0),
    )
    reduced = crane(3.355, 1.0, 0.5, [fc.RayleighDamping(alpha=0.5)]).reduce(fc.BalancedTruncation(3))
    record(
        "crane with friction: integrators that balanced truncation keeps",
        ours=np.count_nonzero(reduced.damped_poles() == 0.0),
        reference=1,
        source="the free trolley",
        tolerance=Absolute(0),
    )


# -- double pendulums and carts


@pytest.mark.parametrize(
    ("upper", "lower", "ratio", "roots"),
    [
        (1.0, 1.0, 1.0, (2.39719940, 5.78735130)),
        (2.0, 1.0, 0.5, (1.99799401, 4.25211947)),
        (6.0, 2.0, 10.0, (1.11709286, 8.40785963)),
        (10.0, 1.5, 5.0, (0.93263560, 6.65253266)),
        (20.0, 4.0, 50.0, (0.64021032, 12.23450574)),
        (2.3, 1.3, 0.5 / 1.2, (1.85115896, 3.64773717)),
    ],
)
def test_double_pendulum_crane(record, upper, lower, ratio, roots):
    """Hook and payload; the last as in mboct-fem-pkg, 1.2 and 0.5 kg."""
    first = fc.Rope("upper", (0, 0, 0), (0, 0, -upper), EA=1.0)
    hook = fc.PointMass("hook", first.end, 1.0)
    second = fc.Rope("lower", first.end, (0, 0, -upper - lower), EA=1.0)
    payload = fc.PointMass("payload", second.end, ratio)
    joints = [fc.Support(first.start), fc.Pin(first.end, hook.node), fc.Pin(hook.node, second.start)]
    joints.append(fc.Pin(second.end, payload.node))
    found = linear(fc.planar(fc.Structure([first, hook, second, payload], joints), "y"), RIGID).modes().omega
    case = f"double pendulum, L₁ = {upper:g}, L₂ = {lower:g}, R = {ratio:.4g}: ω₁, ω₂"
    record(case, ours=found, reference=roots, source="closed form (Singhose): 2 × 2 eigenproblem", tolerance=1e-8)


def test_cart_with_two_inverted_pendulums(record):
    """Cart 0.6 kg, two rods of 0.2 kg and 0.5 m end on end, g = 9.80665 (do-mpc's example)."""
    g, m0, m, l = 9.80665, 0.6, 0.2, 0.25
    J = m * l**2 / 3
    cart = fc.PointMass("cart", (0, 0, 0), m0)
    rods = [
        fc.RigidBody(
            f"rod_{i}", (0, 0, l + 2 * l * i), m, (J, J, 0), {"low": (0, 0, 2 * l * i), "high": (0, 0, 2 * l * (i + 1))}
        )
        for i in range(2)
    ]
    joints = [
        fc.Support(cart.node, "v w"),
        fc.Pin(cart.node, rods[0].point("low")),
        fc.Pin(rods[0].point("high"), rods[1].point("low")),
    ]
    model = linear(fc.planar(fc.Structure([cart, *rods], joints), "y"), [fc.LargeRotation(), fc.Gravity((0, 0, -g))])
    found = np.sort(model.modes().growth)[::-1][:2]
    # x and both angles; the centres lie at l and 2l + l of the turning rods
    M = np.array(
        [
            [m0 + 2 * m, 3 * m * l, m * l],
            [3 * m * l, J + 5 * m * l**2, 2 * m * l**2],
            [m * l, 2 * m * l**2, J + m * l**2],
        ]
    )
    K = -m * g * l * np.diag([0.0, 3.0, 1.0])
    rates = np.sort(np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(M, K)))))[::-1][:2]
    record(
        "cart with two inverted rods: growth rates [1/s]",
        ours=found,
        reference=rates,
        source="Lagrange's equations by hand",
        tolerance=1e-9,
    )


# -- drives


def test_flexible_joint(record):
    """Ks = 1.61 N m/rad, hub 0.0021 and link 0.0059 kg m²."""
    drive = {"stiffness": 1.61, "inertia": 0.0021}
    free, locked = turntable(0.0059, drive).modes(), turntable(0.0059, drive, motor_source=0.0).modes()
    record(
        "flexible joint, hub locked: ω [rad/s]",
        ours=locked.omega,
        reference=[16.519121],
        source="√(Ks/Jl)",
        tolerance=1e-6,
    )
    record(
        "flexible joint, hub free: ω [rad/s]",
        ours=free.omega[1],
        reference=32.242023,
        source="√(Ks(1/Jl + 1/Jh))",
        tolerance=1e-6,
    )


def test_flexible_joint_under_gravity(record):
    """Spong's benchmark: I = J = 1, k = 100, mgl = 10, the link hanging."""
    mass, I, J, k, mgl = 2.0, 1.0, 1.0, 100.0, 10.0
    l = mgl / (mass * G)
    own = I - mass * l**2
    link = fc.RigidBody("link", (0, 0, -l), mass, (own, own, own), {"hub": (0, 0, 0)})
    motor = fc.RotaryDrive("motor", link.point("hub"), axis="y", stiffness=k, inertia=J)
    structure = fc.Structure([link], [fc.Support(link.point("hub"), "u v w rx rz")], [motor])
    found = linear(structure, [*RIGID, fc.Flexible()]).modes().omega_squared
    mean, half = (k + mgl) / (2 * I) + k / (2 * J), (k + mgl) / (2 * I) - k / (2 * J)
    root = math.sqrt(half**2 + k * k / (I * J))
    record(
        "flexible joint with a hanging link: ω²",
        ours=found,
        reference=[mean - root, mean + root],
        source="characteristic equation",
        tolerance=1e-10,
    )


# -- massless freedoms


def test_massless_source_angle(record):
    model = turntable(5.0, {"stiffness": 1000.0})
    modes = model.modes()
    record(
        "drive without motor inertia: infinite eigenvalues, rigid modes, modes",
        ours=[modes.massless, modes.rigid, len(modes)],
        reference=[1, 1, 1],
        source="M = diag(0, 5)",
        tolerance=Absolute(0),
    )
    response = turntable(5.0, {"stiffness": 1000.0}).frequency_response([1e-3, 1.0, 1e3]).values[:, 0]
    s2 = -(np.array([1e-3, 1.0, 1e3]) ** 2)
    worst = np.abs(response / np.array([1 / (5 * s2) + 1e-3, 1 / (5 * s2)]) - 1).max()
    record(
        "drive without motor inertia: torque → angles, relative error",
        ours=worst,
        reference=0,
        source="1/(J s²) + 1/k, 1/(J s²)",
        tolerance=Absolute(1e-10),
    )


def test_massless_node_between_springs(record):
    """A massless shaft end held by 500 N m/rad, joined to 5 kg m² by 1000 N m/rad."""

    def shaft(name: str, at: float, stiffness: float) -> fc.Beam:
        section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=stiffness, rhoA=0.0, rhoJ=0.0)
        return fc.Beam(name, (at, 0, 0), (at + 1, 0, 0), section)

    left, right = shaft("left", 0, 500.0), shaft("right", 1, 1000.0)
    wheel = fc.RigidBody("wheel", (2, 0, 0), 1.0, (5.0, 5.0, 5.0))
    joints = [fc.Support(left.start), fc.Weld(left.end, right.start), fc.Weld(right.end, wheel.node)]
    joints += [fc.Support(left.end, "u v w ry rz"), fc.Support(wheel.node, "u v w ry rz")]
    structure = fc.Structure(
        [left, right, wheel],
        joints,
        inputs=[fc.Torque("torque", left.end, "x")],
        outputs=[fc.Rotation("turn", left.end, "x")],
    )
    model = linear(structure, [fc.LargeRotation(), fc.Flexible()])
    modes = model.modes()
    record(
        "massless node between springs: ω [rad/s]",
        ours=modes.omega,
        reference=[8.164965809],
        source="√(k₁k₂/(k₁ + k₂)/J)",
        tolerance=1e-10,
    )
    response = model.frequency_response([1e-9, 1e9]).values[0, 0].real
    record(
        "massless node between springs: response to torque, slow and fast",
        ours=response,
        reference=[1 / 500, 1 / 1500],
        source="1/k₁, 1/(k₁ + k₂)",
        tolerance=1e-10,
    )
