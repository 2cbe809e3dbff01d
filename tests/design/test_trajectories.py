from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import linprog

from flexctrl.design import (
    Constant,
    ControllerError,
    MinimumJerk,
    PiecewisePolynomial,
    Ramp,
    Shaped,
    Spline,
    Step,
    Sum,
    Table,
    TimeOptimalPendulum,
    TrapezoidalVelocity,
    zvd,
)

G = 9.81

CONTINUOUS = {
    "ramp": Ramp(2.0, 1.5, at=0.5, start=-1.0),
    "endless ramp": Ramp(-0.7),
    "trapezoid": TrapezoidalVelocity(5.0, 1.0, 0.5, at=0.2, start=1.0),
    "triangle": TrapezoidalVelocity(-0.3, 1.0, 0.5),
    "minimum jerk": MinimumJerk(-2.0, 3.0, at=1.0, start=0.5),
    "table": Table((0.0, 1.0, 1.5, 4.0), (1.0, -1.0, 2.0, 2.5)),
    "spline": Spline((0.0, 1.0, 1.5, 4.0), (1.0, -1.0, 2.0, 2.5)),
    "time-optimal": TimeOptimalPendulum(1.0, 0.5, math.sqrt(G)),
    "shaped": Shaped(TrapezoidalVelocity(5.0, 1.0, 0.5), zvd(3.0, 0.05)),
    "sum": Sum((MinimumJerk(1.0, 2.0), Ramp(0.3, at=1.0))),
}


@pytest.mark.parametrize("path", CONTINUOUS.values(), ids=CONTINUOUS.keys())
def test_value_is_the_integral_of_the_rate(path):
    ends = [-1.0, *(b for b in path.breaks if -1 < b < 6.0), 6.0]
    for a, b in pairwise(ends):
        area, _ = quad(path.rate, a, b, epsabs=1e-13)
        assert path(b - 1e-13) - path(a) == pytest.approx(area, abs=1e-10)


@pytest.mark.parametrize(
    "path", [p for n, p in CONTINUOUS.items() if n not in ("ramp", "endless ramp", "table", "sum")]
)
def test_rate_is_the_integral_of_the_acceleration(path):
    ends = [-1.0, *(b for b in path.breaks if -1 < b < 6.0), 6.0]
    for a, b in pairwise(ends):
        area, _ = quad(path.derivative.rate, a, b, epsabs=1e-13)
        assert path.rate(b - 1e-13) - path.rate(a) == pytest.approx(area, abs=1e-10)


def test_step_takes_its_new_value_at_the_step_and_has_no_rate():
    step = Step(2.0, at=1.0, start=3.0)
    assert (step(0.999999), step(1.0), step(9.0)) == (3.0, 5.0, 5.0)
    assert step.rate(1.0) == 0.0
    assert step.breaks == (1.0,)


@given(k=st.integers(1, 100_000), h=st.sampled_from([1e-3, 0.01, 0.1, 1 / 3]))
def test_round_off_in_a_sample_instant_does_not_delay_a_step(k, h):
    accumulated = k * h
    assert Step(1.0, at=math.nextafter(accumulated, math.inf))(accumulated) == 1.0
    assert Step(1.0, at=accumulated)(accumulated - 1e-6 * h) == 0.0


@settings(max_examples=200)
@given(
    distance=st.floats(-50, 50).filter(lambda d: abs(d) > 1e-3),
    speed=st.floats(0.05, 5),
    acceleration=st.floats(0.05, 5),
)
def test_trapezoid_obeys_its_limits_and_takes_the_shortest_time(distance, speed, acceleration):
    path = TrapezoidalVelocity(distance, speed, acceleration, at=1.0, start=2.0)
    d, full = abs(distance), speed**2 / acceleration
    shortest = d / speed + speed / acceleration if d > full else 2 * math.sqrt(d / acceleration)
    assert path.duration == pytest.approx(shortest, rel=1e-12)
    assert path(1.0 + path.duration) == 2.0 + distance
    times = np.linspace(0.5, 1.5 + path.duration, 300)
    assert max(abs(path.rate(t)) for t in times) <= speed * (1 + 1e-12)
    assert max(abs(path.derivative.rate(t)) for t in times) <= acceleration * (1 + 1e-12)
    middle = 1.0 + path.duration / 2
    assert path(middle) == pytest.approx(2.0 + distance / 2)


