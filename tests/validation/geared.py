"""Machines on drives, and their linear models."""

from __future__ import annotations

import flexctrl as fc

__all__ = ["linear", "turntable"]


def linear(structure: fc.Structure, effects: list[fc.Effect], **hold: float) -> fc.LinearModel:
    model = fc.assemble(structure, effects, fc.CasadiVM())
    return fc.linearize(model, fc.equilibrium(model, hold=hold))


def turntable(inertia: float, drive: dict[str, float], **hold: float) -> fc.LinearModel:
    """A body on a vertical hinge, turned by a motor."""
    body = fc.RigidBody("table", (0, 0, 0), 1.0, (inertia, inertia, inertia))
    motor = fc.RotaryDrive("motor", body.node, axis="z", **drive)  # type: ignore[arg-type]
    structure = fc.Structure(
        [body],
        [fc.Support(body.node, "u v w rx ry")],
        [motor],
        inputs=[fc.MotorTorque("torque", motor)],
        outputs=[fc.DriveAngle("angle", motor), fc.Rotation("turn", body.node, "z")],
    )
    return linear(structure, [fc.LargeRotation(), fc.Flexible()], **hold)
