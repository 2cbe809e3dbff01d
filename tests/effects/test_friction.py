"""Friction: the laws themselves, exact sticking, where it acts, and what linear models hold of it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design.piecewise import Sum
from flexctrl.design.trajectories import Ramp, Step
from flexctrl.errors import StructureError

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import machine

G = 9.81
LARGE = fc.LargeRotation()
CLOSE = fc.Tolerance(relative=1e-6, absolute=1e-8)


def block(name: str, x: float = 0.0, mass: float = 1.0) -> fc.RigidBody:
    return fc.RigidBody(name, (x, 0, 0), mass, (1.0, 1.0, 1.0))


def pulled(mass: float = 2.0) -> fc.Structure:
    """A block on the ground that is pulled along x."""
    body = block("block", mass=mass)
    return fc.Structure(
        [body],
        [fc.Support(body.node, "v w rx ry rz")],
        inputs=[fc.Force("pull", body.node, "x")],
        outputs=[fc.Position("x", body.node, "x"), fc.Velocity("v", body.node, "x")],
    )


def turntable(ratio: float = 4.0) -> fc.Structure:
    """A wheel on the ground with a motor behind a reduction, and an arm on a hinge of it about an oblique axis."""
    wheel, arm = block("wheel"), block("arm")
    axis = (0, 1, 2)
    return fc.Structure(
        [wheel, arm],
        [fc.Support(wheel.node, "u v w rx ry"), fc.Hinge(wheel.node, arm.node, axis)],
        [fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=30.0, ratio=ratio, inertia=0.05)],
        outputs=[
            fc.DriveSpeed("speed", "motor"),
            fc.AngularVelocity("spin", wheel.node, "z"),
            fc.Rotation("turn", arm.node, axis, minus=wheel.node),
        ],
    )


# -- viscous friction


@pytest.mark.parametrize("where", ["motor", "arm", "arm.rz", "wheel.rz"])
def test_viscous_friction_takes_c_times_the_square_of_the_speed(where):
    """At any place of any motion; the speeds are those that outputs measure."""
    structure = turntable()
    plain, rubbing = (
        fc.assemble(structure, [LARGE, fc.ShaftElasticity(), *more], fc.CasadiVM())
        for more in ([], [fc.ViscousFriction({where: 0.7})])
    )
    rng = np.random.default_rng(3)
    state = plain.displace(rng.normal(size=plain.n)).with_(v=rng.normal(size=plain.n))
    speed, wheel, _ = plain.measure(state)
    raw = plain.rates(state).reshape(-1)
    tilted = state.R[structure.number(structure.part("wheel").node)] @ np.array([0, 1, 2]) / np.sqrt(5)
    arm = raw[6 * 1 + 3 : 6 * 1 + 6]
    expected = {"motor": speed, "wheel.rz": wheel, "arm.rz": arm[2], "arm": tilted @ (arm - raw[3:6])}[where]
    assert rubbing.energy(state)[2] - plain.energy(state)[2] == pytest.approx(0.7 * expected**2, rel=1e-12)
    still = np.zeros(plain.n)
    force = rubbing.balance(state, state.v, still) - plain.balance(state, state.v, still)
    assert force @ state.v == pytest.approx(-0.7 * expected**2, rel=1e-12)


def test_a_brake_stops_a_rotor_exponentially():
    """Behind a rigid shaft of ratio R the motor's friction counts R² times, as its inertia does."""
    wheel = block("wheel")
    drive = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=30.0, ratio=2.0, inertia=0.05)
    structure = fc.Structure(
        [wheel], [fc.Support(wheel.node, "u v w rx ry")], [drive], outputs=[fc.DriveSpeed("speed", "motor")]
    )
    model = fc.assemble(structure, [LARGE, fc.ViscousFriction({"motor": 0.3})])
    run = fc.simulate(model, until=4.0, start=model.rest.with_(v=np.ones(1)), tolerance=CLOSE)
    assert run["speed"] == pytest.approx(2.0 * np.exp(-4 * 0.3 / (1.0 + 4 * 0.05) * run.t), abs=5e-5)
    assert run.report.energy_residual < 1e-4


