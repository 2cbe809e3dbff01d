"""B15, a hoist rope as a rod with its load.

Vibrations along the rope. Elements that stretch linearly have a consistent mass, whose frequencies are too high by up
to θ²/24, θ = βL/n: 7e-4 with 10 of them in the first mode, 6.5e-3 in the second. With a parabola of stretch each
(`ComponentModes` along them) the error is of fourth order. A `Rope` with `RopeMass`, whose mass is the mean of the
consistent and the lumped one but for its ends, is within 1e-4 in the first mode with 10 elements.
"""

from __future__ import annotations

import numpy as np
import pytest
from prestressed import MOVING, assembled

import flexctrl as fc

PAGE = "linear"


@pytest.mark.parametrize(
    ("ratio", "roots"),
    [
        (1e-6, (9.999998333e-4, 3.1415929719)),
        (1e-3, (0.03161750711,)),
        (0.1, (0.3110528482, 3.1730971767)),
        (1.0, (0.8603335890, 3.4256184595)),
        (10.0, (1.4288700112, 4.3058014131)),
    ],
)
def test_hoist_rope_as_a_rod_with_its_load(record, ratio, roots):
    """Longitudinal: β tan β = ρAL/m."""

    def found(elements: int, *along: fc.Effect) -> np.ndarray:
        section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1.0)
        beam = fc.Beam("rope", (0, 0, 0), (0, 0, -1), section, elements=elements)
        load = fc.PointMass("load", beam.end, 1.0 / ratio)
        joints = [fc.Support(beam.start), fc.Pin(beam.end, load.node)]
        joints += [fc.Support(node, "u v rx ry rz") for node in beam.nodes[1:]]
        return (
            fc.linearize(assembled(fc.Structure([beam, load], joints), [*MOVING, *along])).modes(2).omega[: len(roots)]
        )

    source = "closed form, β tan β = ρAL/m"
    record(
        f"rod with tip mass, ρAL/m = {ratio:g}: β, 10 elements with a parabola of stretch",
        ours=found(10, fc.ComponentModes(0, along=1)),
        reference=roots,
        source=source,
        tolerance=1e-4,
    )
    record(
        f"rod with tip mass, ρAL/m = {ratio:g}: β, 10 elements that stretch linearly",
        ours=found(10),
        reference=roots,
        source=source,
        tolerance=1e-2,
    )
    rope = of_rope(ratio)[: len(roots)]
    case = f"rod with tip mass, ρAL/m = {ratio:g}: β, a `Rope` of 10 elements"
    record(case, ours=rope, reference=roots, source=source, tolerance=1e-3)
    record(f"{case}, the first", ours=rope[0], reference=roots[0], source=source, tolerance=1e-4)


def of_rope(ratio: float) -> np.ndarray:
    """The frequencies of the same as a rope of ten elements, held to its line."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1.0, rhoA=1.0, elements=10)
    load = fc.PointMass("load", rope.end, 1.0 / ratio)
    held = [fc.Support(rope.start, "w"), *(fc.Support(node, "u v") for node in rope.nodes)]
    structure = fc.Structure([rope, load], [*held, fc.Pin(rope.end, load.node)])
    return fc.linearize(fc.assemble(structure, [fc.RopeStretch(), fc.RopeMass()])).modes(2).omega
