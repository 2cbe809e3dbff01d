"""A17: hanging cable between supports of equal height.

Span 100 m, 50 N/m. A rope is massless; a cable with weight is a row of them with point masses between (the outer
halves of its weight hang in the supports). The start is a straight row, slack or stretched, without stiffness across.
With n pieces the polygon differs from the catenary by (span/n)²: 1e-3 of the sag with 20, 3e-4 with 40, 1e-5 with 10
and 20 extrapolated.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc

PAGE = "statics"
SPAN, WEIGHT, G = 100.0, 50.0, 9.81
ELASTIC = {
    1e5: (4354.511585, 14.0883907, 5027.36784),
    1e6: (8632.083688, 7.2274872, 8990.30172),
    1e8: (14239.441656, 4.3998718, 14459.40369),
}
"""EA → horizontal tension, sag, greatest tension; unstretched 100.5 m."""


def cable(length: float, EA: float, pieces: int) -> fc.Rest:
    """Ropes end to end between the supports, drawn straight; the mass of each piece at its ends, half and half."""
    x = np.linspace(0.0, SPAN, pieces + 1)
    piece, mass = length / pieces, WEIGHT * length / pieces / G
    ropes = [fc.Rope(f"rope{i}", (a, 0, 0), (b, 0, 0), EA=EA, length=piece) for i, (a, b) in enumerate(pairwise(x))]
    masses = [fc.PointMass(f"mass{i}", (at, 0, 0), mass) for i, at in enumerate(x[1:-1])]
    joints: list = [fc.Support(ropes[0].start, "u v w"), fc.Support(ropes[-1].end, "u v w")]
    for i, body in enumerate(masses):
        joints += [fc.Pin(ropes[i].end, body.node), fc.Pin(body.node, ropes[i + 1].start)]
    middle = masses[pieces // 2 - 1].node
    outputs = [
        fc.Position("sag", middle, "-z"),
        fc.Tension("steepest", ropes[0]),
    ]
    structure = fc.Structure([*ropes, *masses], joints, outputs=outputs)
    return fc.equilibrium(fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]))


def measured(rest: fc.Rest, length: float, pieces: int) -> np.ndarray:
    """Horizontal tension, sag, tension at the support: the outermost half piece of weight hangs in the support."""
    steepest, half = rest.outputs["steepest"], 0.5 * WEIGHT * length / pieces
    across = np.sqrt(steepest**2 - (0.5 * WEIGHT * length - half) ** 2)
    return np.array([across, rest.outputs["sag"], np.hypot(across, 0.5 * WEIGHT * length)])


@pytest.mark.parametrize("EA", ELASTIC)
def test_elastic(record, EA):
    record(
        f"Elastic catenary, EA = {EA:g}, 40 ropes from a straight start: H, sag, greatest tension",
        ours=measured(cable(100.5, EA, 40), 100.5, 40),
        reference=ELASTIC[EA],
        source="closed form (Irvine)",
        tolerance=1e-3,
    )


@pytest.mark.parametrize("EA", ELASTIC)
def test_elastic_extrapolated(record, EA):
    coarse, fine = (measured(cable(100.5, EA, n), 100.5, n) for n in (10, 20))
    record(
        f"Elastic catenary, EA = {EA:g}, 10 and 20 ropes extrapolated",
        ours=(4.0 * fine - coarse) / 3.0,
        reference=ELASTIC[EA],
        source="closed form (Irvine)",
        tolerance=2e-5,
    )


def test_inextensible(record):
    coarse, fine = (measured(cable(110.0, 1e10, n), 110.0, n) for n in (20, 40))
    record(
        "Inextensible catenary, L = 110, 20 and 40 ropes extrapolated: H, sag, greatest tension",
        ours=(4.0 * fine - coarse) / 3.0,
        reference=(3274.81974, 20.030079, 4276.32369),
        source="closed form",
        tolerance=1e-4,
    )
