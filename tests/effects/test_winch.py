"""Winches: the rope's length follows the motor; hoisting pendulums, work, slack rope, the last of the rope."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.errors import StructureError

LARGE, G = fc.LargeRotation(), 9.81
EXPLICIT, TIGHT = fc.ExplicitRungeKutta(), fc.Tolerance(1e-8, 1e-8)
BALANCED = {"torque": -1000.0 * G * 0.5 / 20.0}


def hoist(length: float = 10.0, inertia: float = 30.0, EA: float = 1e8, plane: bool = True, **more: float) -> fc.Model:
    """A load of 1 t below a fixed drum, in the x-z plane or on a vertical line; elastic if EA is given."""
    top = fc.PointMass("top", (0, 0, 0), 0.0)
    load = fc.PointMass("load", (0, 0, -length), 1000.0)
    winch = fc.Winch("winch", load.node, top.node, EA=EA, radius=0.5, ratio=20.0, inertia=inertia, **more)
    held = fc.Support(load.node, "v" if plane else "u v")
    outputs = [
        fc.Position("x", load.node, "x"),
        fc.Position("z", load.node, "z"),
        fc.DriveAngle("angle", "winch"),
        fc.SwayAngle("sway", top.node, load.node, "x"),
        fc.Tension("pull", winch),
    ]
    return fc.Structure(
        [top, load], [fc.Support(top.node), held], [winch], [fc.MotorTorque("torque", "winch")], outputs
    )


def rigid(structure: fc.Structure) -> fc.Model:
    return fc.assemble(structure, [LARGE, fc.Gravity()])


def elastic(structure: fc.Structure, *more: fc.Effect) -> fc.Model:
    return fc.assemble(structure, [LARGE, fc.Gravity(), fc.RopeStretch(), *more])


def swung(model: fc.Model, angle: float, length: float) -> fc.State:
    shift = {"load_0_u": length * np.sin(angle), "load_0_w": length * (1.0 - np.cos(angle))}
    return model.displace(shift)


def pendulum(length: float, speed: float, angle: float, until: float) -> float:
    """Angle of a pendulum of length l = L + v t."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        at = length + speed * t
        return [y[1], -(G * np.sin(y[0]) + 2.0 * speed * y[1]) / at]

    return float(solve_ivp(slope, (0.0, until), [angle, 0.0], method="DOP853", rtol=1e-12, atol=1e-14).y[0, -1])


@pytest.mark.parametrize(("length", "speed", "until"), [(10.0, -0.5, 16.0), (4.0, 0.5, 12.0), (10.0, -1.0, 9.5)])
def test_a_pendulum_that_is_hoisted(length, speed, until):
    """B13: a motor too heavy to notice, its load balanced, turns at constant speed; tabled values for g = 9.81."""
    model = rigid(hoist(length, inertia=1e6))
    start = swung(model, 0.05, length)
    direction = np.array([np.sin(0.05), -np.cos(0.05)])
    run = fc.simulate(
        model, until=until, start=start.with_(v=speed * direction), inputs=BALANCED, method=EXPLICIT, tolerance=TIGHT
    )
    tabled = {(10.0, -0.5): -0.16700024, (4.0, 0.5): -0.00881964, (10.0, -1.0): -0.45266701}[length, speed]
    assert pendulum(length, speed, 0.05, until) == pytest.approx(tabled, abs=1e-7)
    assert run["sway"][-1] == pytest.approx(tabled, abs=1e-5)


def test_the_motor_winds_the_load_up_and_pays_it_out():
    """Against J and m reflected: (J + m ρ²) θ̈ = M + m g ρ with ρ = r/R, θ paying out."""
    rho, mass, J = 0.5 / 20.0, 1000.0, 30.0
    model = rigid(hoist(plane=False))
    run = fc.simulate(model, until=1.0, inputs={"torque": -400.0}, method=fc.GeneralizedAlpha(1e-2, rho=1.0))
    rate = (-400.0 + mass * G * rho) / (J + mass * rho**2)
    assert run["angle"] == pytest.approx(0.5 * rate * run.t**2, abs=1e-9)
    assert run["z"] == pytest.approx(-10.0 - 0.5 * rho * rate * run.t**2, abs=1e-9)


