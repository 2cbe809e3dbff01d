"""Cross-sections against handbook formulas, and what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

STEEL = fc.Material(E=210e9, rho=7850.0, nu=0.3)
GOOD = {"EA": 1.0, "EI_y": 1.0, "EI_z": 1.0, "GJ": 1.0, "rhoA": 1.0, "rhoJ": 1.0}


def test_shear_modulus():
    assert pytest.approx(210e9 / 2.6) == fc.STEEL.G


def test_round_bar():
    bar = fc.Section.circular(STEEL, 0.05)
    assert pytest.approx(STEEL.E * math.pi * 0.05**2) == bar.EA
    assert bar.EI_y == bar.EI_z == pytest.approx(STEEL.E * math.pi * 0.05**4 / 4)
    assert pytest.approx(STEEL.G * math.pi * 0.05**4 / 2) == bar.GJ
    assert bar.rhoJ == pytest.approx(bar.rhoI_y + bar.rhoI_z)


def test_a_tube_is_a_bar_less_its_hole():
    tube, bar, hole = fc.Section.tube(STEEL, 0.05, 0.01), *(fc.Section.circular(STEEL, r) for r in (0.05, 0.04))
    for name in ("EA", "EI_y", "EI_z", "GJ", "rhoA", "rhoJ"):
        assert getattr(tube, name) == pytest.approx(getattr(bar, name) - getattr(hole, name))


def test_a_tube_as_thick_as_its_radius_is_a_bar():
    assert fc.Section.tube(STEEL, 0.05, 0.05) == fc.Section.circular(STEEL, 0.05)


@pytest.mark.parametrize(("ratio", "beta"), [(1.0, 0.1406), (2.0, 0.229), (4.0, 0.281), (10.0, 0.312)])
def test_torsion_of_rectangles_as_tabled_by_timoshenko(ratio, beta):
    """J = β a b³: Timoshenko & Goodier, Theory of Elasticity, table of §109 (three digits)."""
    section = fc.Section.rectangle(STEEL, 0.02 * ratio, 0.02)
    assert section.GJ / (STEEL.G * 0.02 * ratio * 0.02**3) == pytest.approx(beta, abs=6e-4)
    assert pytest.approx(section.GJ) == fc.Section.rectangle(STEEL, 0.02, 0.02 * ratio).GJ


def test_rectangle_bends_less_over_its_height():
    """width along local y, height along local z: bending about y works on the height."""
    section = fc.Section.rectangle(STEEL, width=0.1, height=0.2)
    assert section.EI_y == pytest.approx(STEEL.E * 0.1 * 0.2**3 / 12)
    assert section.EI_z == pytest.approx(STEEL.E * 0.2 * 0.1**3 / 12)


def test_box_is_the_outer_rectangle_less_the_inner_one_and_twists_by_bredt():
    box = fc.Section.box(STEEL, width=0.4, height=0.8, web=0.01, flange=0.02)
    assert pytest.approx(STEEL.E * (0.4 * 0.8 - 0.38 * 0.76)) == box.EA
    assert box.EI_y == pytest.approx(STEEL.E * (0.4 * 0.8**3 - 0.38 * 0.76**3) / 12)
    assert box.EI_z == pytest.approx(STEEL.E * (0.8 * 0.4**3 - 0.76 * 0.38**3) / 12)
    enclosed, around = 0.39 * 0.78, 2 * 0.39 / 0.02 + 2 * 0.78 / 0.01
    assert pytest.approx(STEEL.G * 4 * enclosed**2 / around) == box.GJ


def test_numbers_become_floats():
    section = fc.Section(**(GOOD | {"EA": np.float32(2.0), "GJ": 3}))
    assert type(section.EA) is float
    assert type(section.GJ) is float


@pytest.mark.parametrize("name", ["EA", "EI_y", "EI_z", "GJ"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "5", True, None, [1.0], 1j, 10**400, 1e60])
def test_a_stiffness_must_be_a_positive_number(name, value):
    with pytest.raises(StructureError, match=rf"Section: {name} = .*expected a (finite )?number"):
        fc.Section(**(GOOD | {name: value}))


@pytest.mark.parametrize("name", ["rhoA", "rhoJ", "rhoI_y", "rhoI_z"])
def test_an_inertia_may_be_zero_but_not_negative(name):
    fc.Section(**(GOOD | {name: 0.0}))
    with pytest.raises(StructureError, match=f"Section: {name} = -1e-09; expected a number ≥ 0"):
        fc.Section(**(GOOD | {name: -1e-9}))


def test_shear_stiffness_may_be_infinite_but_not_zero():
    assert fc.Section(**GOOD).GA_y == math.inf
    for value in (0.0, -math.inf, math.nan):
        with pytest.raises(StructureError, match="GA_z"):
            fc.Section(**GOOD, GA_z=value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Material(E=-1.0, rho=1.0), "Material: E = -1.0; expected a number > 0"),
        (lambda: fc.Material(E=1.0, rho=1.0, nu=0.6), r"Material: nu = 0.6; expected -1 < nu ≤ 0.5"),
        (lambda: fc.Material(E=1.0, rho=1.0, nu="a"), "Material: nu = 'a'; expected a number"),
        (lambda: fc.Material(E=1.0, rho=1.0, nu=-1.0), "nu = -1.0; expected -1 < nu ≤ 0.5"),
        (lambda: fc.Section.circular("steel", 0.1), "material = 'steel'; expected a flexctrl.Material"),
        (lambda: fc.Section.circular(STEEL, "0.1"), "Section.circular: radius = '0.1'"),
        (lambda: fc.Section.tube(STEEL, 0.1, 0.2), "thickness = 0.2 m; expected at most the radius, 0.1 m"),
        (lambda: fc.Section.tube(STEEL, "0.1", 0.02), "Section.tube: radius"),
        (
            lambda: fc.Section.box(STEEL, 0.1, 0.1, web=0.06, flange=0.01),
            "web = 0.06 m; expected at most half the width, 0.05 m",
        ),
        (lambda: fc.Section.box(STEEL, None, 0.1, 0.01, 0.01), "Section.box: width = None"),
        (lambda: fc.Section.rectangle(STEEL, 0.1, 0.0), "Section.rectangle: height = 0.0"),
    ],
)
def test_impossible_sections_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()
