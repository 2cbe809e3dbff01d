"""B15, a hoist rope as a rod with its load.

Vibrations along the rope, of linear elements: their error falls with the square of their length, so that 10 and 20
elements say what many would.
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

    def found(elements: int) -> np.ndarray:
        section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1.0)
        beam = fc.Beam("rope", (0, 0, 0), (0, 0, -1), section, elements=elements)
        load = fc.PointMass("load", beam.end, 1.0 / ratio)
        joints = [fc.Support(beam.start), fc.Pin(beam.end, load.node)]
        joints += [fc.Support(node, "u v rx ry rz") for node in beam.nodes[1:]]
        return fc.linearize(assembled(fc.Structure([beam, load], joints), MOVING)).modes(2).omega[: len(roots)]

    source = "closed form, β tan β = ρAL/m"
    record(
        f"rod with tip mass, ρAL/m = {ratio:g}: β, 40 elements",
        ours=found(40),
        reference=roots,
        source=source,
        tolerance=1e-3,
    )
    record(
        f"rod with tip mass, ρAL/m = {ratio:g}: β, 10 and 20 elements extrapolated",
        ours=(4.0 * found(20) - found(10)) / 3.0,
        reference=roots,
        source=source,
        tolerance=1e-4,
    )
