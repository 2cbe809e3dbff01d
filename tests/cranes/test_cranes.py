"""Ready-made machines: masses, frequencies and deflections known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane, flexible_arm
from flexctrl.cranes.bridge_crane import GIRDERS, SPAN
from flexctrl.cranes.flexible_arm import FORE, UPPER

G = 9.81
PHYSICS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())


def twin(structure: fc.Structure) -> fc.Model:
    return fc.assemble(structure, fc.rigid(PHYSICS))


def test_the_paper_gives_one_kilogram_to_every_member():
    model = fc.assemble(ceiling_crane(), PHYSICS)
    along = np.zeros(model.n)
    for i, name in enumerate(model.coordinates):
        along[i] = name.endswith("_u")
    assert along @ model.mass() @ along == pytest.approx(9.0, rel=1e-12)


@pytest.mark.parametrize("elements", [1, 2])
def test_a_finer_ceiling_crane_weighs_and_measures_the_same(elements):
    crane = ceiling_crane(elements)
    assert [o.name for o in crane.outputs] == ["x1_minus_x4", "load_z", "travel"]
    assert sum(p.length for p in crane.elements) == 9.0
    assert len(crane.nodes) == 7 + 6 * (elements - 1) + 3 * (elements + 1)


def test_the_bridge_cranes_girder_sinks_by_span_over_800_under_trolley_and_load():
    assert 43e3 * G * SPAN**3 / (48 * GIRDERS.EI_y) == pytest.approx(SPAN / 800, rel=0.01)
    loaded, idle = (fc.equilibrium(fc.assemble(bridge_crane(load=m), PHYSICS)).outputs for m in (32e3, 1e-3))
    sink = 32e3 * G * (SPAN**3 / (48 * GIRDERS.EI_y) + 10.0 / 1.28e8)
    assert idle["load_z"] - loaded["load_z"] == pytest.approx(sink, rel=1e-3)


def test_the_rigid_bridge_crane_swings_as_a_trolley_with_a_pendulum():
    # Along: (M + m) g / (M l) with the motors' mass on the rail, J (R/r)² each; across the bridge does not give way.
    moved = 30e3 + 11e3 + 2 * 0.3 * 100.0**2
    along, across = np.sqrt((moved + 32e3) * G / (moved * 10.0)), np.sqrt(G / 10.0)
    modes = fc.linearize(twin(bridge_crane())).modes()
    assert modes.rigid == 2  # travel and skew
    assert modes.omega[modes.flexible] == pytest.approx([across, along], rel=1e-7)


def test_a_metre_of_travel_is_a_hundred_radians_of_motor():
    model = fc.assemble(bridge_crane(), fc.rigid(PHYSICS))
    moved = model.measure(model.displace({"girder_0_u": 0.25}))
    values = dict(zip(model.outputs, moved, strict=True))
    assert values["travel"] == pytest.approx(0.25)
    assert values["left_angle"] == pytest.approx(25.0)
    assert values["right_angle"] == pytest.approx(25.0)


def test_the_rigid_arm_has_the_inertia_of_its_links_motors_and_payload():
    # M in the absolute angles of both links, textbook two-link arm with the rotors behind their gears.
    rotor, elbow, payload, a, b = 100.0**2 * 1.2e-4, 3.0, 4.0, 1.0, 0.8
    upper, fore = UPPER.rhoA * a, FORE.rhoA * b
    first = 2 * rotor + upper * a**2 / 3 + (elbow + fore + payload) * a**2 + UPPER.rhoI_z * a
    second = rotor + fore * b**2 / 3 + payload * b**2 + FORE.rhoI_z * b
    coupling = -rotor + (fore / 2 + payload) * a * b
    textbook = np.array([[first, coupling], [coupling, second]])
    np.testing.assert_allclose(twin(flexible_arm()).mass().toarray(), textbook, rtol=1e-9)
