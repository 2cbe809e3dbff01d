"""Ropes with mass: hanging chains against Bessel functions, taut ropes, catenaries; absent, a massless line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

LARGE, HEAVY, G, L, RHO = fc.LargeRotation(), fc.RopeMass(), 9.81, 10.0, 2.0
CHAIN = np.array([1.20241278, 2.76003906, 4.32686396])
"""(j₀ₖ/2): zeros of the Bessel function J₀ (B14), over √(g/L)."""
LOADED = {1.0: (1.05642248, 4.08168676, 7.73750314), 100.0: (1.00082912, 31.52605999, 63.00444850)}
"""With a load of μ ρ L (B14)."""


def hanging(elements: int, mu: float = 0.0, **more: float) -> fc.Structure:
    """A rope of 20 kg on which a load hangs, in the x-z plane."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -L), EA=1e9, rhoA=RHO, elements=elements, **more)
    parts, joints = [rope], [fc.Support(rope.start)]
    if mu:
        parts.append(fc.PointMass("load", rope.end, mu * RHO * L))
        joints.append(fc.Pin(rope.end, parts[1].node))
    return fc.planar(fc.Structure(parts, joints, outputs=[fc.Tension("pull", rope)]), "y")


def frequencies(model: fc.Model, count: int) -> np.ndarray:
    linear = fc.linearize(model, at=fc.equilibrium(model))
    return np.sort(linear.modes().omega)[:count] / np.sqrt(G / L)


@pytest.mark.parametrize("stretching", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_hanging_chain_swings_as_bessel_says(stretching):
    """Third order in the elements though tension falls to nothing; elastic ones and rigid links alike."""
    more = [fc.RopeStretch()] if stretching else []
    errors = [
        np.abs(frequencies(fc.assemble(hanging(n), [LARGE, fc.Gravity(), HEAVY, *more]), 3) / CHAIN - 1.0)
        for n in (10, 20)
    ]
    assert errors[1] == pytest.approx([2.4e-6, 2.1e-5, 4.0e-4], rel=0.05)
    assert np.all(np.log2(errors[0] / errors[1]) > 2.9)


@pytest.mark.parametrize("elements", [1, 2, 3, 7])
def test_all_that_moves_as_a_rigid_bar_does_has_its_exact_mass(elements):
    """Mass, centre and moment of inertia; the same in every direction; a rope of one element is consistent."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -L), EA=1e9, rhoA=RHO, elements=elements)
    model = fc.assemble(fc.Structure([rope], []), [HEAVY, fc.RopeStretch()])
    M = model.mass().toarray().reshape(elements + 1, 3, elements + 1, 3)
    along = M[:, 0, :, 0]
    assert pytest.approx(np.einsum("ij,kl->ikjl", along, np.eye(3))) == M
    fields = np.array([np.ones(elements + 1), np.linspace(0.0, L, elements + 1)])
    assert fields @ along @ fields.T == pytest.approx(RHO * np.array([[L, L**2 / 2], [L**2 / 2, L**3 / 3]]))
    assert np.linalg.eigvalsh(along).min() > 0.1 * RHO * L / elements


def test_between_its_ends_a_rope_has_the_mean_of_the_consistent_and_the_lumped_mass():
    """So that a taut rope held at both ends has the frequencies that this gives, of fourth order."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -L), EA=1e9, rhoA=RHO, elements=6)
    model = fc.assemble(fc.Structure([rope], [fc.Support(rope.start), fc.Support(rope.end)]), [HEAVY, fc.RopeStretch()])
    mean = RHO * L / 6 / 12 * (10 * np.eye(5) + np.eye(5, k=1) + np.eye(5, k=-1))
    assert model.mass().toarray() == pytest.approx(np.kron(mean, np.eye(3)))


@pytest.mark.parametrize("mu", LOADED)
def test_a_rope_with_a_load(mu):
    model = fc.assemble(hanging(20, mu), [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch()])
    assert frequencies(model, 3) == pytest.approx(LOADED[mu], rel=4e-5)


def test_a_rope_a_millionth_of_its_load():
    """D12: pendulum and string modes both right."""
    pendulum, string = frequencies(fc.assemble(hanging(20, 1e6), [LARGE, fc.Gravity(), HEAVY]), 2)
    assert pendulum == pytest.approx(1.0000000833333, rel=1e-8)
    assert string == pytest.approx(3141.593757, rel=1e-5)


def test_tension_is_measured_where_a_rope_is_drawn_to_begin():
    """A rope drawn in two: each carries what hangs below its start, but for 11/24 of its first element."""
    upper = fc.Rope("upper", (0, 0, 0), (0, 0, -4), EA=1e7, rhoA=2.0, elements=4)
    lower = fc.Rope("lower", (0, 0, -4), (0, 0, -10), EA=1e7, rhoA=2.0, elements=8)
    outputs = [fc.Tension("above", upper), fc.Tension("below", lower)]
    chain = fc.Structure([upper, lower], [fc.Support(upper.start), fc.Pin(upper.end, lower.start)], outputs=outputs)
    model = fc.assemble(chain, [fc.LargeRotation(), fc.Gravity(), fc.RopeMass(), fc.RopeStretch()])
    carried = [2.0 * 9.81 * (10.0 - 11 / 24), 2.0 * 9.81 * (6.0 - 0.75 * 11 / 24)]
    assert list(fc.equilibrium(model).outputs.values()) == pytest.approx(carried, rel=1e-7)


def test_tension_carries_what_hangs_below():
    """At the start of the rope, whose support bears 11/24 of its first element."""
    structure = hanging(10, 1.0)
    model = fc.assemble(structure, [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch()])
    found = fc.equilibrium(model).state
    assert model.measure(found)[0] == pytest.approx(RHO * L * (2.0 - 1.1 / 24) * G, rel=1e-9)


def test_a_rope_between_two_posts_sags_into_a_catenary():
    """y = a (cosh(x/a) − 1) for a rope of 11 m over 10 m: 2 a sinh(5/a) = 11; second order in the elements."""
    from scipy.optimize import brentq

    a = brentq(lambda a: 2.0 * a * np.sinh(5.0 / a) - 11.0, 1.0, 100.0)
    sag, errors = a * (np.cosh(5.0 / a) - 1.0), []
    for count in (8, 16):
        rope = fc.Rope("rope", (0, 0, 0), (10, 0, 0), EA=1e7, length=11.0, rhoA=RHO, elements=count)
        structure = fc.planar(fc.Structure([rope], [fc.Support(rope.start), fc.Support(rope.end)]), "y")
        model = fc.assemble(structure, [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch()])
        x = np.array([p.start.position[0] for p in model.structure.elements])[1:]
        guess = {f"rope{i}_1_w": a * (np.cosh((at - 5.0) / a) - np.cosh(5.0 / a)) for i, at in enumerate(x)}
        found = fc.equilibrium(model, start=model.displace(guess)).state
        errors.append(abs(-found.x[:, 2].min() / sag - 1.0))
    assert errors[0] < 1e-2
    assert errors[1] < 0.3 * errors[0]


def test_how_stiff_a_rope_is_does_not_count_in_the_search():
    rope = fc.Rope("rope", (0, 0, 0), (10, 0, 0), EA=1e7, length=11.0, rhoA=RHO, elements=20)
    joints, effects = [fc.Support(rope.start), fc.Support(rope.end)], [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch()]
    ropes = [replace(rope, EA=EA) for EA in (1e7, 1e9, 1e12)]
    models = [fc.assemble(fc.Structure([r], joints), effects, fc.CasadiVM()) for r in ropes]
    iterations = [fc.equilibrium(model).iterations for model in models]
    assert max(iterations) <= min(iterations) + 2


@pytest.mark.parametrize("large", [True, False])
def test_without_the_effect_a_rope_is_a_massless_line(large):
    effects = [fc.Gravity(), fc.RopeStretch(), *([LARGE] if large else [])]
    heavy, light = fc.assemble(hanging(8, 1.0), effects), fc.assemble(_massless(), effects)
    assert heavy.n == light.n
    assert [f.kernels for f in heavy.forces.families] == [f.kernels for f in light.forces.families]
    assert (heavy.mass() != light.mass()).nnz == 0


def _massless() -> fc.Structure:
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -L), EA=1e9)
    load = fc.PointMass("load", rope.end, RHO * L)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node)]
    return fc.planar(fc.Structure([rope, load], joints, outputs=[fc.Tension("pull", rope)]), "y")


