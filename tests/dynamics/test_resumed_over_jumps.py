"""Runs cut between corners where forces jump go on with the same bits, whatever the process has run in between."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest

import flexctrl as fc


class Swinging:
    """Two motors to and fro, sampled every 10 ms."""

    inputs: ClassVar[tuple[str, ...]] = ("a1", "w1", "a2", "w2")
    outputs: ClassVar[tuple[str, ...]] = ("t1", "t2")
    sample_time = 0.01

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([0.5 * (3 * np.sin(t) - y[0]) - 0.1 * y[1], 0.5 * (2 * np.cos(t) - y[2]) - 0.1 * y[3]])


def arm() -> fc.Model:
    """Two links on elastic drives with damped shafts, play in the second."""
    upper = fc.RigidBody("upper", (0.5, 0, 0), 2.0, (0.01, 0.1, 0.1), {"a": (0, 0, 0), "b": (1, 0, 0)})
    lower = fc.RigidBody("lower", (1.4, 0, 0), 2.0, (0.01, 0.1, 0.1), {"h": (1, 0, 0)})
    base, elbow, hub = upper.point("a"), upper.point("b"), lower.point("h")
    first = fc.RotaryDrive("m1", base, axis="z", stiffness=3.0, ratio=50, inertia=1e-3, damping=1e-3)
    second = fc.RotaryDrive("m2", hub, elbow, axis="z", stiffness=2.0, ratio=30, inertia=1e-3, damping=1e-3)
    drives, joints = [first, second], [fc.Support(base, "u v w rx ry"), fc.Hinge(elbow, hub, axis="z")]
    inputs = [fc.MotorTorque("t1", first), fc.MotorTorque("t2", second)]
    outputs = [s for i, d in enumerate(drives, 1) for s in (fc.DriveAngle(f"a{i}", d), fc.DriveSpeed(f"w{i}", d))]
    plan = fc.Structure([upper, lower], joints, drives, inputs, outputs)
    return fc.assemble(plan, [fc.Flexible(), fc.LargeRotation(), fc.Backlash({"m2": 0.1})])


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()], ids=["fixed", "adaptive"])
def test_a_tangent_remembers_on_which_side_of_a_jump_it_was_made(method, tmp_path):
    """Marches that another run was done with brought their own sides: 1e-14, and 0.085 m where it grew."""
    model, how = arm(), {"method": fc.Unchecked(method), "every": 0.05}
    whole = fc.simulate(model, Swinging(), until=0.6, **how)
    for cut in (0.08, 0.131, 0.301, 0.45):
        fc.simulate(model, Swinging(), until=cut, **how).checkpoint.save(tmp_path / "cut.ck")
        fc.simulate(model, Swinging(), until=0.6, **how)
        rest = fc.simulate(model, Swinging(), until=0.6, start=fc.load_checkpoint(tmp_path / "cut.ck"), **how)
        assert (rest.final.x == whole.final.x).all()
        assert (rest.final.v == whole.final.v).all()
        assert rest.report.newton_iterations == whole.report.newton_iterations
        assert rest.report.factorisations == whole.report.factorisations
