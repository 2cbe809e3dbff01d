"""The order of every method, measured on machines in space: hinges, slides, balls, ropes, a loop of rigid parts."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.model.nlsys import equations_of

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import four_bar, machine

UNTIL = 0.25
EFFECTS = (fc.Gravity((1.0, -2.0, -9.0)), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.002))
MACHINES = {"four_bar": four_bar, "balls": lambda: machine(4, 4), "hinges": lambda: machine(6, 4)}
METHODS = {
    "damped": (lambda h: fc.GeneralizedAlpha(h, 0.8), 2, 1 / 200),
    "undamped": (lambda h: fc.GeneralizedAlpha(h, 1.0), 2, 1 / 200),
    "conserving": (fc.ConservingMidpoint, 2, 1 / 200),
    "extrapolated": (lambda h: fc.Richardson(fc.ConservingMidpoint(h)), 4, 1 / 100),
}


@dataclass
class Subject:
    """A machine set in motion, and where it is at the end."""

    model: fc.Model
    start: fc.State
    inputs: dict[str, float]
    end: np.ndarray

    def run(self, method, **more) -> fc.Run:
        return fc.simulate(self.model, until=UNTIL, start=self.start, inputs=self.inputs, method=method, **more)

    def error(self, method) -> float:
        run = self.run(method, every=UNTIL)
        assert run.status is fc.Status.FINISHED
        return float(np.abs(run.final.x - self.end).max())


@cache
def subject(name: str) -> Subject:
    """The end is scipy's, on the state space that python-control is given."""
    model = fc.assemble(MACHINES[name](), EFFECTS, fc.CasadiVM())
    v = np.random.default_rng(1).normal(size=model.n)
    u = np.zeros(len(model.inputs))
    u[:2] = 1.0, 0.5
    equations = equations_of(model)
    begin = np.append(np.zeros(len(equations.placed)), v)
    found = solve_ivp(
        lambda t, x: equations.rate(t, x, u), (0.0, UNTIL), begin, method="DOP853", rtol=1e-10, atol=1e-11
    )
    inputs = dict(zip(model.inputs, u.tolist(), strict=True))
    return Subject(model, model.rest.with_(v=v), inputs, equations.state(found.y[:, -1]).x)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "balls"])
def test_the_explicit_method_agrees_with_scipys(name):
    s = subject(name)
    run = s.run(fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0.0, 1e-10))
    assert np.abs(run.final.x - s.end).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method"),
    [
        *(("balls", method) for method in METHODS),
        ("hinges", "conserving"),
        ("hinges", "damped"),
        ("four_bar", "damped"),
    ],
)
def test_order(name, method):
    make, order, h = METHODS[method]
    s = subject(name)
    coarse, fine = s.error(make(h)), s.error(make(h / 2))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.25)
    assert make(h).order == order


@pytest.mark.slow
def test_extrapolation_of_a_damped_method_gains_an_order():
    s = subject("balls")
    coarse, fine = (s.error(fc.Richardson(fc.GeneralizedAlpha(h, 0.5))) for h in (1 / 50, 1 / 100))
    assert np.log2(coarse / fine) > 2.7
    assert fc.Richardson(fc.GeneralizedAlpha(1e-3, 0.5)).order == 3


@cache
def swinging() -> tuple[fc.Model, fc.State, np.ndarray]:
    """A mass on a soft spring in space, and where it is after 2 s: scipy's, on x, y, z."""
    spring = fc.Spring("spring", (0, 0, 0), (0.3, 0.4, -1.0), stiffness=40.0, length=0.8)
    mass = fc.PointMass("mass", spring.end, 1.0)
    joints = [fc.Support(spring.start, "u v w"), fc.Pin(spring.end, mass.node)]
    model = fc.assemble(fc.Structure([spring, mass], joints), [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(z[:3])
        return np.append(z[3:], -40.0 * (length - 0.8) / length * z[:3] - (0, 0, 9.81))

    begin = np.array([0.3, 0.4, -1.0, 1.0, -0.5, 0.3])
    found = solve_ivp(rate, (0.0, 2.0), begin, method="DOP853", rtol=1e-13, atol=1e-13)
    return model, model.rest.with_(v=begin[3:]), found.y[:3, -1]


def missed(method, **more) -> tuple[float, int]:
    """How far from there, and in how many steps."""
    model, start, end = swinging()
    run = fc.simulate(model, until=2.0, start=start, method=method, **more)
    return float(np.abs(run.final.x[2] - end).max()), run.report.steps


def test_order_of_the_explicit_method():
    """Of order 8: halving the step gains more than two digits."""
    coarse, fine = (missed(fc.ExplicitRungeKutta(h))[0] for h in (0.1, 0.05))
    assert np.log2(coarse / fine) == pytest.approx(8.0, abs=1.0)


def test_steps_of_the_explicit_method_follow_the_tolerance():
    found = [missed(fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0.0, tol)) for tol in (1e-3, 1e-5, 1e-7, 1e-9)]
    for (loose, few), (tight, many) in pairwise(found):
        assert tight < 0.1 * loose
        assert many > few


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    [fc.AdaptiveAlpha(), fc.Richardson(fc.AdaptiveAlpha())],
    ids=["alpha", "extrapolated"],
)
def test_chosen_steps_follow_the_tolerance(method):
    """A tolerance a hundred times smaller: an error at least ten times smaller, for more steps."""
    s = subject("balls")
    runs = [s.run(method, tolerance=fc.Tolerance(tol, 1e-3 * tol)) for tol in (1e-3, 1e-5)]
    loose, tight = (float(np.abs(run.final.x - s.end).max()) for run in runs)
    assert tight < 0.1 * loose
    assert runs[1].report.steps > runs[0].report.steps


