"""A1: cantilever rolled up by an end moment.

Exact: a circle of radius EI/M. Straight elements close a regular polygon at whole turns, to round-off, in whatever
plane a section with equal stiffnesses bends, and exactly half a turn is a place as any other. GXBeam.jl
``test/examples/tipmoment.jl`` has the data (L = 12, EI = 2.5e6); its own remark is that load factors above 1.8 do not
converge.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from statics import cantilever, slender

import flexctrl as fc

PAGE = "statics"
LENGTH, EI = 12.0, 2.5e6
GXBEAM = fc.Section(EA=30e6, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=1.0)


def rolled(turns: float, elements: int = 16, section: fc.Section = GXBEAM) -> fc.Rest:
    model = cantilever(section, LENGTH, elements, [lambda beam: fc.Torque("moment", beam.end, "z")])
    return fc.equilibrium(model, inputs={"moment": 2.0 * np.pi * turns * EI / LENGTH})


@pytest.mark.parametrize("factor", [0.4, 0.8, 1.2, 1.6, 1.8])
def test_the_tip_is_on_the_circle(record, factor):
    radius = LENGTH / (np.pi * factor)
    exact = (radius * np.sin(LENGTH / radius), radius * (1.0 - np.cos(LENGTH / radius)))
    rest = rolled(0.5 * factor)
    ours = (rest.outputs["x"], rest.outputs["y"])
    record(
        f"Roll-up, M = {factor:g} π EI/L, 16 elements: tip over L",
        ours=np.divide(ours, LENGTH),
        reference=np.divide(exact, LENGTH),
        source="closed form",
        tolerance=Absolute(1e-3),
    )


@pytest.mark.parametrize("turns", [0.5, 1, 2])
@pytest.mark.parametrize(("section", "stiff"), [(GXBEAM, "EA = 3e7"), (slender(EI, LENGTH), "EA L²/EI = 1e8")])
def test_half_and_whole_turns(record, turns, section, stiff):
    rest = rolled(turns, section=section)
    record(
        f"Roll-up to {turns:g} turns, {stiff}: tip over L, angle",
        ours=(rest.outputs["x"] / LENGTH, rest.outputs["y"] / LENGTH, rest.outputs["turn"]),
        reference=(0.0, 2.0 / np.pi if turns == 0.5 else 0.0, 2.0 * np.pi * turns),
        source="closed form",
        tolerance=Absolute(1e-6),
    )


@pytest.mark.parametrize("turns", [1, 2, 3, 4])
@pytest.mark.parametrize("angle", [0.3, 0.9])
def test_in_a_plane_between_the_principal_ones(record, turns, angle):
    axis, moment = (0.0, np.sin(angle), np.cos(angle)), 2.0 * np.pi * turns * EI / LENGTH
    rest = fc.equilibrium(
        cantilever(GXBEAM, LENGTH, 16, [lambda beam: fc.Torque("moment", beam.end, axis)]), inputs={"moment": moment}
    )
    record(
        f"Roll-up to {turns:g} turns about an axis at {angle:g} rad to a principal one: tip over L",
        ours=np.divide([rest.outputs[name] for name in "xyz"], LENGTH),
        reference=(0.0, 0.0, 0.0),
        source="closed form",
        tolerance=Absolute(1e-6),
    )
