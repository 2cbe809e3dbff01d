"""Errors of steps that add up: what a run tells of them, against closed forms, exponentials and much smaller steps."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import MinimumJerk, pd
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.kernels.kernel import Backend

OMEGA = 10.0
ADDED = "may have added up to"


def swing(damping: float = 0.0, **how) -> fc.Run:
    """A mass of 1 kg on a spring, let go 0.3 m from where it rests."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=OMEGA**2, damping=2.0 * damping * OMEGA)
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([spring, mass], joints, outputs=[fc.Position("x", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation()])
    return fc.simulate(model, start=model.displace([0.3]), **{"method": fc.Unchecked(fc.AdaptiveAlpha()), **how})


def off(run: fc.Run) -> float:
    """The largest error over how far it moves, twice the amplitude."""
    return float(np.abs(run["x"] - 1.0 - 0.3 * np.cos(OMEGA * run.t)).max()) / 0.6


def told(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if ADDED in note]


def chain(count: int, stiffness: float, seed: int = 0, backend: Backend | None = None) -> fc.Model:
    """Masses on springs that hang from a point, each a little beside the one above."""
    rng = np.random.default_rng(seed)
    places = np.vstack([np.zeros(3), np.cumsum([(x, 0.0, -1.0) for x in rng.uniform(-0.1, 0.1, count)], axis=0)])
    springs = [
        fc.Spring(f"s{i}", tuple(a), tuple(b), stiffness=stiffness * rng.uniform(0.5, 2.0))
        for i, (a, b) in enumerate(pairwise(places))
    ]
    masses = [fc.PointMass(f"m{i}", spring.end, rng.uniform(0.5, 2.0)) for i, spring in enumerate(springs)]
    joints = [fc.Support(springs[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(springs))]
    joints += [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    structure = fc.planar(fc.Structure([*springs, *masses], joints), "y")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()], backend)


def arm(backend: Backend | None = None) -> fc.Model:
    tube = fc.Section.tube(fc.STEEL, radius=0.01, thickness=0.001)
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), tube, elements=2)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=2.0, ratio=100, inertia=4e-3)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.Flexible()], backend)


def law() -> fc.Tracking:
    move = MinimumJerk(distance=50.0, duration=0.5)
    gains = pd(kp=1.0, kd=0.2, measured="angle", rate="speed", command="torque")
    return fc.Tracking(gains, {"angle": move, "speed": move.derivative})


@pytest.mark.parametrize(
    ("method", "least", "most"),
    [
        (fc.AdaptiveAlpha(), 0.5, 2.0),
        (fc.AdaptiveAlpha(rho=1.0), 0.5, 2.0),
        (fc.Richardson(fc.AdaptiveAlpha()), 0.5, 5.0),
        (fc.ExplicitRungeKutta(), 0.5, 5.0),
    ],
    ids=["0.8", "1", "Richardson", "explicit"],
)
def test_what_is_told_is_about_what_a_swing_is_off_by(method, least, most):
    for until in (3.0, 10.0):
        run = swing(method=method, until=until)
        assert least < run.report.drift / off(run) < most


@pytest.mark.parametrize("until", [3.0, 6.0, 48.0])
def test_a_note_where_it_matters_and_none_where_it_does_not(until):
    run = swing(until=until)
    assert bool(told(run)) == (off(run) > 0.03) == (until > 3.0)
    assert all("of the motion of spring_1_u: give Tolerance(" in note for note in told(run))
    assert "errors of steps add up to" in str(run.report)


def test_half_the_tolerance_leaves_two_thirds():
    """Errors of h³ a step: h² of a time."""
    found = [swing(until=20.0, tolerance=fc.Tolerance(1e-4 * s, 1e-7 * s)).report.drift for s in 0.5 ** np.arange(5)]
    ratios = np.array([b / a for a, b in pairwise(found)])
    assert np.abs(ratios - 0.5 ** (2.0 / 3.0)).max() < 0.05


def test_the_tolerance_that_is_told_leaves_little():
    run = swing(until=20.0)
    [note] = told(run)
    relative, absolute = note.partition("Tolerance(")[2].partition(")")[0].split(", ")
    finer = swing(until=20.0, tolerance=fc.Tolerance(float(relative), float(absolute)))
    assert not told(finer)
    assert off(finer) < 0.02


def test_what_has_come_to_rest_adds_nothing():
    short, long = (swing(0.05, until=until).report.drift for until in (8.0, 40.0))
    assert 0.0 < long < 1.1 * short < 0.03


