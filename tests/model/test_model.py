"""The model: names, states, the linear model about rest, the large one, what odd questions get."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

E = fc.Section(EA=2e4, EI_y=157, EI_z=157, GJ=157, rhoA=1.5, rhoJ=0.02)


def bracket() -> fc.Structure:
    """A clamped arm with a load hanging from its tip on a rope, and a spring to the ground."""
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), E, elements=2)
    rope = fc.Rope("rope", arm.end, (2, 0, -1), EA=900.0, damping=0.4)
    load = fc.PointMass("load", rope.end, 3.0)
    spring = fc.Spring("spring", load.node, (3, 0, -1), stiffness=50.0, damping=0.2)
    joints = [fc.Support(arm.start), fc.Pin(arm.end, rope.start), fc.Pin(rope.end, load.node)]
    joints += [fc.Pin(load.node, spring.start), fc.Support(spring.end)]
    push, lift = fc.Force("push", load.node, "x"), fc.Force("lift", arm.end, "z")
    outputs = [fc.Position("x", load.node, "x"), fc.Velocity("speed", load.node, "x")]
    return fc.Structure([arm, rope, load, spring], joints, inputs=[push, lift], outputs=outputs)


SMALL = [fc.Gravity(), fc.Flexible(), fc.RayleighDamping(0.2, 0.01)]
LARGE = [*SMALL, fc.LargeRotation()]


def model(effects) -> fc.Model:
    return fc.assemble(bracket(), effects, fc.CasadiVM())


def test_names():
    m = model(LARGE)
    assert m.n == len(m.coordinates) == len(set(m.coordinates)) == 15
    assert (m.inputs, m.outputs) == (("push", "lift"), ("x", "speed"))
    assert m.coordinate("arm_2_w") == m.coordinates.index("arm_2_w")
    assert all(name.isidentifier() for name in m.coordinates)


def test_displace_by_name_and_by_vector():
    m = model(LARGE)
    q = np.zeros(m.n)
    q[m.coordinate("arm_2_w")] = 0.1
    by_name, by_vector = m.displace({"arm_2_w": 0.1}), m.displace(q)
    assert np.array_equal(by_name.x, by_vector.x)
    assert by_name.x[2, 2] == pytest.approx(0.1)
    assert np.array_equal(by_name.q, q)
    assert not by_name.v.any()


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ({"arm_2_z": 0.1}, "no coordinate 'arm_2_z'; did you mean"),
        ({"arm_2_w": "0.1"}, "coordinate 'arm_2_w' = '0.1'; expected a number"),
        ({"arm_2_w": float("nan")}, "coordinate 'arm_2_w' = nan"),
        ([0.1, 0.2], "displace: expected 15 finite numbers"),
        (np.full(15, np.nan), "displace: expected 15 finite numbers"),
        (5, "displace: expected 15 finite numbers"),
    ],
)
def test_displace_refuses(q, message):
    with pytest.raises(StructureError, match=message):
        model(LARGE).displace(q)


def test_the_small_model_is_linear():
    """balance = load − K q − C v − M a, and its energies are the quadratic ones."""
    m = model(SMALL)
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, m.n))
    state = m.displace(q).with_(v=v)
    rest = m.balance(m.rest, 0 * v, 0 * a)
    K, M = m.stiffness().toarray(), m.mass().toarray()
    still = m.balance(state, 0 * v, 0 * a)
    assert np.allclose(still, rest - K @ q, rtol=0, atol=1e-9 * np.abs(K @ q).max())
    C = -m.slope(state, v, a, (0.0, 1.0, 0.0), np.zeros(2)).toarray()
    assert np.allclose(m.balance(state, v, a), still - C @ v - M @ a, rtol=0, atol=1e-9 * np.abs(K @ q).max())
    kinetic, stored, power = m.energy(state)
    assert kinetic == pytest.approx(0.5 * v @ M @ v)
    assert stored == pytest.approx(0.5 * q @ K @ q - rest @ q)
    assert power == pytest.approx(v @ C @ v)


def test_the_small_model_carries_the_weight():
    """At rest the balance is the weight: 3 kg on the rope, the arm's mass on its nodes."""
    m = model(SMALL)
    rest = m.balance(m.rest, np.zeros(m.n), np.zeros(m.n))
    down = [rest[m.coordinate(name)] for name in ("arm_1_w", "arm_2_w", "rope_1_w")]
    assert down == pytest.approx([-9.81 * 1.5, -9.81 * 0.75, -9.81 * 3.0])


