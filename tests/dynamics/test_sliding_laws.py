"""Continuous laws that jump with what they read: sliding modes, relays, friction of one's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import flexctrl as fc

REACHED = (np.sqrt(6.5625) - 1.25) / 2.5
"""When 1.25 t² − 1 + 1.25 t is zero."""


@dataclass(frozen=True)
class Law:
    """A continuous law in Python."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    says: Callable[[float, np.ndarray, np.ndarray], object]
    states: int = 0
    grows: Callable[[np.ndarray], object] | None = None
    sample_time: float = 0.0

    def initial(self) -> np.ndarray:
        return np.zeros(self.states)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.atleast_1d(np.asarray(self.says(t, x, y), dtype=float))

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.grows(y) if self.grows else (), dtype=float)


def carts(*masses: float) -> fc.Model:
    """Carts side by side, each with its force, place and speed."""
    bodies = [fc.PointMass(f"m{i}", (0, i, 0), mass) for i, mass in enumerate(masses)]
    joints = [fc.Support(body.node, "v w") for body in bodies]
    inputs = [fc.Force(f"f{i}", body.node, "x") for i, body in enumerate(bodies)]
    outputs = [
        signal
        for i, body in enumerate(bodies)
        for signal in (fc.Position(f"x{i}", body.node, "x"), fc.Velocity(f"v{i}", body.node, "x"))
    ]
    return fc.assemble(fc.Structure(bodies, joints, inputs=inputs, outputs=outputs), [fc.LargeRotation()])


SLIDING = Law(("x0", "v0"), ("f0",), lambda t, x, y: -5.0 * np.sign(y[0] - 1.0 + 0.5 * y[1]))


def slid(t: np.ndarray) -> np.ndarray:
    """2 kg under 5 N until x − 1 + v/2 = 0; along that from there on."""
    left = 1.0 - 1.25 * REACHED**2
    return np.where(t < REACHED, 1.25 * t**2, 1.0 - left * np.exp(-2.0 * (t - REACHED)))


@pytest.mark.parametrize(
    ("method", "near", "most"),
    [(None, 2e-3, 100), (fc.GeneralizedAlpha(0.01), 4e-3, 500), (fc.GeneralizedAlpha(0.01, rho=1.0), 4e-3, 500)],
)
def test_a_sliding_mode_slides_as_filippov_says(method, near, most):
    """Steps with either value did not converge: they fell to nanoseconds, 40 ms of time each."""
    run = fc.simulate(carts(2.0), SLIDING, until=5.0, method=method)
    assert run.status is fc.Status.FINISHED
    assert run["x0"] == pytest.approx(slid(run.t), abs=near)
    assert run.report.steps <= most
    late = run.t > REACHED + 0.2
    assert np.abs(run["x0"] - 1.0 + 0.5 * run["v0"])[late].max() < 1e-5
    assert np.abs(run["f0"][late]).max() < 5.0


def test_extrapolated_runs_slide_with_their_finer_one():
    """Their books take the value between for the input, not what the law says beside it."""
    run = fc.simulate(carts(2.0), SLIDING, until=2.0, method=fc.Richardson(fc.GeneralizedAlpha(0.01)))
    assert run.status is fc.Status.FINISHED
    assert run["x0"] == pytest.approx(slid(run.t), abs=3e-3)


def test_what_is_commanded_is_the_equivalent_control():
    """On x − 1 + v/2 = 0, v' = −2 v: 2 kg ask for −4 v."""
    run = fc.simulate(carts(2.0), SLIDING, until=3.0, method=fc.GeneralizedAlpha(0.01), every=0.004)
    late = run.t > 2.0
    assert run["f0"][late] == pytest.approx(-4.0 * run["v0"][late], abs=0.05)


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(2e-3), fc.GeneralizedAlpha(5e-3, rho=1.0)])
def test_friction_of_ones_own_sticks_and_breaks_loose(method):
    """3 sin 2t over 2 N of friction on 2 kg: it is gone from asin(2/3)/2 to where 3/4 (cos 2t₀ − cos 2t) = t − t₀."""
    law = Law(("v0",), ("f0",), lambda t, x, y: 3.0 * np.sin(2.0 * t) - 2.0 * np.sign(y[0]))
    run = fc.simulate(carts(2.0), law, until=1.9, method=method)
    loose = 0.5 * np.arcsin(2.0 / 3.0)
    stuck = brentq(lambda t: 0.75 * (np.cos(2.0 * loose) - np.cos(2.0 * t)) - t + loose, 1.0, 1.9)

    def way(t):
        return (
            0.75 * np.cos(2.0 * loose) * (t - loose)
            - 0.375 * (np.sin(2.0 * t) - np.sin(2.0 * loose))
            - (0.5 * (t - loose) ** 2)
        )

    assert run["x0"] == pytest.approx(way(np.clip(run.t, loose, stuck)), abs=2e-3)


