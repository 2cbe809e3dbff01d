"""A trolley on a beam that bends: levers, tangents, conservation, closed forms of statics and of rigid rails."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.dynamics.run import Status

LENGTH, EI, G = 4.0, 900.0, 9.81
SECTION = fc.Section(EA=1e6, EI_y=EI, EI_z=1.3 * EI, GJ=700.0, rhoA=2.0, rhoJ=0.05)
LARGE = (fc.LargeRotation(), fc.BeamFlexibility(), fc.RopeStretch())
VM = fc.CasadiVM()
SKEW = Rotation.from_rotvec([0.7, -1.2, 1.9]).as_matrix()


def crane(turned: np.ndarray | None = None, supported: bool = True) -> fc.Structure:
    """A girder of four elements with a trolley 1.3 m from its start and a load on a rope below that."""
    Q = np.eye(3) if turned is None else turned
    girder = fc.Beam("girder", (0, 0, 0), Q @ (LENGTH, 0, 0), SECTION, 4, up=Q[:, 2])
    trolley = fc.Trolley("trolley", girder, at=1.3, mass=5.0)
    load = fc.PointMass("load", Q @ (1.3, 0, -1), 3.0)
    rope = fc.Rope("rope", trolley.node, load.node, EA=5e3)
    hung = [fc.Pin(rope.start, trolley.node), fc.Pin(rope.end, load.node)]
    held = [fc.Support(girder.start), fc.Support(girder.end, "u v w")] if supported else []
    return fc.Structure(
        [girder, trolley, load, rope],
        [*held, *hung],
        inputs=[fc.Force("push", trolley.travel, "x"), fc.Force("pull", trolley.node, Q @ (0.6, 0, -0.8))],
        outputs=[
            fc.Position("s", trolley.travel, "x"),
            fc.Position("height", trolley.node, Q[:, 2]),
            fc.Position("sway", load.node, Q[:, 0], minus=trolley.node),
        ],
    )


def bent(model: fc.Model, seed: int, at: float) -> fc.State:
    """A state far from rest that moves, with the trolley at a place."""
    rng = np.random.default_rng(seed)
    step, v = 0.2 * rng.normal(size=model.n), rng.normal(size=model.n)
    step[model.coordinate("trolley_slide")] = at - 1.3
    return model.displace(step).with_(v=v)


@pytest.mark.parametrize("at", [0.4, 1.7, 3.9])
def test_velocities_and_accelerations_are_rates_of_places(at):
    model = fc.assemble(crane(), LARGE, VM)
    state, motion = bent(model, 1, at), model.motion
    a, h = np.random.default_rng(2).normal(size=model.n), 1e-5
    node = model.structure.number(model.structure.part("trolley").node)
    cells = slice(6 * node, 6 * node + 3)

    def after(t: float) -> fc.State:
        return model.advance(state, t * state.v + 0.5 * t * t * a, state.v + t * a, t)

    places = [after(t).x[node] for t in (-h, h)]
    assert np.allclose(model.rates(state)[cells], (places[1] - places[0]) / (2 * h), atol=1e-7)
    rates = [model.rates(after(t))[cells] for t in (-h, h)]
    assert np.allclose(motion.accelerations(state, state.v, a)[cells], (rates[1] - rates[0]) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("at", [0.4, 2.6])
def test_tangents_are_derivatives(at):
    model = fc.assemble(crane(), (*LARGE, fc.Gravity()), VM)
    state, u = bent(model, 3, at), np.array([4.0, 7.0])
    rng, h = np.random.default_rng(4), 1e-6
    v, a, way = state.v, rng.normal(size=model.n), rng.normal(size=model.n)
    for seeds in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):

        def force(d: float, seeds: tuple[float, ...] = seeds) -> np.ndarray:
            moved = model.advance(state, seeds[0] * d * way, v, 0.0)
            found = model.balance(moved, v + seeds[1] * d * way, a + seeds[2] * d * way)
            return found + model.loads(moved, u)

        change, noise = (force(h) - force(-h)) / (2 * h), 1e-14 * np.abs(model.forces.raw(state, v, a)).max() / h
        found = model.slope(state, v, a, seeds, u) @ way
        assert np.allclose(found, change, rtol=0, atol=1e-7 * np.abs(change).max() + noise)


def test_over_the_border_of_elements_place_and_velocity_go_on():
    """The cubics of two elements meet with one tangent."""
    model = fc.assemble(crane(), LARGE, VM)
    node = model.structure.number(model.structure.part("trolley").node)
    for border in (1.0, 2.0, 3.0):
        before, after = (bent(model, 5, border + d) for d in (-1e-9, 1e-9))
        assert np.allclose(before.x[node], after.x[node], atol=1e-8)
        assert np.allclose(*(model.rates(s)[6 * node : 6 * node + 3] for s in (before, after)), atol=1e-7)


@pytest.mark.parametrize("at", [0.5, 1.25, 2.0, 3.1])
def test_deflection_under_the_trolley_is_the_influence_line(at):
    """P a² b²/(3 E I L), exact at the nodes of the girder and nearly between them."""
    girder = fc.Beam("girder", (0, 0, 0), (LENGTH, 0, 0), SECTION, 16)
    trolley = fc.Trolley("trolley", girder, at=2.0, mass=5.0)
    joints = [fc.Support(girder.start, "u v w rx"), fc.Support(girder.end, "v w")]
    push = fc.Force("push", trolley.node, "-z")
    machine = fc.Structure([girder, trolley], joints, inputs=[push], outputs=[fc.Position("z", trolley.node, "z")])
    rest = fc.equilibrium(fc.assemble(machine, LARGE, VM), hold={"trolley_slide": at - 2.0}, inputs={"push": 0.1})
    assert rest.outputs["z"] == pytest.approx(-0.1 * (at * (LENGTH - at)) ** 2 / (3 * EI * LENGTH), rel=3e-4)


def test_stiffness_of_the_hollow_in_which_a_trolley_rests():
    """V = −½ P² a² b²/(3 E I L): at mid-span P² L/(6 E I) pulls it back, of all the geometric stiffness."""
    girder = fc.Beam("girder", (0, 0, 0), (LENGTH, 0, 0), SECTION, 8)
    trolley = fc.Trolley("trolley", girder, at=0.5 * LENGTH, mass=5.0)
    joints = [fc.Support(girder.start, "u w"), fc.Support(girder.end, "w")]
    machine = fc.planar(fc.Structure([girder, trolley], joints, inputs=[fc.Force("push", trolley.node, "-z")]), "y")
    model = fc.assemble(machine, LARGE, VM)
    linear = fc.linearize(model, inputs={"push": 2.0})
    own = linear.coordinates.index("trolley_slide")
    others = np.delete(np.arange(model.n), own)
    K = linear.K.tocsc()
    led = K[others][:, [own]].toarray().ravel()
    left = K[own, own] - led @ spsolve(K[others][:, others], led)
    assert left == pytest.approx(2.0**2 * LENGTH / (6 * EI), rel=1e-3)


def test_pendulum_under_a_trolley_on_a_rigid_rail():
    """ω² = (1 + m/M) g/l beside the trolley's rigid motion."""
    effects = (fc.LargeRotation(), fc.Gravity())
    model = fc.assemble(crane(), effects, VM)
    modes = fc.linearize(model, at=model.rest).modes()
    assert modes.rigid == 1
    expected = [np.sqrt(G), np.sqrt(G * (1 + 3.0 / 5.0))]
    assert np.allclose(np.sort(modes.omega[modes.rigid :]), expected, rtol=1e-9)


