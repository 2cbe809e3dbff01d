"""A beam hung on a pin and drawn at any angle with any mesh swings down to where it hangs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())
LIGHT = replace(fc.Section.circular(fc.STEEL, 0.05), rhoA=1e-9, rhoJ=0.0, rhoI_y=0.0, rhoI_z=0.0)


def pendulum(angle: float, elements: int) -> fc.Structure:
    """3 kg at the end of a stiff bar of one metre, drawn at an angle from the vertical, in a plane."""
    rod = fc.Beam("rod", (0, 0, 0), (np.sin(angle), 0, -np.cos(angle)), LIGHT, elements=elements)
    bob = fc.PointMass("bob", rod.end, 3.0)
    joints = [fc.Support(rod.start, "u v w"), fc.Pin(rod.end, bob.node)]
    return fc.planar(fc.Structure([rod, bob], joints, outputs=[fc.Position("x", rod.end, "x")]), "y")


@pytest.mark.parametrize("angle", [0.1, 0.6435, 1.0, -1.5])
@pytest.mark.parametrize("elements", [1, 4, 10, 11, 30])
def test_it_hangs_straight_down(angle, elements):
    rest = fc.equilibrium(fc.assemble(pendulum(angle, elements), EFFECTS))
    assert rest.stable
    assert rest.outputs["x"] == pytest.approx(0.0, abs=1e-6)
    assert rest.state.x[-2, 2] == pytest.approx(-1.0, abs=1e-6)
