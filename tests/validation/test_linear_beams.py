"""Beams and rods.

Natural frequencies of beams put together from elements and supports, per length, stiffness and mass of one:
$λ = β L$ with $ω = β^2\\sqrt{EI/ρA}$ in bending, $ω\\,L/c$ along the axis and in torsion. Planar unless said; free,
clamped, pinned and guided ends are supports of the end nodes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from recorder import Absolute
from scipy.linalg import subspace_angles

import flexctrl as fc

PAGE = "linear"
BLEVINS = "closed form, roots of the frequency equation (Blevins 1979, table 8-1)"
ENDS = {"free": "", "clamped": "all", "pinned": "u v w", "forked": "u v w rx", "guided": "u rx ry rz"}
"""What each end holds; guided: it slides across the beam."""
SLENDER = fc.Section(EA=1e4, EI_y=1.0, EI_z=1.0, GJ=0.5, rhoA=1.0, rhoJ=1e-4)
FREE_FREE = (4.73004074486, 7.8532046241, 10.9956078380)
CASES = {
    ("clamped", "free"): (1.87510406871, 4.69409113297, 7.85475743824, 10.9955407349, 14.1371683910),
    ("clamped", "clamped"): FREE_FREE,
    ("free", "free"): FREE_FREE,
    ("clamped", "pinned"): (3.92660231205, 7.06858274563, 10.2101761228),
    ("free", "pinned"): (3.92660231205, 7.06858274563, 10.2101761228),
    ("clamped", "guided"): (2.36502037243, 5.4978039190, 8.6393798287),
    ("pinned", "pinned"): (math.pi, 2 * math.pi, 3 * math.pi),
}
CANTILEVER = CASES["clamped", "free"]


def bar(
    elements: int,
    ends: Sequence[str] = ("clamped", "free"),
    section: fc.Section = SLENDER,
    loads: dict[int, float] | None = None,
    plane: str | None = "y",
    length: float = 1.0,
) -> fc.LinearModel:
    """A beam along x with masses on its nodes, free to move across the plane's normal, without weight."""
    beam = fc.Beam("beam", (0, 0, 0), (length, 0, 0), section, elements=elements)
    masses = [fc.PointMass(f"mass_{i}", beam.node(i), m) for i, m in (loads or {}).items()]
    pins = [fc.Pin(beam.node(i), mass.node) for i, mass in zip(loads or {}, masses, strict=True)]
    supports = [
        fc.Support(node, ENDS[end]) for node, end in zip((beam.start, beam.end), ends, strict=True) if ENDS[end]
    ]
    structure = fc.Structure([beam, *masses], [*supports, *pins])
    return linear(fc.planar(structure, plane) if plane else structure)


def linear(structure: fc.Structure, *more: fc.Effect) -> fc.LinearModel:
    return fc.linearize(fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), *more], fc.CasadiVM()))


def bending(model: fc.LinearModel, count: int) -> np.ndarray:
    """λ of the lowest modes that bend: their energy lies in w and ry."""
    modes = model.modes(min(4 * count + 8, len(model.coordinates)))
    along = np.array([name.endswith("_u") for name in model.coordinates])
    share = np.einsum("ij,ij->j", modes.shapes[along], (model.M @ modes.shapes)[along])
    return np.sqrt(modes.omega[(share < 0.5) & (modes.omega > 0.0)][:count])


@pytest.mark.parametrize("ends", CASES, ids="-".join)
def test_beam_on_its_supports(record, ends):
    roots = CASES[ends]
    found = bending(bar(16, ends), len(roots))
    record(f"{ends[0]}–{ends[1]} beam, λ, 16 elements", ours=found, reference=roots, source=BLEVINS, tolerance=2.5e-4)


@pytest.mark.parametrize(
    ("ratio", "roots"),
    [
        (0.1, (1.72274152059, 4.39952281616)),
        (0.5, (1.41996442977, 4.11113338642)),
        (1.0, (1.24791740961, 4.03113943671)),
        (2.0, (1.07619566408, 3.98257328776)),
        (10.0, (0.73578191939, 3.93846583325)),
    ],
)
def test_cantilever_with_a_mass_at_its_tip(record, ratio, roots):
    found = bending(bar(16, loads={16: ratio}), 2)
    source = "closed form, 1 + cos λ cosh λ = λ μ (sin λ cosh λ − cos λ sinh λ)"
    record(f"cantilever with tip mass μ = {ratio:g}, λ", ours=found, reference=roots, source=source, tolerance=1e-5)