def test_a_free_beam_with_a_free_trolley_has_seven_rigid_motions():
    girder = fc.Beam("girder", (0, 0, 0), (1, 2, 3), SECTION, 3)
    machine = fc.Structure([girder, fc.Trolley("trolley", girder, at=1.3, mass=5.0)])
    linear = fc.linearize(fc.assemble(machine, LARGE, VM))
    assert linear.modes().rigid == 7
    named = [name for name in linear.certificate.rigid_modes if "translation" in name or "rotation" in name]
    assert len(named) == 6


def bead(at: float, supports: Sequence[str], drawn: Sequence[float]) -> tuple[fc.Model, fc.State]:
    """A bead on a rigid rod."""
    rod = fc.Beam("rod", (0, 0, 0), drawn, SECTION, 3)
    trolley = fc.Trolley("trolley", rod, at=at, mass=5.0)
    joints = [fc.Support(rod.start, held) for held in supports]
    machine = fc.Structure([rod, trolley], joints, outputs=[fc.Position("s", trolley.travel, "x")])
    model = fc.assemble(machine, (fc.LargeRotation(), fc.Gravity((0, 0, -G))), VM)
    return model, model.rest


def test_bead_on_an_inclined_rod_falls_along_it():
    model, rest = bead(0.5, ["all"], (2.4, 0, -3.2))
    run = fc.simulate(model, until=0.7, start=rest, method=fc.GeneralizedAlpha(0.01))
    assert run["s"][-1] == pytest.approx(0.5 + 0.5 * G * 0.8 * 0.7**2, rel=1e-9)


