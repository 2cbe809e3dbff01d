"""Functions of time that tell no breaks: pulses, gusts, jumps and laws of one's own, against exact integrals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import flexctrl as fc
from flexctrl.design import OpenLoop, Step, Tracking, pd

METHODS = [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(0.01), fc.ExplicitRungeKutta(), fc.Richardson(fc.AdaptiveAlpha())]
NAMES = [type(method).__name__ for method in METHODS]


def cart(mass: float = 1.0) -> fc.Model:
    point = fc.PointMass("cart", (0, 0, 0), mass)
    structure = fc.Structure(
        [point],
        [fc.Support(point.node, "v w")],
        inputs=[fc.Force("force", point.node, "x")],
        outputs=[fc.Position("x", point.node, "x"), fc.Velocity("v", point.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation()])


@pytest.mark.parametrize("method", [METHODS[0], fc.GeneralizedAlpha(0.03), *METHODS[2:]], ids=NAMES)
def test_a_gust_after_a_long_calm_is_felt(method):
    rope = fc.Rope("rope", (0, 0, 10), (0, 0, 0), EA=1e7)
    load = fc.PointMass("load", rope.end, 2000.0)
    structure = fc.Structure(
        [rope, load],
        [fc.Support(rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.WindSpeed("gust", "x")],
        outputs=[fc.Position("x", load.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Wind({"load": 12.0})])

    def gust(t: float) -> float:
        return 20.0 * np.sin(np.pi * (t - 30.0) / 2.0) ** 2 if 30.0 < t < 32.0 else 0.0

    def swing(t: float, y: np.ndarray) -> list[float]:
        off, rate = gust(t) - y[1] * np.cos(y[0] / 10.0), y[1]
        return [rate, -9.80665 * np.sin(y[0] / 10.0) + 0.5 * 1.25 * 12.0 * abs(off) * off / 2000.0]

    true = solve_ivp(swing, (0.0, 60.0), [0.0, 0.0], rtol=1e-10, atol=1e-12, max_step=0.02)
    run = fc.simulate(model, OpenLoop({"gust": gust}), until=60.0, every=0.1, method=method)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x"]).max() == pytest.approx(np.abs(10.0 * np.sin(true.y[0] / 10.0)).max(), rel=0.01)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize(("start", "width"), [(13.37, 0.02), (0.5, 0.02), (7.0, 1.3)])
def test_an_impulse_is_as_large_as_it_is(start, width, method):
    def pulse(t: float) -> float:
        return 3.0 if start <= t < start + width else 0.0

    run = fc.simulate(cart(), OpenLoop({"force": pulse}), until=20.0, method=method)
    assert run["v"][-1] == pytest.approx(3.0 * width, rel=2e-3)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize("frequency", [1.0, 5.0])
def test_a_square_wave_jumps_where_it_does(frequency, method):
    law = OpenLoop({"force": lambda t: 5.0 * np.sign(np.sin(2.0 * np.pi * frequency * t))})
    run = fc.simulate(cart(), law, until=20.0, method=method)
    assert run["x"][-1] == pytest.approx(25.0 / frequency, abs=1e-6)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_jumps_of_all_sizes_are_met(method):
    """A force that is another one every 10 ms, against products of exponentials."""
    levels, hold = 8.0 * np.random.default_rng(2).normal(size=400), 0.01
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=40.0, damping=0.3)
    mass = fc.PointMass("mass", spring.end, 2.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("force", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    law = OpenLoop({"force": lambda t: levels[int(np.floor(t / hold + 1e-9))]})
    step = expm(hold * np.array([[0.0, 1.0, 0.0], [-20.0, -0.15, 0.5], [0.0, 0.0, 0.0]]))
    x, places = np.zeros(3), [0.0]
    for level in levels[:100]:
        x[2] = level
        x = step @ x
        places.append(x[0])
    run = fc.simulate(model, law, until=1.0, every=hold, method=method)
    assert np.abs(run["x"][: len(places)] - 1.0 - places).max() < 0.02 * np.abs(places).max()


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_smooth_force_is_followed(method):
    law = OpenLoop({"force": lambda t: np.sin(3.0 * t) + 0.1 * np.exp(-(((t - 11.0) / 0.02) ** 2))})
    run = fc.simulate(cart(), law, until=20.0, method=method)
    true = (1.0 - np.cos(60.0)) / 3.0 + 0.1 * 0.02 * np.sqrt(np.pi)
    assert run["v"][-1] == pytest.approx(true, abs=4e-4)


class Own:
    """A law of one's own, with an integral and a reference that jumps as time goes by."""

    inputs, outputs, sample_time = ("x", "v"), ("force",), 0.0

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4.0 * (self.reference(t) - y[0]) - 3.0 * y[1] + 2.0 * x[0]])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([self.reference(t) - y[0]])

    def reference(self, t: float) -> float:
        return 1.0 if 6.0 < t < 6.8 else 0.0


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize("own", [True, False])
def test_references_in_a_loop_are_followed(own, method):
    if own:
        law, gains = Own(), np.array([[0.0, 1.0, 0.0], [-4.0, -3.0, 2.0], [-1.0, 0.0, 0.0]])
        push = np.array([0.0, 4.0, 1.0])
    else:
        regulator = pd(kp=4.0, kd=3.0, measured="x", rate="v", command="force")
        law = Tracking(regulator, {"x": Own().reference})
        gains, push = np.array([[0.0, 1.0, 0.0], [-4.0, -3.0, 0.0], [0.0, 0.0, 0.0]]), np.array([0.0, 4.0, 0.0])
    true, y = [], np.zeros(3)
    for span, r in (((0.0, 6.0), 0.0), ((6.0, 6.8), 1.0), ((6.8, 10.0), 0.0)):
        found = solve_ivp(lambda t, y, r=r: gains @ y + push * r, span, y, rtol=1e-10, atol=1e-12, dense_output=True)
        true.append((span, found.sol))
        y = found.y[:, -1]
    run = fc.simulate(cart(), law, until=10.0, method=method)
    expected = [next(s(t)[0] for (a, b), s in true if a <= t <= b + 1e-9) for t in run.t]
    assert np.abs(run["x"] - expected).max() < 2e-3
    assert np.abs(expected).max() > 0.3