def test_viscous_friction_is_the_damping_of_the_linear_model():
    linear = fc.linearize(fc.assemble(pulled(), [LARGE, fc.ViscousFriction({"block.u": 3.0})]))
    assert linear.C[0, 0] == pytest.approx(3.0)
    small = fc.assemble(pulled(), [fc.ViscousFriction({"block.u": 3.0})])
    assert fc.linearize(small).C[0, 0] == pytest.approx(3.0)


def test_friction_between_two_bodies_does_not_know_the_ground():
    """No force and no moment on the whole: momentum stays."""
    body, slider = block("body"), block("slider", mass=0.4)
    structure = fc.Structure([body, slider], [fc.Slide(body.node, slider.node, (1, 2, 0))])
    model = fc.assemble(structure, [LARGE, fc.ViscousFriction({"slider": 2.0})])
    rng = np.random.default_rng(0)
    start = model.displace(0.3 * rng.normal(size=model.n)).with_(v=rng.normal(size=model.n))

    def momenta(state: fc.State) -> np.ndarray:
        raw = model.rates(state)[:12].reshape(2, 6)
        p = [m * v for m, v in zip((1.0, 0.4), raw[:, :3], strict=True)]
        spin = sum(np.cross(x, q) for x, q in zip(state.x, p, strict=False)) + raw[:, 3:].sum(axis=0)
        return np.append(sum(p), spin)

    run = fc.simulate(model, until=1.0, start=start, method=fc.GeneralizedAlpha(0.01))
    assert momenta(run.final) == pytest.approx(momenta(start), abs=5e-4)
    assert run.report.energy_residual < 1e-3


# -- dry friction: a block


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999999])
def test_less_than_static_friction_moves_nothing_at_all(share):
    model = fc.assemble(pulled(), [LARGE, fc.CoulombFriction({"block.u": fc.Coulomb(3.0, static=5.0)})])
    run = fc.simulate(model, until=100.0, inputs={"pull": 5.0 * share})
    assert np.abs(run["x"]).max() == 0.0
    assert run.report.steps < 60


def test_more_than_static_friction_slides_against_the_kinetic_one():
    model = fc.assemble(pulled(mass=2.0), [LARGE, fc.CoulombFriction({"block.u": fc.Coulomb(3.0, static=5.0)})])
    run = fc.simulate(model, until=2.0, inputs={"pull": 5.001})
    assert run["x"] == pytest.approx(0.5 * (5.001 - 3.0) / 2.0 * run.t**2, abs=1e-9)
    assert run.report.energy_residual < 1e-9


def test_it_breaks_loose_when_a_growing_pull_reaches_static_friction_and_stops_by_itself():
    """A ramp of 2 N/s up to 6 N, then nothing: loose at 2.5 s, sliding with 3 N against it, at rest for good."""
    model = fc.assemble(pulled(mass=2.0), [LARGE, fc.CoulombFriction({"block.u": fc.Coulomb(3.0, static=5.0)})])
    pull = fc.OpenLoop({"pull": Sum((Ramp(2.0, 3.0), Step(-6.0, at=3.0)))})
    run = fc.simulate(model, pull, until=4.0, tolerance=fc.Tolerance(1e-6, 1e-9))
    loose, stop = (e.t for e in run.events)
    assert loose == pytest.approx(2.5, abs=1e-9)
    # from 2.5 s to 3 s: v̇ = (2t − 3)/2, then v̇ = −3/2
    speed = (9.0 - 6.25) / 2.0 - 1.5 * 0.5
    assert stop == pytest.approx(3.0 + speed / 1.5, abs=1e-6)
    x = np.interp(3.0, run.t, run["x"])
    expected = 0.5 * 1.0 * 0.25 + 0.125 / 6.0
    assert x == pytest.approx(expected, abs=2e-6)
    assert run["x"][-1] == pytest.approx(expected + 0.5 * speed**2 / 1.5, abs=2e-6)
    assert np.abs(run["v"][run.t > stop + 1e-9]).max() < 1e-12


def test_a_jump_of_the_inputs_breaks_loose_at_once():
    model = fc.assemble(pulled(mass=2.0), [LARGE, fc.CoulombFriction({"block.u": 3.0})])
    push = fc.OpenLoop({"pull": Step(-8.0, at=1.0, start=1.0)})
    run = fc.simulate(model, push, until=2.0)
    x = np.where(run.t < 1.0, 0.0, -0.5 * (7.0 - 3.0) / 2.0 * (run.t - 1.0) ** 2)
    assert run["x"] == pytest.approx(x, abs=1e-9)


