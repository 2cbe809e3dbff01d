"""Cables drawn straight and longer than that hang as elastic catenaries, whichever way they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

import flexctrl as fc

WEIGHT, G = 30.0, 9.81


def tension(across: float, up: float, length: float, EA: float, elements: int, weight: float = WEIGHT) -> float:
    """Of the first element at the start, whose nodes bear lumps of weight (Irvine 1981)."""

    def missed(forces):
        H, V = forces
        x = length * H / EA + H / weight * (np.arcsinh(V / H) - np.arcsinh((V - weight * length) / H))
        drop = (V * length - weight * length**2 / 2.0) / EA
        drop += (np.sqrt(H * H + V * V) - np.sqrt(H * H + (V - weight * length) ** 2)) / weight
        return x - across, -drop - up

    H, V = fsolve(missed, (0.5 * weight * length, 0.5 * weight * length), xtol=1e-13)
    return float(np.hypot(H, V - 11.0 / 24.0 * weight * length / elements))


def hung(across: float, up: float, length: float, EA: float, elements: int, weight: float, angle: float) -> fc.Rest:
    """A cable between two supports, under its weight."""
    end = (across * np.cos(angle), across * np.sin(angle), up)
    rope = fc.Rope("rope", (0, 0, 0), end, EA=EA, length=length, rhoA=weight / G, elements=elements)
    joints = [fc.Support(rope.start), fc.Support(rope.end)]
    plan = fc.Structure([rope], joints, [], [], [fc.Tension("tension", rope)])
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Gravity((0, 0, -G)), fc.RopeMass(), fc.RopeStretch()])
    return fc.equilibrium(model)


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("elements", [20, 40, 60])
@pytest.mark.parametrize(("up", "length"), [(-15.0, 50.0), (20.0, 60.0)])
def test_a_slack_cable_hangs_in_any_direction(up, length, elements, angle):
    """With 40 and 60 elements it went astray by several lengths at some angles, and no equilibrium was found."""
    rest = hung(40.0, up, length, 1e6, elements, WEIGHT, angle)
    assert rest.stable
    assert rest.outputs["tension"] == pytest.approx(tension(40.0, up, length, 1e6, elements), rel=1e-3)


@pytest.mark.parametrize(
    "cable",
    [
        (34.7084, 1.49420, 35.5458, 2.10182e7, 78, 9.74745, 1.20722),
        (59.4771, 25.1870, 65.3364, 5.28021e7, 65, 37.9646, 5.59722),
        (19.0009, -14.1987, 23.7975, 9.04957e7, 38, 97.8517, 0.433921),
        (6.52278, 0.0248954, 6.58306, 1.18419e8, 53, 195.565, 4.51449),
        (5.41230, 2.85274, 6.23650, 8.00343e6, 44, 27.7767, 5.21376),
    ],
    ids=lambda cable: f"{cable[4]} elements",
)
def test_a_cable_a_hundred_thousand_times_as_stiff_as_heavy_hangs(cable):
    """Of random ones one in a hundred had no equilibrium: it is found by way of ropes that stretch."""
    across, up, length, EA, elements, weight, angle = cable
    rest = hung(across, up, length, EA, elements, weight, angle)
    assert rest.stable
    assert rest.outputs["tension"] == pytest.approx(tension(across, up, length, EA, elements, weight), rel=2e-3)