@pytest.mark.slow
def test_bead_on_a_turning_rod_keeps_energy_and_moment_of_momentum():
    """(J + m s²) ω and ½ (J + m s²) ω² + ½ m ṡ² stay: Coriolis and centrifugal forces."""
    model, rest = bead(0.5, ["u v w rx ry"], (0, LENGTH, 0))
    v = np.zeros(model.n)
    turn, slide = (i for i in range(model.n) if i != model.coordinate("trolley_slide")), "trolley_slide"
    spin = next(turn)
    v[spin] = 2.0
    run = fc.simulate(model, until=0.8, start=rest.with_(v=v), tolerance=fc.Tolerance(1e-9, 1e-9))
    J = 2.0 * LENGTH**3 / 3.0
    s, w, rate = run["s"][-1], run.final.v[spin], run.final.v[model.coordinate(slide)]
    assert s > 1.0
    assert (J + 5.0 * s**2) * w == pytest.approx((J + 5.0 * 0.25) * 2.0, rel=1e-6)
    assert 0.5 * ((J + 5.0 * s**2) * w**2 + 5.0 * rate**2) == pytest.approx(0.5 * (J + 5.0 * 0.25) * 4.0, rel=1e-6)


def _momenta(model: fc.Model, state: fc.State) -> np.ndarray:
    """Momentum and moment of momentum of what floats."""
    M = -model.slope(state, state.v, 0.0 * state.v, (0.0, 0.0, 1.0), np.zeros(len(model.inputs)))
    fields = np.zeros((model.n, 6))
    for k, e in enumerate(np.eye(3)):
        for node, row in enumerate(model.motion.place[:-1]):
            if row[1] < model.n:
                fields[row[:3], k], fields[row[:3], 3 + k] = e, np.cross(e, state.x[node])
            if row[4] < model.n:
                fields[row[3:], 3 + k] = e
    return fields.T @ (M @ state.v)


def _drifting(model: fc.Model) -> fc.State:
    """Drifting and turning as a whole, with the trolley running along it."""
    drift, spin = np.array([0.3, -0.2, 0.5]), np.array([0.2, 0.8, -0.4])
    v = np.zeros(model.n)
    for x, row in zip(model.rest.x[:-1], model.motion.place[:-1], strict=True):
        for cells, values in ((row[:3], drift + np.cross(spin, x)), (row[3:], spin)):
            if (cells < model.n).all():
                v[cells] = values
    v[model.coordinate("trolley_slide")] = 3.0
    return model.rest.with_(v=v)


