"""Play in springs and drives: nothing within the gap, the whole stiffness beyond, corners located."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

LARGE = fc.LargeRotation()


def sprung(damping: float = 0.0) -> fc.Structure:
    """A mass of 1 kg on a spring of 1e4 N/m to the ground, along x."""
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), 1e4, damping=damping)
    return fc.Structure(
        [mass, spring],
        [fc.Support(mass.node, "v w"), fc.Support(spring.start), fc.Pin(mass.node, spring.end)],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Tension("pull", spring)],
    )


def geared(damping: float = 0.0, linear: bool = False) -> fc.Structure:
    """A motor behind an elastic shaft and a load: a wheel, or a trolley on a rail."""
    load = fc.RigidBody("load", (0, 0, 0), 2.0, (2.0, 2.0, 2.0))
    shaft = {"stiffness": 300.0, "ratio": 5.0, "inertia": 0.1, "damping": damping}
    if linear:
        drive = fc.LinearDrive("drive", load.node, direction="x", radius=1.0, **shaft)
        support = fc.Support(load.node, "v w rx ry rz")
    else:
        drive = fc.RotaryDrive("drive", load.node, axis="z", **shaft)
        support = fc.Support(load.node, "u v w rx ry")
    return fc.Structure(
        [load],
        [support],
        [drive],
        [fc.MotorTorque("torque", "drive")],
        [fc.DriveAngle("angle", "drive"), fc.DriveSpeed("speed", "drive")],
    )


@pytest.mark.parametrize("strain", [-0.03, -0.0101, -0.0099, 0.0, 0.004, 0.0101, 0.02])
def test_a_spring_bears_what_goes_beyond_half_the_gap(strain):
    model = fc.assemble(sprung(damping=50.0), [LARGE, fc.Backlash({"spring": 0.02})], fc.CasadiVM())
    beyond = np.sign(strain) * max(abs(strain) - 0.01, 0.0)
    state, still = model.displace({"mass_0_u": strain}), np.zeros(1)
    assert model.balance(state, still, still) == pytest.approx([-1e4 * beyond], abs=1e-9)
    assert model.energy(state)[1] == pytest.approx(0.5e4 * beyond**2, abs=1e-12)
    assert model.measure(state)[1] == pytest.approx(1e4 * beyond, abs=1e-9)
    closing = np.array([0.01 * np.sign(strain)])
    drag = 50.0 * 0.01 if beyond else 0.0
    assert model.energy(state.with_(v=closing))[2] == pytest.approx(drag * 0.01, abs=1e-12)
    slope = model.slope(state, still, still, (1.0, 0.0, 0.0), np.zeros(1))
    assert slope[0, 0] == pytest.approx(-1e4 if beyond else 0.0)


def test_a_contact_does_not_pull_its_sides_together():
    """Opening so fast that the damper would pull harder than the spring presses."""
    model = fc.assemble(sprung(damping=500.0), [LARGE, fc.Backlash({"spring": 0.02})], fc.CasadiVM())
    state, still = model.displace({"mass_0_u": 0.011}), np.zeros(1)
    away = np.array([-1.0])
    assert model.balance(state, away, still) == pytest.approx([0.0])
    assert model.measure(state.with_(v=away))[1] == 0.0
    assert model.balance(state, 0.01 * away, still) == pytest.approx([-10.0 + 5.0])


@pytest.mark.parametrize("linear", [False, True])
def test_a_shaft_with_play_is_the_shaft_beyond_it(linear):
    """Its force is that of the plain shaft with the motor turned on by half the gap, both ways."""
    structure = geared(damping=0.3, linear=linear)
    plain, loose = (
        fc.assemble(structure, [LARGE, fc.Flexible(), *more], fc.CasadiVM())
        for more in ([], [fc.Backlash({"drive": 0.4})])
    )
    still, load = np.zeros(2), plain.coordinates[0]
    for twist in (-0.9, 0.1, 0.9):
        shifted = {load: 0.1, "drive_source": 0.5 - twist + np.clip(twist, -0.2, 0.2)}
        states = plain.displace(shifted), loose.displace({load: 0.1, "drive_source": 0.5 - twist})
        expected = plain.balance(states[0], still, still)
        assert loose.balance(states[1], still, still) == pytest.approx(expected, abs=1e-9)
        assert loose.energy(states[1])[1] == pytest.approx(plain.energy(states[0])[1], abs=1e-12)


def test_free_play_keeps_its_period_and_energy():
    """Free flight over the gap, half a swing on the spring, and back: 2π/ω + 2b/v₀ (B18), here five times."""
    model = fc.assemble(sprung(), [LARGE, fc.Backlash({"spring": 0.02})])
    period = 2.0 * np.pi / 100.0 + 2.0 * 0.02
    run = fc.simulate(model, until=5 * period, start=model.rest.with_(v=np.ones(1)), method=fc.AdaptiveAlpha(1.0))
    assert run.final.v == pytest.approx([1.0], abs=1e-3)
    assert run.report.energy_residual < 1e-8
    flanks = [e.t for e in run.events if e.rising]
    assert len(run.events) == 20
    assert flanks[0] == pytest.approx(0.01, abs=1e-9)


def test_energy_is_accounted_for_where_a_gap_that_damps_is_open_at_the_start():
    """Nothing is dissipated within the gap; at the flanks the power jumps."""
    model = fc.assemble(geared(0.3), [LARGE, fc.Flexible(), fc.Backlash({"drive": 0.4})])
    runs = [fc.simulate(model, until=0.8, inputs={"torque": 2.0}, method=fc.GeneralizedAlpha(h)) for h in (2e-3, 5e-4)]
    assert all(run.report.energy.dissipated > 0.05 for run in runs)
    assert runs[0].report.energy_residual < 1e-3
    assert runs[1].report.energy_residual < 0.1 * runs[0].report.energy_residual


@pytest.mark.slow
def test_free_play_a_hundred_times():
    """D14: period to 1e-4, energy to 1e-6, each of the four flanks of a period met once and no more."""
    model = fc.assemble(sprung(), [LARGE, fc.Backlash({"spring": 0.02})])
    period = 2.0 * np.pi / 100.0 + 2.0 * 0.02
    start = model.rest.with_(v=np.ones(1))
    run = fc.simulate(model, until=100 * period, start=start, method=fc.GeneralizedAlpha(2e-4, rho=1.0))
    flanks = np.array([e.t for e in run.events])
    assert len(flanks) == 400
    assert (flanks[-4] - flanks[0]) / 99 == pytest.approx(period, rel=1e-4)
    assert run.report.energy_residual < 1e-6


def test_compiled_and_plain_marches_meet_the_same_flanks():
    effects, method = [LARGE, fc.Flexible(), fc.Backlash({"drive": 0.4})], fc.AdaptiveAlpha()
    runs = [
        fc.simulate(fc.assemble(geared(0.3), effects, backend), until=0.8, inputs={"torque": 2.0}, method=method)
        for backend in (fc.Compiled(), fc.CasadiVM())
    ]
    times = [[e.t for e in run.events] for run in runs]
    assert len(times[0]) > 2
    assert times[0] == pytest.approx(times[1], abs=1e-5)
    assert runs[0].final.q == pytest.approx(runs[1].final.q, rel=1e-4)


def test_a_rope_goes_slack_and_taut_again_on_time():
    """Thrown up at v₀ from where it hangs: slack at sin ω t = g/(ω v₀), taut 2 v/g later."""
    rope = fc.Rope("rope", (0, 0, 2), (0, 0, 0), EA=2000.0)
    load = fc.PointMass("load", rope.end, 1.0)
    structure = fc.Structure(
        [rope, load], [fc.Support(rope.start), fc.Support(load.node, "u v"), fc.Pin(rope.end, load.node)]
    )
    g, omega, v0 = 9.81, np.sqrt(1000.0), 1.0
    model = fc.assemble(structure, [LARGE, fc.Flexible(), fc.Gravity()])
    hanging = fc.equilibrium(model).state
    run = fc.simulate(model, until=0.5, start=hanging.with_(v=np.array([v0])), method=fc.AdaptiveAlpha(1.0))
    slack = np.arcsin(g / (omega * v0)) / omega
    flight = 2.0 * v0 * np.cos(omega * slack) / g
    assert [(e.name, e.rising) for e in run.events[:2]] == [("rope", False), ("rope", True)]
    assert [e.t for e in run.events[:2]] == pytest.approx([slack, slack + flight], abs=1e-4)
    assert run.report.energy_residual < 1e-6


@pytest.mark.long
def test_long_fixed_steps_follow_play_before_slender_links():
    """The links' fast waves, which such steps do not resolve, are not thrown by the flanks."""
    arm = fc.refine(fc.cranes.flexible_arm(), 2)
    effects = [fc.Gravity(), fc.Flexible(), LARGE, fc.RayleighDamping(0.0, 1e-3), fc.Backlash({"shoulder_drive": 0.02})]
    model = fc.assemble(arm, effects)
    torque = {"shoulder_torque": lambda t: 0.3 * np.sin(12.0 * t)}
    ways = {"near": fc.Unchecked(fc.AdaptiveAlpha()), "long": fc.Unchecked(fc.GeneralizedAlpha(1e-3))}
    runs = {
        name: fc.simulate(
            model, fc.OpenLoop(torque), until=0.6, method=way, tolerance=fc.Tolerance(1e-6, 1e-9), every=0.01
        )
        for name, way in ways.items()
    }
    assert sum(e.name == "shoulder_drive" for e in runs["near"].events) > 4
    for output in ("tip_x", "tip_y"):
        near, long = (runs[name][output] for name in ("near", "long"))
        assert long == pytest.approx(near, abs=1e-3)


