"""States of continuous laws: a law whose command stands still may be timed by them, and their rates may jump."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from test_sliding_laws import carts

import flexctrl as fc
from flexctrl.design import AntiWindup, Constant, FilteredRate, pid
from flexctrl.kernels.kernel import CasadiVM

GAINS = [(2.66, 2.71, 1.54, 0.046, 0.25, 3.47, 0.90), (2.39, 1.54, 1.63, 0.017, 0.72, 3.05, 0.69)]
"""kp, ki, kd, the filter's time, the limit, the mass, the target."""


def cart(mass: float, backend=None) -> fc.Model:
    body = fc.PointMass("cart", (0, 0, 0), mass)
    inputs, outputs = [fc.Force("f", body.node, "x")], [fc.Position("x", body.node, "x")]
    structure = fc.Structure([body], [fc.Support(body.node, "v w")], inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation()], backend)


def wound(gains) -> fc.Tracking:
    kp, ki, kd, lag, limit, _, target = gains
    law = pid(kp, ki, kd, measured="x", rate=FilteredRate(lag), command="f")
    return fc.Tracking(AntiWindup(law, {"f": limit}), {"x": Constant(target)})


@cache
def truth(gains, until: float = 8.0, h: float = 5e-4) -> tuple[np.ndarray, np.ndarray]:
    """The same by the classical method of Runge and Kutta, in steps of half a millisecond."""
    kp, ki, kd, lag, limit, mass, target = gains

    def rates(z):
        e = z[0] - target
        r = (e - z[3]) / lag
        u = -kp * e - ki * z[2] - kd * r
        s = min(max(u, -limit), limit)
        return np.array([z[1], s / mass, 0.0 if (u - s) * -ki * e > 0 else e, r])

    z, found = np.zeros(4), [0.0]
    for _ in range(round(until / h)):
        a = rates(z)
        b = rates(z + 0.5 * h * a)
        c = rates(z + 0.5 * h * b)
        z = z + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates(z + h * c))
        found.append(z[0])
    return h * np.arange(len(found)), np.array(found)


@pytest.mark.parametrize("gains", GAINS)
@pytest.mark.parametrize(
    ("backend", "how", "near"),
    [
        (None, {}, 5e-3),
        (None, {"tolerance": fc.Tolerance(1e-6, 1e-9)}, 5e-4),
        (None, {"method": fc.GeneralizedAlpha(1e-3)}, 1e-3),
        (None, {"method": fc.GeneralizedAlpha(2.46e-3)}, 1e-3),
        (CasadiVM(), {}, 5e-3),
        (CasadiVM(), {"method": fc.GeneralizedAlpha(2.46e-3)}, 1e-3),
    ],
)
def test_anti_windup_slides_along_its_limit(gains, backend, how, near):
    """Where integrating would push further out it stands still: its rate jumps there. It was off by all of the way."""
    run = fc.simulate(cart(gains[5], backend), wound(gains), until=8.0, **how)
    t, x = truth(gains)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x"] - np.interp(run.t, t, x)).max() < near * np.ptp(x)


class Waiting:
    """A PD that waits until its state, which dies away with 2 s from 1, is at 0.1."""

    inputs, outputs, sample_time = ("x0", "v0"), ("f0",), 0.0

    def initial(self) -> np.ndarray:
        return np.array([1.0])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -0.5 * x

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4.0 * (1.0 - y[0]) - 2.0 * y[1] if x[0] < 0.1 else 0.0])


@pytest.mark.parametrize(("tolerance", "near"), [(fc.Tolerance(), 2e-2), (fc.Tolerance(1e-6, 1e-9), 2e-3)])
def test_a_law_that_waits_for_its_own_state_is_on_time(tolerance, near):
    """It begins at 2 ln 10 = 4.605 s; it began at 4.188 s, at any tolerance."""
    run = fc.simulate(carts(2.0), Waiting(), until=8.0, tolerance=tolerance)
    begins = float(run.t[np.flatnonzero(np.abs(run["f0"]) > 0.1)[0]])
    assert begins == pytest.approx(2.0 * np.log(10.0), abs=0.1)
    t = np.linspace(5.0, 8.0, 100)
    s = t - 2.0 * np.log(10.0)
    w = np.sqrt(2.0 - 0.25)
    exact = 1.0 - np.exp(-0.5 * s) * (np.cos(w * s) + 0.5 / w * np.sin(w * s))
    assert np.array([run.at(k)["x0"] for k in t]) == pytest.approx(exact, abs=near)


def test_what_filters_at_once_takes_no_more_steps():
    """A filter of microseconds follows what it reads, and forgets its errors within a step."""

    def steps(lag: float) -> int:
        law = fc.Tracking(pid(8.0, 0.0, 4.0, measured="x", rate=FilteredRate(lag), command="f"), {"x": Constant(0.5)})
        return fc.simulate(cart(1.0), law, until=5.0).report.steps

    assert steps(1e-5) < 2 * steps(1e-2)


def test_compiled_and_plain_steps_are_the_same():
    for gains in GAINS:
        one, other = (fc.simulate(cart(gains[5], backend), wound(gains), until=6.0) for backend in (None, CasadiVM()))
        assert other.report.steps == pytest.approx(one.report.steps, rel=0.1)
        assert other["x"][-1] == pytest.approx(one["x"][-1], abs=2e-3)


def test_a_run_goes_on_with_what_its_law_has_come_to():
    gains = GAINS[0]
    whole = fc.simulate(cart(gains[5]), wound(gains), until=6.0)
    half = fc.simulate(cart(gains[5]), wound(gains), until=3.0)
    rest = fc.simulate(cart(gains[5]), wound(gains), until=6.0, start=half.checkpoint)
    assert half.checkpoint.point.supply.trend.size == 2
    assert (rest.final.q == whole.final.q).all()
    assert rest.report.steps == whole.report.steps


def test_a_law_that_raises_when_its_error_is_asked_for_ends_the_run_and_is_blamed(monkeypatch):
    class Waiting:
        inputs, outputs, sample_time = ("x",), ("f",), 0.0

        def initial(self):
            return np.ones(1)

        def command(self, t, x, y):
            return np.array([1.0 - x[0]])

        def rate(self, t, x, y):
            return -3.0 * x * x

    def fails(*given):
        raise ZeroDivisionError("no slope here")

    monkeypatch.setattr("flexctrl.dynamics.feed.softened", fails)
    run = fc.simulate(cart(1.0), Waiting(), until=2.0)
    assert run.status is fc.Status.FAILED
    assert "the controller raised ZeroDivisionError: no slope here" in run.report.message
    assert len(run.t) > 1
