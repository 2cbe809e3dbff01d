"""Nodes in the wind: their kind, and families of them in a structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.effects.wind import Wind
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.model.laws.families import Family, family
from flexctrl.model.laws.inertial import seen_outside
from flexctrl.model.laws.kinds import Kind, Shares
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["WIND", "drag", "wind_families"]

_CALM = 1e-40


def _wind(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
    """½ ρ c_d A and w are the parameters."""
    import casadi as ca

    force = drag(effects, nodes[0], p)
    return Shares(ca.SX(3, 1), force, ca.SX(1, 1), ca.SX(1, 1), -ca.dot(force, nodes[0].v))


def drag(effects: tuple[Effect, ...], node: NodeMotion, p: ca.SX) -> ca.SX:
    """Return the force of the air on a node; ½ ρ c_d A and the velocity of the air are the parameters."""
    import casadi as ca

    past = p[1:4] - seen_outside(effects, node).v
    return p[0] * ca.sqrt(ca.dot(past, past) + _CALM) * past


WIND = Kind("wind", 1, 3, 0, 4, _wind)


def wind_families(structure: Structure, effects: Sequence[Effect]) -> tuple[Family, ...]:
    """Return the families of nodes in the wind.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect

    Returns
    -------
    tuple of Family
    """
    frames = tuple(e for e in effects if isinstance(e, RotatingFrame))
    winds = (e for e in effects if isinstance(e, Wind) and e.acts(structure))
    return tuple(_family(structure, e, frames) for e in winds)


def _family(s: Structure, effect: Wind, frames: tuple[Effect, ...]) -> Family:
    shares = effect.shares(s)
    rows = [[0.5 * effect.density * area, *effect.speed] for _, area in shares]
    return family(WIND, frames, [node.part for node, _ in shares], [[s.number(n)] for n, _ in shares], rows)
