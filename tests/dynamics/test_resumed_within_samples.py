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
