"""The energy books of marched runs are those of plain steps, over impacts and samples too."""

from __future__ import annotations

import pytest

import flexctrl as fc
from flexctrl.design import Step, Tracking, pd
from flexctrl.dynamics.alpha import method as alpha


def slack() -> dict:
    """A ball dropped on its rope."""
    ball, rope = fc.PointMass("ball", (0, 0, -1), 1.0), fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e4)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, ball.node), fc.Support(ball.node, "u v")]
    model = fc.assemble(fc.Structure([ball, rope], joints), [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])
    return {"model": model, "start": model.displace({model.coordinates[0]: 0.3})}


def driven(effect: fc.Effect) -> dict:
    """A wheel on a motor under a sampled law."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    drive = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=30.0, ratio=2.0, inertia=0.05, damping=0.05)
    structure = fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)],
    )
    law = Tracking(pd(20.0, 2.0, measured="angle", rate="speed", command="torque"), {"angle": Step(1.0)})
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), effect])
    return {"model": model, "controller": fc.Sampled(law, 0.01)}


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.005), fc.AdaptiveAlpha()], ids=["fixed", "adaptive"])
@pytest.mark.parametrize(
    "case",
    [slack, lambda: driven(fc.Backlash({"motor": 0.1})), lambda: driven(fc.MotorLag({"motor": 0.05}))],
    ids=["slack rope", "backlash", "lag"],
)
def test_books_are_those_of_plain_steps(monkeypatch, case, method):
    asked = {**case(), "until": 0.3, "method": method}
    marched = fc.simulate(**asked).report
    monkeypatch.setattr(alpha, "_quickest", lambda plain: plain)
    plain = fc.simulate(**asked).report
    assert (marched.steps, marched.rejected_steps) == (plain.steps, plain.rejected_steps)
    assert marched.energy_residual == pytest.approx(plain.energy_residual, rel=1e-5, abs=1e-10)
    for what in ("work", "dissipated", "kinetic", "stored"):
        assert getattr(marched.energy, what) == pytest.approx(getattr(plain.energy, what), rel=1e-7, abs=1e-9)
