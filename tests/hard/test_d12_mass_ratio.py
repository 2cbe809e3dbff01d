"""D12: a load of a million times its rope's mass: it swings as a pendulum, the rope is a string.

Frequencies and static tensions are in tests/validation; here the load is let go from 0.2 rad on a rope of 20 elements.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from scipy.integrate import solve_ivp

import flexctrl as fc

PAGE = "hard"
G, ANGLE = 9.81, 0.2


def swinging(ratio: float, elements: int = 20) -> fc.Model:
    """A rope of a metre and a kilogram over ``ratio``, hanging askew, next to no bending stiffness."""
    end = (np.sin(ANGLE), 0.0, -np.cos(ANGLE))
    section = fc.Section(EA=1e7 * G, EI_y=1e-9, EI_z=1e-9, GJ=1e-9, rhoA=1.0 / ratio, rhoJ=1e-9 / ratio)
    rope = fc.Beam("rope", (0, 0, 0), end, section, elements=elements)
    load = fc.PointMass("load", rope.end, 1.0)
    outputs = [fc.SwayAngle("sway", rope.start, load.node, "x")]
    structure = fc.Structure(
        [rope, load], [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)], outputs=outputs
    )
    return fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation(), fc.BeamFlexibility(), fc.Gravity()])


def pendulum(t: float) -> float:
    motion = solve_ivp(lambda _, z: (z[1], -G * np.sin(z[0])), (0.0, t), (ANGLE, 0.0), rtol=1e-11, atol=1e-13)
    return float(motion.y[0, -1])


@pytest.mark.parametrize("ratio", [1e3, 1e6])
def test_it_swings_as_a_pendulum(record, ratio):
    run = fc.simulate(swinging(ratio), until=2.0, method=fc.GeneralizedAlpha(2e-3, rho=0.5))
    times = (0.5, 1.0, 1.5, 2.0)
    record(
        f"D12 load of {ratio:g} ropes, angle at 0.5, 1, 1.5, 2 s",
        ours=[run.at(t)["sway"] for t in times],
        reference=[pendulum(t) for t in times],
        source="pendulum by DOP853; the rope's mass changes ω by 1/(12 μ)",
        tolerance=Absolute(2e-5 + 0.2 / ratio),
    )
    assert run.report.energy_residual < 5e-3