@pytest.mark.parametrize(
    ("ratio", "square"), [(0.5, 6.96598013623), (1.0, 5.67959788252), (2.0, 4.39314381896), (10.0, 2.13951289375)]
)
def test_simple_beam_with_a_mass_in_the_middle(record, ratio, square):
    found = bending(bar(16, ("pinned", "pinned"), loads={8: ratio}), 1) ** 2
    source = "closed form, tan(λ/2) − tanh(λ/2) = 4/(μ λ)"
    record(
        f"simple beam with mid-span mass μ = {ratio:g}, λ²", ours=found, reference=square, source=source, tolerance=1e-5
    )


@pytest.mark.parametrize(("mode", "meshes"), [(0, (1, 2, 4, 8)), (2, (8, 16, 32)), (4, (16, 32))])
def test_error_of_cubic_elements(record, mode, meshes):
    """(λ/n)⁴/1440 of the frequency, from above, where an element is shorter than a wave over 2π."""
    root = CANTILEVER[mode]
    fine = [n for n in meshes if n > root]
    errors = [bending(bar(n), mode + 1)[mode] ** 2 / root**2 - 1 for n in fine]
    law = [(root / n) ** 4 / 1440 for n in fine]
    case = f"cantilever, mode {mode + 1}: error of ω with {', '.join(map(str, fine))} elements"
    record(
        case,
        ours=errors,
        reference=law,
        source="(λ/n)⁴/1440, the leading term of the discretisation error",
        tolerance=0.5,
    )
    slope = np.polyfit(np.log(fine), np.log(errors), 1)[0]
    record(
        f"cantilever, mode {mode + 1}: order of convergence",
        ours=slope,
        reference=-4,
        source="cubic elements",
        tolerance=Absolute(0.1),
    )


@pytest.mark.parametrize(("elements", "along", "tolerance"), [(100, 0, 3e-4), (10, 2, 1e-5)])
def test_rod_and_shaft(record, elements, along, tolerance):
    """Along the axis and about it: the linear elements' own error is (ω/n)²/24, that of cubics of sixth order."""
    roots = (2 * np.arange(1, 4) - 1) * np.pi / 2
    section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=4.0, rhoA=1.0, rhoJ=1.0)
    for held, freedom, speed, name in (
        ("v w rx ry rz", "u", 1.0, "rod, along"),
        ("u v w ry rz", "rx", 2.0, "shaft, twist"),
    ):
        beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=elements)
        joints = [fc.Support(beam.start), *(fc.Support(node, held) for node in beam.nodes[1:])]
        model = linear(fc.Structure([beam], joints), fc.ComponentModes(0, along=along))
        own = {f"{kind}{i}" for i in range(1, along + 1) for kind in "xt"}
        assert {c.rsplit("_", 1)[1] for c in model.coordinates} == {freedom} | own
        found = model.modes(3).omega / speed
        record(
            f"fixed–free {name}: ωL/c, {elements} elements" + (f", {along} shapes along each" if along else ""),
            ours=found,
            reference=roots,
            source="closed form, (2k − 1)π/2",
            tolerance=tolerance,
        )


@pytest.mark.parametrize(
    ("slenderness", "elements", "ratios"),
    [
        (0.05, 150, (0.995797, 0.983573, 0.964374, 0.939657, 0.910996)),
        (0.1, 220, (0.983573, 0.939657, 0.879859, 0.814787, 0.751067)),
        (0.2, 300, (0.939657, 0.814787, 0.691889, 0.590572, 0.510392)),
    ],
)
def test_timoshenko_beam(record, slenderness, elements, ratios):
    """Simply supported rectangle, ν = 0.3, κ = 5/6: frequencies over those of the slender beam.

    The shear strain is constant in an element, so that the error falls with the square of its length.
    """
    nu, h = 0.3, slenderness
    EA, EI, rhoI = 12 / h**2, 1.0, h**2 / 12
    GA = 5 / 6 * EA / (2 * (1 + nu))
    section = fc.Section(EA, EI, EI, 1.0, 1.0, 1e-3, rhoI_y=rhoI, rhoI_z=rhoI, GA_y=GA, GA_z=GA)
    found = bending(bar(elements, ("pinned", "pinned"), section), 5) ** 2 / (np.arange(1, 6) * np.pi) ** 2
    source = "closed form (Timoshenko 1921), modes 1…5"
    record(
        f"Timoshenko beam, h/L = {h:g}: ω/ω of Euler–Bernoulli, {elements} elements",
        ours=found,
        reference=ratios,
        source=source,
        tolerance=1e-4,
    )


