"""B14, hanging chains and ropes.

Links, and ropes, under their own weight and loads up to a million times as heavy; upside down, a chain falls. Ropes are
beams of next to no bending stiffness, and the part `Rope` with `RopeMass`, a polygon: where it ends free, 20 elements
have the first mode within 3e-6, the fifth within 5e-3. About the equilibrium that `equilibrium` finds.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from prestressed import MOVING, G, assembled, slender
from recorder import Absolute

import flexctrl as fc

PAGE = "linear"
BESSEL = "closed form, Bessel functions"


def beads(count: int, up: bool = False) -> fc.Structure:
    """Equal masses on rigid massless links a metre long; upside down, the links stand."""
    sign = 1.0 if up else -1.0
    links = [
        fc.Beam(f"link_{i}", (0, 0, sign * i), (0, 0, sign * (i + 1)), slender(1.0, 1.0, 0.0)) for i in range(count)
    ]
    masses = [fc.PointMass(f"mass_{i}", link.end, 1.0) for i, link in enumerate(links)]
    joints = [fc.Support(links[0].start, "u v w")]
    joints += [fc.Pin(link.end, mass.node) for link, mass in zip(links, masses, strict=True)]
    joints += [fc.Pin(a.end, b.start) for a, b in pairwise(links)]
    return fc.planar(fc.Structure([*links, *masses], joints), "y")


BEADS = {
    2: (0.76536686, 1.84775907),
    3: (0.64480583, 1.51468821, 2.50797629),
    5: (0.51338126, 1.18886629, 1.89642447),
    10: (0.37120543, 0.85408111, 1.34474641),
    20: (0.26559347, 0.61002198, 0.95738294),
}


@pytest.mark.parametrize("count", BEADS)
def test_chain_of_equal_masses(record, count):
    found = fc.linearize(assembled(beads(count), [fc.LargeRotation(), fc.Gravity()])).modes().omega / math.sqrt(G)
    roots = np.sqrt(np.polynomial.laguerre.lagroots([0.0] * count + [1.0]))
    assert BEADS[count] == pytest.approx(roots[: len(BEADS[count])], abs=5e-9)
    record(
        f"{count} masses on rigid links: all ω/√(g/l), first {len(BEADS[count])} shown",
        ours=found[:3],
        reference=roots[:3],
        source="roots of the Laguerre polynomial",
        tolerance=1e-10,
    )
    assert found == pytest.approx(roots, rel=1e-10)


def test_inverted_chain_falls(record):
    linear = fc.linearize(assembled(beads(5, up=True), [fc.LargeRotation(), fc.Gravity()]))
    modes = linear.modes()
    record(
        "five masses standing: unstable modes",
        ours=modes.unstable,
        reference=5,
        source="one a link",
        tolerance=Absolute(0),
    )
    roots = np.sqrt(np.polynomial.laguerre.lagroots([0.0] * 5 + [1.0]))
    record(
        "five masses standing: growth rates/√(g/l)",
        ours=np.sort(modes.growth) / math.sqrt(G),
        reference=roots,
        source="roots of the Laguerre polynomial",
        tolerance=1e-8,
    )


def rope(elements: int, ratio: float, stiff: float = 1e8) -> fc.LinearModel:
    """A rope a metre long, a beam of next to no bending stiffness, with a load ``ratio`` times its own mass."""
    weight = (1 + ratio) * G
    beam = fc.Beam("rope", (0, 0, 0), (0, 0, -1), slender(1e-9 * weight, stiff * weight), elements=elements)
    load = fc.PointMass("load", beam.end, ratio)
    structure = fc.Structure([beam, load], [fc.Support(beam.start, "u v w"), fc.Pin(beam.end, load.node)])
    return fc.linearize(assembled(fc.planar(structure, "x"), [*MOVING, fc.Gravity()]))


def polygon(elements: int, ratio: float) -> fc.LinearModel:
    """The same of a `Rope`."""
    line = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e8 * (1 + ratio) * G, rhoA=1.0, elements=elements)
    load = fc.PointMass("load", line.end, ratio)
    structure = fc.Structure([line, load], [fc.Support(line.start), fc.Pin(line.end, load.node)])
    return fc.linearize(assembled(fc.planar(structure, "y"), [*MOVING, fc.RopeMass(), fc.Gravity()]))


FREE = (1.20241278, 2.76003906, 4.32686396, 5.89576722, 7.46545885)


def test_hanging_rope_that_ends_free(record):
    found = polygon(20, 0.0).modes(5).omega / math.sqrt(G)
    source = f"{BESSEL}: half the zeros of J₀"
    record("hanging rope, a `Rope` of 20 elements: ω/√(g/L)", ours=found, reference=FREE, source=source, tolerance=1e-2)
    record(
        "hanging rope, a `Rope` of 20 elements: the first",
        ours=found[0],
        reference=FREE[0],
        source="the same",
        tolerance=1e-5,
    )


def test_hanging_chain(record):
    roots = FREE
    found = rope(20, 0.0).modes(5).omega / math.sqrt(G)
    record(
        "hanging chain, 20 elements: ω/√(g/L)",
        ours=found,
        reference=roots,
        source=f"{BESSEL}: half the zeros of J₀",
        tolerance=1e-3,
    )
    record(
        "hanging chain, 20 elements: the first", ours=found[0], reference=roots[0], source="the same", tolerance=1e-6
    )


LOADED = [
    (0.1, (1.15739376, 2.81604648, 4.71450617)),
    (1.0, (1.05642248, 4.08168676, 7.73750314)),
    (10.0, (1.00793371, 10.27642630, 20.40413143)),
    (100.0, (1.00082912, 31.52605999, 63.00444850)),
    (1e4, (1.0000083329097, 314.1703022)),
    (1e6, (1.0000000833333, 3141.593757)),
]


@pytest.mark.parametrize(("ratio", "roots"), LOADED)
def test_hanging_rope_with_a_load(record, ratio, roots):
    """The pendulum and the string modes, though the load may weigh a million ropes."""
    found = rope(20, ratio).modes(len(roots)).omega / math.sqrt(G)
    record(
        f"rope with a load of {ratio:g} times its mass: ω/√(g/L)",
        ours=found,
        reference=roots,
        source=BESSEL,
        tolerance=2e-6,
    )


@pytest.mark.parametrize(("ratio", "roots"), LOADED)
def test_hanging_rope_with_a_load_of_twenty_straight_elements(record, ratio, roots):
    found = polygon(20, ratio).modes(len(roots)).omega / math.sqrt(G)
    case = f"a `Rope` of 20 elements with a load of {ratio:g} times its mass: ω/√(g/L)"
    record(case, ours=found, reference=roots, source=BESSEL, tolerance=1e-4)
    record(f"{case}, the first", ours=found[0], reference=roots[0], source=BESSEL, tolerance=3e-6)


def test_tension_along_a_rope_that_bears_a_million_times_its_mass(record):
    """Twenty lumps on twenty stretching pieces: each bears all that hangs below, to round-off."""
    heights = np.linspace(0.0, -1.0, 21)
    pieces = [fc.Rope(f"piece_{i}", (0, 0, a), (0, 0, b), EA=1e10) for i, (a, b) in enumerate(pairwise(heights))]
    masses = [0.05] * 19 + [1e6]
    lumps = [fc.PointMass(f"lump_{i}", piece.end, m) for i, (piece, m) in enumerate(zip(pieces, masses, strict=True))]
    joints = [fc.Support(pieces[0].start)]
    joints += [fc.Pin(piece.end, lump.node) for piece, lump in zip(pieces, lumps, strict=True)]
    joints += [fc.Pin(a.end, b.start) for a, b in pairwise(pieces)]
    outputs = [fc.Tension(f"pull_{i}", piece) for i, piece in enumerate(pieces)]
    rest = fc.equilibrium(assembled(fc.Structure([*pieces, *lumps], joints, outputs=outputs), [*MOVING, fc.Gravity()]))
    below = G * np.cumsum(masses[::-1])[::-1]
    worst = np.abs(np.array(list(rest.outputs.values())) - below).max() / below[0]
    record(
        "rope of lumps, load 10⁶ times its mass: error of the tensions over mg",
        ours=worst,
        reference=0,
        source="what hangs below",
        tolerance=Absolute(1e-9),
    )