def test_a_law_that_stops_what_moves_holds_it():
    """30 N back as soon as it goes on beyond 0.5 m: held there, as by friction; the run went on for hours."""
    law = Law(("x0", "v0"), ("f0",), lambda t, x, y: 1.0 - (30.0 if y[0] > 0.5 and y[1] > 0.0 else 0.0))
    run = fc.simulate(carts(2.0), law, until=6.0)
    assert run.status is fc.Status.FINISHED
    assert run.report.steps < 200
    assert run["x0"][-1] == pytest.approx(0.5 + 0.5 / 29.0, abs=2e-3)
    assert abs(run["v0"][-1]) < 1e-4


def test_two_that_slide_each_have_their_value_between():
    law = Law(
        ("x0", "v0", "x1", "v1"),
        ("f0", "f1"),
        lambda t, x, y: (
            -5.0 * np.sign(y[0] - 1.0 + 0.5 * y[1]),
            0.1 * y[0] - 3.0 * np.sign(y[2] + 0.5 + 0.7 * y[3]),
        ),
    )
    run = fc.simulate(carts(2.0, 1.0), law, until=3.0)
    assert run.status is fc.Status.FINISHED
    assert run["x0"] == pytest.approx(slid(run.t), abs=2e-3)
    late = run.t > 1.5
    assert np.abs(run["x1"] + 0.5 + 0.7 * run["v1"])[late].max() < 1e-4


def test_a_force_and_its_reaction_stay_opposite():
    """Dry friction between two carts, beside a relay of a third: only what shakes them moves their centre of mass.

    Each with a value of its own where they stick, the carts of 2 and 1 kg flew off together.
    """

    def says(t, x, y):
        rubs = 2.0 * np.sign(y[0] - y[1])
        return 8.0 * np.sin(3.0 * t) - rubs, rubs, -5.0 * np.sign(y[2] - 1.0 + 0.5 * y[3])

    law = Law(("v0", "v1", "x2", "v2"), ("f0", "f1", "f2"), says)
    method, tolerance = fc.Unchecked(fc.AdaptiveAlpha()), fc.Tolerance(1e-5, 1e-8)
    run = fc.simulate(carts(2.0, 1.0, 2.0), law, until=4.0, method=method, tolerance=tolerance, every=0.01)
    centre = (2.0 * run["x0"] + run["x1"]) / 3.0
    assert centre == pytest.approx(8.0 / 9.0 * (run.t - np.sin(3.0 * run.t) / 3.0), abs=5e-3)
    assert run["x2"] == pytest.approx(slid(run.t), abs=2e-3)

    def slope(t, y):
        rubs = 2.0 * np.clip((y[2] - y[3]) / 1e-6, -1.0, 1.0)
        return [y[2], y[3], 0.5 * (8.0 * np.sin(3.0 * t) - rubs), rubs]

    truth = solve_ivp(slope, (0.0, 4.0), np.zeros(4), "LSODA", run.t, rtol=1e-8, atol=1e-10, max_step=1e-3).y
    apart = truth[0] - truth[1]
    assert np.ptp(apart) > 0.05
    assert run["x0"] - run["x1"] == pytest.approx(apart, abs=0.02 * np.ptp(apart))


def test_surfaces_that_hang_together_and_move_are_slid_along():
    """Two carts whose surfaces share speeds, one of them led by time: as each says once it is reached."""
    law = Law(
        ("x0", "v0", "x1", "v1"),
        ("f0", "f1"),
        lambda t, x, y: (
            -12.0 * np.sign(y[1] + 2.0 * (y[0] - 0.5 * np.sin(t)) + 0.3 * (y[3] + 3.0 * (y[2] - 0.3))),
            -12.0 * np.sign(y[3] + 3.0 * (y[2] - 0.3)),
        ),
    )
    run = fc.simulate(carts(1.5, 1.5), law, until=3.0)
    assert run.status is fc.Status.FINISHED
    assert run.report.steps < 300
    late = run.t > 1.0
    assert np.abs(run["v0"] + 2.0 * (run["x0"] - 0.5 * np.sin(run.t)))[late].max() < 1e-4
    assert np.abs(run["v1"] + 3.0 * (run["x1"] - 0.3))[late].max() < 1e-4
    left = run["x1"][late] - 0.3
    assert left == pytest.approx(left[0] * np.exp(-3.0 * (run.t[late] - run.t[late][0])), abs=1e-4)


def test_a_law_with_states_slides_too():
    law = Law(
        ("x0", "v0"),
        ("f0",),
        lambda t, x, y: -5.0 * np.sign(y[0] - 1.0 + 0.5 * y[1]) + 0.2 * x[0],
        states=1,
        grows=lambda y: [1.0 - y[0]],
    )
    run = fc.simulate(carts(2.0), law, until=3.0)
    late = run.t > 1.0
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x0"] - 1.0 + 0.5 * run["v0"])[late].max() < 1e-4