@pytest.mark.parametrize("method", METHODS[:3], ids=NAMES[:3])
@pytest.mark.parametrize("cut", [0.5, 5.9999, 6.004, 6.4, 7.1])
def test_they_go_on_with_the_same_bits(cut, method):
    model, law = cart(), Own()
    once = fc.simulate(model, law, until=8.0, method=method)
    half = fc.simulate(model, law, until=cut, method=method)
    run = fc.simulate(model, law, until=8.0, start=half.checkpoint, method=method)
    assert np.array_equal(run.final.q, once.final.q)
    assert np.array_equal(run.final.v, once.final.v)
    assert run.report.steps == once.report.steps


def test_cut_where_a_law_jumps_they_go_on_but_for_round_off():
    once = fc.simulate(cart(), Own(), until=8.0, method=fc.GeneralizedAlpha(0.01))
    half = fc.simulate(cart(), Own(), until=6.0, method=fc.GeneralizedAlpha(0.01))
    run = fc.simulate(cart(), Own(), until=8.0, start=half.checkpoint, method=fc.GeneralizedAlpha(0.01))
    assert run.final.q == pytest.approx(once.final.q, rel=1e-12)


def test_linear_models_feel_them():
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=40.0)
    mass = fc.PointMass("mass", spring.end, 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("force", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x")],
    )
    linear = fc.linearize(fc.assemble(structure, [fc.LargeRotation()]))
    run = fc.simulate(
        linear, OpenLoop({"force": lambda t: 100.0 if 2.003 <= t < 2.004 else 0.0}), until=4.0, every=0.05
    )
    w = np.sqrt(40.0)
    assert np.abs(run["x"]).max() == pytest.approx(0.1 / w, rel=0.025)


@pytest.mark.parametrize("backend", [None, fc.CasadiVM()], ids=["compiled", "vm"])
@pytest.mark.parametrize("at", [1e-3, 8e-3, 0.01, 0.0102, 0.05])
def test_no_force_acts_before_its_jump(at, backend):
    """Also in the first 10 ms, where what a trajectory takes for its break is more than a share of the time."""
    point = fc.PointMass("cart", (0, 0, 0), 2.0)
    structure = fc.Structure(
        [point],
        [fc.Support(point.node, "v w")],
        inputs=[fc.Force("force", point.node, "x")],
        outputs=[fc.Position("x", point.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()], backend)
    for step in (1e-3, 5e-4):
        run = fc.simulate(model, OpenLoop({"force": Step(3.0, at=at)}), until=0.1, method=fc.GeneralizedAlpha(step))
        assert np.abs(run["x"][run.t <= at]).max() == 0.0
        assert run["x"][-1] == pytest.approx(0.75 * (0.1 - at) ** 2, rel=1e-9)


def test_a_run_that_goes_on_has_looked_ahead_beyond_where_it_was_cut():
    """It looked no farther than its end, and went on by other steps: a quarter of cuts were not bit for bit."""
    law = OpenLoop({"force": lambda t: np.sin(2.1 * t) + (t > 0.35) * np.sin(31.0 * t) + np.tanh(80.0 * (t - 0.5))})
    model, method = cart(), fc.Unchecked(fc.AdaptiveAlpha())
    whole = fc.simulate(model, law, until=1.0, method=method)
    for cut in (0.35, 0.37, 0.43, 0.495, 0.505, 0.515, 0.525, 0.58):
        part = fc.simulate(model, law, until=cut, method=method)
        rest = fc.simulate(model, law, until=1.0, start=part.checkpoint, method=method)
        assert np.array_equal(rest.final.q, whole.final.q), cut


def test_a_law_that_knows_nothing_beyond_the_end_is_not_asked_in_earnest_there():
    def known(t: float) -> float:
        if t > 1.0:
            raise ValueError("no such time")
        return np.sin(2.1 * t) + np.tanh(80.0 * (t - 0.5))

    run = fc.simulate(cart(), OpenLoop({"force": known}), until=1.0)
    assert run.status is fc.Status.FINISHED
    assert run["v"][-1] == pytest.approx((1.0 - np.cos(2.1)) / 2.1, abs=1e-3)


def test_the_shortest_runs_look_at_their_functions_as_often_as_others():
    """A run of a microsecond in steps of 10 ms asked for forty million values."""
    block = fc.PointMass("block", (0, 0, 0), 1.0)
    pull = fc.Force("pull", block.node, "x")
    model = fc.assemble(fc.Structure([block], [fc.Support(block.node, "v w")], inputs=[pull]), [fc.LargeRotation()])
    for method in (None, fc.GeneralizedAlpha(0.01), fc.ConservingMidpoint(0.01)):
        asked = []
        law = fc.OpenLoop({"pull": lambda t, asked=asked: asked.append(t) or 1.0 + t})
        run = fc.simulate(model, law, until=1e-6, method=method)
        assert run.status is fc.Status.FINISHED
        assert len(asked) < 50_000


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01), fc.ExplicitRungeKutta()])
def test_what_cannot_move_is_pushed_to_no_avail(method):
    """All is held: a force that jumps found no freedom to set going."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.02, 0.001))
    push, place = fc.Force("push", beam.end, "x"), fc.Position("x", beam.end, "x")
    structure = fc.Structure([beam], [fc.Support(beam.start)], [], [push], [place])
    law = fc.OpenLoop({"push": fc.design.Step(1.0, at=0.05)})
    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation()]), law, until=0.1, method=method)
    assert run.status is fc.Status.FINISHED
    assert (run["x"] == 1.0).all()


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha, fc.ConservingMidpoint])
@pytest.mark.parametrize("step", [0.002, 0.004, 0.005, 0.01])
@pytest.mark.parametrize("width", [0.001, 0.0015, 0.002, 0.003, 0.004])
@pytest.mark.parametrize("middle", [2.1, 2.1013, 2.1027])
def test_a_bump_within_steps_of_one_length_is_as_large_as_it_is(middle, width, step, method):
    """Of those seen in part at the end of a step up to 114 % were lost, and as little as 1 % told."""
    run = fc.simulate(
        cart(2.0),
        OpenLoop({"force": lambda t: 500.0 * np.exp(-(((t - middle) / width) ** 2))}),
        until=4.0,
        method=method(step),
    )
    assert run["v"][-1] == pytest.approx(250.0 * width * np.sqrt(np.pi), rel=0.025)


def test_what_bends_little_in_steps_of_one_length_ends_none():
    for method in (fc.GeneralizedAlpha(0.05), fc.ConservingMidpoint(0.05)):
        run = fc.simulate(cart(), OpenLoop({"force": lambda t: np.sin(10.0 * t)}), until=5.0, method=method)
        assert run.report.steps == 100


@pytest.mark.parametrize(("middle", "width"), [(33.3, 0.0003), (33.3, 2.0)])
def test_a_run_of_few_steps_says_how_closely_it_has_looked(middle, width):
    def bump(t: float) -> float:
        return 50.0 * np.exp(-(((t - middle) / width) ** 2))

    run = fc.simulate(cart(), OpenLoop({"force": bump}), until=50.0)
    felt = run["v"][-1] == pytest.approx(50.0 * width * np.sqrt(np.pi), rel=0.01)
    assert felt or any("looked at every 0.01 s" in note for note in run.report.notes)
    assert felt == (width > 1.0)


def test_what_tells_its_instants_is_not_passed_over():
    run = fc.simulate(cart(), OpenLoop({"force": Step(3.0, 10.0)}), until=50.0)
    assert run["v"][-1] == pytest.approx(120.0)
    assert not run.report.notes