def test_the_stribeck_curve_lies_between_static_and_kinetic_friction():
    """Pulled at constant force, the steady speed is where F_k + (F_s − F_k) exp(−(v/v_s)²) + c v meets it."""
    law = fc.Coulomb(2.0, static=4.0, stribeck=0.1)
    model = fc.assemble(
        pulled(1.0), [LARGE, fc.CoulombFriction({"block.u": law}), fc.ViscousFriction({"block.u": 10.0})]
    )
    run = fc.simulate(model, until=4.0, inputs={"pull": 4.5}, tolerance=CLOSE)
    v = run["v"][-1]
    assert 2.0 + 2.0 * np.exp(-((v / 0.1) ** 2)) + 10.0 * v == pytest.approx(4.5, rel=1e-6)


# -- several contacts


def stack() -> fc.Structure:
    """Block b rides on block a, which is pulled over the ground."""
    a, b = block("a", mass=3.0), block("b", mass=1.0)
    return fc.Structure(
        [a, b],
        [fc.Support(a.node, "v w rx ry rz"), fc.Slide(a.node, b.node, "x")],
        inputs=[fc.Force("pull", a.node, "x")],
        outputs=[fc.Position("xa", a.node, "x"), fc.Position("xb", b.node, "x")],
    )


@pytest.mark.parametrize(
    ("pull", "a", "b"),
    [
        (3.9, 0.0, 0.0),
        (6.0, 0.5, 0.5),  # together: (6 − 4)/4, which takes 0.5 N of the 2 N between them
        (15.0, 3.0, 2.0),  # apart: (15 − 4 − 2)/3, and 2/1
    ],
)
def test_one_block_on_another(pull, a, b):
    model = fc.assemble(stack(), [LARGE, fc.CoulombFriction({"a.u": 4.0, "b": 2.0})])
    run = fc.simulate(model, until=1.0, inputs={"pull": pull})
    assert run["xa"] == pytest.approx(0.5 * a * run.t**2, abs=1e-9)
    assert run["xb"] == pytest.approx(0.5 * b * run.t**2, abs=1e-9)


def test_two_contacts_on_one_freedom_share_the_load():
    """Redundant sticking: the block holds as long as both together can."""
    laws = {"block.u": fc.Coulomb(2.0, static=3.0), "block": fc.Coulomb(2.0, static=3.0)}
    body, rail = block("block", mass=2.0), block("rail")
    structure = fc.Structure(
        [rail, body],
        [fc.Support(rail.node), fc.Slide(rail.node, body.node, "x")],
        inputs=[fc.Force("pull", body.node, "x")],
        outputs=[fc.Position("x", body.node, "x")],
    )
    model = fc.assemble(structure, [LARGE, fc.CoulombFriction(laws)])
    assert fc.simulate(model, until=1.0, inputs={"pull": 5.9})["x"][-1] == pytest.approx(0.0, abs=1e-15)
    run = fc.simulate(model, until=1.0, inputs={"pull": 6.5})
    assert run["x"][-1] == pytest.approx(0.5 * (6.5 - 4.0) / 2.0, abs=1e-9)


def test_a_stuck_hinge_in_space_is_a_weld():
    """A free body with an arm stuck on its hinge turns as one body: relative angle, momenta and energy stay."""
    body = fc.RigidBody("body", (0, 0, 0), 2.0, (0.5, 0.8, 1.0), {"pin": (0.4, 0, 0)})
    arm = fc.RigidBody("arm", (0.4, 0.3, 0.1), 1.0, (0.1, 0.2, 0.25), {"pin": (0.4, 0, 0)})
    axis = (1, 1, 3)
    structure = fc.Structure(
        [body, arm],
        [fc.Hinge(body.point("pin"), arm.point("pin"), axis)],
        outputs=[fc.Rotation("turn", arm.node, axis, minus=body.node)],
    )
    model = fc.assemble(structure, [LARGE, fc.CoulombFriction({"arm": 50.0})])
    v = np.zeros(model.n)
    spin = np.array([0.8, -1.0, 1.4])
    for k, name in enumerate(("rx", "ry", "rz")):
        v[model.coordinate(f"body_0_{name}")] = spin[k]
    unit = np.array(axis) / np.sqrt(11.0)
    v[[i for i, n in enumerate(model.coordinates) if n.endswith("_turn")]] = unit @ spin
    start = model.rest.with_(v=v)
    run = fc.simulate(model, until=2.0, start=start, tolerance=fc.Tolerance(1e-5, 1e-7))
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["turn"]).max() < 1e-7
    assert model.energy(run.final)[0] == pytest.approx(model.energy(start)[0], rel=1e-4)
    assert not run.events