@pytest.mark.parametrize("stretching", [False, True])
def test_hoist_work_is_energy_gained(stretching):
    """D13: to 1e-6 of what passes, swinging and slack ropes included."""
    structure = hoist(EA=1e6, damping=200.0 * stretching)
    model = elastic(structure) if stretching else rigid(structure)
    start = swung(model, 0.3, 10.0)
    run = fc.simulate(model, until=4.0, start=start, inputs={"torque": -400.0}, method=EXPLICIT, tolerance=TIGHT)
    assert run["z"][-1] > -9.1
    assert run.report.energy_residual < 1e-6


def test_forces_are_the_slope_of_the_energy():
    model = elastic(hoist(EA=2e4))
    rng, still = np.random.default_rng(3), np.zeros(3)
    for _ in range(5):
        q = np.array([rng.normal(), 0.5 * rng.normal() - 1.0, 40.0 * rng.normal()])
        force = model.balance(model.displace(q), still, still)
        slope = []
        for e in np.eye(3) * 1e-5:
            slope.append((model.energy(model.displace(q + e))[1] - model.energy(model.displace(q - e))[1]) / 2e-5)
        assert force == pytest.approx(-np.array(slope), rel=1e-6, abs=1e-3)


def test_the_linear_model_is_the_slope_of_the_forces():
    """Hanging on the held motor: certified by the forces, rope mode and pendulum as they should be."""
    model = elastic(hoist(EA=1e6))
    at = fc.equilibrium(model, hold={"winch_source": 0.0})
    linear = fc.linearize(model, at=at)
    assert linear.certificate.taylor_slope > 1.9
    stretch = 1000.0 * G / 1e6 * 10.0
    place = [linear.coordinates.index(name) for name in ("load_0_u", "load_0_w")]
    K, M = (np.asarray(A.todense() if hasattr(A, "todense") else A)[np.ix_(place, place)] for A in (linear.K, linear.M))
    assert np.diag(K) / np.diag(M) == pytest.approx([G / (10.0 + stretch), 1e5 / 1000.0], rel=1e-6)


def test_stiff_ropes_are_rigid_in_the_limit():
    """First order in 1/EA."""
    torque = {"torque": BALANCED["torque"] - 10.0}
    method = fc.AdaptiveAlpha(0.8, 1e-3)
    expected = fc.simulate(rigid(hoist(plane=False)), until=1.0, inputs=torque, method=method)["z"][-1]
    errors = []
    for EA in (1e7, 1e8):
        model = elastic(hoist(EA=EA, plane=False, damping=0.02 * np.sqrt(EA * 1e3)))
        start = model.displace({"load_0_w": -1000.0 * G / EA * 10.0})
        found = fc.simulate(model, until=1.0, start=start, inputs=torque, method=method)["z"][-1]
        errors.append(abs(found - expected))
    assert errors[1] < 0.2 * errors[0]
    assert errors[1] < 2e-3


def test_a_slack_rope_does_not_push():
    """The motor pays out faster than the load falls: free fall, and the corner is told."""
    model = elastic(hoist(EA=1e6, inertia=0.1, plane=False))
    start = model.displace({"load_0_w": -1000.0 * G / 1e6 * 10.0})
    run = fc.simulate(model, until=0.5, start=start, inputs={"torque": 500.0}, method=fc.AdaptiveAlpha(1.0, 1e-4))
    slack = next(e for e in run.events if not e.rising)
    assert slack.name == "winch"
    late = run.t > slack.t
    assert np.polyfit(run.t[late], run["z"][late], 2)[0] == pytest.approx(-0.5 * G, rel=1e-6)


