"""What a sampled law remembers from sample to sample, its integrals and its delayed commands, under every method."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

SAMPLE, UNTIL = 0.01, 2.0
KP, KI, KD = 20.0, 15.0, 6.0
METHODS = [
    fc.GeneralizedAlpha(0.005),
    fc.AdaptiveAlpha(),
    fc.ConservingMidpoint(0.005),
    fc.ExplicitRungeKutta(),
    fc.Richardson(fc.GeneralizedAlpha(0.005)),
    fc.Richardson(fc.AdaptiveAlpha()),
    fc.Richardson(fc.ConservingMidpoint(0.005)),
]


class PI:
    """A force towards x = 1, with an integral of what is left, that answers every sample."""

    inputs, outputs, sample_time = ("x", "v"), ("f",), SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([KP * (1.0 - y[0]) - KD * y[1] + KI * x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + SAMPLE * (1.0 - y[0])


def by_hand(late: int) -> float:
    """Where 1 kg under that force, ``late`` samples late, is at the end: between samples the force is constant."""
    x = v = total = 0.0
    waiting = [0.0] * late
    for _ in range(round(UNTIL / SAMPLE)):
        waiting.append(KP * (1.0 - x) - KD * v + KI * total)
        total += SAMPLE * (1.0 - x)
        force = waiting.pop(0)
        x += SAMPLE * v + 0.5 * SAMPLE**2 * force
        v += SAMPLE * force
    return x


def cart(effects: list = ()) -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")]
    inputs = [fc.Force("f", mass.node, "x")]
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), *effects])


@pytest.mark.parametrize("late", [0, 3])
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_it_is_kept_as_a_recursion_by_hand_says(method, late):
    law = fc.Delayed(PI(), late) if late else PI()
    run = fc.simulate(cart(), law, until=UNTIL, method=method)
    assert run.status is fc.Status.FINISHED
    assert run["x"][-1] == pytest.approx(by_hand(late), rel=1e-11)


class Ramp:
    """A torque that grows from sample to sample."""

    inputs, outputs, sample_time = ("angle",), ("torque",), 0.02

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([3.0 * t])


def driven(friction: float) -> fc.Model:
    """A cart behind an elastic shaft, whose motor has dry friction [N m]."""
    cart = fc.PointMass("cart", (0, 0, 0), 70.0)
    drive = fc.LinearDrive(
        "drive", cart.node, direction="x", radius=0.1, ratio=10.0, stiffness=50.0, inertia=0.01, damping=0.02
    )
    outputs = [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)]
    structure = fc.Structure(
        [cart], [fc.Support(cart.node, "v w")], [drive], [fc.MotorTorque("torque", drive)], outputs
    )
    effects = [fc.LargeRotation(), fc.ShaftElasticity(), fc.CoulombFriction({"drive": friction})]
    return fc.assemble(structure, effects)


@pytest.mark.parametrize("method", [m for m in METHODS if "Conserving" not in str(m)], ids=str)
def test_friction_of_next_to_nothing_changes_next_to_nothing(method):
    """A contact that breaks loose takes the tangent of the machine that stuck with it: the shaft was not felt."""
    with_it, without = (fc.simulate(driven(f), Ramp(), until=0.4, method=method) for f in (1e-6, 0.0))
    assert np.abs(with_it.y[-1] - without.y[-1]).max() <= 1e-4
    assert with_it.report.energy_residual <= 1e-5


@pytest.mark.parametrize("step", [5e-3, 1e-3])
def test_friction_under_a_sampled_law_is_that_of_another_method(step):
    """Both of order two or more, and the event-driven Runge-Kutta method needs no tangent at all."""
    exact = fc.simulate(driven(0.05), Ramp(), until=0.4, method=fc.ExplicitRungeKutta(1e-3))
    run = fc.simulate(driven(0.05), Ramp(), until=0.4, method=fc.GeneralizedAlpha(step))
    assert np.abs(run.y[-1] - exact.y[-1]).max() <= 60.0 * step**2
