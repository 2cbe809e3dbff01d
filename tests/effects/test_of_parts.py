"""Flexibility of some parts only."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import ceiling_crane

WEIGHT = [fc.Gravity(), fc.LargeRotation()]


def test_naming_all_parts_is_naming_none():
    crane = ceiling_crane()
    every = fc.assemble(crane, [*WEIGHT, fc.BeamFlexibility()])
    named = fc.assemble(crane, [*WEIGHT, fc.BeamFlexibility(of=[e.name for e in crane.elements])])
    assert named.coordinates == every.coordinates
    step = 1e-3 * np.cos(np.arange(every.n))
    states = [m.displace(step) for m in (every, named)]
    forces = [m.balance(s, step, step) for m, s in zip((every, named), states, strict=True)]
    np.testing.assert_array_equal(forces[0], forces[1])


def test_a_beam_that_is_not_named_is_rigid():
    crane = ceiling_crane()
    some = fc.assemble(crane, [*WEIGHT, fc.BeamFlexibility(of="girder")])
    state = some.displace(1e-2 * np.cos(np.arange(some.n)))
    number = crane.number
    for link in [e for e in crane.elements if e.name != "girder"]:
        i, j = number(link.start), number(link.end)
        assert np.linalg.norm(state.x[j] - state.x[i]) == pytest.approx(link.length, rel=1e-12)
        np.testing.assert_allclose(state.R[i], state.R[j], atol=1e-12)
    girder = [number(crane.elements[0].node(k)) for k in range(7)]
    assert np.ptp([state.R[k] for k in girder], axis=0).max() > 1e-3


def test_a_rigid_part_is_what_a_very_stiff_one_tends_to():
    """The lowest frequencies of a crane whose links stiffen approach those with rigid links, as 1/k."""
    crane = ceiling_crane()
    limit = fc.linearize(fc.assemble(crane, [fc.BeamFlexibility(of="girder")])).modes(16).omega

    def off(factor: float) -> float:
        stiff = [e if e.name == "girder" else _stiffened(e, factor) for e in crane.elements]
        model = fc.assemble(crane.with_(elements=stiff), [fc.BeamFlexibility()])
        omega = fc.linearize(model).modes(16).omega
        return float(np.abs(omega - limit).max() / limit.max())

    first, second = off(1e2), off(1e3)
    assert second < 1e-3
    assert np.log10(first / second) == pytest.approx(1.0, abs=0.15)


def _stiffened(beam: fc.Beam, factor: float) -> fc.Beam:
    from dataclasses import replace

    s = beam.section
    section = replace(s, EA=s.EA * factor, EI_y=s.EI_y * factor, EI_z=s.EI_z * factor, GJ=s.GJ * factor)
    return replace(beam, section=section)


@pytest.mark.parametrize(
    ("effect", "message"),
    [(fc.BeamFlexibility("girdr"), "did you mean 'girder'"), (fc.RopeStretch(("girder",)), "has no such part")],
)
def test_a_wrong_name_is_refused(effect, message):
    with pytest.raises(fc.errors.StructureError, match=message):
        fc.assemble(ceiling_crane(), [*WEIGHT, effect])


def test_shafts_of_some_drives():
    arm = fc.cranes.flexible_arm()
    first = arm.drives[0].name
    model = fc.assemble(arm, [*WEIGHT, fc.ShaftElasticity(of=[first])])
    assert [n for n in model.coordinates if n.endswith("_source")] == [f"{first}_source"]
