"""Impacts as deep as micrometres: steps chosen from errors of places follow them, and their speed comes back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

G, LENGTH = 9.81, 10.0


def caught(
    stiffness: float, mass: float, until: float, method: object = None, tolerance: fc.Tolerance | None = None
) -> fc.Run:
    """A mass that falls by half a metre into its rope, again and again."""
    rope = fc.Rope("rope", (0, 0, LENGTH), (0, 0, 0.5), EA=stiffness * LENGTH, length=LENGTH)
    load = fc.PointMass("load", rope.end, mass)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node), fc.Support(load.node, "u v")]
    outputs = [fc.Tension("pull", rope), fc.Position("z", load.node, "z")]
    model = fc.assemble(
        fc.Structure([rope, load], joints, outputs=outputs), [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()]
    )
    return fc.simulate(model, until=until, method=method, tolerance=tolerance or fc.Tolerance())


def bounced(t: float, stiffness: float, mass: float) -> float:
    """Height in closed form: half a fall, and half a swing about the place where the load would hang."""
    omega, fall, speed = np.sqrt(stiffness / mass), np.sqrt(1.0 / G), np.sqrt(G)
    sag, phase = G / omega**2, np.arctan2(speed * omega, G)
    contact = 2.0 * (np.pi - phase) / omega
    t = t % (2.0 * fall + contact)
    if t <= fall:
        return 0.5 - 0.5 * G * t**2
    if t <= fall + contact:
        s = omega * (t - fall)
        return -sag + sag * np.cos(s) - speed / omega * np.sin(s)
    t -= fall + contact
    return speed * t - 0.5 * G * t**2


@pytest.mark.parametrize(
    ("stiffness", "mass"), [(1e6, 1000.0), (1e9, 1000.0), (1e6, 1e-3), (1e9, 1e-3), (1e12, 1.0), (1e14, 1.0)]
)
def test_a_load_comes_back_from_a_rope_however_stiff(stiffness, mass):
    """Default method and tolerance; contacts from 0.1 s to 3 µs."""
    run = caught(stiffness, mass, 3.0)
    peak = mass * G * (1.0 + np.sqrt(1.0 + stiffness / (mass * G)))
    assert run.status is fc.Status.FINISHED
    assert run.report.energy_residual < 2e-3
    assert run["pull"].max() == pytest.approx(peak, rel=5e-3)
    assert run["pull"].min() >= 0.0
    exact = [bounced(t, stiffness, mass) for t in run.t]
    assert np.abs(run["z"] - exact).max() < 4e-3
    assert run.report.steps < 400


def test_a_method_of_high_order_needs_few_more_steps_for_far_less():
    """By the eighth root of the tolerance, as all of its steps do."""
    method = fc.Unchecked(fc.ExplicitRungeKutta())
    loose, tight = (caught(4e5, 350.0, 2.0, method, fc.Tolerance(r, 1e-3 * r)) for r in (1e-4, 1e-9))
    assert tight.report.steps < 6 * loose.report.steps
    assert np.abs(tight["z"] - [bounced(t, 4e5, 350.0) for t in tight.t]).max() < 1e-8


def test_fixed_steps_without_damping_keep_the_energy_of_an_impact_they_do_not_resolve():
    """They may come back too late, but not on the rope: the step that ends at the corner ends in front of it."""
    run = caught(1e8, 1.0, 2.0, fc.GeneralizedAlpha(1e-3, rho=1.0))
    assert run.report.energy_residual < 1e-2


def hung(mass: float, EA: float, up: float, backend: object) -> tuple[fc.Model, fc.State]:
    """A load on a rope of 2 m, let go higher up than where that is taut."""
    load, length = fc.PointMass("load", (0, 0, up - 2.0), mass), 2.0
    rope = fc.Rope("rope", (0, 0, 0), load.node, EA=EA, length=length)
    joints = [fc.Support(load.node, "u v"), fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)]
    structure = fc.Structure([load, rope], joints, outputs=[fc.Velocity("v", load.node, "z")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()], backend)
    return model, model.rest


def hoisted(mass: float, EA: float, up: float, backend: object) -> tuple[fc.Model, fc.State]:
    """The same on the rope of a winch, from whose drum most of it has been paid out."""
    load, top, out = fc.PointMass("load", (0, 0, -1.0), mass), fc.PointMass("top", (0, 0, 0), 1.0), 12.0
    winch = fc.Winch("rope", load.node, top.node, EA=EA, radius=0.1, ratio=10.0, inertia=1e6 * mass)
    structure = fc.Structure(
        [load, top],
        [fc.Support(top.node), fc.Support(load.node, "u v")],
        drives=[winch],
        outputs=[fc.Velocity("v", load.node, "z")],
    )
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()], backend)
    move = np.where(np.array(model.coordinates) == "load_0_w", 1.0 - out + up, (out - 1.0) / 0.01)
    return model, model.advance(model.rest, move, np.zeros(model.n), 0.0)


LET_GO = {
    "rope": (hung, 1.088, 1302915.77344, 0.7816, 0.45, fc.GeneralizedAlpha(1e-3)),
    "heavy": (hung, 357.0, 382264811.46, 0.08641, 0.2, fc.GeneralizedAlpha(1e-3)),
    "chosen steps": (hung, 188.8, 3813854.4, 0.8509, 0.6, None),
    "winch": (hoisted, 19.4980233300813, 117776848.58, 0.2674981284508647, 0.36, fc.GeneralizedAlpha(1e-3)),
}


@pytest.mark.parametrize("backend", [fc.Compiled(), fc.CasadiVM()], ids=["compiled", "plain"])
@pytest.mark.parametrize("case", LET_GO.values(), ids=LET_GO)
def test_what_a_rope_throws_back_falls_freely(case, backend):
    """From the first step on, wherever within the last digits of places that sets out from the corner."""
    make, mass, EA, up, until, method = case
    model, start = make(mass, EA, up, backend)
    run = fc.simulate(model, until=until, start=start, method=method)
    leaves = next(event.t for event in run.events if not event.rising)
    flying = run.t > leaves + 1e-9
    assert flying.sum() > 3
    assert np.diff(run["v"][flying]) == pytest.approx(-G * np.diff(run.t[flying]), abs=1e-6)


@pytest.mark.parametrize("stiffness", [1e4, 1e8, 1e12])
def test_a_block_between_stops_of_any_stiffness(stiffness):
    """2π/ω + 2 b/v, thirty contacts of 30 ms to 3 µs."""
    body = fc.PointMass("block", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=stiffness)
    structure = fc.Structure(
        [body, spring],
        [fc.Support(spring.start), fc.Pin(spring.end, body.node), fc.Support(body.node, "v w")],
        outputs=[fc.Position("x", body.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"spring": 0.02})])
    period = 2.0 * np.pi / np.sqrt(stiffness) + 2.0 * 0.02
    centre = fc.Event("centre", "x", direction=fc.Direction.RISING)
    start = model.rest.with_(v=np.ones(1))
    run = fc.simulate(model, start=start, until=15.2 * period, tolerance=fc.Tolerance(1e-5, 1e-8), events=[centre])
    passing = [event.t for event in run.events if event.name == "centre"]
    assert np.diff(passing) == pytest.approx(period, rel=2e-3)
    assert run.report.energy_residual < 5e-3


def thrown_back(t: np.ndarray, omega: float, zeta: float) -> np.ndarray:
    """Height above the end of a rope that catches what fell by half a metre, and lets go of it when its pull ends."""

    def rates(s: float, y: np.ndarray) -> list[float]:
        pull = max(-(omega**2) * y[0] - 2.0 * zeta * omega * y[1], 0.0) if y[0] < 0.0 else 0.0
        return [y[1], pull - G]

    fall = np.sqrt(1.0 / G)
    inside = solve_ivp(
        rates, (0.0, 6.0 / omega), [-1e-15, -np.sqrt(G)], "DOP853", rtol=1e-12, atol=1e-14, max_step=0.01 / omega
    )
    after = fall + inside.t[-1]
    z, v = inside.y[:, -1]
    s = t - after
    return np.where(t < fall, 0.5 - 0.5 * G * t**2, np.where(s < 0.0, np.nan, z + v * s - 0.5 * G * s**2))


@pytest.mark.parametrize("backend", [None, fc.CasadiVM()], ids=["compiled", "plain"])
@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()], ids=["alpha", "explicit"])
@pytest.mark.parametrize(("omega", "zeta"), [(1000.0, 0.1), (1000.0, 0.02), (1824.0, 0.21), (116.0, 0.056)])
def test_a_damped_catch_is_the_more_exact_the_less_is_allowed(omega, zeta, method, backend):
    """However deep it is: of a millimetre under the default, a tenth of the tolerance was ten times worse."""
    rope = fc.Rope("rope", (0, 0, LENGTH), (0, 0, 0.5), EA=omega**2 * LENGTH, length=LENGTH, damping=2.0 * zeta * omega)
    load = fc.PointMass("load", rope.end, 1.0)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node), fc.Support(load.node, "u v")]
    structure = fc.Structure([rope, load], joints, outputs=[fc.Position("z", load.node, "z")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()], backend)
    for tolerance in (1e-4, 1e-5, 1e-6):
        run = fc.simulate(model, until=0.6, method=method, tolerance=fc.Tolerance(tolerance, 1e-3 * tolerance))
        true = thrown_back(run.t, omega, zeta)
        seen = ~np.isnan(true)
        assert np.abs(run["z"] - true)[seen].max() < 2e-3 * (tolerance / 1e-4) ** (2.0 / 3.0)
        assert run.report.steps < 80.0 * (tolerance / 1e-4) ** (-1.0 / 3.0)