FIXED = {
    "alpha": (lambda h: fc.Unchecked(fc.GeneralizedAlpha(h)), 0.8, 1.6),
    "undamped": (lambda h: fc.Unchecked(fc.GeneralizedAlpha(h, rho=1.0)), 0.9, 1.1),
    "midpoint": (lambda h: fc.Unchecked(fc.ConservingMidpoint(h)), 0.9, 1.1),
    "Richardson": (lambda h: fc.Unchecked(fc.Richardson(fc.GeneralizedAlpha(3.0 * h))), 0.5, 5.0),
}


@pytest.mark.parametrize("name", FIXED)
def test_steps_of_one_length_tell_what_a_swing_is_off_by(name):
    make, least, most = FIXED[name]
    for step in (2e-3, 5e-3):
        run = swing(method=make(step), until=20.0)
        assert least < run.report.drift / off(run) < most


@pytest.mark.parametrize("name", FIXED)
def test_the_step_that_is_told_leaves_little(name):
    make, _, _ = FIXED[name]
    run = swing(method=make(8e-3), until=20.0)
    step = float(told(run)[0].partition("take steps of ")[2].partition(" s")[0])
    assert off(run) > 0.03
    finer = swing(method=make(step if name != "Richardson" else step / 3.0), until=20.0)
    assert not told(finer)
    assert off(finer) < 0.02


def test_a_linear_model_that_is_integrated_exactly_adds_up_nothing():
    linear = fc.linearize(chain(3, 1e4))
    start = LinearPlant(linear).rest
    run = fc.simulate(linear, until=20.0, start=replace(start, q=np.full(start.q.size, 0.01)))
    assert run.report.drift == 0.0
    assert "add up" not in str(run.report)


@pytest.mark.parametrize("amplitude", [0.5, 1.5, 2.0, 2.5, 2.9])
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(0.02), fc.ExplicitRungeKutta()], ids=str)
def test_a_pendulum_whose_energy_is_wrong_swings_in_another_time(amplitude, method):
    """Its period grows with its amplitude: θ̈ = −g m r sin θ / I."""
    model, pull = pendulum((9.81, 0, 0))
    times = np.linspace(0.0, 20.0, 2001)
    exact = {"method": "DOP853", "t_eval": times, "rtol": 1e-11, "atol": 1e-11}
    true = solve_ivp(lambda t, y: [y[1], -pull * np.sin(y[0])], (0.0, 20.0), [amplitude, 0.0], **exact).y[0]
    run = fc.simulate(model, until=20.0, start=model.displace([amplitude]), method=method, every=0.01)
    error = float(np.abs(run["angle"] - true).max()) / min(1.0, 2.0 * amplitude)
    assert 0.5 * min(error, 1.0) < run.report.drift
    assert run.report.drift < max(10.0 * error, 2e-3)


def to_and_fro(t: np.ndarray, omega: float) -> np.ndarray:
    """A mass at 1 m/s between springs 0.02 m apart: where it is, from the middle."""
    half = np.pi / omega + 0.02
    t = (t + 0.01) % (2.0 * half)
    turn, s = np.where(t < half, 1.0, -1.0), t % half
    return turn * np.where(s < 0.02, s - 0.01, 0.01 + np.sin(omega * (s - 0.02)) / omega)


