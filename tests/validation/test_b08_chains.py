"""B8, chains and ropes that snap: a folded chain that falls, a mass caught by a rope.

The folded chain hangs by one end; the other, held beside it, is let go. Half way down it has overtaken free fall, as
the fold pulls at it: in the limit of fine links v² = g x (2L − x)/(L − x) (Calkin and March 1989). Forty pieces of a
stiff rope with the masses between, half of one at the tip, generalised alpha of 0.1 ms. The pull on the tip:
tests/hard/test_d17_folded_chain.py.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute
from scipy.integrate import quad

import flexctrl as fc

PAGE = "dynamics"
G, LINKS = 9.81, 40


@cache
def falling() -> fc.Run:
    """Links of 1/40 m: half of them down, one across, the others up to where the end is let go."""
    length, half = 1.0 / LINKS, (LINKS - 1) // 2
    across, bottom = length * np.sqrt(0.75), -(half + 0.5) * length
    places = [(0.0, 0.0, -i * length) for i in range(half + 1)] + [(across, 0.0, bottom)]
    places += [(2.0 * across, 0.0, -(half - i) * length) for i in range(LINKS - half - 1)]
    ropes = [fc.Rope(f"link{i}", a, b, EA=1e4) for i, (a, b) in enumerate(pairwise(places))]
    masses = [fc.PointMass(f"mass{i}", rope.end, length) for i, rope in enumerate(ropes[:-1])]
    masses.append(fc.PointMass("tip", ropes[-1].end, 0.5 * length))
    joints = [fc.Support(ropes[0].start, "u v w"), *(fc.Support(mass.node, "v") for mass in masses)]
    joints += [fc.Pin(rope.end, mass.node) for rope, mass in zip(ropes, masses, strict=True)]
    joints += [fc.Pin(mass.node, rope.start) for mass, rope in zip(masses, ropes[1:], strict=False)]
    outputs = [fc.Position("tip", masses[-1].node, "z")]
    structure = fc.Structure([*ropes, *masses], joints, outputs=outputs)
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    return fc.simulate(model, until=0.405, method=fc.GeneralizedAlpha(1e-4))


def when(x: float) -> float:
    """The time until the tip of a chain of 1 m has fallen by x: ∫ √((1 − s)/(g s (2 − s))) ds, with s = r²."""
    return quad(lambda r: 2.0 * np.sqrt((1.0 - r * r) / (G * (2.0 - r * r))), 0.0, np.sqrt(x))[0]


@pytest.mark.slow
def test_a_folded_chain_falls_faster_than_free(record):
    run = falling()
    fallen = run["tip"][0] - run["tip"]
    whole = int(np.argmax(fallen))
    ours = [*(float(np.interp(x, fallen[:whole], run.t[:whole])) for x in (0.5, 0.9)), run.t[whole]]
    record(
        "B8 folded chain of 40 links, time to fall by 0.5, 0.9 and all of its length [s]",
        ours=ours,
        reference=[when(0.5), when(0.9), when(1.0)],
        source="Calkin and March 1989, closed form",
        tolerance=0.02,
    )
    assert when(1.0) * np.sqrt(G) == pytest.approx(1.1981402, abs=1e-6)
    assert ours[1] < np.sqrt(2.0 * 0.9 / G)


@cache
def caught(drop: float, until: float) -> fc.Run:
    """1000 kg that fall by ``drop`` before a rope of 1 MN/m takes them."""
    rope = fc.Rope("rope", (0, 0, 10.0), (0, 0, drop), EA=1e7, length=10.0)
    mass = fc.PointMass("mass", rope.end, 1000.0)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, mass.node), fc.Support(mass.node, "u v")]
    outputs = [fc.Tension("tension", rope), fc.Velocity("speed", mass.node, "z")]
    structure = fc.Structure([rope, mass], joints, outputs=outputs)
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    return fc.simulate(model, until=until, method=fc.GeneralizedAlpha(1e-4))


def tops(run: fc.Run) -> np.ndarray:
    """When the mass is highest."""
    v = run["speed"]
    last = np.flatnonzero((v[:-1] > 0.0) & (v[1:] <= 0.0))
    return run.t[last] + (run.t[last + 1] - run.t[last]) * v[last] / (v[last] - v[last + 1])


def test_a_rope_catches_a_mass(record):
    run = caught(0.5, 7.6)
    record(
        "B8 rope catch, largest tension [N]",
        ours=run["tension"].max(),
        reference=1000 * G * (1.0 + np.sqrt(1.0 + 2.0 * 0.5 * 1e6 / (1000 * G))),
        source="closed form",
        tolerance=1e-4,
    )
    record(
        "B8 rope catch, period after ten bounces [s]",
        ours=tops(run)[9] / 10.0,
        reference=0.744140559,
        source="closed form",
        tolerance=1e-4,
    )
    record(
        "B8 rope catch, smallest tension over the largest",
        ours=run["tension"].min() / run["tension"].max(),
        reference=0.0,
        source="a rope does not push",
        tolerance=Absolute(1e-9),
    )


def test_a_load_put_on_at_once_counts_twice(record):
    record(
        "B8 rope catch without a fall, largest tension over the weight",
        ours=caught(0.0, 0.3)["tension"].max() / (1000 * G),
        reference=2.0,
        source="closed form",
        tolerance=1e-4,
    )
