"""Corners of play while motors slide dry: marched, the same as in plain steps, and resumed bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha import steps

INERTIA, MOTOR, PLAY, RUBS = 0.5, 2e-3, 0.02, fc.Coulomb(0.05, 0.08)


def arm(backend=None) -> fc.Model:
    """An arm behind a damped gear with play, whose motor rubs."""
    body = fc.RigidBody("arm", (0.3, 0, 0), 2.0, (1e-3, INERTIA, INERTIA), {"joint": (0, 0, 0)})
    joint = body.point("joint")
    drive = fc.RotaryDrive("motor", joint, axis="z", stiffness=20.0, ratio=10.0, inertia=MOTOR, damping=0.02)
    structure = fc.Structure(
        [body],
        [fc.Support(joint, "u v w rx ry")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Rotation("arm", joint, "z"), fc.DriveAngle("angle", drive)],
    )
    effects = [
        fc.LargeRotation(),
        fc.ShaftElasticity(),
        fc.Backlash({"motor": PLAY}),
        fc.CoulombFriction({"motor": RUBS}),
    ]
    return fc.assemble(structure, effects, backend=backend)


class Shaking:
    """1.2 sin 30 t, every 5 ms."""

    inputs, outputs, sample_time = ("angle",), ("torque",), 0.005

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([1.2 * np.sin(30.0 * t)])


METHODS = [fc.Unchecked(fc.AdaptiveAlpha()), fc.Unchecked(fc.GeneralizedAlpha(1e-3))]


@pytest.mark.parametrize("method", METHODS, ids=["chosen", "fixed"])
def test_corners_are_marched_as_plain_steps_take_them(method, monkeypatch):
    tries, attempt = [], steps.Stepper._attempt

    def counted(self, *args, **kwargs):
        tries.append(1)
        return attempt(self, *args, **kwargs)

    monkeypatch.setattr(steps.Stepper, "_attempt", counted)
    model = arm()
    run = fc.simulate(model, Shaking(), until=0.5, method=method, every=0.005)
    few = len(tries)
    plain = fc.simulate(arm(fc.CasadiVM()), Shaking(), until=0.5, method=method, every=0.005)
    corners = [event for event in run.events if event.name == "motor"]
    assert len(corners) > 8, corners
    assert few < 0.2 * (len(tries) - few)
    assert np.abs(run.y - plain.y).max() < 1e-6 * np.ptp(run["arm"])
    assert run.report.energy_residual < 1e-2


@pytest.mark.parametrize("method", METHODS, ids=["chosen", "fixed"])
def test_they_are_where_runs_go_on_bit_for_bit(method):
    model = arm()
    how = {"method": method, "every": 0.005}
    once = fc.simulate(model, Shaking(), until=0.6, **how)
    for event in once.events[2:8]:
        cut = fc.simulate(model, Shaking(), until=event.t + 1e-4, **how)
        rest = fc.simulate(model, Shaking(), until=0.6, start=cut.checkpoint, **how)
        assert all(np.array_equal(getattr(once.final, name), getattr(rest.final, name)) for name in ("x", "q", "v"))
