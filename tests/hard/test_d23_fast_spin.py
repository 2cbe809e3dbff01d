"""D23, fast spin: every method of its order on the heavy top, no precession of its own, Dzhanibekov's flips.

The heavy top of B10 spins at 150 rad/s and is to be right to 5e-4 m with steps of 0.2 ms. A top with its axis level
precesses steadily at Ω = m g l/(J ω); a step that turned along the mean of its spins would make that slower by
(hω)²/12, which is 8.5e-3 with 160 rad/s and steps of 2 ms.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import flexctrl as fc

PAGE = "hard"
PLACE = (0.6055505614, 0.5989576818, -0.5239830274)
"""Of the heavy top at 0.2 s."""

FLIPS = (8.0532570, 23.0192521, 37.9852472, 52.9512424)
MASS, ARM, ACROSS, ALONG = 1.0, 0.5, 0.02, 0.04


def top(arm: float, mass: float, across: float, along: float, spin: tuple[float, float, float]):
    """A body of revolution about y, held at the origin."""
    body = fc.RigidBody("top", (0, arm, 0), mass, (across, along, across), {"tip": (0, 0, 0)})
    outputs = [fc.Position(axis, body.node, axis) for axis in "xyz"]
    structure = fc.Structure([body], [fc.Support(body.point("tip"), "u v w")], outputs=outputs)
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    return model, model.rest.with_(v=np.array(spin))


@cache
def heavy():
    return top(1.0, 15.0, 0.234375, 0.46875, (0.0, 150.0, -4.61538))


METHODS = {
    "ConservingMidpoint": (fc.ConservingMidpoint, 2e-4, 2.0),
    "GeneralizedAlpha": (fc.GeneralizedAlpha, 2e-4, 2.0),
    "GeneralizedAlpha, undamped": (lambda h: fc.GeneralizedAlpha(h, rho=1.0), 2e-4, 2.0),
    "GeneralizedAlpha, damped": (lambda h: fc.GeneralizedAlpha(h, rho=0.5), 2e-4, 2.0),
    "Richardson of GeneralizedAlpha": (lambda h: fc.Richardson(fc.GeneralizedAlpha(h, rho=1.0)), 4e-4, 4.0),
    "Richardson of ConservingMidpoint": (lambda h: fc.Richardson(fc.ConservingMidpoint(h)), 4e-4, 4.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_heavy_top(name, record):
    (model, start), (method, step, order) = heavy(), METHODS[name]
    runs = [fc.simulate(model, until=0.2, start=start, method=method(h)) for h in (2.0 * step, step)]
    coarse, fine = (np.abs(np.array([run[axis][-1] for axis in "xyz"]) - PLACE).max() for run in runs)
    record(
        f"D23 heavy top, mass centre at 0.2 s, {name} of {1e3 * step:g} ms",
        ours=[runs[1][axis][-1] for axis in "xyz"],
        reference=PLACE,
        source="Brüls, Cardona and Arnold 2012; quaternions by DOP853",
        tolerance=Absolute(5e-5),
    )
    record(
        f"D23 heavy top, order of {name}",
        ours=np.log2(coarse / fine),
        reference=order,
        source="theory",
        tolerance=Absolute(0.1),
    )


def azimuth(run: fc.Run) -> np.ndarray:
    return np.unwrap(np.arctan2(-run["x"], run["y"]))


@pytest.mark.parametrize("spin", [40.0, 160.0, 640.0])
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha, fc.ConservingMidpoint])
def test_no_artificial_precession(spin, method):
    """However fast the spin, up to a radian and more a step."""
    rate = MASS * 9.81 * ARM / (ALONG * spin)
    model, start = top(ARM, MASS, ACROSS, ALONG, (0.0, spin, rate))
    run = fc.simulate(model, until=2.0, start=start, method=fc.Unchecked(method(2e-3)))
    assert azimuth(run)[-1] == pytest.approx(2.0 * rate, rel=1e-4)
    assert np.abs(run["z"]).max() < 2e-4 * ARM


@pytest.mark.parametrize("spin", [40.0, 80.0, 160.0])
def test_chosen_steps_see_what_they_miss(spin):
    """Some 500 steps under the default tolerance of 1e-4: 0.05 rad at most."""
    rate = MASS * 9.81 * ARM / (ALONG * spin)
    model, start = top(ARM, MASS, ACROSS, ALONG, (0.0, spin, rate))
    run = fc.simulate(model, until=5.0, start=start)
    assert np.abs(azimuth(run) - rate * run.t).max() < 0.02
    assert np.abs(run["z"]).max() < 0.02 * ARM


@pytest.mark.slow
def test_error_falls_with_the_tolerance():
    """A top that sways at 40 rad/s: its error is that of its steps, not of what they cannot see."""
    model, start = top(ARM, MASS, ACROSS, ALONG, (0.0, 40.0, 0.0))
    offset, turned = MASS * 9.81 * ARM, ALONG * 40.0
    whole = ACROSS + MASS * ARM**2

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        """The axis d and its rate: J₁ d × d̈ + J₃ω ḋ = m g l z × d, the spin about it being constant."""
        d, w = y[:3], y[3:]
        pull = -offset * np.array([0.0, 0.0, 1.0])
        moment = np.cross(d, pull) - turned * w
        return np.append(w, np.cross(moment / whole, d) - (w @ w) * d)

    true = solve_ivp(rates, (0.0, 10.0), [0, 1, 0, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
    errors = []
    for tolerance in (1e-4, 1e-5, 1e-6):
        run = fc.simulate(model, until=10.0, start=start, tolerance=fc.Tolerance(tolerance), every=0.02)
        d = np.array([run[axis] for axis in "xyz"]) / ARM
        errors.append(np.abs(d - true.sol(run.t)[:3]).max())
    assert errors[0] < 0.2
    assert all(4.0 < a / b < 5.5 for a, b in pairwise(errors))


def nut() -> tuple[fc.Model, fc.State]:
    body = fc.RigidBody("nut", (0, 0, 0), 1.0, (1.0, 2.0, 3.0))
    model = fc.assemble(fc.Structure([body]), [fc.LargeRotation()])
    return model, model.rest.with_(v=np.array([0.0, 0.0, 0.0, 1e-3, 2.0, 1e-3]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method", "off"),
    [
        ("ExplicitRungeKutta", fc.ExplicitRungeKutta(), 1e-6),
        ("GeneralizedAlpha of 2 ms, undamped", fc.GeneralizedAlpha(2e-3, rho=1.0), 1e-4),
        ("Richardson of GeneralizedAlpha", fc.Richardson(fc.GeneralizedAlpha(1e-2, rho=1.0)), 1e-4),
    ],
)
def test_dzhanibekov(name, method, off, record):
    """The middle axis turns over when its component of the spin, in the body, goes through zero."""
    model, start = nut()
    room = fc.InMemory(states=1e9)
    tight = fc.Tolerance(0.0, 1e-12)
    run = fc.simulate(model, until=60.0, start=start, method=method, tolerance=tight, record=room)

    def spin(t: float) -> float:
        state = run.at(t).state
        return float(state.R[0][:, 1] @ state.v[3:])

    record(
        f"D23 Dzhanibekov, times of the flips, {name}",
        ours=[brentq(spin, t - 1.0, t + 1.0, xtol=1e-10) for t in FLIPS],
        reference=FLIPS,
        source="Euler's equations",
        tolerance=off,
    )
    if name != "ExplicitRungeKutta":
        return
    final = run.final
    record(
        "D23 Dzhanibekov, angular momentum after 60 s",
        ours=final.R[0] @ np.diag([1.0, 2.0, 3.0]) @ final.R[0].T @ final.v[3:],
        reference=[1e-3, 4.0, 3e-3],
        source="constant",
        tolerance=Absolute(1e-8),
    )
    record(
        "D23 Dzhanibekov, energy after 60 s",
        ours=sum(model.energy(final)[:2]),
        reference=0.5 * (1e-6 + 2 * 4.0 + 3e-6),
        source="constant",
        tolerance=1e-8,
    )