def test_assembled_matrices_are_the_slopes_of_the_forces():
    model = fc.assemble(hanging(4, 1.0), [LARGE, HEAVY, fc.RopeStretch(), fc.RayleighDamping(alpha=0.3)])
    still = np.zeros(model.n)
    slope = [-model.slope(model.rest, still, still, seeds, np.zeros(0)).toarray() for seeds in np.eye(3).tolist()]
    assert slope[2] == pytest.approx(model.mass().toarray(), abs=1e-9)
    assert slope[1] == pytest.approx(0.3 * model.mass().toarray(), abs=1e-9)
    v = np.random.default_rng(1).normal(size=model.n)
    assert model.energy(model.rest.with_(v=v))[0] == pytest.approx(0.5 * v @ model.mass() @ v)


def test_a_swinging_rope_keeps_its_energy():
    for backend in (fc.Compiled(), fc.CasadiVM()):
        structure = hanging(4, 0.5, damping=0.0)
        model = fc.assemble(structure, [LARGE, fc.Gravity(), HEAVY], backend)
        start = model.rest.with_(v=np.linspace(1.0, 0.5, model.n))
        run = fc.simulate(model, until=0.2, start=start, method=fc.GeneralizedAlpha(2e-3, rho=1.0))
        assert run.report.energy_residual < 1e-4