@pytest.mark.parametrize("name", ["alpha", "undamped", "midpoint"])
@pytest.mark.parametrize(("omega", "step"), [(50.0, 1e-3), (50.0, 0.01), (100.0, 0.01), (350.0, 0.01), (1e3, 1e-3)])
def test_steps_too_long_for_a_contact_tell_that_it_comes_too_late(name, omega, step):
    """What comes again every so many steps is seen neither always nor never."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=omega**2)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([mass, spring], joints, outputs=[fc.Position("x", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"spring": 0.02})])
    run = fc.simulate(model, start=model.rest.with_(v=np.ones(1)), until=1.0, method=FIXED[name][0](step))
    assert run.status is fc.Status.FINISHED
    true = to_and_fro(run.t, omega)
    error = float(np.abs(run["x"] - true).max() / (true.max() - true.min()))
    assert run.report.drift > 0.4 * error
    assert bool(told(run)) == (error > 0.02)


@pytest.mark.parametrize("seed", range(4))
def test_stiff_linear_chains_against_the_exponential(seed):
    """Told to a factor of two: nothing grows there, so that what is off is errors that have added up."""
    linear = fc.linearize(chain(4, 1e4, seed))
    start = LinearPlant(linear).rest
    start = replace(start, q=0.02 * np.random.default_rng(seed).normal(size=start.q.size))
    run = fc.simulate(linear, until=1.0, start=start, method=fc.AdaptiveAlpha())
    exact = fc.simulate(linear, until=1.0, start=start)
    q, true = (np.array([r.at(t).state.q for t in np.linspace(0.0, 1.0, 201)]) for r in (run, exact))
    assert 0.5 < run.report.drift * np.abs(true - true[0]).max() / np.abs(q - true).max() < 2.0


def runs(backend: Backend | None) -> dict[str, fc.Run]:
    hanging, moving, sampled = chain(3, 1e4, backend=backend), arm(backend), fc.Sampled(law(), 0.01)
    return {
        "chain": fc.simulate(hanging, until=1.0),
        "Richardson": fc.simulate(hanging, until=1.0, method=fc.Richardson(fc.AdaptiveAlpha())),
        "sampled": fc.simulate(moving, sampled, until=0.2),
        "continuous": fc.simulate(moving, law(), until=0.2),
        "one length": fc.simulate(hanging, until=1.0, method=fc.GeneralizedAlpha(2e-3)),
        "one length, undamped": fc.simulate(hanging, until=1.0, method=fc.GeneralizedAlpha(2e-3, rho=1.0)),
        "one length, sampled": fc.simulate(moving, sampled, until=0.2, method=fc.GeneralizedAlpha(1e-3)),
    }


def test_compiled_steps_tell_what_plain_ones_do():
    ours, theirs = runs(None), runs(fc.CasadiVM())
    for name, run in ours.items():
        assert run.report.steps == theirs[name].report.steps
        assert run.report.drifted == theirs[name].report.drifted
        assert run.report.drift == pytest.approx(theirs[name].report.drift, rel=1e-5, abs=1e-6)
        assert run.report.drift > 0.0


def pendulum(gravity: tuple[float, float, float]) -> tuple[fc.Model, float]:
    """A body of 2 kg, 0.3 m from its hinge, and what gravity does to its angle [1/s²]."""
    body = fc.RigidBody("body", (0.3, 0, 0), 2.0, (0.01, 0.02, 0.03), {"hinge": (0, 0, 0)})
    hinge = body.point("hinge")
    outputs = [fc.Rotation("angle", hinge, "z")]
    structure = fc.Structure([body], [fc.Support(hinge, "u v w rx ry")], outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(gravity)]), 2.0 * 9.81 * 0.3 / (0.03 + 2.0 * 0.3**2)


@pytest.mark.parametrize(("speed", "until"), [(12.0, 20.0), (30.0, 15.0)])
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.ExplicitRungeKutta()], ids=str)
def test_what_goes_round_runs_off_with_its_speed(speed, until, method):
    """A body on a hinge that goes round under gravity: I φ̈ = −m g r cos φ."""
    model, pull = pendulum((0, -9.81, 0))
    found = solve_ivp(
        lambda t, y: [y[1], -pull * np.cos(y[0])], (0.0, until), [0.0, speed], "DOP853", rtol=1e-11, atol=1e-11
    )
    run = fc.simulate(model, start=model.rest.with_(v=np.array([speed])), until=until, method=fc.Unchecked(method))
    error = abs(run["angle"][-1] - found.y[0, -1])
    assert run.report.drift > 0.7 * error > 1e-4
    assert run.report.drift < 10.0 * error or method.order > 2
    assert bool(told(run)) == (run.report.drift > 0.03)


@pytest.mark.parametrize(
    "method",
    [
        fc.AdaptiveAlpha(),
        fc.Richardson(fc.AdaptiveAlpha()),
        fc.ExplicitRungeKutta(),
        fc.GeneralizedAlpha(2e-3),
        fc.ConservingMidpoint(5e-3),
        fc.Richardson(fc.GeneralizedAlpha(2e-3)),
    ],
)
def test_resumed_runs_tell_the_same_to_the_bit(method, tmp_path):
    model, method = chain(3, 1e3), fc.Unchecked(method)
    whole = fc.simulate(model, until=4.0, method=method)
    half = fc.simulate(model, until=2.0, method=method)
    half.checkpoint.save(tmp_path / "half")
    resumed = fc.simulate(model, until=4.0, method=method, start=fc.load_checkpoint(tmp_path / "half"))
    assert resumed.report.drift == whole.report.drift > 0.0
    assert replace(resumed.report, wall_s=0.0) == replace(whole.report, wall_s=0.0)
