"""A two-link robot arm with slender links and elastic drive shafts, turning about vertical axes."""

from __future__ import annotations

from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass
from flexctrl.structure.drives import RotaryDrive
from flexctrl.structure.inputs import MotorTorque
from flexctrl.structure.joints import Hinge, Pin, Support
from flexctrl.structure.outputs import DriveAngle, DriveSpeed, Output, Position, Rotation
from flexctrl.structure.sections import Material, Section
from flexctrl.structure.structure import Structure

ALUMINIUM = Material(E=70e9, rho=2700.0, nu=0.33)
"""Structural aluminium (EN 1999-1-1, 3.2.5)."""

UPPER = Section.tube(ALUMINIUM, radius=0.025, thickness=0.002)
FORE = Section.tube(ALUMINIUM, radius=0.020, thickness=0.002)
MOTOR_MASS = 3.0


def flexible_arm(payload: float = 4.0, elements: int = 3) -> Structure:
    """Return a two-link arm in the horizontal plane, stretched along x, with a motor in each joint.

    Links of 1.0 m and 0.8 m are tubes of 50 mm and 40 mm by 2 mm; the elbow motor weighs 3 kg. Each
    drive is a harmonic gear of ratio 100 with 2·10⁴ N m/rad at the joint, 2 N m/rad on the motor's
    side, and 1.2·10⁻⁴ kg m² of rotor. All parameters are assumed; they make a first bending
    frequency of a few hertz, as slender arms have.

    Parameters
    ----------
    payload : float
        [kg].
    elements : int
        Elements a link.

    Returns
    -------
    Structure
        Inputs ``shoulder_torque`` and ``elbow_torque`` [N m] of the motors; outputs ``tip_x``,
        ``tip_y``, ``tip_z`` [m], the joint angles ``shoulder`` and ``elbow`` [rad], and motor angles
        and speeds.
    """
    upper = Beam("upper", (0, 0, 0), (1.0, 0, 0), UPPER, elements=elements)
    fore = Beam("fore", upper.end, (1.8, 0, 0), FORE, elements=elements)
    motor = PointMass("elbow_motor", upper.end, MOTOR_MASS)
    load = PointMass("payload", fore.end, payload)
    return Structure(
        elements=[upper, motor, fore, load],
        joints=[
            Support(upper.start, held="u v w rx ry"),
            Pin(upper.end, motor.node),
            Hinge(upper.end, fore.start, axis="z"),
            Pin(fore.end, load.node),
        ],
        drives=[
            RotaryDrive("shoulder_drive", upper.start, axis="z", stiffness=2.0, ratio=100.0, inertia=1.2e-4),
            RotaryDrive("elbow_drive", fore.start, upper.end, axis="z", stiffness=2.0, ratio=100.0, inertia=1.2e-4),
        ],
        inputs=[MotorTorque("shoulder_torque", "shoulder_drive"), MotorTorque("elbow_torque", "elbow_drive")],
        outputs=_outputs(upper, fore, load),
        name="flexible_arm",
    )


def _outputs(upper: Beam, fore: Beam, load: PointMass) -> list[Output]:
    return [
        *(Position(f"tip_{axis}", at=load.node, direction=axis) for axis in "xyz"),
        Rotation("shoulder", at=upper.start, axis="z"),
        Rotation("elbow", at=fore.start, axis="z", minus=upper.end),
        DriveAngle("shoulder_angle", "shoulder_drive"),
        DriveAngle("elbow_angle", "elbow_drive"),
        DriveSpeed("shoulder_speed", "shoulder_drive"),
        DriveSpeed("elbow_speed", "elbow_drive"),
    ]


__all__ = ["ALUMINIUM", "flexible_arm"]