def test_trapezoid_without_distance_stays():
    assert TrapezoidalVelocity(0.0, 1.0, 1.0, start=4.0)(3.0) == 4.0


def test_minimum_jerk_closed_form():
    d, T = 3.0, 2.0
    path = MinimumJerk(d, T)
    assert path(T / 2) == pytest.approx(d / 2)
    assert path.rate(T / 2) == pytest.approx(15 / 8 * d / T)
    peak = T * (0.5 - math.sqrt(3) / 6)
    assert path.derivative.rate(peak) == pytest.approx(10 / math.sqrt(3) * d / T**2)
    ends = (path.rate(0.0), path.derivative.rate(0.0), path.rate(T), path.derivative.rate(T))
    assert ends == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert path(T) == d


def test_table_is_linear_interpolation():
    times, values = (0.0, 0.4, 1.0, 3.0), (2.0, -1.0, 0.5, 0.5)
    path, at = Table(times, values), np.linspace(-1, 4, 173)
    np.testing.assert_allclose([path(t) for t in at], np.interp(at, times, values), atol=1e-14)


def test_spline_passes_its_points_smoothly_and_starts_and_ends_at_rest():
    times, values = (0.0, 0.4, 1.0, 3.0), (2.0, -1.0, 0.5, 0.5)
    path, bend = Spline(times, values), Spline(times, values).derivative.derivative
    np.testing.assert_allclose([path(t) for t in times], values, atol=1e-13)
    assert (path.rate(0.0), path.rate(3.0 - 1e-12)) == pytest.approx((0.0, 0.0), abs=1e-9)
    for t in times[1:-1]:
        assert bend(t - 1e-9) == pytest.approx(bend(t), abs=1e-6)


# length, acceleration, distance, switches and end (reference case C8)
QUICKEST = [
    (1.0, 1.0, 1.0, (0.73042772, 1.20191665, 1.67340558, 2.40383329)),
    (1.0, 0.5, 1.0, (1.15347763, 1.49392311, 1.83436858, 2.98784621)),
    (0.5, 0.6, 0.5, (0.71714511, 0.99240688, 1.26766865, 1.98481376)),
    (10.0, 0.3, 10.0, (5.41591444, 5.79884516, 6.18177589, 11.59769032)),
    (25.0, 0.6, 40.0, (7.15981103, 8.33137346, 9.50293589, 16.66274692)),
]


@pytest.mark.parametrize(("length", "limit", "distance", "switches"), QUICKEST)
def test_time_optimal_switches(length, limit, distance, switches):
    path = TimeOptimalPendulum(distance, limit, math.sqrt(G / length))
    np.testing.assert_allclose(path.switches, switches, atol=1.5e-8)


@settings(max_examples=60)
@given(distance=st.floats(-60, 60).filter(lambda d: abs(d) > 0.01), limit=st.floats(0.05, 3), length=st.floats(0.2, 40))
def test_time_optimal_move_ends_at_rest_with_the_load_at_rest(distance, limit, length):
    omega = math.sqrt(G / length)
    path = TimeOptimalPendulum(distance, limit, omega)
    # θ̈ = −ω² θ − a/ℓ, solved exactly between the switches.
    A = np.array([[0, 1, 0], [-(omega**2), 0, -1 / length], [0, 0, 0]])
    state, edges = np.zeros(2), (0.0, *path.switches)
    for a, b in pairwise(edges):
        acceleration = path.derivative.rate((a + b) / 2)
        assert abs(acceleration) == pytest.approx(limit)
        state = (expm(A * (b - a)) @ [*state, acceleration])[:2]
    np.testing.assert_allclose(state * [1, 1 / omega], 0.0, atol=1e-9)
    end = path.duration - 1e-13
    assert (path(end), path.rate(end)) == pytest.approx((distance, 0.0), abs=1e-9)


