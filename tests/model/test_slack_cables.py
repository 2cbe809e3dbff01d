"""Cables drawn straight and longer than that hang as elastic catenaries, whichever way they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

import flexctrl as fc

WEIGHT, G = 30.0, 9.81


def tension(across: float, up: float, length: float, EA: float, elements: int) -> float:
    """Of the first element at the start, whose nodes bear lumps of weight (Irvine 1981)."""

    def missed(forces):
        H, V = forces
        x = length * H / EA + H / WEIGHT * (np.arcsinh(V / H) - np.arcsinh((V - WEIGHT * length) / H))
        drop = (V * length - WEIGHT * length**2 / 2.0) / EA
        drop += (np.sqrt(H * H + V * V) - np.sqrt(H * H + (V - WEIGHT * length) ** 2)) / WEIGHT
        return x - across, -drop - up

    H, V = fsolve(missed, (600.0, 0.5 * WEIGHT * length), xtol=1e-13)
    return float(np.hypot(H, V - 11.0 / 24.0 * WEIGHT * length / elements))


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("elements", [20, 40, 60])
@pytest.mark.parametrize(("up", "length"), [(-15.0, 50.0), (20.0, 60.0)])
def test_a_slack_cable_hangs_in_any_direction(up, length, elements, angle):
    """With 40 and 60 elements it went astray by several lengths at some angles, and no equilibrium was found."""
    end = (40.0 * np.cos(angle), 40.0 * np.sin(angle), up)
    rope = fc.Rope("rope", (0, 0, 0), end, EA=1e6, length=length, rhoA=WEIGHT / G, elements=elements)
    joints = [fc.Support(rope.start), fc.Support(rope.end)]
    plan = fc.Structure([rope], joints, [], [], [fc.Tension("tension", rope)])
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Gravity((0, 0, -G)), fc.RopeMass(), fc.RopeStretch()])
    rest = fc.equilibrium(model)
    assert rest.stable
    assert rest.outputs["tension"] == pytest.approx(tension(40.0, up, length, 1e6, elements), rel=1e-3)
