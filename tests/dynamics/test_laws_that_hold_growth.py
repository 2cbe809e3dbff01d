"""Continuous laws that answer little to much: what grows about rest is held by them, and the run has not failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.dynamics.notes.limits import limited

NEAR, FAR, STIFFNESS, DAMPING = 2.0, 1.0, 4000.0, 2.0


@dataclass(frozen=True)
class Compensated:
    """A weak proportional-derivative law of the far cart, and a switch of finite steepness for friction beside it."""

    most: float
    width: float
    sample_time: float = 0.0
    inputs: ClassVar[tuple[str, ...]] = ("far", "rate")
    outputs: ClassVar[tuple[str, ...]] = ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        s = min(t / 4.0, 1.0)
        wanted = 1.0 + 0.5 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        pull = 40.0 * (wanted - y[0]) - 30.0 * y[1]
        return np.array([0.1 * pull + self.most * np.tanh(pull / self.width)])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.zeros(0)


def carts() -> fc.Model:
    a, b = fc.PointMass("a", (0, 0, 0), NEAR), fc.PointMass("b", (1, 0, 0), FAR)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS, damping=DAMPING)
    joints = [fc.Support(a.node, "v w"), fc.Support(b.node, "v w"), fc.Pin(a.node, spring.start)]
    outputs = [fc.Position("far", b.node, "x"), fc.Velocity("rate", b.node, "x")]
    plan = fc.Structure(
        [a, b, spring],
        [*joints, fc.Pin(b.node, spring.end)],
        inputs=[fc.Force("push", a.node, "x")],
        outputs=outputs,
    )
    return fc.assemble(plan, [fc.LargeRotation()])


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(0.05, 0.0)], ids=repr)
@pytest.mark.parametrize("width", [1e-3, 1e-2])
def test_growth_that_the_law_holds_is_noted(width, method):
    """About rest a pole of 20 to 60 1/s grows, by 0.05 N at most: the far cart goes where it should all the same."""
    law = Compensated(0.05, width)
    run = fc.simulate(carts(), law, until=12.0, method=method)

    def rates(t: float, z: np.ndarray) -> list[float]:
        spring = STIFFNESS * (z[1] - z[0] - 1.0) + DAMPING * (z[3] - z[2])
        (push,) = law.command(t, np.zeros(0), z[1::2])
        return [z[2], z[3], (spring + push) / NEAR, -spring / FAR]

    true = solve_ivp(rates, (0.0, 12.0), [0.0, 1.0, 0.0, 0.0], "LSODA", run.t, rtol=1e-8, atol=1e-11).y[1]
    assert run.status is fc.Status.FINISHED
    assert any("the continuous loop is unstable" in note for note in run.report.notes)
    assert abs(run["far"] - true).max() < 0.002 * np.ptp(true)


def test_growth_that_nothing_holds_fails_the_run():
    """The same slope about rest, all the way."""
    run = fc.simulate(carts(), Compensated(5e4, 1e3), until=12.0, method=fc.GeneralizedAlpha(0.1, 0.0))
    assert run.status is fc.Status.FAILED
    assert "the continuous loop is unstable" in run.report.message


@pytest.mark.parametrize(("width", "wanted"), [(0.01, True), (0.1, False), (10.0, False)])
def test_what_counts_is_what_a_tenth_of_the_range_is_answered_with(width, wanted):
    """The secant of tanh(y / width) at 0.1 beside its slope of 1 / width: 0.1, 0.76 and 1 of it."""
    told = lambda y: np.tanh(y / width)  # noqa: E731
    assert limited(told, np.zeros(1), np.ones(1)) is wanted


def test_what_is_hardly_answered_does_not_count():
    def told(y: np.ndarray) -> np.ndarray:
        return np.array([y[0] + 1e-3 * np.tanh(100.0 * y[1])])

    assert not limited(told, np.zeros(2), np.array([1.0, 1e-3]))
