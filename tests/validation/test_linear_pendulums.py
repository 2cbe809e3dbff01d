"""Pendulums.

A load that hangs on pins, rods, springs and beams: the weight stiffens what it pulls.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from prestressed import MOVING, G, assembled, slender

import flexctrl as fc

PAGE = "linear"


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