@pytest.mark.slow
def test_a_free_beam_with_a_mass_running_along_it_keeps_its_momenta_and_energy():
    model = fc.assemble(crane(supported=False), LARGE)
    start = _drifting(model)
    run = fc.simulate(model, until=0.6, start=start, method=fc.GeneralizedAlpha(5e-4, rho=1.0))
    assert run["s"][-1] > 2.5
    before, after = _momenta(model, start), _momenta(model, run.final)
    assert np.allclose(after, before, atol=1e-5 * np.abs(before).max())
    kinetic, stored, _ = model.energy(run.final)
    assert stored > 1e-3 * kinetic
    assert kinetic + stored == pytest.approx(sum(model.energy(start)[:2]), rel=1e-5)


def _swung(turned: np.ndarray | None, backend: fc.CasadiVM | None = None) -> np.ndarray:
    Q = np.eye(3) if turned is None else turned
    model = fc.assemble(crane(turned), (*LARGE, fc.Gravity(Q @ (0, 0, -G))), backend)
    loads, accurate = {"push": 100.0, "pull": 20.0}, fc.Tolerance(1e-7, 1e-10)
    run = fc.simulate(model, until=0.45, inputs=loads, method=fc.GeneralizedAlpha(5e-3), tolerance=accurate)
    return np.column_stack([run["s"], run["height"], run["sway"]])


@pytest.mark.slow
def test_any_orientation_and_both_loops_give_the_same_run():
    """Over two borders of elements; plain steps of the casadi machine, and compiled ones."""
    plain = _swung(None, VM)
    assert plain[-1, 0] > 3.1
    assert np.allclose(_swung(None), plain, atol=1e-8)
    assert np.allclose(_swung(SKEW), plain, atol=1e-8)


def test_wheels_share_what_a_body_weighs_and_its_moment():
    """12 N on 6 kg: 2 m/s²; the body's 4 kg hang 0.3 m below the wheels, 0.6 m before and behind its centre."""
    model = fc.assemble(carriage(), (*LARGE, fc.Gravity()), VM)
    loads = {name: fc.rail_force(model, model.rest, name, {"push": 12.0}) for name in ("front", "back")}
    more = 4.0 * 2.0 * 0.3 / 1.2
    assert np.allclose(loads["front"][[1, 2]], (0.0, -3.0 * G - more), atol=1e-9)
    assert np.allclose(loads["back"][[1, 2]], (0.0, -3.0 * G + more), atol=1e-9)
    assert loads["front"][0] + loads["back"][0] == pytest.approx(-12.0)
    with pytest.raises(fc.errors.StructureError, match=r"no trolley 'fornt'.*front"):
        fc.rail_force(model, model.rest, "fornt")
    beam = next(p for p in model.structure.elements if isinstance(p, fc.Beam))
    with pytest.raises(fc.errors.StructureError, match=rf"^rail_force: '{beam.name}' is a Beam; expected a Trolley$"):
        fc.rail_force(model, model.rest, beam)
    with pytest.raises(fc.errors.StructureError, match=r"rail_force: trolley = 3; expected a Trolley"):
        fc.rail_force(model, model.rest, 3)


def test_wheel_load_of_a_swinging_load():
    """A load that passes its lowest place at 2 m/s on a rope of 1 m pulls with m (g + v²/l); the trolley is held."""
    girder = fc.Beam("girder", (0, 0, 0), (LENGTH, 0, 0), SECTION, 4)
    trolley = fc.Trolley("trolley", girder, at=1.3, mass=5.0)
    load, rope = fc.PointMass("load", (1.3, 0, -1), 3.0), fc.Rope("rope", trolley.node, (1.3, 0, -1), EA=1.0)
    pins = [fc.Pin(rope.start, trolley.node), fc.Pin(rope.end, load.node)]
    held = [fc.Support(girder.start), fc.Support(trolley.travel, "u")]
    model = fc.assemble(fc.Structure([girder, trolley, load, rope], [*held, *pins]), (LARGE[0], fc.Gravity()), VM)
    rates = [-2.0 if name.endswith("ry") else 0.0 for name in model.coordinates]
    state = model.rest.with_(v=np.array(rates))
    assert abs(model.rates(state)[6 * model.structure.number(load.node)]) == pytest.approx(2.0)
    push = fc.rail_force(model, state, trolley)
    assert np.allclose(push, (0.0, 0.0, -5.0 * G - 3.0 * (G + 4.0)), atol=1e-9)