def test_a_motor_takes_up_the_play_before_the_load_moves():
    """Half the gap under constant torque takes √(b J/M); until then the load knows nothing."""
    model = fc.assemble(geared(), [LARGE, fc.Flexible(), fc.Backlash({"drive": 0.4})])
    run = fc.simulate(model, until=0.2, inputs={"torque": 2.0}, method=fc.AdaptiveAlpha(1.0))
    contact = run.events[0].t
    assert contact == pytest.approx(np.sqrt(0.4 * 0.1 / 2.0), rel=1e-6)
    before = run.t <= contact
    assert run["angle"][before] == pytest.approx(0.5 * 20.0 * run.t[before] ** 2, abs=1e-8)
    assert run.final.q[0] > 0.0
    assert run.report.energy_residual < 1e-6


def test_linear_models_are_those_of_where_the_machine_rests():
    """Pressed to a flank: the whole stiffness. Within the gap: none, as certified by the forces themselves."""
    model = fc.assemble(sprung(), [LARGE, fc.Backlash({"spring": 0.02})])
    pressed = fc.linearize(
        model, at=fc.equilibrium(model, inputs={"push": 50.0}, start=model.displace({"mass_0_u": 0.012}))
    )
    assert pressed.K[0, 0] == pytest.approx(1e4)
    assert pressed.certificate.taylor_slope > 1.9
    free = fc.linearize(model, at=model.rest)
    assert abs(free.K).max() == 0.0
    assert model.stiffness().nnz == 0 or abs(model.stiffness()).max() == 0.0