@pytest.mark.parametrize("stretching", [False, True])
def test_the_last_of_the_rope_ends_the_run(stretching):
    """D13: up to the drum; the run stops there, keeps what it has, and says why."""
    structure = hoist(length=2.0, EA=1e6, plane=False, shortest=0.01)
    model = elastic(structure) if stretching else rigid(structure)
    run = fc.simulate(model, until=60.0, inputs={"torque": -300.0}, method=fc.AdaptiveAlpha(0.8, 1e-3))
    assert run.status is fc.Status.STOPPED
    assert "the rope of winch is down to its shortest, 0.01 m" in run.report.message
    left, out = -run["z"][-1], 2.0 + run["angle"][-1] / 40.0
    assert left == pytest.approx(0.01, abs=1e-7)
    assert out >= left - 1e-6
    assert np.isfinite(run["z"]).all()


def test_compiled_is_plain():
    runs = [
        fc.simulate(
            fc.assemble(hoist(EA=1e6), [LARGE, fc.Gravity(), fc.RopeStretch(), fc.RayleighDamping(0.1, 1e-3)], backend),
            until=1.0,
            inputs={"torque": -300.0},
            method=fc.GeneralizedAlpha(5e-3),
        )
        for backend in (fc.Compiled(), fc.CasadiVM())
    ]
    assert runs[0].final.q == pytest.approx(runs[1].final.q, rel=1e-6)


def test_the_tension_is_what_carries_the_load():
    """Rows of compiled marches, the model's own outputs, and the linear model's slope of them."""
    model = elastic(hoist(EA=1e6, plane=False, damping=100.0))
    run = fc.simulate(model, until=0.5, inputs={"torque": -300.0}, method=fc.GeneralizedAlpha(1e-3, rho=1.0))
    out = 10.0 + run["angle"] / 40.0
    stretch = -run["z"] - out
    damped = 100.0 * np.gradient(stretch, run.t)
    assert run["pull"][5:-5] == pytest.approx((1e6 * stretch / out + damped)[5:-5], abs=5.0)
    assert model.measure(run.final)[-1] == pytest.approx(run["pull"][-1], rel=1e-9)
    assert "pull" not in rigid(hoist()).outputs
    linear = fc.linearize(model, at=fc.equilibrium(model, hold={"winch_source": 0.0}))
    assert linear.certificate.taylor_slope > 1.9


def test_a_crane_on_a_moving_trolley():
    """A trolley that a motor drives, its winch hauling in: momentum along the rail is what was pushed."""
    trolley = fc.PointMass("trolley", (0, 0, 0), 500.0)
    load = fc.PointMass("load", (0, 0, -5), 1000.0)
    winch = fc.Winch("hoist", load.node, trolley.node, EA=1e8, radius=0.5, ratio=20.0, inertia=1.0)
    structure = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [winch],
        [fc.Force("push", trolley.node, "x"), fc.MotorTorque("haul", "hoist")],
        [fc.Velocity("vt", trolley.node, "x"), fc.Velocity("vl", load.node, "x")],
    )
    for model in (rigid(structure), elastic(structure)):
        run = fc.simulate(model, until=1.0, inputs={"push": 300.0, "haul": -260.0}, method=fc.AdaptiveAlpha(1.0, 1e-3))
        assert 500.0 * run["vt"] + 1000.0 * run["vl"] == pytest.approx(300.0 * run.t, abs=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hoist(EA=0.0), "EA = 0"),
        (lambda: hoist(shortest=11.0), "shortest = 11 m, but only 10 m are out"),
        (lambda: hoist(length=1e-20), "coincide"),
        (lambda: elastic(hoist(), fc.Backlash({"winch": 0.1})), "no drive or spring 'winch'"),
    ],
)
def test_impossible_winches_are_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()


def test_how_stiff_its_rope_is_does_not_count_in_the_search():
    """A load drawn aside swings under the winch."""
    iterations = []
    for EA in (1e7, 1e9, 1e13):
        top, load = fc.PointMass("top", (0, 0, 0), 0.0), fc.PointMass("load", (5, 0, -10), 1000.0)
        winch = fc.Winch("winch", load.node, top.node, EA=EA, radius=0.5, ratio=20.0, inertia=1.0)
        structure = fc.Structure([top, load], [fc.Support(top.node), fc.Support(load.node, "v")], [winch])
        model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Flexible()], fc.CasadiVM())
        rest = fc.equilibrium(model, hold={"winch_source": 0.0})
        stretched = np.hypot(5.0, 10.0) * (1.0 + 1000.0 * 9.81 / EA)
        assert rest.state.x[1] == pytest.approx((0.0, 0.0, -stretched), abs=1e-9)
        iterations.append(rest.iterations)
    assert max(iterations) <= min(iterations) + 2


