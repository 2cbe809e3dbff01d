"""Buckling.

Columns, masts and strips on edge on the way to the load under which K is singular.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from prestressed import MOVING, G, assembled, slender
from scipy.optimize import brentq

import flexctrl as fc

PAGE = "linear"
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