def test_a_stuck_motor_holds_its_joint_through_the_shaft():
    """Dry friction in the motor's bearing: the load swings on k R² as if the motor were clamped."""
    arm = fc.RigidBody("arm", (0, 0, 0), 1.0, (2.0, 2.0, 2.0))
    structure = fc.Structure(
        [arm],
        [fc.Support(arm.node, "u v w rx ry")],
        [fc.RotaryDrive("motor", arm.node, axis="z", stiffness=0.5, ratio=10.0, inertia=0.01)],
        outputs=[fc.Rotation("turn", arm.node, "z"), fc.DriveAngle("angle", "motor")],
    )
    model = fc.assemble(structure, [LARGE, fc.Flexible(), fc.CoulombFriction({"motor": 1.0})])
    start = model.displace({"arm_0_rz": 0.1})
    run = fc.simulate(model, until=1.0, start=start, method=fc.GeneralizedAlpha(0.005, rho=1.0))
    assert np.abs(run["angle"]).max() == 0.0
    assert run["turn"] == pytest.approx(0.1 * np.cos(5.0 * run.t), abs=1e-4)


# -- everywhere


@pytest.mark.parametrize("seed", range(2))
def test_energy_books_close_on_machines_made_at_random(seed):
    structure = machine(seed, supported=True)
    places = {d.name: 0.5 for d in structure.drives}
    moving = {j.second.part for j in structure.joints if isinstance(j, fc.Hinge | fc.Slide)}
    for name in moving:
        joints = [
            j for j in structure.joints if isinstance(j, fc.Hinge | fc.Slide) and name in (n.part for n in j.nodes)
        ]
        if len(joints) == 1:
            places[name] = 0.5
    if not places:
        pytest.skip("nothing rubs in this machine")
    effects = [LARGE, fc.Gravity(), fc.Flexible(), fc.ViscousFriction(places), fc.CoulombFriction(places)]
    model = fc.assemble(structure, effects)
    run = fc.simulate(model, until=0.2, method=fc.GeneralizedAlpha(2e-3))
    assert run.status is fc.Status.FINISHED
    assert run.report.energy_residual < 1e-3


NOTHING = {
    "viscous": fc.ViscousFriction({"motor": 0.0, "arm": 0.0, "wheel.rz": 0.0}),
    "dry": fc.CoulombFriction({"motor": 0.0, "arm": 0.0, "wheel.rz": 0.0}),
    "none": fc.CoulombFriction({}),
}


@pytest.mark.parametrize("kind", NOTHING)
def test_no_friction_is_as_if_it_were_not_there(kind):
    structure, effects = turntable(), [LARGE, fc.Flexible()]
    without, with_ = (fc.assemble(structure, e) for e in (effects, [*effects, NOTHING[kind]]))
    rng = np.random.default_rng(1)
    v = rng.normal(size=without.n)
    runs = [fc.simulate(m, until=0.1, start=m.rest.with_(v=v)) for m in (without, with_)]
    assert runs[1].final.q == pytest.approx(runs[0].final.q, abs=1e-13)
    assert runs[1].report.steps == runs[0].report.steps


def test_friction_costs_nothing_where_it_is_not():
    """The kernels of parts and drives are the same ones, not only as long."""
    plain, rubbing = (
        fc.assemble(turntable(), [LARGE, *more]) for more in ([], [fc.ViscousFriction({"arm": 1.0}), fc.MotorLag({})])
    )
    own = {f.kernels.kind.name: f.kernels for f in rubbing.forces.families}
    for family in plain.forces.families:
        assert own.pop(family.kernels.kind.name) is family.kernels
    assert set(own) == {"viscous_turning"}
    assert rubbing.n == plain.n