def test_a_run_that_slides_goes_on_bit_for_bit(tmp_path):
    model = carts(2.0)
    whole = fc.simulate(model, SLIDING, until=2.0, method=fc.GeneralizedAlpha(0.01))
    half = fc.simulate(model, SLIDING, until=1.0, method=fc.GeneralizedAlpha(0.01))
    half.checkpoint.save(tmp_path / "half.ck")
    start = fc.load_checkpoint(tmp_path / "half.ck")
    rest = fc.simulate(model, SLIDING, until=2.0, method=fc.GeneralizedAlpha(0.01), start=start)
    assert start.point.supply.slid
    assert (rest.final.q == whole.final.q).all()
    assert (rest.u == whole.u[-len(rest.u) :]).all()


def test_a_smooth_law_steps_as_it_did():
    """What does not jump is solved by Newton's method, however stiff."""
    soft = Law(("x0", "v0"), ("f0",), lambda t, x, y: -5.0 * np.tanh(300.0 * (y[0] - 1.0 + 0.5 * y[1])))
    run = fc.simulate(carts(2.0), soft, until=5.0)
    assert run.status is fc.Status.FINISHED
    assert run["x0"] == pytest.approx(slid(run.t), abs=5e-3)
    assert not run.checkpoint.point.supply.slid


def test_what_cannot_slide_says_so_at_once():
    """It took an hour's chatter in steps of 20 µs; what it found until then is kept."""
    run = fc.simulate(carts(2.0), SLIDING, until=5.0, method=fc.ConservingMidpoint(0.005))
    assert run.status is fc.Status.FAILED
    assert "fall apart into more than 32 pieces" in run.report.message
    assert "take AdaptiveAlpha or GeneralizedAlpha" in run.report.message
    assert REACHED - 0.005 < run.final.t < REACHED + 0.1
    assert run["x0"] == pytest.approx(slid(run.t), abs=5e-3)


def test_what_goes_through_a_jump_needs_no_sliding():
    """The force falls from 5 to 2 N at 0.5 m: no way back."""
    law = Law(("x0",), ("f0",), lambda t, x, y: 5.0 if y[0] < 0.5 else 2.0)
    run = fc.simulate(carts(2.0), law, until=1.0, method=fc.ConservingMidpoint(0.005))
    passed = np.sqrt(0.4)
    late = run.t - passed
    true = np.where(late < 0.0, 1.25 * run.t**2, 0.5 + 2.5 * passed * late + 0.5 * late**2)
    assert run.status is fc.Status.FINISHED
    assert run["x0"] == pytest.approx(true, abs=5e-3)


MASSES, SPRING, DAMPER = (3.9535049494, 9.5756010975), 534.7606289685, 9.0619766176


def linked() -> fc.Model:
    """Two carts on a spring, one of them pushed."""
    spring = fc.Spring("spring", (0, 0, 0), (2, 0, 0), SPRING, damping=DAMPER)
    bodies = [fc.PointMass(f"m{i}", (2 * i, 0, 0), mass) for i, mass in enumerate(MASSES)]
    joints = [fc.Support(body.node, "v w") for body in bodies]
    joints += [fc.Pin(body.node, end) for body, end in zip(bodies, (spring.start, spring.end), strict=True)]
    outputs = [fc.Velocity("v0", bodies[0].node, "x"), fc.Position("x1", bodies[1].node, "x")]
    plan = fc.Structure([*bodies, spring], joints, inputs=[fc.Force("f0", bodies[0].node, "x")], outputs=outputs)
    return fc.assemble(plan, [fc.LargeRotation()])


def dragged(t: float, v: float, sign: Callable[[float], float]) -> float:
    """Drag and dry friction of a cart that is shaken."""
    return 2.180224641 * np.sin(6.745613641 * t + 0.195) - 4.6775302555 * (v * abs(v) + 0.3 * sign(v))


def test_what_is_near_by_chance_is_told_by_a_finer_run():
    """They told 0.4 % of what is 1.3 % off, as the nearer one happens to stick at the same moments."""
    law = Law(("v0",), ("f0",), lambda t, x, y: dragged(t, y[0], np.sign))
    model = linked()
    start = model.displace([0.1297892372, 0.0648946186]).with_(v=np.array([0.6771891943, -0.3088613069]))
    run = fc.simulate(model, law, until=1.968131424, start=start, every=0.02)

    def slope(t, y):
        pull = SPRING * (y[1] - y[0]) + DAMPER * (y[3] - y[2])
        push = dragged(t, y[2], lambda v: np.clip(v / 1e-6, -1.0, 1.0))
        return [y[2], y[3], (push + pull) / MASSES[0], -pull / MASSES[1]]

    begin, span = [*start.q, *start.v], (0.0, run.t[-1])
    truth = solve_ivp(slope, span, begin, "LSODA", run.t, rtol=1e-8, atol=1e-10, max_step=1e-3).y[1] + 2.0
    off = np.abs(run["x1"] - truth).max() / np.ptp(truth)
    assert off < 0.03
    assert run.report.output_errors["x1"] > 0.5 * off