@pytest.mark.parametrize(("length", "limit", "distance", "switches"), QUICKEST[:3])
def test_no_quicker_move_exists(length, limit, distance, switches):
    assert _feasible(length, limit, distance, 1.002 * switches[-1])
    assert not _feasible(length, limit, distance, 0.998 * switches[-1])


def _feasible(length, limit, distance, duration, intervals=400):
    """Whether any piecewise constant |a| <= limit brings trolley and pendulum from rest to rest."""
    h, omega = duration / intervals, math.sqrt(G / length)
    start = np.arange(intervals) * h
    left = duration - start
    position = (left**2 - (left - h) ** 2) / 2
    sine = np.cos(omega * (left - h)) - np.cos(omega * left)
    cosine = np.sin(omega * left) - np.sin(omega * (left - h))
    rows = np.array([np.full(intervals, h), position, sine, cosine])
    result = linprog(np.zeros(intervals), A_eq=rows, b_eq=[0, distance, 0, 0], bounds=(-limit, limit))
    return result.status == 0


def test_move_of_whole_swings_needs_one_switch():
    # Half the unswung time a whole number of periods: plain bang-bang leaves no sway (ω T/2 = π).
    omega, limit = 2.0, 0.5
    half = 2 * math.pi / omega
    path = TimeOptimalPendulum(limit * half**2, limit, omega)
    assert path.duration == pytest.approx(2 * half, rel=1e-9)


@pytest.mark.parametrize("duration", [3.0, 5.5, 6.343739])
def test_sway_after_constant_acceleration(duration):
    # C9: (2 a/g) |sin(ω t_a/2)| after accelerating at a for t_a seconds.
    a, length = 0.3, 10.0
    omega = math.sqrt(G / length)
    path = TrapezoidalVelocity(1000.0, a * duration, a)
    sine, _ = quad(lambda t: path.derivative.rate(t) * math.sin(omega * t), 0, duration)
    cosine, _ = quad(lambda t: path.derivative.rate(t) * math.cos(omega * t), 0, duration)
    sway = math.hypot(sine, cosine) / (length * omega)
    assert sway == pytest.approx(2 * a / G * abs(math.sin(omega * duration / 2)), abs=1e-9)


def test_sum_adds_up_and_knows_all_breaks():
    path = Sum((Step(1.0, at=2.0), Ramp(1.0, 1.0), Constant(3.0)))
    assert path(2.5) == 5.0
    assert path.breaks == (0.0, 1.0, 2.0)
    assert path.rate(0.5) == 1.0


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: TrapezoidalVelocity(1.0, -1.0, 1.0), "speed = -1.0 must be > 0"),
        (lambda: TrapezoidalVelocity(math.nan, 1.0, 1.0), "not a finite number"),
        (lambda: MinimumJerk(1.0, 0.0), "duration = 0.0"),
        (lambda: Table((0.0, 1.0, 1.0), (0.0, 1.0, 2.0)), "must increase: 1.0 s comes too early"),
        (lambda: Table((0.0,), (0.0,)), "two or more times"),
        (lambda: Spline((0.0, 1.0), (0.0, math.inf)), "not a finite number"),
        (lambda: PiecewisePolynomial((1.0, 0.0), ((1.0,), (2.0,))), "must increase"),
        (lambda: TimeOptimalPendulum(0.0, 1.0, 1.0), "distance = 0.0"),
        (lambda: Step(math.inf), "not a finite number"),
    ],
)
def test_what_cannot_be_is_refused_at_construction(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()