def test_dry_friction_is_not_in_equilibria_and_linear_models_and_that_is_said():
    effects = [LARGE, fc.ViscousFriction({"block.u": 2.0})]
    law = fc.LuGre(1e5, kinetic=3.0, damping=300.0, viscous=0.5)
    for more, damping in (([fc.CoulombFriction({"block.u": 3.0})], 2.0), ([fc.LuGreFriction({"block.u": law})], 2.5)):
        model = fc.assemble(pulled(), [*effects, *more])
        assert any("block.u" in note for note in model.notes)
        linear = fc.linearize(model)
        assert linear.coordinates == ("block_0_u",)
        assert linear.C[0, 0] == pytest.approx(damping)
        assert linear.K.nnz == 0 or abs(linear.K).max() == 0.0


@pytest.mark.parametrize(("viscous", "same"), [(0.7, [fc.ViscousFriction({"block.u": 0.7})]), (0.0, [])])
def test_lugre_without_bristles_is_viscous_friction_or_none(viscous, same):
    law = fc.LuGre(1e4, 0.0, damping=200.0, viscous=viscous)
    effects = ([fc.LuGreFriction({"block.u": law})], same)
    models = [fc.assemble(pulled(2.0), [LARGE, *more]) for more in effects]
    ours, theirs = (([f.kernels for f in m.forces.families], m.coordinates, m.notes) for m in models)
    assert ours == theirs
    ours, theirs = (fc.simulate(m, until=1.0, inputs={"pull": 2.0}, method=fc.GeneralizedAlpha(1e-2)) for m in models)
    np.testing.assert_array_equal(ours.y, theirs.y)


def test_lugre_sticks_elastically_and_slides_at_its_level():
    """Pulled below F_s the bristles bend by F/σ₀; above, it accelerates by (F − F_k)/m."""
    law = fc.LuGre(1e4, kinetic=3.0, static=5.0, stribeck=1e-3, damping=200.0)
    model = fc.assemble(pulled(2.0), [LARGE, fc.LuGreFriction({"block.u": law})])
    held = fc.simulate(model, until=1.0, inputs={"pull": 2.0}, tolerance=fc.Tolerance(1e-5, 1e-8))
    assert held.final.q[model.coordinate("block_u_bristle")] == pytest.approx(2.0 / 1e4, rel=1e-3)
    assert held.report.energy_residual < 1e-2
    loose = fc.simulate(model, until=1.0, inputs={"pull": 9.0}, tolerance=fc.Tolerance(1e-5, 1e-8))
    late = loose.t > 0.5
    assert np.polyfit(loose.t[late], loose["v"][late], 1)[0] == pytest.approx((9.0 - 3.0) / 2.0, rel=1e-3)


def test_extrapolation_knows_bristles():
    """Two runs of an explicit order more than one: nearer to the explicit method than the finer of the two."""
    law = fc.LuGre(100.0, kinetic=3.0, damping=2.0)
    model = fc.assemble(pulled(2.0), [LARGE, fc.LuGreFriction({"block.u": law})])

    def end(method):
        return fc.simulate(model, until=0.5, inputs={"pull": 5.0}, method=method, tolerance=fc.Tolerance(0.0, 1e-8))[
            "x"
        ][-1]

    exact, fine = end(fc.GeneralizedAlpha(1e-4)), end(fc.GeneralizedAlpha(5e-3))
    assert abs(end(fc.Richardson(fc.GeneralizedAlpha(1e-2))) - exact) < 0.1 * abs(fine - exact)


def test_the_rigid_twin_rubs_as_the_machine_does():
    effects = [LARGE, fc.Flexible(), fc.ViscousFriction({"motor": 0.1}), fc.CoulombFriction({"arm": 0.2})]
    model = fc.rigid(fc.assemble(turntable(), effects))
    assert [type(e) for e in model.effects] == [fc.LargeRotation, fc.ViscousFriction, fc.CoulombFriction]
    v = np.zeros(model.n)
    v[model.coordinate("wheel_0_rz")] = 1.0
    # behind a rigid shaft the motor turns R times as fast
    assert model.energy(model.rest.with_(v=v))[2] == pytest.approx(0.1 * 16.0)