def guided(along: tuple[float, float, float], welded: bool) -> fc.Structure:
    """A car on the guide of a mast, drawn by a rope from its head, askew to the guide."""
    mast = fc.RigidBody("mast", (0, 0, 0), 1.0, (1, 1, 1), {"guide": (0, 0, 0), "head": (1.0, 0, 2.0)})
    boom = fc.RigidBody("boom", (1.0, 0, 2.0), 1.0, (1, 1, 1), {"sheave": (1.0, 0, 2.0)})
    car = fc.RigidBody("car", (0, 0, 0), 10.0, (1, 1, 1))
    sheave = boom.point("sheave") if welded else mast.point("head")
    winch = fc.Winch("winch", car.node, sheave, EA=1e5, radius=0.1, inertia=0.05)
    joints = [fc.Support(mast.node), fc.Slide(mast.point("guide"), car.node, along)]
    joints += [fc.Weld(mast.point("head"), boom.node)] if welded else []
    outputs = [fc.Position("place", car.node, along), fc.DriveAngle("angle", winch)]
    parts = [mast, boom, car] if welded else [mast, car]
    return fc.Structure(parts, joints, [winch], [fc.MotorTorque("torque", winch)], outputs)


def drawn_along(along: tuple[float, float, float], stretches: bool, torque: float, until: float) -> float:
    """m s̈ = −m g a_z − T ∂d/∂s; J θ̈ = M + r (T + T²/2EA), or J θ̈ = M + r T where r θ = d − d₀."""
    a, head = np.array(along), np.array([1.0, 0.0, 2.0])
    EA, r, J, m = 1e5, 0.1, 0.05, 10.0
    first = np.linalg.norm(head)

    def slope(t: float, y: np.ndarray) -> list[float]:
        s, v, angle, spin = y
        arm = a * s - head
        d = np.linalg.norm(arm)
        onto = arm @ a / d
        if stretches:
            pull = max(EA * (d / (first + r * angle) - 1.0), 0.0)
            return [v, -G * a[2] - pull * onto / m, spin, (torque + r * (pull + pull**2 / (2 * EA))) / J]
        bend = (1.0 - onto**2) / d  # d² d / ds²
        change = (-m * G * a[2] + (torque / r - J / r**2 * bend * v**2) * onto) / (m + J / r**2 * onto**2)
        return [v, change, spin, (onto * change + bend * v**2) / r]

    return float(solve_ivp(slope, (0.0, until), np.zeros(4), method="DOP853", rtol=1e-11, atol=1e-13).y[0, -1])


@pytest.mark.parametrize("welded", [False, True])
@pytest.mark.parametrize("along", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.6, 0.8)])
@pytest.mark.parametrize("stretches", [False, True])
def test_a_rope_draws_a_car_askew_to_its_guide(along, welded, stretches):
    machine = guided(along, welded)
    model = elastic(machine) if stretches else rigid(machine)
    run = fc.simulate(model, until=0.5, inputs={"torque": -12.0}, method=EXPLICIT, tolerance=TIGHT)
    assert run["place"][-1] == pytest.approx(drawn_along(along, stretches, -12.0, 0.5), rel=1e-5)


def test_a_rope_between_what_cannot_move_is_refused():
    post, hook = (fc.RigidBody(name, (0, 0, z), 1.0, (1, 1, 1)) for name, z in (("post", 2.0), ("hook", 0.0)))
    winch = fc.Winch("winch", hook.node, post.node, EA=1e5, radius=0.1)
    with pytest.raises(StructureError, match="its joint holds the displacement"):
        fc.Structure([post, hook], [fc.Support(post.node), fc.Support(hook.node, "w rx ry")], [winch])