def test_only_the_named_ropes_have_mass_and_stretch():
    ropes = [fc.Rope(n, (i, 0, 0), (i, 0, -1), EA=1e6, rhoA=1.0, elements=3) for i, n in enumerate(("a", "b"))]
    loads = [fc.PointMass(f"m_{r.name}", r.end, 1.0) for r in ropes]
    joints = [j for r, m in zip(ropes, loads, strict=True) for j in (fc.Support(r.start), fc.Pin(r.end, m.node))]
    structure = fc.Structure([*ropes, *loads], joints)
    model = fc.assemble(structure, [LARGE, fc.RopeMass(of=["a"]), fc.RopeStretch(of=["a", "b"])])
    assert [p.name for p in model.structure.elements] == ["a0", "a1", "a2", "b", "m_a", "m_b"]
    assert all(model.bends(p) for p in model.structure.elements[:4])
    twin = fc.rigid(model)
    assert twin.n == 3 * 2 + 2
    assert [fc.refine(structure, 2).part(n).elements for n in "ab"] == [6, 6]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hanging(0), "elements = 0"),
        (lambda: fc.assemble(hanging(2), [fc.RopeMass(of=["rpoe"])]), "no rope 'rpoe' with rhoA.*rope"),
        (lambda: fc.Rope("rope", (0, 0, 0), (0, 0, 1), EA=1.0, rhoA=-1.0), "rhoA = -1"),
    ],
)
def test_impossible_heavy_ropes_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_a_rope_without_mass_per_length_is_named():
    light, heavy = (
        fc.Rope("light", (0, 0, 0), (0, 0, -1), EA=1e6),
        fc.Rope("heavy", (1, 0, 0), (1, 0, -1), EA=1e6, rhoA=1.0),
    )
    joints = [fc.Support(light.start), fc.Support(heavy.start)]
    loads = [fc.PointMass(f"{rope.name}_load", rope.end, 5.0) for rope in (light, heavy)]
    pins = [fc.Pin(rope.end, load.node) for rope, load in zip((light, heavy), loads, strict=True)]
    model = fc.assemble(
        fc.Structure([light, heavy, *loads], [*joints, *pins]), [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch()]
    )
    [note] = model.notes
    assert "mass of rope light is left out" in note
    assert "rhoA=…" in note


@pytest.mark.parametrize("effects", [[LARGE, HEAVY], [LARGE], [HEAVY], []], ids=["large", "bare", "small", "none"])
def test_a_rope_drawn_slack_is_refused_where_it_does_not_stretch(effects):
    rope = fc.Rope("sling", (0, 0, 0), (100, 0, 0), EA=1.0, length=110.0, rhoA=5.0, elements=20)
    structure = fc.Structure([rope], [fc.Support(rope.start), fc.Support(rope.end)])
    with pytest.raises(StructureError, match="rope 'sling' is 110 m long, but drawn over 100 m, slack"):
        fc.assemble(structure, [fc.Gravity(), *effects], fc.CasadiVM())
    fc.assemble(structure, [fc.Gravity(), *effects, fc.RopeStretch()], fc.CasadiVM())


def test_a_rope_drawn_stretched_says_that_it_keeps_the_distance_drawn():
    """Small oscillations with the period of the drawn length, 1 m, not of the unstretched one, 0.9 m."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e4, length=0.9)
    load = fc.PointMass("load", rope.end, 2.0)
    structure = fc.Structure([rope, load], [fc.Support(rope.start), fc.Pin(rope.end, load.node)])
    model = fc.assemble(structure, [LARGE, fc.Gravity()], fc.CasadiVM())
    assert "rope rope is drawn over 1 m, stretched from 0.9 m: without RopeStretch it keeps" in model.notes[0]
    assert fc.linearize(model).modes().omega == pytest.approx(np.sqrt(9.81) * np.ones(2), rel=1e-9)
    assert not fc.assemble(structure, [LARGE, fc.Gravity(), fc.RopeStretch()], fc.CasadiVM()).notes


BENDING = (
    fc.BeamFlexibility(["beam"]),
    fc.ComponentModes(1, ["beam"]),
    fc.ComponentModes(2, ["beam"], along=1),
)


@pytest.mark.parametrize("bending", BENDING)
def test_what_is_named_beside_a_rope_with_mass_is_what_it_is_without_names(bending):
    """Cutting ropes renames ropes alone, and leaves how many modes beams have."""
    section = fc.Section(EA=2e6, EI_y=4e3, EI_z=3e3, GJ=2e3, rhoA=4.0, rhoJ=0.05)
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), section, 2)
    rope = fc.Rope("rope", (2, 0, 0), (2, 0, -L), EA=1e6, rhoA=RHO, elements=3)
    structure = fc.Structure([beam, rope], [fc.Support(beam.start), fc.Pin(beam.end, rope.start)])
    beside = [LARGE, fc.Gravity(), HEAVY, fc.RopeStretch(["rope"])]
    named, all_of_them = (fc.assemble(structure, [*beside, effect]) for effect in (bending, replace(bending, of=())))
    assert named.coordinates == all_of_them.coordinates
    for ours, theirs in ((named.mass(), all_of_them.mass()), (named.stiffness(), all_of_them.stiffness())):
        assert (ours != theirs).nnz == 0
    assert [e.of for e in named.effects if isinstance(e, fc.RopeStretch)] == [("rope0", "rope1", "rope2")]
