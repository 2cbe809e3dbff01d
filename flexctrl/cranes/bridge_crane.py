"""A double-girder bridge crane of 32 t with its load on a rope: an assumed data set of real size.

No measured machine stands behind these numbers: they are typical of catalogues (span 22.5 m, bridge
30 t, trolley 11 t, eight falls of rope, 87 m/min) and rounded. What follows from them is reasoned here.

Girder: the pair as one box 1.0 m × 1.4 m (flanges 14 mm, webs 8 mm) has EI = 3.54e9 N m² upright, so
48 EI/L³ = 1.5e7 N/m: it sinks by 28 mm = span/800 under trolley and load (43 t), the usual limit.
Mass: 22 t of girders, walkways and cables are spread over the span, 4 t of end carriage sit at each end.
Rope: eight falls of 18 mm wire rope, 160 mm² of metal and 100 kN/mm² each: EA = 1.28e8 N.
Drives: one at each end. A wheel of 0.63 m and a reduction of 31.5 turn the motor by 100 rad a metre:
1390 1/min at 1.45 m/s. 0.3 m/s² of 73 t need 110 N m from each motor; about twice that is its limit.
Shaft: 90 mm of steel over 1 m, 5.2e5 N m/rad, is 525 N m/rad on the motor's side.
Motor with coupling and brake disc: 0.3 kg m², as heavy on the rail as 3 t.
"""

from __future__ import annotations

from dataclasses import replace

from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass
from flexctrl.structure.drives import LinearDrive
from flexctrl.structure.inputs import MotorTorque
from flexctrl.structure.joints import Joint, Pin, Support
from flexctrl.structure.lines import Rope
from flexctrl.structure.nodes import Node
from flexctrl.structure.outputs import DriveAngle, DriveSpeed, Output, Position, SwayAngle, Velocity
from flexctrl.structure.sections import STEEL, Section
from flexctrl.structure.structure import Structure

SPAN = 22.5
GIRDERS = replace(Section.box(STEEL, width=1.0, height=1.4, web=0.008, flange=0.014), rhoA=22e3 / SPAN)
"""Both girders as one box, with all that they carry."""

CARRIAGE, TROLLEY, ROPES = 4e3, 11e3, 1.28e8


def bridge_crane(load: float = 32e3, rope: float = 10.0, elements: int = 4) -> Structure:
    """Return a bridge crane whose two long-travel drives carry a load along x, the trolley at mid span.

    The girders lie along y and run on rails at both ends; one rail guides sideways, so the bridge may
    skew as far as its drives let it. The load swings freely. All parameters are assumed, see the module.

    Parameters
    ----------
    load : float
        [kg].
    rope : float
        Unstretched length from trolley to load [m].
    elements : int
        Elements along the girders, an even number.

    Returns
    -------
    Structure
        Inputs ``left_torque`` and ``right_torque`` [N m] of the motors; outputs ``travel`` [m] of the
        trolley, ``sway`` [rad], ``load_x``, ``load_z`` [m], ``bend`` [m] of the girders' middle behind
        the mean of the ends, motor angles and speeds [rad, rad/s], and ``load_offset`` [m],
        ``load_offset_rate`` [m/s] of the load ahead of the trolley.
    """
    girder = Beam("girder", (0, -SPAN / 2, 0), (0, SPAN / 2, 0), GIRDERS, elements=elements)
    middle = girder.node(elements // 2)
    trolley = PointMass("trolley", middle, TROLLEY)
    hoist = Rope("rope", middle, (0, 0, -rope), EA=ROPES)
    mass = PointMass("load", hoist.end, load)
    left, right = PointMass("left_carriage", girder.start, CARRIAGE), PointMass("right_carriage", girder.end, CARRIAGE)
    return Structure(
        elements=[girder, left, right, trolley, hoist, mass],
        joints=_joints(girder, middle, left, right, trolley, hoist, mass),
        drives=[_drive("left_drive", girder.start), _drive("right_drive", girder.end)],
        inputs=[MotorTorque("left_torque", "left_drive"), MotorTorque("right_torque", "right_drive")],
        outputs=_outputs(girder, trolley.node, mass.node),
        name="bridge_crane",
    )


def _joints(
    girder: Beam,
    middle: Node,
    left: PointMass,
    right: PointMass,
    trolley: PointMass,
    hoist: Rope,
    load: PointMass,
) -> list[Joint]:
    return [
        Support(girder.start, held="v w ry"),
        Support(girder.end, held="w ry"),
        Pin(girder.start, left.node),
        Pin(girder.end, right.node),
        Pin(middle, trolley.node),
        Pin(trolley.node, hoist.start),
        Pin(hoist.end, load.node),
    ]


def _drive(name: str, end: Node) -> LinearDrive:
    return LinearDrive(name, end, direction="x", radius=0.315, ratio=31.5, stiffness=525.0, inertia=0.3)


def _outputs(girder: Beam, trolley: Node, load: Node) -> list[Output]:
    return [
        Position("travel", at=trolley, direction="x"),
        SwayAngle("sway", top=trolley, load=load, direction="x"),
        Position("load_x", at=load, direction="x"),
        Position("load_z", at=load, direction="z"),
        Position("bend", at=trolley, direction="x", minus=girder.start),
        DriveAngle("left_angle", "left_drive"),
        DriveAngle("right_angle", "right_drive"),
        DriveSpeed("left_speed", "left_drive"),
        DriveSpeed("right_speed", "right_drive"),
        Position("load_offset", at=load, direction="x", minus=trolley),
        Velocity("load_offset_rate", at=load, direction="x", minus=trolley),
    ]


__all__ = ["GIRDERS", "bridge_crane"]
