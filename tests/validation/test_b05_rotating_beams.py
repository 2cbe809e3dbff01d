"""B5, rotating beams.

Blades stiffened by their spin, flapping and lagging, straight and with a swept tip; with Coriolis forces.

The published chordwise values are of a blade that is as long when it spins as when it does not. Ours are of one that
is made so much shorter, and of one that stretches. The value at η = 50, 7.3362, is 3.6e-4 above what the Ritz series
converges to, 7.333589: the blade bends within L/50 of its clamp, and polynomials of order 11 have 7.3368.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from prestressed import MOVING, assembled, slender
from spinning_blade import lagging as lagging_by_ritz

import flexctrl as fc

PAGE = "linear"
BLADE = {
    0: (3.51602, 22.03449, 61.69721, 3.51602),
    1: (3.68165, 22.18101, 61.84176, 3.54324),
    2: (4.13732, 22.61492, 62.27318, 3.62180),
    3: (4.79728, 23.32026, 62.98497, 3.74351),
    4: (5.58500, 24.27335, 63.96676, 3.89772),
    5: (6.44954, 25.44608, 65.20504, 4.07390),
    6: (7.36037, 26.80908, 66.68391, 4.26323),
    8: (9.25684, 29.99538, 70.29296, 4.65715),
    10: (11.20233, 33.64037, 74.64929, 5.04897),
    12: (13.17015, 37.60311, 79.61448, 5.42705),
}
PUBLISHED = "octave-user/mboct-fem-pkg inst/fem_tests_060.tst (Hamza Cherif & Houmat 2004)"
SOUTHWELL = "Ritz series of order 18; Wright et al. 1982"
EPPS = "measured (Epps & Chandra 1996), as in GXBeam.jl test/examples/rotating.jl"


def blade(
    eta: float, normal: str, hub: float = 0.0, EA: float = 1e8, root: float = 0.2, elements: tuple[int, int] = (4, 16)
) -> fc.LinearModel:
    """A uniform blade a metre long along x on a hub of radius ``hub``, spinning about z at η √(EI/ρAL⁴) = 1 rad/s.

    EA is that over EI/L²; so many elements are along ``root``, and along the rest.
    """
    EI = 1.0 / eta**2 if eta else 1.0
    inner = fc.Beam("root", (hub, 0, 0), (hub + root, 0, 0), slender(EI, EA * EI), elements=elements[0])
    outer = fc.Beam("blade", inner.end, (hub + 1, 0, 0), slender(EI, EA * EI), elements=elements[1])
    joints = [fc.Support(inner.start), fc.Weld(inner.end, outer.start)]
    structure = fc.planar(fc.Structure([inner, outer], joints), normal)
    return fc.linearize(assembled(structure, [*MOVING, *([fc.RotatingFrame((0, 0, 1))] if eta else [])]))


def flapping(eta: float, count: int, **shape: Any) -> np.ndarray:
    """ω √(ρAL⁴/EI) of the lowest modes out of the plane of rotation."""
    return blade(eta, "y", **shape).modes(count).omega * (eta or 1.0)


def lagging(eta: float, **shape: Any) -> float:
    """The same of the lowest mode in the plane, with Coriolis forces."""
    return float(np.abs(blade(eta, "z", **shape).damped_poles(1))[0] * (eta or 1.0))


@pytest.mark.parametrize("spin", BLADE)
def test_southwells_blade(record, spin):
    *flap, lag = BLADE[spin]
    found = flapping(spin, 3)
    record(
        f"blade, η = {spin}: flapping ω, modes 1–3, 20 elements",
        ours=found,
        reference=flap,
        source=SOUTHWELL,
        tolerance=1e-4,
    )
    found = lagging(spin)
    record(
        f"blade, η = {spin}: lagging ω₁, with Coriolis forces",
        ours=found,
        reference=lag,
        source=f"{SOUTHWELL}; ω² = flapping ω² − η²",
        tolerance=1e-4,
    )


@pytest.mark.parametrize(
    ("spin", "first"), [(1, 3.88882), (2, 4.83369), (3, 6.08175), (5, 8.94036), (10, 16.60636), (12, 19.72154)]
)
def test_blade_on_a_hub_as_large_as_itself(record, spin, first):
    found = flapping(spin, 1, hub=1.0)
    record(
        f"blade, hub radius L, η = {spin}: flapping ω₁, 20 elements",
        ours=found,
        reference=[first],
        source=SOUTHWELL,
        tolerance=1e-4,
    )


def test_blade_that_spins_fast(record):
    """It bends within L/50 of its clamp, so elements are shorter there; 20 equal ones are off by 1.1e-4."""
    record(
        "blade, η = 50: flapping ω₁, 20 elements, 4 of them along the first tenth",
        ours=flapping(50, 1, root=0.1),
        reference=[51.07981],
        source=SOUTHWELL,
        tolerance=1e-4,
    )


CHORDWISE = {2: 3.6195, 4: 3.888, 6: 4.2393, 8: 4.6105, 10: 4.97, 50: 7.3362}
"""η → lagging ω₁ at slenderness 70, the steady stretch left out."""

ENDS = np.linspace(0.0, 1.0, 21) ** 2
"""Of 20 elements, shorter towards the clamp, near which a blade that spins fast bends."""


def swaying(eta: float, made: np.ndarray) -> float:
    """ω₁ √(ρAL⁴/EI) in the plane of a blade of slenderness 70 made of elements so long over what they are in `ENDS`.

    Mass, and stiffness against what is added, are those of elements that are as long as in `ENDS`.
    """
    EI, start, beams = 1.0 / eta**2, 0.0, []
    for i, (length, ratio) in enumerate(zip(made * np.diff(ENDS), made, strict=True)):
        section = slender(EI * ratio, 4900.0 * EI * ratio, 1.0 / ratio)
        beams.append(fc.Beam(f"blade_{i}", (start, 0, 0), (start + length, 0, 0), section))
        start += length
    joints = [fc.Support(beams[0].start), *(fc.Weld(a.end, b.start) for a, b in pairwise(beams))]
    structure = fc.planar(fc.Structure(beams, joints), "z")
    linear = fc.linearize(assembled(structure, [*MOVING, fc.RotatingFrame((0, 0, 1))]))
    return float(np.abs(linear.damped_poles(1))[0] * eta)


def drawn_to_length(eta: float) -> np.ndarray:
    """How long elements are made that the pull Ω² ρA (L² − x²)/2 draws to those of `ENDS`."""
    a, b = ENDS[:-1], ENDS[1:]
    return 1.0 - 0.5 * (1.0 - (a * a + a * b + b * b) / 3.0) * eta**2 / 4900.0


def test_blade_drawn_to_its_length(record):
    """The published model leaves the steady stretch out: it is that of a blade which has its length when it spins."""
    slow = [eta for eta in CHORDWISE if eta <= 10]
    for case, spins, tolerance in (("η = 2, 4 … 10", slow, 1e-4), ("η = 50", [50], 1e-3)):
        case = f"blade of slenderness 70 made so much shorter as it stretches, {case}: lagging ω₁"
        ritz = [lagging_by_ritz(eta, 70.0, stretched=False) for eta in spins]
        source = {"reference": [CHORDWISE[eta] for eta in spins], "source": PUBLISHED, "tolerance": tolerance}
        record(f"{case}, Ritz series of order 20", ours=ritz, **source)
        ours = [swaying(eta, drawn_to_length(eta)) for eta in spins]
        record(f"{case}, 20 elements", ours=ours, **source)
        record(
            f"{case}, 20 elements, against the series",
            ours=ours,
            reference=np.round(ritz, 6),  # known to 1e-7
            source="Ritz series of order 20",
            tolerance=tolerance,
        )


def test_blade_that_stretches(record):
    """By 0.4 % less frequency at η = 10, 10 % at η = 50."""
    for eta in CHORDWISE:
        record(
            f"blade of slenderness 70, η = {eta}: lagging ω₁, 20 elements",
            ours=swaying(eta, np.ones(20)),
            reference=round(lagging_by_ritz(eta, 70.0, stretched=True), 5),  # known to 1e-6
            source="Ritz series of order 20, about the stretched blade",
            tolerance=1e-4 if eta <= 10 else 1e-3,
        )


def test_blade_that_stretches_and_spins_fast(record):
    """Most of the error is along the first tenth; every element halved leaves about a fifth of it."""
    for inner, outer in ((12, 8), (24, 16)):
        record(
            f"blade of slenderness 70, η = 50: lagging ω₁, {inner + outer} elements, {inner} along the first tenth",
            ours=lagging(50, EA=4900.0, root=0.1, elements=(inner, outer)),
            reference=round(lagging_by_ritz(50, 70.0, stretched=True), 5),  # known to 1e-6
            source="Ritz series of order 20, about the stretched blade",
            tolerance=1e-4,
        )


def test_stretch_of_a_spinning_rod(record):
    beam = fc.Beam("rod", (0, 0, 0), (10, 0, 0), slender(1.4e4, 2.8e7, 1.2), elements=20)
    structure = fc.Structure([beam], [fc.Support(beam.start)], outputs=[fc.Position("tip", beam.end, "x")])
    rest = fc.equilibrium(assembled(structure, [*MOVING, fc.RotatingFrame((0, 0, 6.0))]))
    record(
        "rod of the spin-up manoeuvre at 6 rad/s: stretch [m]",
        ours=rest.outputs["tip"] - 10,
        reference=5.1429e-4,
        source="L (tan x/x − 1), x = ΩL √(ρA/EA)",
        tolerance=1e-3,
    )


@pytest.mark.parametrize(
    ("sweep", "speeds"),
    [
        (0, {0: (1.4, 10.3, 27.7), 500: (10.2, 25.2, 47.0), 750: (14.8, 36.1, 62.9)}),
        (45, {0: (1.6, 10.4, 24.8), 500: (10.2, 21.6, 35.1), 750: (14.7, 26.1, 44.8)}),
    ],
)
def test_blade_with_a_swept_tip(record, sweep, speeds):
    """Inches and pounds: 31.5 in straight from 2.5 in, a tip of 6 in, 1 × 0.063 in, aluminium."""
    for rpm, measured in speeds.items():
        found = swept_blade(math.radians(sweep), rpm * math.pi / 30)
        case = f"blade with a tip swept by {sweep}°, {rpm} rpm: f₁…f₃ [Hz]"
        record(case, ours=found, reference=measured, source=EPPS, tolerance=0.1)


def swept_blade(back: float, spin: float) -> np.ndarray:
    """The three lowest frequencies [Hz] of flapping and twisting; time is counted in units of 1/spin."""
    rate = spin or 1.0
    section = fc.Section.rectangle(fc.Material(1.06e7 / rate**2, 2.51e-4, 0.325), 1.0, 0.063)
    straight = fc.Beam("straight", (2.5, 0, 0), (34, 0, 0), section, elements=12)
    tip = fc.Beam("tip", straight.end, (34 + 6 * math.cos(back), -6 * math.sin(back), 0), section, elements=4)
    structure = fc.Structure([straight, tip], [fc.Support(straight.start), fc.Weld(straight.end, tip.start)])
    turning = [fc.RotatingFrame((0, 0, 1))] if spin else []
    return rate * out_of_plane(fc.linearize(assembled(structure, [*MOVING, *turning])))


def out_of_plane(linear: fc.LinearModel) -> np.ndarray:
    """The three lowest frequencies [Hz] of flapping and twisting."""
    modes = linear.modes(12)
    flaps = np.array([name.endswith(("_w", "_rx", "_ry")) for name in linear.coordinates])
    share = np.einsum("ij,ij->j", modes.shapes[flaps], (linear.M @ modes.shapes)[flaps])
    return modes.frequencies[share > 0.5][:3]


def test_mass_on_springs_in_a_turning_frame(record):
    """Foucault's pendulum: ω₀ ± Ω, stable beyond Ω = ω₀ where K alone is not."""
    load = fc.PointMass("load", (0, 0, 0), 2.0)
    places = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]
    springs = [fc.Spring(f"spring_{i}", load.node, p, stiffness=4.0) for i, p in enumerate(places)]
    joints = [
        fc.Support(load.node, "w"),
        *(fc.Pin(load.node, s.start) for s in springs),
        *(fc.Support(s.end) for s in springs),
    ]
    structure = fc.Structure([load, *springs], joints)
    for spin in (1.0, 2.5):
        linear = fc.linearize(assembled(structure, [*MOVING, fc.RotatingFrame((0, 0, spin))]))
        poles = linear.damped_poles()
        found = np.sort(np.abs(poles))[::2]
        record(
            f"mass on springs, ω₀ = 2, Ω = {spin}: ω",
            ours=found,
            reference=sorted([abs(2 - spin), 2 + spin]),
            source="ω₀ ± Ω",
            tolerance=1e-12,
        )
        assert np.abs(poles.real).max() < 1e-12
        assert linear.modes().unstable == (2 if spin > 2 else 0)
