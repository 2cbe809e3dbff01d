"""Modes of small motion live in the same parts as those of the machine that may move as far as it likes."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


@pytest.fixture(scope="module")
def gallows():
    """A leaning mast and an arm, a load on a stay from the arm's end, a second one hung from the middle."""
    tube = fc.Section.tube(fc.STEEL, 0.06, 0.004)
    mast = fc.Beam("mast", (0, 0, 0), (0.4, 0, 3), tube, elements=2)
    arm = fc.Beam("arm", (0.4, 0, 3), (2.4, 0, 3.4), tube, elements=2)
    stay = fc.Rope("stay", (2.4, 0, 3.4), (2.4, 0, 0.9), EA=3e5)
    hung = fc.Rope("hung", arm.nodes[1].position, (1.4, 0, 2.0), EA=3e5)
    load, bob = fc.PointMass("load", (2.4, 0, 0.9), 60.0), fc.PointMass("bob", (1.4, 0, 2.0), 15.0)
    joints = [
        fc.Support(mast.start, "u v w rx ry rz"),
        fc.Weld(mast.end, arm.start),
        fc.Pin(arm.end, stay.start),
        fc.Pin(stay.end, load.node),
        fc.Pin(arm.nodes[1], hung.start),
        fc.Pin(hung.end, bob.node),
    ]
    return fc.planar(fc.Structure([mast, arm, stay, hung, load, bob], joints), "y")


def linear(structure, *effects):
    model = fc.assemble(structure, effects)
    return fc.linearize(model, at=fc.equilibrium(model))


FLEXIBLE = (fc.Gravity(), fc.Flexible())


@pytest.mark.parametrize("given", [FLEXIBLE, (*FLEXIBLE, fc.RayleighDamping(0.02, 5e-4))])
def test_shares_about_the_equilibrium_are_those_of_large_motion(gallows, given):
    small, large = (linear(gallows, *given, e).modes() for e in (fc.GeometricStiffness(), fc.LargeRotation()))
    assert small.frequencies == pytest.approx(large.frequencies, rel=1e-9)
    assert set(small.strain_shares) == set(large.strain_shares) == {p.name for p in gallows.elements}
    for part, shares in large.strain_shares.items():
        assert small.strain_shares[part] == pytest.approx(shares, abs=1e-7)
        assert small.kinetic_shares[part] == pytest.approx(large.kinetic_shares[part], abs=1e-7)


@pytest.mark.parametrize("last", [(fc.GeometricStiffness(),), ()])
def test_parts_add_up_to_the_machine(gallows, last):
    found = linear(gallows, *FLEXIBLE, *last, fc.RayleighDamping(0.02, 5e-4))
    for whole, own in ((found.K, "stiffness"), (found.M, "mass")):
        total = sum(getattr(part, own) for part in found.parts.values())
        assert abs(total - whole).max() < 1e-6 * abs(whole).max()


@pytest.mark.parametrize("motion", [fc.GeometricStiffness(), fc.LargeRotation()])
def test_where_nothing_bends_modes_live_where_the_mass_swings(gallows, motion):
    """Two bobs on stiff rods under a stiff frame: each swings for itself."""
    modes = linear(gallows, fc.Gravity(), motion).modes()
    assert [modes.dominant_part(i) for i in range(len(modes))] == ["load", "bob"]
    assert modes.frequencies == pytest.approx(np.sqrt(9.81 / np.array([2.5, 1.2])) / (2.0 * np.pi), rel=1e-3)
    for i in range(len(modes)):
        assert modes.part_shares(i)[modes.dominant_part(i)] > 0.99
