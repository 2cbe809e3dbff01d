"""ω² that span 1e20 to 1e30, of motors on one joint, against the roots of their secular equation in 80 digits."""

import decimal
import itertools

import numpy as np
import pytest

import flexctrl as fc

LENGTH, MASS, GRAVITY = 1.0, 1.0, 9.81
WEIGHT, INERTIA = 0.5 * MASS * GRAVITY * LENGTH, MASS * LENGTH**2 / 3.0


def arm(side, stiffness, ratios, inertias):
    """A rod that hangs (side -1) or stands on the joint, with free motors beside each other."""
    own = MASS * LENGTH**2 / 12.0
    body = fc.RigidBody("arm", (0.0, 0.5 * side * LENGTH, 0.0), MASS, (own, own, own), points={"p": (0.0, 0.0, 0.0)})
    joint = body.point("p")
    drives = [
        fc.RotaryDrive(f"m{i}", joint, axis="z", stiffness=k / R**2, ratio=R, inertia=J / R**2)
        for i, (k, R, J) in enumerate(zip(stiffness, ratios, inertias, strict=True))
    ]
    torques = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives)]
    structure = fc.Structure([body], [fc.Support(joint, "u v w rx ry")], drives, inputs=torques)
    effects = [fc.Gravity((0.0, -GRAVITY, 0.0)), fc.LargeRotation(), fc.ShaftElasticity()]
    return fc.assemble(structure, effects)


def secular_roots(side, stiffness, inertias):
    """λ with G − λ (I + Σ kᵢ Jᵢ / (kᵢ − λ Jᵢ)) = 0: one under the least pole kᵢ/Jᵢ, between any two, and over all."""
    with decimal.localcontext(prec=80):
        number = decimal.Decimal
        G, inertia = -side * number(WEIGHT), number(INERTIA)
        pairs = [(number(k), number(J)) for k, J in zip(stiffness, inertias, strict=True)]
        poles = sorted(k / J for k, J in pairs)

        def over(x):
            return G - x * (inertia + sum(k * J / (k - x * J) for k, J in pairs)) < 0

        far = (abs(G) + sum(k for k, _ in pairs)) * (1 / inertia + sum(1 / J for _, J in pairs))
        edges = [-2 * abs(G) / inertia, *poles, 2 * far]
        roots = []
        for low, high in itertools.pairwise(edges):
            size = number(0)
            for _ in range(240):  # from many powers of ten, then to the last digit
                size = (low + high) / 2
                low, high = (low, size) if over(size) else (size, high)
            roots.append(float(size))
        return np.array(roots)


def misses(side, stiffness, ratios, inertias):
    model = arm(side, stiffness, ratios, inertias)
    found = np.sort(fc.linearize(model, at=fc.equilibrium(model)).modes().omega_squared)
    known = secular_roots(side, stiffness, inertias)
    assert len(found) == len(known)
    return np.abs(found / known - 1.0).max()


@pytest.mark.parametrize("side", [-1, 1])
def test_modes_about_the_middle_are_no_rounding_of_either_end(side):
    """The middle one, 2.9e10 of 7e-3 to 1.5e22, was 5e-5 off."""
    stiffness, inertias = np.array([1e12, 1e1, 1e21]) * WEIGHT, np.array([1e3, 1.0, 1e3]) * INERTIA
    assert misses(side, stiffness, [-1.0, 0.2, 10.0], inertias) < 1e-10


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("stiffness", [1e22, 1e24, 1e26, 1e28])
def test_a_slow_swing_of_a_heavy_motor_is_no_free_motion(side, stiffness):
    """Of 1e-4 (rad/s)² beside 1e26 it was half as much again, or 0."""
    assert misses(side, [stiffness * WEIGHT], [1000.0], [1e5 * INERTIA]) < 1e-10


@pytest.mark.parametrize("seed", range(12))
def test_motors_of_all_kinds_on_one_joint(seed):
    rng = np.random.default_rng(seed)
    count, side = int(rng.integers(1, 4)), int(rng.choice([-1, 1]))
    stiffness, inertias = 10.0 ** rng.uniform(-1.0, 24.0, count), 10.0 ** rng.uniform(-6.0, 6.0, count)
    ratios = rng.choice([1.0, -1.0, 10.0, 0.2, 1000.0], count)
    assert misses(side, stiffness * WEIGHT, ratios, inertias * INERTIA) < 1e-9
