"""A7: right-angle cantilever frame, which buckles out of its plane (Argyris et al. 1979).

Legs of 240 mm from a strip 30 by 0.6 mm, E = 71240 N/mm², ν = 0.31, J = h t³/3 or that of a rectangle, a load in the
plane at the free end, opening or closing the frame. The perfect frame is followed until another path crosses; a
disturbance of a thousandth of the load across the plane rounds the corner off, and deflections grow fastest where the
load is the critical one.
"""

from __future__ import annotations

import numpy as np
import pytest
from statics import NONLINEAR

import flexctrl as fc

PAGE = "statics"
LEG, HEIGHT, THICKNESS, E, NU = 240.0, 30.0, 0.6, 71240.0, 0.31
THIN = HEIGHT * THICKNESS**3 / 3
RECTANGLE = THIN * (1 - 192 / np.pi**5 * THICKNESS / HEIGHT * sum(1 / k**5 for k in range(1, 99, 2)))
"""Torsion constants; the series of the second as it is for a strip, tanh = 1 (Timoshenko and Goodier)."""

CRITICAL = {"opening": 1.087518, "closing": -0.680427}
"""P_cr in N."""

CRITICAL_RECTANGLE = {"opening": 1.084088, "closing": -0.678928}


def frame(elements: int, J: float = THIN) -> fc.Model:
    G, area = E / 2 / (1 + NU), HEIGHT * THICKNESS
    section = fc.Section(
        E * area,
        E * THICKNESS**3 * HEIGHT / 12,
        E * HEIGHT**3 * THICKNESS / 12,
        G * J,
        rhoA=1.0,
        rhoJ=1.0,
        GA_y=5 / 6 * G * area,
        GA_z=5 / 6 * G * area,
    )
    first = fc.Beam("first", (0, 0, 0), (LEG, 0, 0), section, elements=elements)
    second = fc.Beam("second", (LEG, 0, 0), (LEG, -LEG, 0), section, elements=elements)
    structure = fc.Structure(
        [first, second],
        [fc.Support(first.start), fc.Weld(first.end, second.start)],
        inputs=[fc.Force("load", second.end, "x"), fc.Force("across", second.end, "z")],
        outputs=[fc.Position("z", second.end, "z")],
    )
    return fc.assemble(structure, NONLINEAR)


@pytest.mark.parametrize("direction", CRITICAL)
def test_critical_load(record, direction):
    expected = CRITICAL[direction]
    path = fc.equilibrium_path(frame(16), load={"load": 1.0}, until=1.5 * expected)
    assert path.unstable[[0, -1]].tolist() == [0, 1]
    record(
        f"Right-angle frame, {direction}, 16 elements a leg: P_cr",
        ours=path.branchings[0].factor,
        reference=expected,
        source="zero of the shooting determinant; Argyris 1.088, −0.6804",
        tolerance=2e-3,
    )


@pytest.mark.slow
@pytest.mark.parametrize("direction", CRITICAL_RECTANGLE)
def test_critical_load_of_a_rectangle(record, direction):
    expected = CRITICAL_RECTANGLE[direction]
    path = fc.equilibrium_path(frame(16, RECTANGLE), load={"load": 1.0}, until=1.5 * expected)
    record(
        f"Right-angle frame, {direction}, J of a rectangle, 16 elements a leg: P_cr",
        ours=path.branchings[0].factor,
        reference=expected,
        source="zero of the shooting determinant",
        tolerance=2e-3,
    )


def test_a_disturbed_frame_goes_out_of_plane_at_the_critical_load(record):
    path = fc.equilibrium_path(frame(16), load={"load": 1.0, "across": 1e-3}, until={"z": 60.0})
    assert path.end is fc.PathEnd.REACHED
    softest = int(np.argmax(np.diff(path["z"]) / np.diff(path.factor)))
    record(
        "Right-angle frame, disturbed by P/1000: P where it yields most",
        ours=0.5 * (path.factor[softest] + path.factor[softest + 1]),
        reference=CRITICAL["opening"],
        source="zero of the shooting determinant",
        tolerance=5e-3,
    )
