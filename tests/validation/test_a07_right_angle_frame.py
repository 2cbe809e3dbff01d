"""A7: right-angle cantilever frame, which buckles out of its plane (Argyris et al. 1979).

Legs of 240 mm from a strip 30 by 0.6 mm, E = 71240 N/mm², ν = 0.31, J = h t³/3 or that of a rectangle, a load in the
plane at the free end, opening or closing the frame. The perfect frame is followed until another path crosses; a
disturbance of a thousandth of the load across the plane rounds the corner off, and deflections grow fastest where the
load is the critical one.

The same frame on two hinges about the normal of its plane, one of which slides towards the other, under a couple on
each: no leg feels a force, and each turns over as a strip in uniform moment of a length of one leg.

Of legs 3 mm thick FinEtools (PetrKryslUCSD/FinEtoolsFlexStructures.jl, test/test_beam_modal.jl, b = 3, h = 30,
ρ = 5e-9 t/mm³, J = 0.312 h b³, no shear) lists two frequencies. Its mass matrix gives bending about either axis the
rotary inertia of the other (ρ I₂ with the deflection along x₂, whose stiffness is E I₃): a hundred times too much for
motion out of the plane. With the inertias exchanged ours are those listed; with each at its place they are those of an
exact solution (transfer matrices of the legs), 7e-4 and 6e-3 above.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from statics import NONLINEAR

import flexctrl as fc

PAGE = "statics"
LEG, HEIGHT, THICKNESS, E, NU = 240.0, 30.0, 0.6, 71240.0, 0.31
THIN = HEIGHT * THICKNESS**3 / 3
RECTANGLE = THIN * (1 - 192 / np.pi**5 * THICKNESS / HEIGHT * sum(1 / k**5 for k in range(1, 99, 2)))
"""Torsion constants; the series of the second as it is for a strip, tanh = 1 (Timoshenko and Goodier)."""

CRITICAL = {"opening": 1.087518, "closing": -0.680427}
"""P_cr in N."""

RIGID = 1.086757
"""P_cr of opening legs that do not bend in the plane."""

CRITICAL_RECTANGLE = {"opening": 1.084088, "closing": -0.678928}


def strip(J: float = THIN) -> fc.Section:
    G, area = E / 2 / (1 + NU), HEIGHT * THICKNESS
    weak, strong = E * THICKNESS**3 * HEIGHT / 12, E * HEIGHT**3 * THICKNESS / 12
    return fc.Section(E * area, weak, strong, G * J, rhoA=1.0, rhoJ=1.0, GA_y=5 / 6 * G * area, GA_z=5 / 6 * G * area)


def frame(section: fc.Section) -> fc.Model:
    first = fc.Beam("first", (0, 0, 0), (LEG, 0, 0), section, elements=16)
    second = fc.Beam("second", (LEG, 0, 0), (LEG, -LEG, 0), section, elements=16)
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
    path = fc.equilibrium_path(frame(strip()), load={"load": 1.0}, until=1.5 * expected)
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
    path = fc.equilibrium_path(frame(strip(RECTANGLE)), load={"load": 1.0}, until=1.5 * expected)
    record(
        f"Right-angle frame, {direction}, J of a rectangle, 16 elements a leg: P_cr",
        ours=path.branchings[0].factor,
        reference=expected,
        source="zero of the shooting determinant",
        tolerance=2e-3,
    )


@pytest.mark.parametrize(
    ("names", "factor"), [(("EI_z",), 1e4), (("EI_z", "EA", "GA_y"), 1e6)], ids=["bending", "bending, stretch, shear"]
)
def test_critical_load_of_legs_rigid_in_the_plane(record, names, factor):
    rigid = replace(strip(), **{name: factor * getattr(strip(), name) for name in names})
    path = fc.equilibrium_path(frame(rigid), load={"load": 1.0}, until=1.5 * RIGID)
    record(
        f"Right-angle frame, opening, {', '.join(names)} times {factor:g}, 16 elements a leg: P_cr",
        ours=path.branchings[0].factor,
        reference=RIGID,
        source="zero of the shooting determinant",
        tolerance=2e-3,
    )


def test_a_disturbed_frame_goes_out_of_plane_at_the_critical_load(record):
    path = fc.equilibrium_path(frame(strip()), load={"load": 1.0, "across": 1e-3}, until={"z": 60.0})
    assert path.end is fc.PathEnd.REACHED
    softest = int(np.argmax(np.diff(path["z"]) / np.diff(path.factor)))
    record(
        "Right-angle frame, disturbed by P/1000: P where it yields most",
        ours=0.5 * (path.factor[softest] + path.factor[softest + 1]),
        reference=CRITICAL["opening"],
        source="zero of the shooting determinant",
        tolerance=5e-3,
    )


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["opening", "closing"])
def test_hinged_frame_under_couples(record, sign):
    """Its ends turn about the normal only, so that the couples have a potential."""
    apex = (0, LEG / np.sqrt(2), 0)
    left, right = (fc.Beam(name, start, end, strip(), elements=16) for name, start, end in legs(apex))
    joints = [fc.Support(left.start, "u v w rx ry"), fc.Support(right.end, "v w rx ry"), fc.Weld(left.end, right.start)]
    couples = [fc.Torque("left", left.start, "z"), fc.Torque("right", right.end, "-z")]
    model = fc.assemble(fc.Structure([left, right], joints, inputs=couples), NONLINEAR)
    stiff = E * THICKNESS**3 * HEIGHT / 12 * E / 2 / (1 + NU) * THIN
    expected = sign * np.pi / LEG * np.sqrt(stiff)
    path = fc.equilibrium_path(model, load={"left": 1.0, "right": 1.0}, until=1.2 * expected)
    assert abs(expected) == pytest.approx(622.208, abs=1e-3)
    record(
        f"Hinged right-angle frame, couples of sign {sign:+g}, 16 elements a leg: M_cr [N mm]",
        ours=path.branchings[0].factor,
        reference=expected,
        source="±(π/L) √(EI GJ); Argyris 622.2",
        tolerance=2e-3,
    )


def legs(apex: tuple[float, float, float]) -> list[tuple]:
    return [("left", (-apex[1], 0, 0), apex), ("right", apex, (apex[1], 0, 0))]


LISTED = (11.2732, 30.5269)
"""Frequencies of FinEtools [Hz], good to 3e-5 together."""

B, RHO = 3.0, 5e-9
TORSION = E / 2 / (1 + NU) * 0.312 * HEIGHT * B**3
SMALL, LARGE = B**3 * HEIGHT / 12, B * HEIGHT**3 / 12


def frequencies(about_y: float, about_z: float) -> np.ndarray:
    """Of the frame from a strip of 3 mm, with these second moments in the rotary inertia [Hz]."""
    inertia = {"rhoJ": RHO * (SMALL + LARGE), "rhoI_y": RHO * about_y, "rhoI_z": RHO * about_z}
    section = fc.Section(E * B * HEIGHT, E * SMALL, E * LARGE, TORSION, RHO * B * HEIGHT, **inertia)
    first = fc.Beam("first", (0, 0, 0), (LEG, 0, 0), section, elements=16)
    second = fc.Beam("second", (LEG, 0, 0), (LEG, -LEG, 0), section, elements=16)
    structure = fc.Structure([first, second], [fc.Support(first.start), fc.Weld(first.end, second.start)])
    return fc.linearize(fc.assemble(structure, NONLINEAR)).modes(2).frequencies


def exact(second_moment: float) -> np.ndarray:
    """The same by transfer of deflection, slope, twist, shear, moment, torque along the legs: no mesh."""

    def free_end(f: float) -> float:
        s = (2.0 * np.pi * f) ** 2 * RHO
        along = np.zeros((6, 6))
        along[0, 1], along[1, 4], along[2, 5] = 1.0, 1.0 / (E * SMALL), 1.0 / TORSION
        along[3, 0], along[4, 3], along[4, 1] = -s * B * HEIGHT, -1.0, -s * second_moment
        along[5, 2] = -s * (SMALL + LARGE)
        leg, corner = expm(LEG * along), np.eye(6)
        corner[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = np.kron(np.eye(2), [[0.0, 1.0], [-1.0, 0.0]])
        return float(np.linalg.det((leg @ corner @ leg)[3:, 3:]))

    return np.array([brentq(free_end, 0.98 * f, 1.02 * f, xtol=1e-9) for f in LISTED])


def test_frequencies_as_listed(record):
    case = "Right-angle frame of 3 mm, f₁, f₂ [Hz]"
    listed = {"reference": LISTED, "source": "FinEtoolsFlexStructures.jl test/test_beam_modal.jl"}
    record(f"{case}, rotary inertias exchanged, exact", ours=exact(LARGE), tolerance=3e-5, **listed)
    record(
        f"{case}, rotary inertias exchanged, 16 elements a leg",
        ours=frequencies(LARGE, SMALL),
        tolerance=3e-5,
        **listed,
    )
    record(
        f"{case}, 16 elements a leg",
        ours=frequencies(SMALL, LARGE),
        reference=exact(SMALL),
        source="transfer matrices of the legs",
        tolerance=1e-6,
    )
