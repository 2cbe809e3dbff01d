"""The rope of a winch: a line whose unstretched length follows a motor's angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, LineMotion, named

if TYPE_CHECKING:
    import casadi as ca

WINCH_PARAMETERS = ("EA", "damping", "inertia", "ratio", "length", "shortest")


def paid_out(node: NodeMotion, base: NodeMotion, source: ca.SX, parameters: ca.SX) -> LineMotion:
    """Return the motion of the rope that is out: ``rate`` is that of its stretch.

    Parameters
    ----------
    node, base : NodeMotion
        What hangs, and where the rope leaves the drum.
    source : casadi.SX, 3
        θ_d, its rate and its acceleration.
    parameters : casadi.SX
        In the order of `WINCH_PARAMETERS`.
    """
    import casadi as ca

    p = named(WINCH_PARAMETERS, parameters)
    arm = base.x - node.x
    distance = ca.sqrt(ca.dot(arm, arm))
    direction = arm / distance
    out = ca.fmax(p["length"] + source[0] / p["ratio"], p["shortest"])
    rate = ca.dot(direction, base.v - node.v) - source[1] / p["ratio"]
    return LineMotion({"stiffness": p["EA"] / out, "length": out, "damping": p["damping"]}, distance, rate, direction)


def motor(source: ca.SX, parameters: ca.SX) -> DriveMotion:
    """Return the motion of a winch's motor without the rope: a drive whose shaft bears nothing."""
    import casadi as ca

    p = named(WINCH_PARAMETERS, parameters)
    bare = {"stiffness": ca.SX(1, 1), "damping": ca.SX(1, 1), "inertia": p["inertia"], "ratio": p["ratio"]}
    return DriveMotion(bare, ca.SX(1, 1), ca.SX(1, 1), source[0], source[1], source[2], ca.SX(12, 1))


def hoisting(m: LineMotion, pull: ca.SX, stored: ca.SX, ratio: ca.SX) -> ca.SX:
    """Return the force of a winch's rope on both nodes and the source (7): minus the gradient of ``stored``."""
    import casadi as ca

    return ca.vertcat(m.direction * pull, -m.direction * pull, (pull + stored / m.p["length"]) / ratio)
