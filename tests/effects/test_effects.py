"""Each effect by itself: what it does, that nothing of it changes nothing, and that leaving it out is free."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

E = fc.Section(EA=2e4, EI_y=157, EI_z=90, GJ=60, rhoA=1.5, rhoJ=0.02, rhoI_y=0.01)
MOVING = [fc.LargeRotation(), fc.Flexible()]


def machine() -> fc.Structure:
    """One of each: two beams on a motor's hinge, a body, a rope with its load, a spring, a wheel drive."""
    base = fc.RigidBody("base", (0, 0, 0), 6.0, (1, 1, 1), {"top": (0, 0, 0.5)})
    first = fc.Beam("first", (0, 0, 0.5), (1, 0, 0.5), E, elements=2)
    second = fc.Beam("second", first.end, (1.5, 0.5, 1.0), E)
    rope = fc.Rope("rope", second.end, (1.5, 0.5, 0.2), EA=700.0, damping=0.3)
    load = fc.PointMass("load", rope.end, 2.0)
    spring = fc.Spring("spring", load.node, (2.5, 0.5, 0.0), stiffness=40.0, damping=0.1)
    joints = [fc.Support(base.node, "v w rx ry"), fc.Weld(base.point("top"), first.start)]
    joints += [
        fc.Hinge(first.end, second.start, (0, 1, 1)),
        fc.Pin(second.end, rope.start),
        fc.Pin(rope.end, load.node),
    ]
    joints += [fc.Pin(load.node, spring.start), fc.Support(spring.end)]
    drives = [
        fc.RotaryDrive("elbow", second.start, first.end, axis=(0, 1, 1), stiffness=30.0, ratio=4.0, inertia=0.05),
        fc.LinearDrive("travel", base.node, direction="x", radius=0.2, stiffness=20.0, ratio=3.0, inertia=0.04),
    ]
    return fc.Structure([base, first, second, rope, load, spring], joints, drives)


def assembled(effects) -> fc.Model:
    return fc.assemble(machine(), effects, fc.CasadiVM())


def somewhere(model: fc.Model):
    v, a = np.random.default_rng(1).normal(size=(2, model.n))
    return model.displace(0.2 * np.random.default_rng(0).normal(size=model.n)).with_(v=v), v, a


