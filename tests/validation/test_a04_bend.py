"""A4: 45-degree bend (Bathe & Bolourchi 1979; Simo & Vu-Quoc 1986), and D1: the same from stout to slender.

An arc of radius 100 m, clamped, with a dead load out of its plane. Reference: the rod equations by shooting in
quaternions. The elements are straight, with their nodes on the arc: the answer converges with the square of their
length, from 0.4 % in the radial direction (0.07 % in the others) with 8 elements to 6e-5 with 64. Published tables
differ by their torsion constant and shear area; both are stated.

The slenderness family has sides R/s: EA L²/EI from 740 to 7.4e8. The search predicts stresses beside displacements,
so how stiff the arc is along its axis changes neither the answer's digits nor the number of iterations.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from statics import NONLINEAR

import flexctrl as fc

PAGE = "statics"
RADIUS = 100.0
TABLE = {
    300.0: (-11.931556, -7.044541, 40.191892),
    450.0: (-18.472120, -10.781143, 48.502927),
    600.0: (-23.560240, -13.604521, 53.474859),
}
"""P → displacements along the tangent, radial, out of plane; GA = 5e6, GJ = 8.3333e5."""

BATHE_J = {600.0: (-23.818829, -13.731507, 53.607850)}
"""The same with kGA = 4.1667e6, GJ = 7.03e5."""

FAMILY = {
    1e1: (6e6, (-23.645012, -13.632074, 54.095027)),
    1e2: (6e2, (-23.560240, -13.604521, 53.474859)),
    1e3: (6e-2, (-23.559392, -13.604246, 53.468661)),
    1e4: (6e-6, (-23.559384, -13.604244, 53.468599)),
}
"""s → load, displacements; square section of side R/s, E = 1e7, GJ = G I_p, GA = G A."""


def bend(section: fc.Section, elements: int) -> tuple[fc.Model, np.ndarray]:
    points = fc.arc((0, RADIUS, 0), (0, 0, 0), "z", np.pi / 4, elements)
    chain = fc.BeamChain("bend", points, section)
    structure = fc.Structure(
        chain.beams,
        [fc.Support(chain.start), *chain.welds],
        inputs=[fc.Force("load", chain.end, "z")],
        outputs=[fc.Position(axis, chain.end, axis) for axis in "xyz"],
    )
    return fc.assemble(structure, NONLINEAR), points[-1]


def square(side: float, E: float = 1e7) -> fc.Section:
    area, second = side**2, side**4 / 12.0
    G = E / 2.0
    shear = {"GA_y": G * area, "GA_z": G * area}
    return fc.Section(E * area, E * second, E * second, G * 2 * second, rhoA=area, rhoJ=2 * second, **shear)


def displaced(section: fc.Section, load: float, elements: int) -> tuple[np.ndarray, fc.Rest]:
    model, tip = bend(section, elements)
    rest = fc.equilibrium(model, inputs={"load": load})
    return np.array([rest.outputs[axis] for axis in "xyz"]) - tip, rest


@pytest.mark.parametrize("load", TABLE)
def test_eight_elements(record, load):
    record(
        f"45° bend, P = {load:g}, 8 elements: displacement of the tip",
        ours=displaced(square(1.0), load, 8)[0],
        reference=TABLE[load],
        source="rod shooting",
        tolerance=5e-3,
    )


@pytest.mark.parametrize("load", TABLE)
def test_converged(record, load):
    record(
        f"45° bend, P = {load:g}, 64 elements: displacement of the tip",
        ours=displaced(square(1.0), load, 64)[0],
        reference=TABLE[load],
        source="rod shooting",
        tolerance=1e-4,
    )


def test_with_the_torsion_constant_of_a_square(record):
    section = fc.Section(1e7, 1e7 / 12, 1e7 / 12, 7.03e5, rhoA=1.0, rhoJ=1.0, GA_y=4.1667e6, GA_z=4.1667e6)
    record(
        "45° bend, P = 600, GJ = 7.03e5, kGA = 4.1667e6, 64 elements",
        ours=displaced(section, 600.0, 64)[0],
        reference=BATHE_J[600.0],
        source="rod shooting; Sonneville et al. 2021: -23.821, -13.732, 53.610",
        tolerance=1e-4,
    )


@pytest.mark.parametrize("slenderness", FAMILY)
def test_slenderness_family(record, slenderness):
    load, expected = FAMILY[slenderness]
    record(
        f"45° bend, s = {slenderness:g} (EA L²/EI = {7.4 * slenderness**2:.3g}), 64 elements",
        ours=displaced(square(RADIUS / slenderness), load, 64)[0],
        reference=expected,
        source="rod shooting",
        tolerance=1e-4,
    )


def test_iterations_do_not_depend_on_slenderness(record):
    stout, slim = (displaced(square(RADIUS / s), FAMILY[s][0], 16)[1] for s in (1e2, 1e4))
    record(
        "Iterations at s = 1e4 less those at s = 1e2",
        ours=slim.iterations - stout.iterations,
        reference=0.0,
        source="required: at most 2 (MIP Newton: none)",
        tolerance=Absolute(2.0),
    )
