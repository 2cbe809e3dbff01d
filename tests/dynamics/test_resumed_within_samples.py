"""A run cut short between samples, where a step that its end forbids is tried by itself, goes on bit for bit.

The energy books are summed up in another order in compiled loops: their last digit may differ.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import flexctrl as fc


class Servo:
    """A servo in Python with a state of its own."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 7e-3

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4.0 * (0.5 * np.sin(0.7 * t) - y[0]) - 0.8 * y[1] - x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 0.007 * y[:1]


@cache
def arm() -> fc.Model:
    """Two rigid links on a motor, in small motion about where gravity holds them: steps are refused, too."""
    link = fc.RigidBody("link", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0), "tip": (1, 0, 0)})
    second = fc.RigidBody("second", (1.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (1, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="y", stiffness=2000.0, inertia=0.05, damping=1.0)
    structure = fc.Structure(
        [link, second],
        [fc.Support(hinge, "u v w rx rz"), fc.Hinge(link.point("tip"), second.point("hinge"), "y")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(structure, [fc.GeometricStiffness(), fc.ShaftElasticity(), fc.Gravity()])


def swung(until: float, start: Any = None) -> fc.Run:
    return fc.simulate(arm(), Servo(), until=until, start=start, events=[fc.Event("never", "angle", 50.0)])


@cache
def whole() -> fc.Run:
    return swung(0.4)


@pytest.mark.parametrize("cut", [0.01, 0.024, 0.1, 0.1873, 0.2005, 0.23, 0.2871, 0.3334])
def test_it_goes_on_bit_for_bit(cut):
    rest = swung(0.4, swung(cut).checkpoint)
    assert rest.report.rejected_steps > 0
    assert np.array_equal(rest.final.q, whole().final.q)
    assert np.array_equal(rest.final.v, whole().final.v)
    assert rest.report.energy.work == pytest.approx(whole().report.energy.work, rel=1e-14)


class Counting:
    """A sampled law with a state."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 0.01

    def __init__(self, until: float = np.inf) -> None:
        self.until = until

    def initial(self) -> np.ndarray:
        return np.array([0.1])

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if t > self.until:
            raise RuntimeError("the sensor is gone")
        return np.array([-6.0 * (y[0] - 0.4 * np.sin(3.0 * t)) - 1.2 * y[1] - x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 0.01 * y[:1]


@pytest.mark.parametrize("every", [None, 0.0137])
@pytest.mark.parametrize(
    "method",
    [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1.7e-3), fc.ExplicitRungeKutta(), fc.ConservingMidpoint(3e-3)],
    ids=lambda method: type(method).__name__,
)
def test_a_run_that_its_law_ends_asks_it_again(method, every):
    """The sample at which it raised was left out: the run went on under the command before."""
    body = fc.RigidBody("arm", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0)})
    motor = fc.RotaryDrive("motor", body.point("hinge"), axis="z", stiffness=300.0, inertia=0.05, damping=0.5)
    structure = fc.Structure(
        [body],
        [fc.Support(body.point("hinge"), "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity()])
    how = {"until": 0.3, "method": method, "every": every}
    whole = fc.simulate(model, Counting(), **how)
    half = fc.simulate(model, Counting(until=0.105), **how)
    assert half.status is fc.Status.FAILED
    assert half.final.t == pytest.approx(0.11)
    rest = fc.simulate(model, Counting(), start=half.checkpoint, **how)
    for name in ("q", "v"):
        assert np.array_equal(getattr(rest.final, name), getattr(whole.final, name))
    rows = np.isin(whole.t, rest.t)
    assert rows.sum() == len(rest.t)
    for name in ("y", "u"):
        assert np.array_equal(getattr(whole, name)[rows], getattr(rest, name))