@pytest.mark.slow
def test_a_run_ends_with_the_rail():
    model = fc.assemble(crane(), LARGE)
    for push, end, word in ((200.0, LENGTH, "end of its rail, 4 m from its start"), (-200.0, 0.0, "start of its rail")):
        run = fc.simulate(model, until=9.0, inputs={"push": push})
        assert run.status is Status.STOPPED
        assert f"trolley is at the {word}" in run.report.message
        assert run["s"][-1] == pytest.approx(end, abs=1e-7)


def test_a_bead_that_leaves_its_rod_is_stopped():
    model = bead(0.5, ["all"], (2.4, 0, -3.2))[0]
    run = fc.simulate(model, until=3.0, method=fc.GeneralizedAlpha(0.02))
    assert run.status is Status.STOPPED
    assert run.final.t == pytest.approx(np.sqrt(2.0 * 3.5 / (0.8 * G)), rel=1e-6)


def carriage() -> fc.Structure:
    """A rigid body on two trolleys, on a girder that is held everywhere."""
    girder = fc.Beam("girder", (0, 0, 0), (LENGTH, 0, 0), SECTION, 4)
    front, back = (fc.Trolley(name, girder, at=at, mass=1.0) for name, at in (("front", 2.6), ("back", 1.4)))
    eyes = {"front": front.node.position, "back": back.node.position}
    body = fc.RigidBody("body", (2.0, 0, -0.3), 4.0, (0.1, 0.5, 0.5), points=eyes)
    return fc.Structure(
        [girder, front, back, body],
        [
            *(fc.Support(girder.node(i)) for i in range(5)),
            fc.Pin(body.point("front"), front.node),
            fc.Pin(body.point("back"), back.node),
        ],
        inputs=[fc.Force("push", front.travel, "x")],
        outputs=[fc.Position("front", front.travel, "x"), fc.Position("back", back.travel, "x")],
    )


@pytest.mark.slow
def test_two_trolleys_carry_one_body():
    """s₂ − s₁ follows."""
    model = fc.assemble(carriage(), LARGE, VM)
    run = fc.simulate(model, until=0.5, inputs={"push": 12.0}, method=fc.GeneralizedAlpha(0.01))
    assert run["front"][-1] == pytest.approx(2.6 + 0.5 * 2.0 * 0.25, rel=1e-9)
    assert run["back"][-1] == pytest.approx(run["front"][-1] - 1.2, abs=1e-9)


def test_dry_friction_along_the_rail_stops_a_trolley():
    """3 N on 5 kg from 1.2 m/s: it stands still after 1.2² · 5/6 m."""
    model = bead(0.5, ["all"], (LENGTH, 0, 0))[0]
    model = fc.assemble(
        model.structure, (*model.effects, fc.CoulombFriction({"trolley.travel.u": fc.Coulomb(3.0)})), VM
    )
    run = fc.simulate(model, until=4.0, start=model.rest.with_(v=np.array([1.2])))
    assert run["s"][-1] == pytest.approx(0.5 + 1.2**2 * 5.0 / 6.0, rel=1e-6)
    assert run.final.v[0] == pytest.approx(0.0, abs=1e-12)


