"""D7: modes that come twice: what is made of them does not depend on which vectors stand for the pair.

A square cantilever drawn with its section's axes turned about its own; frequencies, gap and detuning are in
tests/validation.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from scipy.linalg import subspace_angles

import flexctrl as fc

PAGE = "hard"
OMEGA = np.array([1.0, 13.0, 13.4, 80.0, 84.5])


def cantilever(turn: float) -> fc.LinearModel:
    EI = 210e9 * 0.3**4 / 12
    section = fc.Section(210e9 * 0.09, EI, EI, 1e9, 7850 * 0.09, 1e3)
    up = (0.0, np.sin(turn), np.cos(turn))
    beam = fc.Beam("beam", (0, 0, 0), (10, 0, 0), section, elements=10, up=up)
    push, out = fc.Force("push", beam.end, (0, 1, 2)), fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[out])
    return fc.linearize(fc.assemble(structure, [fc.BeamFlexibility(), fc.RayleighDamping(0.0, 1e-4)]))


@pytest.mark.parametrize("turn", [0.3, 1.1])
def test_section_turned_about_its_axis(record, turn):
    plain, turned = cantilever(0.0), cantilever(turn)
    first, second = plain.modes(), turned.modes()
    case = f"D7 square cantilever, section turned by {turn:g} rad"
    record(
        f"{case}: gap of the first two pairs",
        ours=[second.omega[1] / second.omega[0] - 1, second.omega[3] / second.omega[2] - 1],
        reference=[0, 0],
        source="symmetry",
        tolerance=Absolute(1e-10),
    )
    angles = [subspace_angles(first.shapes[:, k : k + 2], second.shapes[:, k : k + 2]).max() for k in (0, 2)]
    record(
        f"{case}: angle between the pairs' spaces [rad]",
        ours=angles,
        reference=[0, 0],
        source="the same",
        tolerance=Absolute(1e-6),
    )
    product = second.shapes[:, :4].T @ (turned.M @ second.shapes[:, :4])
    record(
        f"{case}: ΦᵀMΦ less one",
        ours=np.abs(product - np.eye(4)).max(),
        reference=0,
        source="orthonormal",
        tolerance=Absolute(1e-10),
    )
    a, b = (m.frequency_response(OMEGA).values[0, 0] for m in (plain, turned))
    record(
        f"{case}: frequency response over that of the other",
        ours=np.abs(b / a - 1).max(),
        reference=0,
        source="the same machine",
        tolerance=Absolute(1e-10),
    )


def test_the_same_vectors_every_time():
    first, second = (cantilever(0.3).modes() for _ in range(2))
    assert np.array_equal(first.shapes, second.shapes)
    assert np.array_equal(first.omega, second.omega)
