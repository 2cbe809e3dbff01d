"""What has no mass and stands on negative stiffness, or spins without inertia, is refused by name."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import LinearizationError, MechanismError
from flexctrl.model.audit import Freedom

EI, LENGTH = 100.0, 1.0
EULER = np.pi**2 * EI / LENGTH**2


def column(load: float, rhoA: float = 0.0) -> fc.Model:
    """A column pinned at both ends, a heavy mass guided upright on top of it: load in units of Euler's."""
    section = fc.Section(EA=1e7, EI_y=EI, EI_z=EI, GJ=EI, rhoA=rhoA, rhoJ=1e-4 * rhoA)
    beam = fc.Beam("col", (0, 0, 0), (0, 0, LENGTH), section, elements=4)
    mass = fc.PointMass("mass", beam.end, load * EULER / 9.81)
    joints = [fc.Support(beam.start, "u v w rz"), fc.Pin(beam.end, mass.node), fc.Support(mass.node, "u v")]
    drawn = fc.Structure([beam, mass], joints, inputs=[fc.Force("f", mass.node, "z")])
    return fc.assemble(fc.planar(drawn, "y"), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def test_a_column_under_its_buckling_load_is_condensed_to_the_limit_of_vanishing_mass():
    limit = fc.linearize(column(0.9)).modes().omega_squared
    assert fc.linearize(column(0.9, 1e-9)).modes(1).omega_squared[0] == pytest.approx(limit[0], rel=1e-7)


@pytest.mark.parametrize("load", [1.1, 2.0, 4.5])
def test_a_column_beyond_it_is_refused_by_name(load):
    model = column(load)
    rest = fc.equilibrium(model)
    assert rest.unstable == (1 if load < 4.0 else 2)
    with pytest.raises(LinearizationError, match=r"negative stiffness.*col_\d_u"):
        fc.linearize(model, at=rest)
    assert len(fc.audit(model, at=rest).named(Freedom.FALLING)) == rest.unstable


def test_springs_in_compression_with_nothing_between_them_are_refused():
    mass = fc.PointMass("a", (0, 0, 0), 5.0)
    springs = [
        fc.Spring("s0", (-1, 0, 0), (0, 0, 0), 1e3),
        fc.Spring("s1", (0, 0, 0), (1, 0, 0), 1e4, length=1.01),
        fc.Spring("s2", (1, 0, 0), (2, 0, 0), 1e4, length=1.01),
    ]
    joints = [
        fc.Support(springs[0].start, "u v w"),
        fc.Pin(mass.node, springs[0].end),
        fc.Pin(mass.node, springs[1].start),
        fc.Pin(springs[1].end, springs[2].start),
        fc.Support(springs[2].end, "u v w"),
        fc.Support(mass.node, "v w"),
    ]
    model = fc.assemble(fc.Structure([mass, *springs], joints), [fc.LargeRotation()])
    with pytest.raises(LinearizationError, match=r"s1_1_v .*s1_1_w"):
        fc.linearize(model)


@pytest.mark.parametrize("elements", [1, 2, 3])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (1 / 3, 2 / 3, 2 / 3)])
def test_a_rod_that_sags_and_spins_without_inertia_is_refused_by_name(axis, elements):
    rod = fc.Beam("rod", (0, 0, 0), axis, spinning(), elements=elements)
    joints = [fc.Support(rod.start, "u v w"), fc.Support(rod.end, "u v w")]
    model = fc.assemble(fc.Structure([rod], joints), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    with pytest.raises(MechanismError, match=r"rod_\d_r[xyz].*rotation about.*rhoJ"):
        fc.linearize(model)


def test_a_rod_that_sags_and_is_held_against_spinning_is_accepted():
    rod = fc.Beam("rod", (0, 0, 0), (0.6, 0.0, 0.8), spinning(), elements=2)
    joints = [fc.Support(rod.start), fc.Support(rod.end, "u v w")]
    model = fc.assemble(fc.Structure([rod], joints), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    assert fc.linearize(model).modes(1).frequencies[0] > 1.0


def spinning() -> fc.Section:
    area, inertia = np.pi * 0.03**2, np.pi * 0.03**4 / 4
    return fc.Section(2.1e11 * area, 2.1e11 * inertia, 2.1e11 * inertia, 1.6e11 * inertia, 7850 * area, rhoJ=0.0)