@pytest.mark.parametrize(("rho", "order"), [(1.0, 4), (0.5, 3)], ids=["undamped", "damped"])
@pytest.mark.parametrize("name", ["four_bar", "hinges"])
def test_order_of_extrapolation_over_chosen_steps(name, rho, order):
    """The steps are those of the method, and with their number the error falls as with that of fixed ones."""
    s, found = subject(name), []
    for tol in (1e-4, 1e-6):
        how = {"tolerance": fc.Tolerance(tol, 1e-3 * tol), "every": UNTIL}
        once, run = (s.run(method, **how) for method in (fc.AdaptiveAlpha(rho), fc.Richardson(fc.AdaptiveAlpha(rho))))
        assert run.report.steps == pytest.approx(once.report.steps, abs=2)
        found.append((run.report.steps, float(np.abs(run.final.x - s.end).max())))
    (few, loose), (many, tight) = found
    assert np.log(loose / tight) / np.log(many / few) == pytest.approx(order, abs=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha, fc.ConservingMidpoint], ids=lambda m: m.__name__)
def test_between_steps_the_error_falls_as_at_them(method):
    """At an instant that no step ends at: places to the order of the method, and rates with them."""
    s = subject("hinges")
    t = 0.1937 * UNTIL / 0.25
    reference = s.run(fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0.0, 1e-11)).at(t).state
    found = [s.run(method(h)).at(t).state for h in (1 / 100, 1 / 200, 1 / 400)]
    places = [np.abs(state.x - reference.x).max() for state in found]
    rates = [np.abs(state.v - reference.v).max() for state in found]
    assert np.log2(places[0] / places[2]) == pytest.approx(4.0, abs=0.6)
    assert np.log2(rates[0] / rates[2]) > 3.3


@pytest.mark.parametrize("method", [lambda h: fc.GeneralizedAlpha(h, rho=1.0), fc.ConservingMidpoint])
def test_between_steps_extrapolation_keeps_its_order(method):
    """A mass on a spring: places between steps are of the fourth order, and no worse than at the steps; rates third."""
    spring = fc.Spring("spring", (0, 0, 0), (0.3, 0.4, -1.0), stiffness=40.0, length=1.25**0.5)
    mass = fc.PointMass("mass", spring.end, 1.0)
    seen = [kind(f"{kind.__name__}_{axis}", mass.node, axis) for kind in (fc.Position, fc.Velocity) for axis in "xyz"]
    structure = fc.Structure(
        [spring, mass], [fc.Support(spring.start, "u v w"), fc.Pin(spring.end, mass.node)], outputs=seen
    )
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    start, fine = model.rest.with_(v=np.array([1.0, -0.5, 0.3])), 1.0 / 800.0
    exact = fc.simulate(
        model, until=0.5, start=start, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(0.0, 1e-13), every=fine
    )
    found = []
    for h in (0.01, 0.005):
        run = fc.simulate(model, until=0.5, start=start, method=fc.Richardson(method(h)), every=fine)
        off = np.abs(run.y - exact.y)
        found.append((off[:, :3].max(), off[:, 3:].max()))
        assert off[:, :3].max() < 1.1 * off[:: round(h / fine), :3].max()
    (places, rates), (closer, slower) = found
    assert np.log2(places / closer) > 3.9
    assert np.log2(rates / slower) > 2.9
