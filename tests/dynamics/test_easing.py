"""Motors whose lag is shorter than a step: as good as without lag, never worse the shorter it is."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.swift.easing import eased_change, eased_rate

H = 1e-3


def disc(lag: float, backend: fc.Compiled | fc.CasadiVM) -> fc.Model:
    """2.5 kg m² about z, and a motor that takes some time."""
    body = fc.RigidBody("disc", (0, 0, 0), 10.0, (1.0, 1.0, 2.0), {"hub": (0, 0, 0)})
    hub = body.point("hub")
    motor = fc.RotaryDrive("motor", hub, axis="z", stiffness=4e3, inertia=0.5)
    inputs, outputs = [fc.MotorTorque("torque", motor)], [fc.Rotation("phi", hub, "z")]
    structure = fc.Structure([body], [fc.Support(hub, "u v w rx ry")], [motor], inputs, outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.MotorLag({"motor": lag})], backend=backend)


@pytest.mark.parametrize("backend", [fc.Compiled(), fc.CasadiVM()], ids=["compiled", "vm"])
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("lag", [1e-4, 1e-6, 1e-8, 1e-10])
def test_a_lag_shorter_than_a_step_delays_by_less_than_one(lag, rho, backend):
    """J θ = M (t²/2 − T t + …): a torque that is late by a step is a step of the velocity off."""
    run = fc.simulate(
        disc(lag, backend), until=0.1, inputs={"torque": 3.0}, method=fc.GeneralizedAlpha(H, rho), every=0.01
    )
    exact = 3.0 / 2.5 * (0.5 * run.t**2 - lag * run.t)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["phi"] - exact).max() <= 0.6 * H * 3.0 / 2.5 * 0.1


@pytest.mark.parametrize("rho", [0.3, 0.9, 1.0])
@pytest.mark.parametrize("z", [2.1, 5.0, 50.0])
def test_newmark_arrives_where_the_exponential_does(z, rho):
    c, decay = Coefficients.of(rho), z / H
    begun = 2.0 * decay, -2.0 * decay**2, H, c.beta, c.gamma
    rate, change, left = eased_rate(*begun), eased_change(*begun), np.exp(-z)
    end = -2.0 * decay**2 * left
    place = H * rate + H * H * ((0.5 - c.beta) * change + c.beta * end)
    assert place == pytest.approx(2.0 * (1.0 - left), rel=1e-9)
    assert rate + H * ((1.0 - c.gamma) * change + c.gamma * end) == pytest.approx(2.0 * decay * left, abs=1e-7 * decay)
