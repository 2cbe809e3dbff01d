"""Kinds of pieces with free play, and families of them in a structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.backlash import gaps_of
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import ShaftElasticity
from flexctrl.mechanics import pieces, play
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.model.laws.families import Family, drives_family, lines_family
from flexctrl.model.laws.kinds import Kind, Shares
from flexctrl.model.laws.part_kinds import drive_shares, spring_pull
from flexctrl.structure.drives import Drive, LinearDrive, RotaryDrive
from flexctrl.structure.lines import Spring
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["loose_families", "loose_names", "loose_spring"]


def _spring(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
    import casadi as ca

    m, pull = loose_spring(effects, nodes[0], nodes[1], p)
    return Shares(ca.SX(6, 1), pieces.line_force(m, pull), ca.SX(1, 1), pieces.spring_energy(m))


def loose_spring(
    effects: tuple[Effect, ...], first: NodeMotion, second: NodeMotion, p: ca.SX
) -> tuple[pieces.LineMotion, ca.SX]:
    """Return the motion of a spring beyond its gap, the last of its parameters, and its tension."""
    m = play.loose_line(pieces.line_motion(first, second, p[:-1]), p[-1])
    return m, play.pressing(spring_pull(effects, m), m.length - m.p["length"])


def _rotary(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
    return _loose(effects, pieces.rotary_motion(nodes[0], nodes[1], slot[:3], slot[3], p[:-1]), p[-1])


def _linear(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, p: ca.SX) -> Shares:
    return _loose(effects, pieces.linear_motion(nodes[0], nodes[1], slot[:3], p[:-1]), p[-1])


def _loose(effects: tuple[Effect, ...], m: pieces.DriveMotion, gap: ca.SX) -> Shares:
    """A drive with an elastic shaft that has play."""
    beyond = play.loose_drive(m, gap)
    shares = drive_shares(tuple(e for e in effects if not isinstance(e, ShaftElasticity)), beyond)
    return replace(
        shares,
        force=shares.force + play.loose_shaft_force(beyond),
        stored=shares.stored + pieces.shaft_energy(beyond),
    )


_SPRING = Kind("loose_spring", 2, 3, 0, len(pieces.LINE_PARAMETERS) + 1, _spring)
_ROTARY = Kind("loose_rotary", 2, 6, 1, len(pieces.DRIVE_PARAMETERS) + 1, _rotary)
_LINEAR = Kind("loose_linear", 2, 6, 1, len(pieces.DRIVE_PARAMETERS) + 1, _linear)
LOOSE_DRIVES = (_ROTARY, _LINEAR)


def loose_names(structure: Structure, effects: Sequence[Effect]) -> frozenset[str]:
    """Return the drives and springs that have play under some effects; behind a rigid shaft there is none."""
    stiff = {d.name for d in structure.drives if not any(e.bends(d) for e in effects)}
    return frozenset(name for name, gap in gaps_of(effects).items() if gap) - stiff


def loose_families(structure: Structure, effects: tuple[Effect, ...]) -> tuple[Family, ...]:
    """Return the families of pieces with play.

    Parameters
    ----------
    structure : Structure
    effects : tuple of Effect

    Returns
    -------
    tuple of Family
    """
    names, gaps = loose_names(structure, effects), gaps_of(effects)
    acting = tuple(e.everywhere() for e in effects if not e.apart)
    springs = [p for p in structure.elements if isinstance(p, Spring) and p.name in names]
    drives = [d for d in structure.drives if d.name in names]
    made = [
        _with_gaps(lines_family(_SPRING, structure, acting, springs), gaps),
        *(_with_gaps(_drives(kind, structure, acting, drives, of), gaps) for kind, of in _DRIVES),
    ]
    return tuple(f for f in made if f.count)


_DRIVES: tuple[tuple[Kind, type[Drive]], ...] = ((_ROTARY, RotaryDrive), (_LINEAR, LinearDrive))


def _drives(kind: Kind, s: Structure, effects: tuple[Effect, ...], drives: list[Drive], of: type[Drive]) -> Family:
    return drives_family(kind, s, effects, [d for d in drives if isinstance(d, of)])


def _with_gaps(family: Family, gaps: dict[str, float]) -> Family:
    """The family with the gaps of its parts as last parameter."""
    column = np.array([[gaps[name]] for name in family.parts]).reshape(family.count, 1)
    return replace(family, parameters=np.hstack([family.parameters, column]))
