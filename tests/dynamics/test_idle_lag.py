"""A motor that lags and is never commanded takes nothing from what is told of the rest of the machine."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def machine(*effects: fc.MotorLag) -> fc.Model:
    """An idle arm beside a mass of 1 kg on a spring of 100 N/m."""
    arm = fc.RigidBody("arm", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0)})
    hinge = arm.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=100.0, inertia=0.05)
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0), fc.PointMass("mass", (1, 0, 0), 1.0)
    structure = fc.Structure(
        [arm, spring, mass],
        [
            fc.Support(hinge, "u v w rx ry"),
            fc.Support(spring.start),
            fc.Pin(spring.end, mass.node),
            fc.Support(mass.node, "v w"),
        ],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.Position("x", mass.node, "x"), fc.DriveAngle("angle", motor)],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), *effects])


@pytest.mark.parametrize("method", [None, fc.Unchecked(fc.AdaptiveAlpha()), fc.GeneralizedAlpha(0.01)])
def test_what_errors_add_up_to_is_told_beside_it(method):
    """It was no number, and the note on the mass was lost: a third of its motion."""
    reports = []
    for effects in ((), (fc.MotorLag({"motor": 0.02}),)):
        model = machine(*effects)
        start = model.displace({"spring_1_u": 0.01})
        run = fc.simulate(model, until=48.0, start=start, method=method)
        assert np.abs(run["x"] - 1.0 - 0.01 * np.cos(10.0 * run.t)).max() > 0.2 * 0.02
        assert run.report.drift > 0.2
        assert any("spring_1_u" in note for note in run.report.notes)
        assert np.isfinite([run.report.error, *run.report.output_errors.values()]).all()
        reports.append(run.report)
    assert reports[1].drift == pytest.approx(reports[0].drift, rel=1e-3)
