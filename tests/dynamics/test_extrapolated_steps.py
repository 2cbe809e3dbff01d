"""Extrapolated runs: steps chosen as the method alone chooses them, laws that break, and ends beyond what holds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

STIFFNESS, UNTIL = 900.0, 0.6
METHODS = (fc.AdaptiveAlpha(), fc.Richardson(fc.AdaptiveAlpha()))
BRISTLES = fc.LuGre(500.0, kinetic=1.0, static=1.5, stribeck=0.1, damping=2.0, viscous=0.4)


@cache
def swinging(*effects: fc.Effect) -> fc.Model:
    """A kilogram on a spring, along a line."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-1, 0, 0), mass.node, stiffness=STIFFNESS)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([spring, mass], joints, outputs=[fc.Position("x", mass.node, "x")])
    return fc.assemble(structure, [fc.LargeRotation(), *effects])


def swung(method: fc.Integrator, *effects: fc.Effect, until: float = UNTIL, **how: fc.Tolerance) -> fc.Run:
    model = swinging(*effects)
    return fc.simulate(model, until=until, method=method, start=model.rest.with_(v=np.eye(model.n)[0]), **how)


def smooth() -> float:
    """Where it is at the end without friction."""
    w = np.sqrt(STIFFNESS)
    return np.sin(w * UNTIL) / w


def rubbed() -> float:
    """Where it is at the end with friction: bristles by hand."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        rate = v - 500.0 * abs(v) * z / (1.0 + 0.5 * np.exp(-((v / 0.1) ** 2)))
        return [v, -STIFFNESS * x - 500.0 * z - 2.0 * rate - 0.4 * v, rate]

    found = solve_ivp(slope, (0.0, UNTIL), [0.0, 1.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-13, max_step=1e-3)
    return float(found.y[0, -1])


@pytest.mark.parametrize(
    ("effects", "end"),
    [((), smooth), ((fc.LuGreFriction({"mass.u": BRISTLES}),), rubbed)],
    ids=["spring", "bristles"],
)
@pytest.mark.parametrize("tolerance", [fc.Tolerance(), fc.Tolerance(1e-6, 1e-9)], ids=["loose", "tight"])
def test_chosen_steps_are_those_of_the_method_and_are_worth_more(effects, end, tolerance):
    """By the gap of two runs that have drifted apart, 68,000 steps were chosen where 2,100 do."""
    once, twice = (swung(how, *effects, tolerance=tolerance) for how in METHODS)
    assert twice.report.steps == pytest.approx(once.report.steps, rel=0.05)
    off, further = (abs(run["x"][-1] - end()) for run in (twice, once))
    assert off <= 0.1 * further


class Ramp:
    """A force that is the law's state, which begins to grow at a break: the force does not jump there."""

    inputs, outputs, sample_time, breaks = ("x",), ("force",), 0.0, (0.1,)

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 if t >= 0.1 else 0.0])


@pytest.mark.parametrize("inner", [fc.GeneralizedAlpha(0.02), fc.ConservingMidpoint(0.02), fc.AdaptiveAlpha()])
def test_rates_of_a_law_that_break_are_known_to_both_runs(inner):
    """A force in proportion to time since the break: both runs integrate it exactly."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    outputs, inputs = [fc.Position("x", mass.node, "x")], [fc.Force("force", mass.node, "x")]
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs)
    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation()]), Ramp(), until=0.5, method=fc.Richardson(inner))
    assert run.u[-1, 0] == pytest.approx(0.4, abs=1e-12)
    assert run["x"][-1] == pytest.approx(0.4**3 / 6.0, abs=1e-8)


@pytest.mark.parametrize(
    ("method", "remedy"),
    [
        (fc.Richardson(fc.GeneralizedAlpha(0.02)), "take steps smaller than 0.02 s"),
        (fc.Richardson(fc.AdaptiveAlpha()), "take a smaller Tolerance"),
    ],
    ids=["fixed", "chosen"],
)
def test_where_the_coarser_run_does_not_follow_the_end_says_so(method, remedy):
    """Six tenths of a radian a step, for ninety radians: the coarser run is three radians late."""
    run = swung(method, until=3.0, tolerance=fc.Tolerance(3e-2))
    assert run.status is fc.Status.FAILED
    assert "the coarser of the two runs of Richardson no longer follows the motion" in run.report.message
    assert remedy in run.report.message


def struck(speed: float, rho: float) -> fc.Run:
    """A mass that meets a damped spring behind 10 mm of play, on its way to a wall."""
    ball, wall = fc.PointMass("ball", (0, 0, 0), 1.0), fc.PointMass("wall", (1, 0, 0), 0.01)
    stop = fc.Spring("stop", ball.node, wall.node, stiffness=1e5, length=1.0, damping=10.0)
    ground = fc.Spring("ground", wall.node, (2, 0, 0), stiffness=1e8, length=1.0)
    joints = [fc.Pin(stop.start, ball.node), fc.Pin(stop.end, wall.node), fc.Pin(ground.start, wall.node)]
    joints += [fc.Support(ground.end, "u v w"), fc.Support(ball.node, "v w"), fc.Support(wall.node, "v w")]
    machine = fc.Structure(
        [ball, wall, stop, ground], joints, outputs=[fc.Position("x", ball.node, "x"), fc.Velocity("v", ball.node, "x")]
    )
    model = fc.assemble(machine, [fc.LargeRotation(), fc.Backlash({"stop": 0.02})])
    method = fc.Richardson(fc.GeneralizedAlpha(1e-3, rho=rho))
    return fc.simulate(model, until=0.03, start=model.rest.with_(v=np.array([speed, 0.0])), method=method, every=1e-3)


@pytest.mark.parametrize("speed", [1.25, 1.0, 0.5])
@pytest.mark.parametrize("rho", [0.9, 1.0])
def test_a_damped_corner_just_at_the_end_of_a_step_is_passed(speed, rho):
    """Where the force jumps no step ends, nor do its halves, which end there too."""
    run, beside = struck(speed, rho), struck(1.0001 * speed, rho)
    assert run.status is fc.Status.FINISHED
    assert len(run.t) == 31
    assert run["v"] == pytest.approx(beside["v"], abs=0.02 * speed)
    assert run["v"][-1] == pytest.approx(beside["v"][-1], rel=1e-3)
    assert run.events[0].t == pytest.approx(0.01 / speed, abs=1e-9)