@pytest.mark.parametrize(("plane", "rigid"), [("y", 3), (None, 6)], ids=["planar", "spatial"])
def test_free_beam_keeps_its_rigid_motion(record, plane, rigid):
    model = bar(16, ("free", "free"), plane=plane)
    modes = model.modes()
    name = "planar" if plane else "spatial"
    record(
        f"free beam, {name}: rigid-body modes",
        ours=modes.rigid,
        reference=rigid,
        source="motions of a body",
        tolerance=Absolute(0),
    )
    worst = np.abs(modes.omega_squared[:rigid]).max() / modes.omega_squared[rigid]
    record(
        f"free beam, {name}: largest rigid ω² over the first flexible",
        ours=worst,
        reference=0,
        source="exact zero",
        tolerance=Absolute(1e-12),
    )
    first = np.sqrt(modes.omega[modes.flexible][0])
    record(f"free beam, {name}: first flexible λ", ours=first, reference=FREE_FREE[0], source=BLEVINS, tolerance=2e-5)
    assert len(model.certificate.rigid_modes) == rigid


def square(elements: int = 20, detuned: float = 0.0) -> fc.LinearModel:
    """Simply supported steel bar of 10 m, 0.3 × 0.3 m, in both planes."""
    EI = 210e9 * 0.3**4 / 12
    section = fc.Section(210e9 * 0.09, EI, EI * (1 + detuned), 1e9, 7850 * 0.09, 1e3)
    return bar(elements, ("forked", "forked"), section, plane=None, length=10.0)


def test_square_beam_has_its_modes_twice(record):
    modes = square().modes()
    case = "square steel beam 10 × 0.3 × 0.3 m, simply supported: f₁ = f₂ [Hz]"
    source = "closed form, (π/2) √(EI/ρA)/L²"
    record(case, ours=modes.frequencies[:2], reference=[7.035991850] * 2, source=source, tolerance=1e-6)
    gap = modes.omega[1] / modes.omega[0] - 1
    record("square beam: gap of the first pair", ours=gap, reference=0, source="symmetry", tolerance=Absolute(1e-10))
    gap = square(detuned=1e-6).modes().omega[1] / modes.omega[0] - 1
    record("square beam, one EI larger by 1e-6: gap", ours=gap, reference=5e-7, source="½ ΔEI/EI", tolerance=0.1)


def test_the_space_of_a_double_mode_does_not_depend_on_the_mesh(record):
    spaces = []
    for elements in (12, 24):
        model = square(elements)
        rows = [model.coordinates.index(f"beam_{i * elements // 4}_{f}") for i in (1, 2, 3) for f in ("v", "w")]
        spaces.append(model.modes().shapes[rows, :2])
    angle = subspace_angles(*spaces).max()
    case = "square beam: angle between the pair's spaces, 12 and 24 elements [rad]"
    record(case, ours=angle, reference=0, source="the same space", tolerance=Absolute(1e-6))


def test_response_does_not_depend_on_the_basis_of_a_double_mode(record):
    """A push along a skew direction, answered by direct solution and by the sum over modes."""
    beam = fc.Beam("beam", (0, 0, 0), (10, 0, 0), fc.Section(1e9, 1e8, 1e8, 1e8, 700.0, 1e3), elements=6)
    push = fc.Force("push", beam.end, (0, 1, 2))
    out = fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[out])
    effects = [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(0.0, 1e-4)]
    model = fc.linearize(fc.assemble(structure, effects, fc.CasadiVM()))
    omega = np.array([1.0, 13.0, 13.4, 80.0])
    found = model.frequency_response(omega).values[0, 0]
    M, C, K = (A.toarray() for A in (model.M, model.C, model.K))
    direct = [(model.Cq @ np.linalg.solve(K + 1j * w * C - w * w * M, model.B))[0, 0] for w in omega]
    worst = np.abs(found / np.array(direct) - 1).max()
    record(
        "cantilever with double modes: response by modes over direct solution, less 1",
        ours=worst,
        reference=0,
        source="dense solution at each frequency",
        tolerance=Absolute(1e-10),
    )
