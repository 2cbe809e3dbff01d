"""Prestress: weight, spin and axial load.

What loads add to the stiffness (and turn into Coriolis terms): pendulums, hanging chains and ropes, rotating blades,
columns on the way to buckling. Every linear model is taken about the equilibrium that `equilibrium` finds.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute
from scipy.optimize import brentq
from spinning_blade import lagging as lagging_by_ritz

import flexctrl as fc

PAGE = "linear"
G = 9.81
MOVING = [fc.LargeRotation(), fc.Flexible()]
BESSEL = "closed form, Bessel functions"


def assembled(structure: fc.Structure, effects: list[fc.Effect]) -> fc.Model:
    return fc.assemble(structure, effects, fc.CasadiVM())


def slender(EI: float, EA: float, rhoA: float = 1.0) -> fc.Section:
    return fc.Section(EA=EA, EI_y=EI, EI_z=EI, GJ=EI, rhoA=rhoA, rhoJ=1e-6 * rhoA)


# -- pendulums


def by_a_pin() -> fc.Structure:
    body = fc.RigidBody("load", (0, 0, -2), 3.0, (0, 0, 0), {"eye": (0, 0, 0)})
    return fc.planar(fc.Structure([body], [fc.Support(body.point("eye"), "u v w")]), "y")


def by_a_spring() -> fc.Structure:
    spring, load = fc.Spring("spring", (0, 0, 0), (0, 0, -2), stiffness=3e4), fc.PointMass("load", (0, 0, -2), 3.0)
    return fc.Structure([spring, load], [fc.Support(spring.start), fc.Pin(spring.end, load.node)])


def by_a_rod() -> fc.Structure:
    rod, load = fc.Rope("rod", (0, 0, 0), (0, 0, -2), EA=1.0), fc.PointMass("load", (0, 0, -2), 3.0)
    return fc.Structure([rod, load], [fc.Support(rod.start), fc.Pin(rod.end, load.node)])


def by_beams(count: int, held: str) -> fc.Structure:
    tops = np.linspace(0.0, -2.0, count + 1)
    section = slender(EI=40.0, EA=3e6, rhoA=0.0)
    beams = [fc.Beam(f"link_{i}", (0, 0, a), (0, 0, b), section) for i, (a, b) in enumerate(pairwise(tops))]
    load = fc.PointMass("load", (0, 0, -2), 3.0)
    chain = [fc.Pin(a.end, b.start) for a, b in pairwise(beams)]
    return fc.planar(
        fc.Structure([*beams, load], [fc.Support(beams[0].start, held), *chain, fc.Pin(beams[-1].end, load.node)]), "y"
    )


def lever(EI: float, tension: float, length: float) -> float:
    """Length of the pendulum that a clamped massless beam makes: L − tanh(λL)/λ, λ² = T/EI."""
    rate = math.sqrt(tension / EI)
    return length - math.tanh(rate * length) / rate


PULL = 3.0 * G
HANGINGS = {
    "a pin": (by_a_pin(), [fc.LargeRotation()], 2.0, "ω² = g/L"),
    "a stiff spring": (by_a_spring(), MOVING, 2.0 + PULL / 3e4, "ω² = g/(L + mg/k)"),
    "a rigid rod": (by_a_rod(), [fc.LargeRotation()], 2.0, "ω² = g/L"),
    "a hinged beam": (by_beams(1, "u v w"), MOVING, 2.0 * (1 + PULL / 3e6), "ω² = g/(L + mgL/EA)"),
    "a chain of four beams": (by_beams(4, "u v w"), MOVING, 2.0 * (1 + PULL / 3e6), "ω² = g/(L + mgL/EA)"),
}


@pytest.mark.parametrize("by", HANGINGS)
def test_a_mass_swings_at_g_over_l(record, by):
    structure, effects, length, source = HANGINGS[by]
    linear = fc.linearize(assembled(structure, [*effects, fc.Gravity()]))
    swings = linear.modes(2).omega_squared
    assert swings[0] > 0.0
    record(f"point mass on {by}: ω²", ours=swings[0], reference=G / length, source=source, tolerance=1e-6)


def test_a_mass_on_a_clamped_beam(record):
    """Bent at the clamp: the pendulum is shorter by the length in which the beam bends. 32 elements."""
    beam = fc.Beam("beam", (0, 0, 0), (0, 0, -2), slender(EI=1.0, EA=3e7, rhoA=0.0), elements=32)
    load = fc.PointMass("load", beam.end, 3.0)
    structure = fc.planar(fc.Structure([beam, load], [fc.Support(beam.start), fc.Pin(beam.end, load.node)]), "y")
    found = fc.linearize(assembled(structure, [*MOVING, fc.Gravity()])).modes().omega_squared[0]
    expected = G / lever(1.0, PULL, 2.0 * (1 + PULL / 3e7))
    source = "ω² = g/(L − tanh(λL)/λ), λ² = mg/EI"
    record("point mass on a clamped beam: ω²", ours=found, reference=expected, source=source, tolerance=1e-5)


# -- chains and ropes


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


def test_hanging_chain(record):
    roots = (1.20241278, 2.76003906, 4.32686396, 5.89576722, 7.46545885)
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


@pytest.mark.parametrize(
    ("ratio", "roots"),
    [
        (0.1, (1.15739376, 2.81604648, 4.71450617)),
        (1.0, (1.05642248, 4.08168676, 7.73750314)),
        (10.0, (1.00793371, 10.27642630, 20.40413143)),
        (100.0, (1.00082912, 31.52605999, 63.00444850)),
        (1e4, (1.0000083329097, 314.1703022)),
        (1e6, (1.0000000833333, 3141.593757)),
    ],
)
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


# -- blades

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
SOUTHWELL = "Ritz series of order 18; Wright et al. 1982"


EPPS = "measured (Epps & Chandra 1996), as in GXBeam.jl test/examples/rotating.jl"


def blade(eta: float, normal: str, hub: float = 0.0, EA: float = 1e8, elements: int = 20) -> fc.LinearModel:
    """A uniform blade a metre long along x on a hub of radius ``hub``, spinning about z at η √(EI/ρAL⁴) = 1 rad/s.

    EA is that over EI/L².
    """
    EI = 1.0 / eta**2 if eta else 1.0
    beam = fc.Beam("blade", (hub, 0, 0), (hub + 1, 0, 0), slender(EI, EA * EI), elements=elements)
    structure = fc.planar(fc.Structure([beam], [fc.Support(beam.start)]), normal)
    return fc.linearize(assembled(structure, [*MOVING, *([fc.RotatingFrame((0, 0, 1))] if eta else [])]))


def flapping(eta: float, count: int, **shape: float) -> np.ndarray:
    """ω √(ρAL⁴/EI) of the lowest modes out of the plane of rotation."""
    return blade(eta, "y", **shape).modes(count).omega * (eta or 1.0)  # type: ignore[arg-type]


def lagging(eta: float, **shape: float) -> float:
    """The same of the lowest mode in the plane, with Coriolis forces."""
    return float(np.abs(blade(eta, "z", **shape).damped_poles(1))[0] * (eta or 1.0))  # type: ignore[arg-type]


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
    found = flapping(50, 1, elements=40)
    record(
        "blade, η = 50: flapping ω₁, 40 elements", ours=found, reference=[51.07981], source=SOUTHWELL, tolerance=1e-4
    )


def test_blade_that_stretches(record):
    """Slenderness 70: the published model leaves the steady stretch out, 0.4 % at η = 10; ours has it."""
    published = {2: 3.6195, 4: 3.888, 6: 4.2393, 8: 4.6105, 10: 4.97}
    case = "blade of slenderness 70, η = 2, 4 … 10: lagging ω₁"
    record(
        f"{case}, steady stretch left out, Ritz series of order 14",
        ours=[lagging_by_ritz(spin, 70.0, stretched=False) for spin in published],
        reference=list(published.values()),
        source="octave-user/mboct-fem-pkg inst/fem_tests_060.tst",
        tolerance=1e-4,
    )
    record(
        case,
        ours=[lagging(spin, EA=4900.0) for spin in published],
        reference=[round(lagging_by_ritz(spin, 70.0, stretched=True), 6) for spin in published],  # known to 1e-8
        source="Ritz series of order 14, about the stretched blade",
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


# -- columns

COLUMNS = {
    "clamped–free": ("all", "", math.pi**2 / 4),
    "pinned–pinned": ("u v w", "v", math.pi**2),
    "clamped–pinned": ("all", "v", 20.190728556),
    "clamped–clamped": ("all", "v rx", 4 * math.pi**2),
}


def column(start: str, end: str, elements: int = 16, EA: float = 1e7) -> fc.Model:
    beam = fc.Beam("column", (0, 0, 0), (0, 0, 1), slender(1.0, EA), elements=elements)
    supports = [fc.Support(beam.start, start), *([fc.Support(beam.end, end)] if end else [])]
    structure = fc.Structure([beam], supports, inputs=[fc.Force("pull", beam.end, "z")])
    return assembled(fc.planar(structure, "x"), MOVING)


def loaded(model: fc.Model, pull: float) -> fc.LinearModel:
    return fc.linearize(model, fc.equilibrium(model, inputs={"pull": pull}))


def softest(linear: fc.LinearModel) -> float:
    return float(np.linalg.eigvalsh(linear.K.toarray())[0])


@pytest.mark.parametrize("ends", COLUMNS)
def test_column_buckles_where_k_is_singular(record, ends):
    start, end, load = COLUMNS[ends]
    model = column(start, end)
    found = brentq(lambda p: softest(loaded(model, -p)), 0.95 * load, 1.05 * load, xtol=1e-6 * load)
    record(
        f"{ends} column: P/(EI/L²) where K is singular, 16 elements",
        ours=found,
        reference=load,
        source="closed form (Euler 1744)",
        tolerance=1e-4,
    )


def test_frequency_falls_to_nothing_at_the_buckling_load(record):
    model = column("u v w", "v", elements=32)
    for pull in (1.0, -0.5, -0.9, -0.99):
        found = loaded(model, pull * math.pi**2).modes(1).omega[0] / math.pi**2
        record(
            f"simple beam under N = {pull:g} Pe: ω/ω₀",
            ours=found,
            reference=math.sqrt(1 + pull),
            source="√(1 + N/Pe)",
            tolerance=1e-4,
        )


def test_heavy_mast_buckles(record):
    """Under its own weight: q L³/EI."""

    def stiffness(ratio: float) -> float:
        beam = fc.Beam("mast", (0, 0, 0), (0, 0, 1), slender(G / ratio, 1e7), elements=16)
        structure = fc.planar(fc.Structure([beam], [fc.Support(beam.start)]), "x")
        return softest(fc.linearize(assembled(structure, [*MOVING, fc.Gravity()])))

    found = brentq(stiffness, 7.5, 8.2, xtol=1e-6)
    record(
        "mast under its own weight: qL³/EI where K is singular, 16 elements",
        ours=found,
        reference=7.8373474,
        source="closed form, 9/4 of the square of a zero of J₋₁⸝₃ (Greenhill 1881)",
        tolerance=1e-5,
    )


def test_lateral_buckling(record):
    """A strip on edge, loaded at its tip: EI about the strong axis is 10⁴ times that about the weak one."""
    section = fc.Section(EA=1e9, EI_y=1e4, EI_z=1.0, GJ=0.5, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("strip", (0, 0, 0), (1, 0, 0), section, elements=24)
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[fc.Force("pull", beam.end, "z")])
    model = assembled(structure, MOVING)
    unit = math.sqrt(0.5)
    found = brentq(lambda p: softest(loaded(model, -p * unit)), 3.9, 4.15, xtol=1e-5)
    record(
        "strip with a load at its tip: P L²/√(EI GJ) where K is singular, 24 elements",
        ours=found,
        reference=4.0125993,
        source="closed form, zero of J₋₁⸝₄ (Prandtl 1899)",
        tolerance=2e-3,
    )


def test_lateral_buckling_under_a_uniform_moment(record):
    """A8: a strip on edge between forks, bent by a couple at each end.

    A couple of fixed direction has no potential. Here it is a pair of forces along the strip on the ends of an upright
    lever that the fork keeps from leaning, a quasi-tangential couple: K is symmetric.
    """
    section = fc.Section(EA=1e9, EI_y=1e4, EI_z=1.0, GJ=0.5, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("strip", (0, 0, 0), (1, 0, 0), section, elements=24)
    arms = [
        fc.RigidBody(f"arm{x}", (x, 0, 0), 1.0, (1.0, 1.0, 1.0), points={"top": (x, 0, 0.1), "foot": (x, 0, -0.1)})
        for x in (0, 1)
    ]
    forces = [fc.Force(f"{end}{x}", arm.point(end), "x") for x, arm in enumerate(arms) for end in ("top", "foot")]
    joints = [fc.Weld(beam.start, arms[0].node), fc.Weld(beam.end, arms[1].node)]
    joints += [fc.Support(beam.start, "u v w rx"), fc.Support(beam.end, "v w rx")]
    model = assembled(fc.Structure([beam, *arms], joints, inputs=forces), MOVING)
    unit = math.pi * math.sqrt(0.5)

    def stiffness(share: float) -> float:
        force = share * unit / 0.2
        pulls = {"top0": force, "foot0": -force, "top1": -force, "foot1": force}
        return softest(fc.linearize(model, fc.equilibrium(model, inputs=pulls)))

    record(
        "strip between forks under end couples: M L/(π √(EI GJ)) where K is singular, 24 elements",
        ours=brentq(stiffness, 0.97, 1.03, xtol=1e-6),
        reference=1.0,
        source="closed form (Timoshenko & Gere 1961)",
        tolerance=2e-3,
    )
