"""The three controllers of the bridge crane on a rigid crane with a swinging load (assumed 32 t data)."""

from __future__ import annotations

import math
from itertools import pairwise

import control as ct
import numpy as np
import pytest
from scipy.linalg import expm

from flexctrl.design import (
    FeedForward,
    RateLimited,
    Sampled,
    Saturated,
    Shaped,
    Step,
    Tracking,
    TrapezoidalVelocity,
    as_controller,
    bryson,
    lqr,
    pd,
    state_feedback,
    zvd,
)

G, ROPE, LOAD, BRIDGE = 9.81, 10.0, 32e3, 41e3  # m/s², m, kg, kg: trolley and bridge travel together
DISTANCE, FORCE = 5.0, 6e4
OUTPUTS = ("travel", "travel_rate", "sway", "sway_rate")
KP, KD = 4e5, 6e5


def linear_crane() -> ct.StateSpace:
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1, 2], A[3, 2] = LOAD * G / BRIDGE, -(BRIDGE + LOAD) * G / (BRIDGE * ROPE)
    B = [[0.0], [1 / BRIDGE], [0.0], [-1 / (BRIDGE * ROPE)]]
    return ct.StateSpace(A, B, np.eye(4), 0, 0, inputs=["force"], outputs=OUTPUTS, states=OUTPUTS)


def crane(x, force):
    """Exact equations of a driven bridge with a point load on a stiff rope."""
    _, v, sway, rate = x
    sine, cosine = math.sin(sway), math.cos(sway)
    acceleration = (force + LOAD * sine * (ROPE * rate**2 + G * cosine)) / (BRIDGE + LOAD * sine**2)
    return np.array([v, acceleration, rate, -(acceleration * cosine + G * sine) / ROPE])


def held(x, force, h):
    """One sample with the force held: Runge-Kutta 4, whose error is 1e-11 at 100 Hz."""
    a = crane(x, force)
    b = crane(x + h / 2 * a, force)
    c = crane(x + h / 2 * b, force)
    return x + h / 6 * (a + 2 * b + 2 * c + crane(x + h * c, force))


def drive(controller, until=60.0):
    """Sampled control of the nonlinear crane from rest; times, states and forces."""
    controller = as_controller(controller, ["force"], OUTPUTS)
    place = [OUTPUTS.index(name) for name in controller.inputs]
    h, x, z = controller.sample_time, np.zeros(4), controller.initial()
    states, forces = [], []
    for k in range(round(until / h)):
        force = controller.command(k * h, z, x[place])
        z = controller.update(k * h, z, x[place])
        states.append(x)
        forces.append(force[0])
        x = held(x, force[0], h)
    return h * np.arange(len(states)), np.array(states), np.array(forces)


def swinging_mode() -> tuple[float, float]:
    """Frequency and damping of the load under PD: what the shaper has to be made for."""
    loop = ct.interconnect(
        [linear_crane(), pd(KP, KD, measured="travel", rate="travel_rate", command="force")],
        inputs=["force"],
        outputs=list(OUTPUTS),
    )
    slow = min((p for p in loop.poles() if p.imag > 0), key=lambda p: -p.real)
    return abs(slow), -slow.real / abs(slow)


def following(move):
    law = pd(KP, KD, measured="travel", rate="travel_rate", command="force")
    tracking = Tracking(Sampled(law, 0.01), {"travel": move, "travel_rate": move.derivative})
    return Saturated(tracking, {"force": FORCE})


def residual_sway(t, x, after):
    """Sway amplitude left after an instant, rad."""
    energy = x[:, 3] ** 2 / 2 + G / ROPE * (1 - np.cos(x[:, 2]))
    return math.sqrt(2 * energy[t >= after].max() * ROPE / G)


MOVE = TrapezoidalVelocity(DISTANCE, 1.0, 0.35)


def test_shaping_removes_the_swing_that_pd_leaves():
    shaper = zvd(*swinging_mode())
    arrival = MOVE.duration + shaper.duration
    t, plain, plain_force = drive(following(MOVE))
    _, shaped, force = drive(following(Shaped(MOVE, shaper)))
    assert np.abs(plain_force).max() < FORCE  # linear enough for the shaper to be exact
    assert residual_sway(t, plain, arrival) > 0.02
    assert residual_sway(t, shaped, arrival) < 0.03 * residual_sway(t, plain, arrival)
    assert np.abs(force).max() <= np.abs(plain_force).max()
    assert shaped[-1, 0] == pytest.approx(DISTANCE, abs=2e-3)


def test_a_shaped_reference_leaves_the_linear_loop_free_of_its_mode():
    # Whatever the loop, the shaper's zeros cancel the pole pair: its modal amplitude is zero from the last impulse.
    plant, (omega, zeta) = linear_crane(), swinging_mode()
    A = plant.A - plant.B @ np.array([[KP, KD, 0.0, 0.0]])
    pole = omega * (-zeta + 1j * math.sqrt(1 - zeta**2))
    values, left = np.linalg.eig(A.T)
    mode = left[:, np.argmin(abs(values - pole))]
    shaper = zvd(omega, zeta)
    left_over = {}
    for name, step in (("plain", Step(1.0)), ("shaped", Shaped(Step(1.0), shaper))):
        x, ends = np.zeros(4), [*step.breaks, 15.0]
        for a, b in pairwise(ends):
            rest = np.array([step(a), 0.0, 0.0, 0.0])
            x = rest + expm(A * (b - a)) @ (x - rest)
        left_over[name] = abs(mode @ (x - [1.0, 0.0, 0.0, 0.0]))
    assert left_over["shaped"] < 1e-10 * left_over["plain"]


def test_lqr_of_the_rigid_crane_stops_without_swing_within_its_limits():
    plant = linear_crane()
    regulator = lqr(plant, *bryson(plant, {"travel": 1.0, "sway": 0.03, "sway_rate": 0.03}, {"force": FORCE}))
    law = state_feedback(regulator.gain, plant)
    reference = {"travel": MOVE, "travel_rate": MOVE.derivative}
    hardware = RateLimited(Saturated(Sampled(Tracking(law, reference), 0.01), {"force": FORCE}), {"force": 3e5})
    t, x, force = drive(hardware)
    assert np.abs(force).max() <= FORCE
    assert np.abs(np.diff(force, prepend=0.0)).max() <= 3e5 * 0.01 * (1 + 1e-12)
    assert residual_sway(t, x, 40.0) < 2e-3
    assert x[-1, 0] == pytest.approx(DISTANCE, abs=5e-3)


def test_feed_forward_takes_the_lag_out_of_tracking():
    acceleration = MOVE.derivative.derivative
    both = BRIDGE + LOAD
    law = Tracking(
        Sampled(pd(KP, KD, measured="travel", rate="travel_rate", command="force"), 0.01),
        {"travel": MOVE, "travel_rate": MOVE.derivative},
    )
    wanted = np.array([MOVE(0.01 * k) for k in range(600)])
    _, plain, _ = drive(law, until=6.0)
    _, helped, _ = drive(FeedForward(law, {"force": lambda t: both * acceleration(t)}), until=6.0)
    errors = [np.abs(run[:, 0] - wanted).max() for run in (plain, helped)]
    assert errors[1] < 0.7 * errors[0]
