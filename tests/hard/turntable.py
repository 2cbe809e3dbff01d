"""A motor that turns 5 kg m² through an elastic shaft."""

from __future__ import annotations

import flexctrl as fc

__all__ = ["LOAD", "turntable"]

LOAD = 5.0


def turntable(stiffness: float, inertia: float = 0.0, ratio: float = 1.0) -> fc.Model:
    body = fc.RigidBody("table", (0, 0, 0), 1.0, (LOAD, LOAD, LOAD))
    motor = fc.RotaryDrive("motor", body.node, axis="z", stiffness=stiffness, inertia=inertia, ratio=ratio)
    structure = fc.Structure(
        [body],
        [fc.Support(body.node, "u v w rx ry")],
        [motor],
        inputs=[fc.MotorTorque("torque", "motor")],
        outputs=[fc.Rotation("table", body.node, "z"), fc.DriveAngle("angle", "motor")],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity()])
