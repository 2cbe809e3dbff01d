"""Inertia in a frame that turns: it feels another motion than that of the nodes."""

from __future__ import annotations

from flexctrl.effects.effect import Effect
from flexctrl.mechanics.corotation import NodeMotion

__all__ = ["seen_outside", "standing", "turning"]


def turning(effects: tuple[Effect, ...]) -> bool:
    """Tell whether some effect lets inertia feel another motion than that of the nodes."""
    return any(type(e).inertial is not Effect.inertial for e in effects)


def seen_outside(effects: tuple[Effect, ...], node: NodeMotion) -> NodeMotion:
    """Return the motion of a node as its inertia feels it: seen from an inertial frame."""
    for effect in effects:
        node = effect.inertial(node)
    return node


def standing(node: NodeMotion) -> NodeMotion:
    """Return a node in its place, without rates and accelerations."""
    import casadi as ca

    return NodeMotion(node.x, node.R, *[ca.SX(3, 1)] * 4)
