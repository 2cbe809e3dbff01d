"""Tensions of stiff ropes in rows between steps: places leave the rope's circle there, what it bears does not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

MASS, LENGTH, G, SWING = 500.0, 3.0, 9.81, 0.3


def pendulum(stiffness: float) -> fc.Model:
    """A load on a rope that bears it from the start on, with a twentieth of critical damping along it."""
    start = (LENGTH * np.sin(SWING), 0, -LENGTH * np.cos(SWING))
    damping = 0.1 * np.sqrt(stiffness / LENGTH * MASS)
    drawn = LENGTH / (1.0 + MASS * G * np.cos(SWING) / stiffness)
    rope = fc.Rope("rope", (0, 0, 0), start, EA=stiffness, length=drawn, damping=damping)
    load = fc.PointMass("load", start, MASS)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    outputs = [fc.Tension("tension", rope), fc.Position("x", load.node, "x")]
    plan = fc.Structure([rope, load], joints, outputs=outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])


def right(t: np.ndarray) -> np.ndarray:
    """The tension of a rigid rope."""
    angle, rate = solve_ivp(
        lambda _, y: [y[1], -G / LENGTH * np.sin(y[0])], (0.0, t[-1]), [SWING, 0.0],
        t_eval=t, rtol=1e-10, atol=1e-12,
    ).y  # fmt: skip
    return np.asarray(MASS * (G * np.cos(angle) + LENGTH * rate**2))


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.05), fc.Richardson(fc.GeneralizedAlpha(0.05))])
@pytest.mark.parametrize("stiffness", [5e7, 1e9], ids="{:.0e}".format)
def test_rows_between_steps(stiffness, method):
    """They were off by 126 % of the tension's range, where steps were right to 4 %."""
    run = fc.simulate(pendulum(stiffness), until=6.0, method=method, every=0.01)
    calm = run.t > 1.0
    truth = right(run.t)
    assert np.abs(run["tension"] - truth)[calm].max() < 0.07 * np.ptp(truth)
    dense = np.array([run.at(t)["tension"] for t in run.t[calm][::10]])
    assert np.abs(dense - truth[calm][::10]).max() < 0.07 * np.ptp(truth)


def test_an_event_between_steps():
    """The tension passes the weight four times in a swing, no oftener."""
    event = fc.Event("heavy", "tension", MASS * G)
    run = fc.simulate(pendulum(5e7), until=6.0, method=fc.GeneralizedAlpha(0.05), events=[event])
    fine = np.linspace(0.0, 6.0, 6001)
    signs = np.sign(right(fine) - MASS * G)
    crossings = fine[1:][np.diff(signs) != 0.0]
    found = np.array([e.t for e in run.events if e.t > 0.1])
    assert found == pytest.approx(crossings[crossings > 0.1], abs=0.02)
    assert all(e.signals["tension"] == pytest.approx(MASS * G, rel=1e-3) for e in run.events if e.t > 0.1)


def test_what_steps_resolve_is_interpolated_as_all_else():
    """A soft rope rings at 8 rad/s, of which steps of 20 ms see all: cubic in places, not straight."""
    model = pendulum(1e5)
    coarse = fc.simulate(model, until=2.0, method=fc.GeneralizedAlpha(0.02), every=0.005)
    fine = fc.simulate(model, until=2.0, method=fc.GeneralizedAlpha(0.005), every=0.005)
    assert np.abs(coarse["tension"] - fine["tension"]).max() < 0.01 * np.ptp(fine["tension"])


def elastic(t: np.ndarray, stiffness: float) -> np.ndarray:
    """The tension of the elastic rope itself, by the equations of a mass on a damped spring in the plane."""
    drawn = LENGTH / (1.0 + MASS * G * np.cos(SWING) / stiffness)
    damping = 0.1 * np.sqrt(stiffness / LENGTH * MASS)

    def pull(place, rate):
        long = np.hypot(*place)
        return stiffness / drawn * (long - drawn) + damping * (place * rate).sum(axis=0) / long

    def slope(_, y):
        place, rate = y[:2], y[2:]
        return [*rate, *(-pull(place, rate) / MASS * place / np.hypot(*place) - [0.0, G])]

    start = [LENGTH * np.sin(SWING), -LENGTH * np.cos(SWING), 0.0, 0.0]
    y = solve_ivp(slope, (0.0, t[-1]), start, method="DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y
    return np.asarray(pull(y[:2], y[2:]))


@pytest.mark.parametrize("turn", [1.5, 2.5])
@pytest.mark.parametrize("stiffness", [1e5, 1e6], ids="{:.0e}".format)
def test_a_polynomial_of_many_stages_follows_more_than_a_radian(stiffness, turn):
    """Straight lines between the ends of its steps were off by 0.4 to 11 % of the range."""
    method = fc.ExplicitRungeKutta(turn / np.sqrt(stiffness / LENGTH / MASS))
    run = fc.simulate(pendulum(stiffness), until=3.0, method=method, every=0.003)
    truth = elastic(run.t, stiffness)
    assert np.abs(run["tension"] - truth).max() < 1e-3 * np.ptp(truth)


def caught() -> fc.Model:
    """A load that falls into a slack rope, whose damping bears at once."""
    start = (LENGTH * np.sin(SWING), 0, -LENGTH * np.cos(SWING))
    rope = fc.Rope("rope", (0, 0, 0), start, EA=5e7, length=1.01 * LENGTH, damping=1e4)
    load = fc.PointMass("load", start, MASS)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    plan = fc.Structure([rope, load], joints, outputs=[fc.Tension("tension", rope)])
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.01), fc.AdaptiveAlpha()], ids=["fixed", "adaptive"])
def test_rows_beyond_a_catch_are_what_is_asked_for_there(method):
    """The step from a damped corner starts beyond it, where the rope bears; what was asked for was 2.5 % off."""
    run = fc.simulate(caught(), until=0.3, method=fc.Unchecked(method), every=0.0013)
    assert any(event.rising for event in run.events)
    asked = np.array([run.at(t)["tension"] for t in run.t])
    assert np.abs(asked - run["tension"]).max() < 1e-6 * np.ptp(run["tension"])