def test_what_is_no_small_motion_is_refused():
    with pytest.raises(fc.errors.StructureError, match=r"Trolley 'trolley' travels.*Support\(trolley.travel, 'u'\)"):
        fc.assemble(crane(), [fc.BeamFlexibility()])
    held = crane().with_(joints=[*crane().joints, fc.Support(crane().part("trolley").travel, "u")])
    small, large = fc.assemble(held, LARGE[1:]), fc.assemble(held, LARGE)
    assert "trolley_slide" not in small.coordinates
    still = np.zeros(large.n)
    M = -large.slope(large.rest, still, still, (0.0, 0.0, 1.0), np.zeros(2))
    assert abs(small.mass() - M).max() < 1e-12 * abs(M).max()


def test_modes_inside_the_elements_of_a_rail_are_refused():
    with pytest.raises(fc.errors.StructureError, match="ComponentModes bends 'girder'"):
        fc.assemble(crane(), [*LARGE, fc.ComponentModes(2)])


def test_a_start_beyond_the_rail_is_refused():
    model = fc.assemble(crane(), LARGE)
    with pytest.raises(fc.errors.StructureError, match=r"trolley is 0.3 m beyond an end of its rail"):
        fc.simulate(model, until=1.0, start=model.displace({"trolley_slide": 3.0}))


def test_no_equilibrium_beyond_the_rail():
    """A spring that would pull the trolley 1 m past the end."""
    girder = fc.Beam("girder", (0, 0, 0), (LENGTH, 0, 0), SECTION, 4)
    trolley = fc.Trolley("trolley", girder, at=3.0, mass=5.0)
    spring = fc.Spring("spring", trolley.node, (5, 0, 0), stiffness=10.0, length=1e-3)
    joints = [fc.Support(girder.start), fc.Support(girder.end, "v w"), fc.Support(spring.end)]
    machine = fc.Structure([girder, trolley, spring], [*joints, fc.Pin(spring.start, trolley.node)])
    with pytest.raises(fc.errors.EquilibriumError, match=r"trolley is .* m beyond an end of its rail"):
        fc.equilibrium(fc.assemble(machine, LARGE, VM))


def test_a_carriage_of_two_trolleys_goes_from_element_to_element():
    """It ended at the first node: what was to follow from the rest was that node's deflection, felt less and less."""
    section = fc.Section(EA=1e10, EI_y=1e7, EI_z=1e7, GJ=1e8, rhoA=50.0, rhoJ=1e-6)
    girder = fc.Beam("girder", (0, 0, 8), (10, 0, 8), section, elements=6)
    front, back = fc.Trolley("front", girder, at=2.5, mass=50.0), fc.Trolley("back", girder, at=2.0, mass=50.0)
    carriage = fc.RigidBody("carriage", (2.25, 0, 8), 200.0, [100.0] * 3, {"a": (2, 0, 8), "b": (2.5, 0, 8)})
    joints = [fc.Support(end, "u v w rx") for end in (girder.start, girder.end)]
    joints += [fc.Pin(back.node, carriage.point("a")), fc.Pin(front.node, carriage.point("b"))]
    joints += [fc.Support(carriage.node, "rx")]
    inputs = [fc.Force("pull", [back.travel, front.travel], "x")]
    outputs = [fc.Position("s", back.travel, "x"), fc.Position("w", carriage.node, "z")]
    plan = fc.Structure([girder, front, back, carriage], joints, inputs=inputs, outputs=outputs)
    effects = [fc.LargeRotation(), fc.Gravity(), fc.BeamFlexibility(), fc.RayleighDamping(beta=2e-4)]
    model = fc.assemble(plan, effects)
    assert not any("girder" in note.partition(" given by")[0] for note in model.notes)
    held = next(name for name in model.coordinates if name.endswith("slide"))
    start = fc.equilibrium(model, hold={held: 0.0}).state
    run = fc.simulate(
        model, until=2.6, start=start, inputs={"pull": 150.0}, method=fc.Unchecked(fc.GeneralizedAlpha(0.01))
    )
    assert run.status is fc.Status.FINISHED
    assert run["s"][-1] == pytest.approx(
        2.0 + 0.5 * 300.0 / 300.0 * 2.6**2, abs=0.15
    )  # 2 × 150 N on 300 kg, and a hollow