def test_no_gap_is_as_if_there_were_no_backlash():
    for structure, name in ((sprung(3.0), "spring"), (geared(0.3), "drive"), (geared(0.3, linear=True), "drive")):
        effects = [LARGE, fc.Flexible(), fc.RayleighDamping(0.1, 0.01)]
        plain, loose = (fc.assemble(structure, e) for e in (effects, [*effects, fc.Backlash({name: 0.0})]))
        rng = np.random.default_rng(2)
        v, a = rng.normal(size=(2, plain.n))
        state = plain.displace(0.1 * rng.normal(size=plain.n)).with_(v=v)
        assert loose.balance(state, v, a) == pytest.approx(plain.balance(state, v, a), rel=1e-12)
        assert loose.energy(state) == pytest.approx(plain.energy(state), rel=1e-12)
        assert loose.measure(state) == pytest.approx(plain.measure(state), rel=1e-12)


def test_play_costs_only_the_drives_that_have_it():
    effects = [LARGE, fc.Flexible()]
    tight, none, loose = (
        fc.assemble(geared(), [*effects, *more]) for more in ([], [fc.Backlash({})], [fc.Backlash({"drive": 0.1})])
    )
    kinds = [[f.kernels for f in m.forces.families] for m in (tight, none, loose)]
    assert all(a is b for a, b in zip(kinds[0], kinds[1], strict=True))
    assert [k.kind.name for k in kinds[2]] == ["body", "loose_rotary"]
    assert loose.n == tight.n


def test_the_rigid_twin_has_no_play_and_says_so():
    model = fc.assemble(geared(), [LARGE, fc.Flexible(), fc.Backlash({"drive": 0.4})])
    twin = fc.rigid(model)
    assert any("backlash of drive is left out" in note for note in twin.notes)
    run = fc.simulate(twin, until=0.5, inputs={"torque": 2.0})
    inertia = 0.1 + 2.0 / 25.0
    assert run["angle"] == pytest.approx(0.5 * 2.0 / inertia * run.t**2, abs=1e-9)
    assert not run.events


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Backlash({"drive": -0.1}), "Backlash: gap of 'drive' = -0.1"),
        (lambda: fc.Backlash(0.1), "expected a mapping"),
        (lambda: fc.assemble(geared(), [LARGE, fc.Backlash({"driv": 0.1})]), "no drive or spring 'driv'.*drive"),
        (lambda: fc.assemble(geared(), [fc.Backlash({"drive": 0.1})]), "Backlash is not linear"),
    ],
)
def test_impossible_play_is_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_the_tension_of_a_loose_spring_is_written_as_it_acts():
    """Rows of compiled marches and of the model itself."""
    model = fc.assemble(sprung(), [LARGE, fc.Backlash({"spring": 0.02})])
    run = fc.simulate(model, until=0.05, start=model.rest.with_(v=np.ones(1)), method=fc.GeneralizedAlpha(1e-3))
    strain = run["x"] - 1.0
    assert run["pull"] == pytest.approx(1e4 * np.sign(strain) * np.maximum(np.abs(strain) - 0.01, 0.0), abs=1e-8)
    assert run["pull"].max() > 50.0
