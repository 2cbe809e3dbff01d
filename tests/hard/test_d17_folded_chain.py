"""D17: a folded chain lets go of one end: faster than free fall, its tip whips.

v² = g x (2L − x)/(L − x) for the falling end (Calkin & March); 40 links of a metre together, as masses on stiff springs
a fortieth of a metre long, the fold one link wide. Energy until 0.95 L.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
LINKS, G = 40, 9.81
FREE_FALL = math.sqrt(2.0 / G)


def chain() -> fc.Model:
    link, half = 1.0 / LINKS, LINKS // 2
    places = [(0.0, 0.0, -i * link) for i in range(half + 1)]
    places += [(link, 0.0, (i - half) * link) for i in range(LINKS - half)]
    springs = [fc.Spring(f"s{i}", a, b, stiffness=2e5) for i, (a, b) in enumerate(pairwise(places))]
    masses = [fc.PointMass(f"m{i}", s.end, link * (0.5 if i == LINKS - 1 else 1)) for i, s in enumerate(springs)]
    joints = [fc.Support(springs[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(springs))]
    joints += [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    outputs = [fc.Position("fallen", masses[-1].node, "-z", minus=springs[0].start)]
    structure = fc.planar(fc.Structure([*springs, *masses], joints, outputs=outputs), "y")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])


@pytest.mark.slow
def test_the_fall(record):
    model = chain()
    events = [fc.Event("almost", "fallen", at=0.95, terminal=True)]
    method, tolerance = fc.AdaptiveAlpha(), fc.Tolerance(1e-8, 1e-10)
    run = fc.simulate(model, until=0.5, method=method, tolerance=tolerance, events=events)
    record(
        "D17 folded chain: time to 0.95 L over √(L/g)",
        ours=run.final.t * math.sqrt(G),
        reference=exact(0.95),
        source="∫ dx/v of the continuous chain",
        tolerance=0.02,
    )
    record(
        "D17 folded chain: energy lost or made until 0.95 L",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-4),
    )
    assert run.final.t < FREE_FALL * math.sqrt(0.95)


def exact(share: float) -> float:
    from scipy.integrate import quad

    return float(quad(lambda s: 2.0 * s * math.sqrt((1 - s * s) / (s * s * (2 - s * s))), 0.0, math.sqrt(share))[0])


def test_the_whole_time_is_that_of_the_reference():
    assert exact(1.0) == pytest.approx(1.1981402, abs=1e-7)


@pytest.mark.slow
def test_what_a_dissipative_method_loses_is_told(record):
    """ρ = 0: what is missing in the end is what the report says it lost."""
    model = chain()
    run = fc.simulate(model, until=0.45, method=fc.AdaptiveAlpha(rho=0.0), tolerance=fc.Tolerance(1e-4, 1e-7))
    lost = sum(model.energy(model.rest)[:2]) - sum(model.energy(run.final)[:2])
    record(
        "D17 folded chain, ρ = 0, past the whip: loss told over loss",
        ours=-run.report.energy.gap / lost,
        reference=1.0,
        source="energy of the first and the last state",
        tolerance=1e-9,
    )
    assert lost > 0.0
    assert "spectral radius 0 " in run.report.damping