NOTHING = [
    fc.RayleighDamping(0.0, 0.0),
    fc.ModalDamping((0.0, 0.0)),
    fc.Gravity((0.0, 0.0, 0.0)),
    fc.RotatingFrame((0.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("others", [[fc.LargeRotation()], MOVING, [fc.Flexible()]], ids=["rigid", "flexible", "small"])
def test_effects_at_zero_strength_are_as_if_they_were_not_there(others):
    without, with_ = assembled(others), assembled([*others, *NOTHING])
    state, v, a = somewhere(without)
    force = without.balance(state, v, a)
    assert np.allclose(with_.balance(state, v, a), force, rtol=0, atol=1e-13 * np.abs(force).max())
    slope, same = (m.slope(state, v, a, (1.0, 1.0, 1.0), np.zeros(0)).toarray() for m in (without, with_))
    assert np.allclose(same, slope, rtol=0, atol=1e-13 * np.abs(slope).max())
    assert with_.energy(state) == pytest.approx(without.energy(state), rel=1e-13)


def test_no_modal_damping_needs_no_equilibrium():
    """A hoist whose motor is free falls, and has no modes to damp."""
    load, top = fc.PointMass("load", (0, 0, -5), 10.0), fc.PointMass("top", (0, 0, 0), 1.0)
    winch = fc.Winch("winch", load.node, top.node, EA=1e5, radius=0.1, ratio=1.0, inertia=0.02)
    hoist = fc.Structure([load, top], [fc.Support(top.node)], [winch])
    falling = [fc.LargeRotation(), fc.Gravity()]
    without, with_ = (fc.assemble(hoist, [*falling, *e], fc.CasadiVM()) for e in ([], [fc.ModalDamping(0.0)]))
    assert with_.coordinates == without.coordinates
    assert with_.viscous.nnz == 0


def cost(model: fc.Model) -> dict[str, int]:
    families = model.forces.families
    return {f.kernels.kind.name: f.kernels.force.instructions * f.count for f in families}


@pytest.mark.parametrize(
    ("effect", "pays"),
    [
        (fc.Gravity(), {"beam", "body", "point"}),
        (fc.RayleighDamping(0.1, 0.1), {"beam", "spring", "rope", "body", "point", "rotary_drive", "linear_drive"}),
        (fc.RotatingFrame((0.0, 0.0, 2.0)), {"beam", "body", "point"}),
    ],
    ids=["gravity", "damping", "spin"],
)
def test_an_effect_left_out_costs_nothing_and_one_put_in_only_where_it_acts(effect, pays):
    """Counted in instructions of the force kernels."""
    without, with_ = cost(assembled(MOVING)), cost(assembled([*MOVING, effect]))
    assert {kind for kind in without if with_[kind] > without[kind]} == pays
    assert {kind for kind in without if with_[kind] == without[kind]} == set(without) - pays


def test_flexibility_left_out_leaves_out_freedoms():
    counts = {}
    for name, effects in {
        "all": [fc.Flexible()],
        "beams": [fc.BeamFlexibility()],
        "shafts": [fc.ShaftElasticity()],
        "rope": [fc.RopeStretch()],
        "none": [],
    }.items():
        counts[name] = assembled([fc.LargeRotation(), *effects]).n
    # rigid: the base's travel and turn, the hinge, two directions of the rope
    assert counts["none"] == 2 + 1 + 2
    assert counts["rope"] == counts["none"] + 1
    assert counts["shafts"] == counts["none"] + 2
    # welded end, two nodes of the first beam, the end of the second (its start is the hinge)
    assert counts["beams"] == counts["none"] + 2 * 6 + 6
    assert counts["all"] - counts["none"] == sum(counts[k] - counts["none"] for k in ("beams", "shafts", "rope"))


def test_flexible_is_all_three():
    assert fc.Flexible().parts() == (fc.BeamFlexibility(), fc.ShaftElasticity(), fc.RopeStretch())
    by_one, by_three = (assembled([fc.LargeRotation(), *e]) for e in ([fc.Flexible()], fc.Flexible().parts()))
    assert by_one.effects == by_three.effects


def test_gravity_pulls_each_mass_and_no_more():
    """A rigid push of the whole machine along g works against its whole weight."""
    g = np.array([1.0, -2.0, -9.0])
    loose = machine()
    free = fc.Structure(loose.elements, [j for j in loose.joints if not isinstance(j, fc.Support)], loose.drives[:1])
    model = fc.assemble(free, [*MOVING, fc.Gravity(g)], fc.CasadiVM())
    state = model.displace(0.1 * np.random.default_rng(0).normal(size=model.n))
    still = np.zeros(model.n)
    push = np.zeros((model.n, 3))
    for i, name in enumerate(model.coordinates):
        for k, axis in enumerate("uvw"):
            push[i, k] = name.endswith(f"_{axis}")
    lengths = 1.0 + np.sqrt(0.75)
    mass = 6.0 + 2.0 + E.rhoA * lengths
    assert push.T @ model.balance(state, still, still) == pytest.approx(mass * g, rel=1e-9)


def test_gravity_is_a_potential_that_falls_with_height():
    model = assembled([fc.LargeRotation(), fc.Gravity((0, 0, -10.0))])
    state, *_ = somewhere(model)
    drop = {n: (model.rest.x - state.x)[model.structure.number(n), 2] for n in model.structure.nodes}
    weights = {"base": 6.0, "load": 2.0}
    energy = -10.0 * sum(m * drop[model.structure.part(name).node] for name, m in weights.items())
    for name in ("first", "second"):
        beam = model.structure.part(name)
        energy -= 10.0 * E.rhoA * beam.length * 0.5 * (drop[beam.start] + drop[beam.end])
    spring = model.structure.part("spring")
    a, b = (state.x[model.structure.number(n)] for n in (spring.start, spring.end))
    stretch = 0.5 * 40.0 * (np.linalg.norm(a - b) - spring.length) ** 2
    found = model.energy(state)[1] - model.energy(model.rest)[1]
    assert found == pytest.approx(energy + stretch)


def test_rayleigh_damping_at_rest_is_alpha_m_plus_beta_k():
    """Exactly, with K and M as assembled; the parts' own dampers beside it."""
    alpha, beta = 0.3, 0.02
    model, plain = assembled([*MOVING, fc.RayleighDamping(alpha, beta)]), assembled(MOVING)
    still = np.zeros(model.n)
    C, own = (-m.slope(m.rest, still, still, (0.0, 1.0, 0.0), np.zeros(0)).toarray() for m in (model, plain))
    expected = alpha * model.mass().toarray() + beta * model.stiffness().toarray()
    assert np.allclose(C - own, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_tangent_at_rest_is_the_assembled_stiffness():
    """Nothing under load: also for a rope that is just taut."""
    model = assembled(MOVING)
    still = np.zeros(model.n)
    K = -model.slope(model.rest, still, still, (1.0, 0.0, 0.0), np.zeros(0)).toarray()
    expected = model.stiffness().toarray()
    assert np.allclose(K, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_damping_ratio_at_two_frequencies():
    """ζ = α/2ω + βω/2 is what was asked at both, and less between."""
    damping = fc.RayleighDamping.through(0.02, 3.0, 40.0)

    def zeta(omega):
        return damping.alpha / (2 * omega) + damping.beta * omega / 2

    assert zeta(3.0) == pytest.approx(0.02)
    assert zeta(40.0) == pytest.approx(0.02)
    assert zeta(11.0) < 0.02


def test_rayleigh_damping_does_not_brake_rigid_motion_by_its_beta():
    """A floating beam, bent and turning as a whole."""
    beam = fc.Structure([fc.Beam("beam", (0, 0, 0), (1, 2, 0), E, elements=3)])
    model = fc.assemble(beam, [*MOVING, fc.RayleighDamping(0.0, 0.5)], fc.CasadiVM())
    state = model.displace(0.1 * np.random.default_rng(4).normal(size=model.n))
    spin, drift = np.array([0.3, -0.5, 0.8]), np.array([1.0, 2.0, -3.0])
    v = np.concatenate([np.concatenate([drift + np.cross(spin, x), spin]) for x in state.x[:-1]])
    assert model.energy(state.with_(v=v))[2] == pytest.approx(0.0, abs=1e-10)
    v[0] += 0.1
    assert model.energy(state.with_(v=v))[2] > 1.0


@pytest.mark.parametrize("ratios", [0.03, [0.05, 0.01]])
def test_modal_damping_gives_each_mode_its_ratio(ratios):
    """About the equilibrium, by the eigenvalues of the damped system; rigid and later modes have none."""
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), E, elements=3)
    structure = fc.Structure([arm], [fc.Support(arm.start, "u v w rx ry")])
    effects = [fc.Flexible(), fc.LargeRotation(), fc.ModalDamping(ratios)]
    linear = fc.linearize(fc.assemble(structure, effects, fc.CasadiVM()))
    M, C, K = (m.toarray() for m in (linear.M, linear.C, linear.K))
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    s = np.linalg.eigvals(A)
    s = s[s.imag > 1e-3 * np.abs(s).max() ** 0.5]
    s = s[np.argsort(np.abs(s))]
    zeta = -s.real / np.abs(s)
    if isinstance(ratios, float):
        assert zeta == pytest.approx(ratios * np.ones(len(s)), rel=1e-6)
    else:
        assert zeta[:2] == pytest.approx(ratios, rel=1e-6)
        assert np.abs(zeta[2:]).max() < 1e-8


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Gravity(9.81), "Gravity: expected three finite numbers"),
        (lambda: fc.Gravity("xyz"), "Gravity: expected three finite numbers"),
        (lambda: fc.Gravity((0, 0, np.nan)), "Gravity: expected three"),
        (lambda: fc.RayleighDamping(-0.1), "RayleighDamping: alpha = -0.1; expected a number ≥ 0"),
        (lambda: fc.RayleighDamping(0.1, "0.2"), "RayleighDamping: beta = '0.2'"),
        (lambda: fc.RayleighDamping.through(0.1, 0.0, 2.0), "RayleighDamping.through: omega1 = 0.0"),
        (lambda: fc.RayleighDamping.through(-0.1, 1.0, 2.0), "RayleighDamping.through: zeta = -0.1"),
        (lambda: fc.ModalDamping([]), "no ratios given"),
        (lambda: fc.ModalDamping("0.1"), "ModalDamping: ratios = '0.1'; expected a list"),
        (lambda: fc.ModalDamping([0.1, -0.1]), "ModalDamping: ratio = -0.1"),
        (lambda: fc.ModalDamping(None), "ModalDamping: ratio = None"),
    ],
)
def test_impossible_effects_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_effects_are_values():
    assert fc.Gravity() == fc.Gravity((0, 0, -9.81))
    assert (
        len({fc.Gravity(), fc.Gravity([0, 0, -9.81]), fc.Flexible(), fc.RayleighDamping(1), fc.ModalDamping(0.1)}) == 4
    )
    assert fc.ModalDamping(np.array([0.1, 0.2])) == fc.ModalDamping([0.1, 0.2])
