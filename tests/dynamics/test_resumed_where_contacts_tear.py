"""A run cut in the sample period in which a command tears a dry contact loose goes on bit for bit."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import flexctrl as fc

PERIOD, TORN = 0.02, 0.06


class Rising:
    """A law whose command rises from sample to sample, and holds the arm a little."""

    inputs, outputs = ("a1", "a2"), ("t1", "t2")

    def __init__(self, sample_time: float = PERIOD, haste: float = 1.0) -> None:
        self.sample_time, self.haste = sample_time, haste

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rise = self.haste * t
        return np.array([4.0 * rise - 0.5 * y[0], 25.0 * rise - 3.0 * y[1]])


@cache
def arm(*more: fc.Effect) -> fc.Model:
    """Two links behind elastic drives, a dry contact at each motor."""
    one = fc.RigidBody("one", (0.5, 0, 0), 1.0, (1e-3, 0.1, 0.1), {"root": (0, 0, 0), "end": (1, 0, 0)})
    two = fc.RigidBody("two", (1.3, 0, 0), 0.5, (1e-3, 0.03, 0.03), {"root": (1, 0, 0)})
    places = (one.point("root"), None), (two.point("root"), one.point("end"))
    drives = [
        fc.RotaryDrive(f"d{i}", *at, axis="z", stiffness=k, ratio=ratio, inertia=J, damping=0.02)
        for i, (at, k, ratio, J) in enumerate(zip(places, (20.0, 400.0), (10.0, 1.0), (0.01, 0.1), strict=True), 1)
    ]
    joints = [fc.Support(one.point("root"), "u v w rx ry"), fc.Hinge(one.point("end"), two.point("root"), "z")]
    inputs = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives, 1)]
    outputs = [fc.DriveAngle(f"a{i}", drive) for i, drive in enumerate(drives, 1)]
    dry = fc.CoulombFriction({"d1": fc.Coulomb(0.5), "d2": fc.Coulomb(1.2, 1.2, 0.1)})
    effects = [fc.LargeRotation(), fc.ShaftElasticity(), dry, *more]
    return fc.assemble(fc.Structure([one, two], joints, drives, inputs, outputs), effects)


def pushed(method: Any, until: float, start: Any = None) -> fc.Run:
    return fc.simulate(arm(), Rising(), until=until, start=start, method=fc.Unchecked(method))


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(1.3e-3), fc.AdaptiveAlpha()], ids=["fixed", "chosen"])
def test_it_goes_on_bit_for_bit(method):
    whole = pushed(method, 0.3)
    assert any(event.t == pytest.approx(TORN, abs=1e-9) for event in whole.events)
    for cut in (0.041, 0.045, 0.0573, TORN, 0.0601, 0.064, 0.07, 0.0799, 0.08, 0.11, 0.14, 0.145):
        rest = pushed(method, 0.3, pushed(method, cut).checkpoint)
        for name in ("x", "R", "q", "v"):
            assert np.array_equal(getattr(rest.final, name), getattr(whole.final, name)), cut
        assert rest.report.newton_iterations == whole.report.newton_iterations, cut


@pytest.mark.parametrize("samples", [2, 5, 8, 13, 18])
def test_it_goes_on_whatever_the_last_steps_were(samples):
    """Steps between samples of 1 ms differ in their last digits, and torque that lags behind jumps by their length."""
    model, law = arm(fc.MotorLag({"d1": 0.007})), Rising(1e-3, 0.05 / (1e-3 * samples))

    def lagging(until: float, start: Any = None) -> fc.Run:
        return fc.simulate(model, law, until=until, start=start, method=fc.Unchecked(fc.GeneralizedAlpha(1.3e-3)))

    whole = lagging(0.05)
    torn = whole.events[0].t
    assert torn == pytest.approx(1e-3 * samples, abs=1e-9)
    rest = lagging(0.05, lagging(torn + 1e-4).checkpoint)
    for name in ("x", "R", "q", "v"):
        assert np.array_equal(getattr(rest.final, name), getattr(whole.final, name))