# -- refusals


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.ViscousFriction(0.3), "expected a mapping of names to values"),
        (
            lambda: fc.ViscousFriction({"motor": -1.0}),
            "ViscousFriction: coefficient of 'motor' = -1.0; expected a number ≥ 0",
        ),
        (lambda: fc.Coulomb(3.0, static=2.0), "static = 2 below kinetic = 3"),
        (lambda: fc.Coulomb(-1.0), "kinetic = -1.0"),
        (lambda: fc.CoulombFriction({"motor": "much"}), "CoulombFriction: friction of 'motor' = 'much'"),
        (lambda: fc.LuGre(0.0, 1.0), "LuGre: stiffness = 0.0"),
        (lambda: fc.LuGre(1.0, 2.0, static=1.0), "static = 1 below kinetic = 2"),
        (lambda: fc.LuGre(1e4, 0.0, static=5.0), "kinetic = 0 below static = 5: .* give a small kinetic > 0, as 0.005"),
        (lambda: fc.LuGre(1e4, -1.0), "LuGre: kinetic = -1"),
        (lambda: fc.LuGreFriction({"motor": 2.0}), "LuGreFriction: law of 'motor' = 2.0; expected a flexctrl.LuGre"),
    ],
)
def test_impossible_friction_is_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("moter", "there is no drive or part 'moter'.*motor"),
        ("arm.stat", "names no node of 'arm'"),
        ("wheel.u", "cannot move: u of node 0 of wheel is held"),
        ("nothing.rz", "there is no element 'nothing'"),
    ],
)
def test_places_that_there_are_not_are_refused(where, message):
    for effect in (fc.ViscousFriction({where: 1.0}), fc.CoulombFriction({where: 1.0})):
        with pytest.raises(StructureError, match=message):
            fc.assemble(turntable(), [LARGE, effect])


def test_a_part_with_two_joints_needs_its_node():
    a, b, c = block("a"), block("b"), block("c")
    structure = fc.Structure([a, b, c], [fc.Hinge(a.node, b.node, "z"), fc.Hinge(b.node, c.node, "x")])
    with pytest.raises(StructureError, match="2 joints of 'b' turn or slide; name a node"):
        fc.assemble(structure, [LARGE, fc.ViscousFriction({"b": 1.0})])


def test_dry_friction_needs_large_rotation_and_mass():
    with pytest.raises(StructureError, match="CoulombFriction is not linear"):
        fc.assemble(pulled(), [fc.CoulombFriction({"block.u": 1.0})])
    with pytest.raises(StructureError, match="LuGreFriction is not linear"):
        fc.assemble(pulled(), [fc.LuGreFriction({"block.u": fc.LuGre(1e4, 1.0)})])
    arm = block("arm")
    drive = fc.RotaryDrive("motor", arm.node, axis="z", stiffness=3.0, inertia=0.0)
    light = fc.Structure([arm], [fc.Support(arm.node, "u v w rx ry")], [drive])
    model = fc.assemble(light, [LARGE, fc.Flexible(), fc.CoulombFriction({"motor": 1.0})])
    with pytest.raises(StructureError, match="nothing with mass moves at 'motor'"):
        fc.simulate(model, until=0.1)


def test_compiled_friction_is_the_same(monkeypatch):
    """Kernel by kernel: under steps of the same tolerance."""
    pytest.importorskip("llvmlite", reason="the compiled path needs the extra [fast]")
    monkeypatch.setattr("flexctrl.dynamics.alpha.method._quickest", lambda plain: plain)
    law = fc.LuGre(1e3, kinetic=3.0, static=5.0, stribeck=1e-2, damping=20.0, viscous=0.3)
    effects = [LARGE, fc.LuGreFriction({"arm": law}), fc.CoulombFriction({"motor": fc.Coulomb(0.1, 0.2, 0.5)})]
    runs = []
    for backend in (fc.CasadiVM(), fc.Compiled()):
        model = fc.assemble(turntable(), [*effects, fc.Flexible()], backend)
        start = model.rest.with_(v=np.linspace(1.0, 2.0, model.n))
        runs.append(fc.simulate(model, until=0.2, start=start, method=fc.GeneralizedAlpha(4e-3)))
    assert runs[1].final.q == pytest.approx(runs[0].final.q, abs=1e-12)
