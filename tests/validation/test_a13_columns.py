"""A13: columns: the elastica after buckling, and a follower load that flutters.

The perfect column is followed to its branch point; from there a path leaves along the buckling mode. Elliptic
integrals give the bent shapes. Beck's column has a thrust that stays tangent to its end: no other equilibrium is near
at any load, and it flutters where its first two frequencies meet, at P L²/EI = 20.0509.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from statics import NONLINEAR, cantilever, out_of_plane, slender

import flexctrl as fc

PAGE = "statics"
ELASTICA = {
    20: (1.015397, 0.969731, 0.219413),
    40: (1.063663, 0.881204, 0.422240),
    60: (1.151720, 0.741020, 0.593208),
    80: (1.293889, 0.559396, 0.719497),
    100: (1.518389, 0.348989, 0.791539),
    120: (1.884801, 0.123160, 0.803171),
    140: (2.542258, -0.106923, 0.750388),
    176: (9.116218, -0.577211, 0.421442),
}
"""Tip angle in degrees → P/P_cr, x/L, y/L."""

CRITICAL = np.pi**2 / 4.0


@cache
def column() -> tuple[fc.Model, fc.EquilibriumPath]:
    model = cantilever(slender(1.0, 1.0), 1.0, 32, [lambda beam: fc.Force("P", beam.end, "-x")], planar=True)
    return model, fc.equilibrium_path(model, load={"P": CRITICAL}, until=1.2)


def test_the_branch_point_is_eulers_load(record):
    _, path = column()
    assert len(path.branchings) == 1
    assert path.unstable[[0, -1]].tolist() == [0, 1]
    record(
        "Column, 32 elements: P/P_cr at the branch point",
        ours=path.branchings[0].factor,
        reference=1.0,
        source="Euler",
        tolerance=1e-4,
    )


@pytest.mark.parametrize("angle", ELASTICA)
def test_elastica(record, angle):
    model, path = column()
    side = np.sign(path.branchings[0].mode[model.coordinate("beam_32_rz")])
    until = {"turn": side * np.radians(angle)}
    end = fc.equilibrium_path(model, load={"P": CRITICAL}, until=until, start=path.branchings[0]).points[-1]
    assert end.rest.stable
    record(
        f"Elastica with its tip at {angle}°, 32 elements: P/P_cr, x/L, y/L",
        ours=(end.factor, end.outputs["x"], abs(end.outputs["y"])),
        reference=ELASTICA[angle],
        source="elliptic integrals",
        tolerance=1e-3,
    )


@cache
def follower(*steady: str) -> fc.Model:
    """Beck's column; with steady thrusts beside the one that follows."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section(1e6, 1.0, 1.0, 1.0, 1.0, 1e-6), elements=20)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start), *out_of_plane(beam.nodes[1:])],
        inputs=[
            fc.FollowerForce("thrust", beam.end, "-x"),
            *(fc.Force(name, beam.end, "-x") for name in steady),
        ],
    )
    return fc.assemble(structure, NONLINEAR)


def beck(load: float) -> np.ndarray:
    """The two lowest poles of Beck's column."""
    model = follower()
    linear = fc.linearize(model, fc.equilibrium(model, inputs={"thrust": load}))
    assert linear.certificate is not None
    assert linear.certificate.loads == ("thrust",)
    poles = linear.damped_poles()
    return poles[poles.imag > 0][:2]


@pytest.mark.parametrize(("load", "expected"), [(10.0, (5.175762, 18.586795)), (20.0, (10.528942, 11.510617))])
def test_frequencies_of_becks_column(record, load, expected):
    poles = beck(load)
    assert np.abs(poles.real).max() < 1e-6
    record(
        f"Beck's column, P L²/EI = {load:g}, 20 elements: first two frequencies",
        ours=np.sort(poles.imag),
        reference=expected,
        source="closed form",
        tolerance=1e-3,
    )


def test_becks_column_has_no_branch_point():
    path = fc.equilibrium_path(follower(), load={"thrust": 19.0}, until=1.0)
    assert not path.branchings
    assert not path.limits


def test_a_thrust_that_follows_in_part_buckles_where_its_determinant_vanishes():
    """A share η ≤ ½ of the thrust follows: 1 − η + η cos kL … = 0 has roots P = (k L)² EI/L² (Leipholz)."""
    share = 0.4
    root = brentq(lambda k: share + (1.0 - share) * np.cos(k), 1.6, np.pi - 1e-9) ** 2
    path = fc.equilibrium_path(
        follower("steady"), load={"thrust": share * root, "steady": (1.0 - share) * root}, until=1.1
    )
    assert [p.factor for p in path.branchings] == pytest.approx([1.0], abs=1e-3)


@pytest.mark.slow
def test_becks_column_flutters(record):
    assert np.abs(beck(20.2).real).min() > 0.1
    flutter = brentq(lambda load: np.ptp(beck(load).imag) - 0.05, 19.9, 20.1, xtol=1e-5)
    record(
        "Beck's column, 20 elements: load at which the frequencies meet (to 0.05 rad/s)",
        ours=flutter,
        reference=20.0509,
        source="closed form",
        tolerance=1e-3,
    )


def test_a_hanging_torque_buckles_a_propped_column(record):
    """Hockling: a propped cantilever under an end torque, T = 2 · 4.493409 EI/L (STAIRlab, FrameHockle)."""
    length, E, G, second, torsion = 240.0, 71240.0, 27190.0, 0.0833, 2.16
    section = fc.Section(E * 10.0, E * second, E * second, G * torsion, rhoA=1.0, rhoJ=1.0)
    beam = fc.Beam("beam", (0, 0, 0), (length, 0, 0), section, elements=32)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start), fc.Support(beam.end, held="v w ry rz")],
        inputs=[fc.Torque("torque", beam.end, "x")],
    )
    critical = 2.0 * 4.493409 * E * second / length
    path = fc.equilibrium_path(fc.assemble(structure, NONLINEAR), load={"torque": critical}, until=1.1)
    record(
        "Column under an end torque, 32 elements: torque at the branch point over T_cr",
        ours=path.branchings[0].factor,
        reference=1.0,
        source="closed form; STAIRlab FrameHockle",
        tolerance=1e-3,
    )