def test_the_small_model_is_the_large_one_for_small_motion():
    """They part by the square of the motion where nothing is under load at rest: no weight, no rope."""
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), E, elements=2)
    spring = fc.Spring("spring", arm.end, (3, 0, 2), stiffness=50.0, damping=0.2)
    joints = [fc.Support(arm.start), fc.Pin(arm.end, spring.start), fc.Support(spring.end)]
    common = [fc.Flexible(), fc.RayleighDamping(0.2, 0.01)]
    structure = fc.Structure([arm, spring], joints)
    small, large = (fc.assemble(structure, [*common, *more], fc.CasadiVM()) for more in ([], [fc.LargeRotation()]))
    q, v, a = np.random.default_rng(1).normal(size=(3, small.n))
    gaps = []
    for size in (1e-3, 5e-4):
        forces = [m.balance(m.displace(size * q), size * v, size * a) for m in (small, large)]
        gaps.append(np.abs(forces[0] - forces[1]).max())
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.1)


def test_measures_of_the_small_model():
    m = model(SMALL)
    state = m.displace({"rope_1_u": 0.2}).with_(v=np.eye(m.n)[m.coordinate("rope_1_u")])
    assert m.measure(state) == pytest.approx([2.2, 1.0])


def test_work_of_loads_is_force_times_path():
    m = model(LARGE)
    v = np.random.default_rng(2).normal(size=m.n)
    state = m.displace(0.1 * v).with_(v=v)
    assert m.loads(state, np.array([7.0, 0.0])) @ v == pytest.approx(7.0 * m.measure(state)[1])


def test_states_are_values():
    m = model(LARGE)
    before = m.rest.x.copy()
    m.advance(m.rest, 0.1 * np.ones(m.n), np.ones(m.n), 1.0)
    assert np.array_equal(m.rest.x, before)
    later = m.rest.with_(t=2.0)
    assert (later.t, m.rest.t) == (2.0, 0.0)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ([fc.Gravity], "is no effect; give e.g. flexctrl.Gravity"),
        ([fc.Gravity(), 5], "5 is no effect"),
        (fc.Gravity(), "assemble: effects = .*; expected a list"),
        ([fc.Gravity(), fc.Gravity((0, 0, -1))], "the effect Gravity is given twice; keep one"),
        (
            [fc.Flexible(), fc.BeamFlexibility()],
            r"BeamFlexibility is given twice \(it is a part of Flexible\); keep one",
        ),
    ],
)
def test_wrong_effects_are_refused(effects, message):
    with pytest.raises(StructureError, match=message):
        fc.assemble(bracket(), effects)


def test_what_is_no_structure_is_refused():
    with pytest.raises(StructureError, match="5 is no Structure"):
        fc.assemble(5, [])
    with pytest.raises(StructureError, match="effects = 5; expected a list"):
        fc.rigid(5)


def test_a_machine_that_cannot_move_is_a_machine():
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), E)
    m = fc.assemble(fc.Structure([beam], [fc.Support(beam.start)]), [fc.Gravity(), fc.LargeRotation()], fc.CasadiVM())
    none = np.zeros(0)
    assert m.n == 0
    assert m.balance(m.rest, none, none).shape == (0,)
    assert m.slope(m.rest, none, none, (1.0, 0.0, 0.0), none).shape == (0, 0)
    assert m.energy(m.rest)[0] == 0.0
