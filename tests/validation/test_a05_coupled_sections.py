"""A5: cantilevers whose section couples bending and torsion, and one twisted by 90° (Wang et al. 2017).

Sections with a full 6 × 6 law (`Section.coupled`). Reference: a spectral rod in kynema, reproduced by shooting to
1e-12. The straight elements converge with the square of their length; the last digits are from three meshes
(Richardson). Half the lateral displacement of the composite comes from the section's law being written in the axes of
the section, which shear has turned against the element by 4e-3, and 6e-6 of it is of third order in this turn.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from statics import NONLINEAR

import flexctrl as fc

PAGE = "statics"
LENGTH = 10.0
COMPOSITE = (-9.02726627566e-2, -6.47488486259e-2, 1.22973648292)
TWISTED = (-1.14152599954, -1.71805334646, -3.59321324027)
SOLID = (-1.134192, -1.714467, -3.58423)


def composite() -> fc.Section:
    law = np.zeros((6, 6))
    law[:3, :3] = np.diag([1368.17e3, 88.56e3, 38.78e3])
    law[3:, 3:] = [[16.96e3, 17.61e3, -0.351e3], [17.61e3, 59.12e3, -0.370e3], [-0.351e3, -0.370e3, 141.47e3]]
    return fc.Section.coupled(law, rhoA=8.538e-2, rhoJ=1.4433e-2, rhoI_y=0.4097e-2, rhoI_z=1.0336e-2)


def strip() -> fc.Section:
    law = np.diag([2.5e10, 8.2604167e9, 8.2604167e9, 1.41872656e8, 5.20833e8, 1.30208333e8])
    return fc.Section.coupled(law, rhoA=1.0, rhoJ=1.0)


@cache
def tip(section: fc.Section, elements: int, load: float, twist: float) -> np.ndarray:
    """Displacement of the tip; the axes of each element are those of its middle."""
    x = np.linspace(0.0, LENGTH, elements + 1)
    angles = twist * 0.5 * (x[1:] + x[:-1]) / LENGTH
    ups = [(0.0, -np.sin(a), np.cos(a)) for a in angles]
    chain = fc.BeamChain("blade", [(at, 0.0, 0.0) for at in x], section, up=ups)
    structure = fc.Structure(
        chain.beams,
        [fc.Support(chain.start), *chain.welds],
        inputs=[fc.Force("load", chain.end, "z")],
        outputs=[fc.Position(axis, chain.end, axis) for axis in "xyz"],
    )
    outputs = fc.equilibrium(fc.assemble(structure, NONLINEAR), inputs={"load": load}).outputs
    return np.array(list(outputs.values())) - (LENGTH, 0.0, 0.0)


def extrapolated(section: fc.Section, load: float, twist: float) -> np.ndarray:
    """From 40, 80 and 160 elements: without errors of second and fourth order."""
    coarse, middle, fine = (tip(section, n, load, twist) for n in (40, 80, 160))
    return (64.0 * fine - 20.0 * middle + coarse) / 45.0


CASES = {
    "composite": (composite(), 150.0, 0.0, COMPOSITE),
    "twisted by 90°": (strip(), -4000e3, np.pi / 2, TWISTED),
}


@pytest.mark.parametrize("case", CASES)
def test_tip(record, case):
    section, load, twist, expected = CASES[case]
    source = "kynema; rod shooting"
    eighty = tip(section, 80, load, twist)
    record(f"Cantilever, {case}, 80 elements", ours=eighty, reference=expected, source=source, tolerance=2e-4)
    record(
        f"Cantilever, {case}, 40, 80 and 160 elements extrapolated",
        ours=extrapolated(section, load, twist),
        reference=expected,
        source=source,
        tolerance=1e-6,
    )


def test_solid_model(record):
    section, load, twist, _ = CASES["twisted by 90°"]
    record(
        "Twisted cantilever, 80 elements, against a solid model",
        ours=tip(section, 80, load, twist),
        reference=SOLID,
        source="ANSYS",
        tolerance=1e-2,
    )
