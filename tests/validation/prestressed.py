"""Machines about their equilibria: sections without much rotary inertia, models without a compiler."""

from __future__ import annotations

import flexctrl as fc

__all__ = ["MOVING", "G", "assembled", "slender"]

G = 9.81
MOVING = [fc.LargeRotation(), fc.Flexible()]


def assembled(structure: fc.Structure, effects: list[fc.Effect]) -> fc.Model:
    return fc.assemble(structure, effects, fc.CasadiVM())


def slender(EI: float, EA: float, rhoA: float = 1.0) -> fc.Section:
    return fc.Section(EA=EA, EI_y=EI, EI_z=EI, GJ=EI, rhoA=rhoA, rhoJ=1e-6 * rhoA)
