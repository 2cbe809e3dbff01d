from __future__ import annotations

import math
import pickle
from itertools import pairwise

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from flexctrl.design import (
    CoarseGridWarning,
    Constant,
    ControllerError,
    MinimumJerk,
    OpenLoop,
    Ramp,
    Sampled,
    Shaped,
    Shaper,
    Spline,
    Step,
    Sum,
    Tracking,
    TrapezoidalVelocity,
    convolve,
    ei,
    fir,
    pi,
    um_zv,
    um_zv_fit,
    um_zvd,
    um_zvd_fit,
    zv,
    zvd,
    zvdd,
)

G = 9.81
RATIOS = np.array([0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2])

# Reference case C7 (formulas of the CRAWLAB toolbox and Klipper): residual in % at RATIOS, width of the 5 % band.
TABLE = [
    (zv, 0.0, (30.9017, 15.6434, 7.8459, 0, 7.8459, 15.6434, 30.9017), 0.0636),
    (zvd, 0.0, (9.5492, 2.4472, 0.6156, 0, 0.6156, 2.4472, 9.5492), 0.2871),
    (zvdd, 0.0, (2.9508, 0.3828, 0.0483, 0, 0.0483, 0.3828, 2.9508), 0.4803),
    (um_zv_fit, 0.0, (33.865, 17.604, 8.980, 0.060, 9.141, 18.587, 38.123), 0.0552),
    (um_zvd_fit, 0.0, (10.891, 2.908, 0.758, 0.017, 0.776, 3.137, 12.875), 0.2582),
    (zv, 0.05, (28.966, 14.548, 7.268, 0, 7.211, 14.321, 28.069), 0.0690),
    (zvd, 0.05, (8.390, 2.116, 0.528, 0, 0.520, 2.051, 7.878), 0.3117),
    (zv, 0.1, (27.040, 13.472, 6.704, 0, 6.599, 13.053, 25.385), 0.0751),
    (zvd, 0.1, (7.311, 1.815, 0.449, 0, 0.435, 1.704, 6.444), 0.3402),
]
FAMILIES = [zv, zvd, zvdd, um_zv, um_zvd]
mode = {"omega": st.floats(0.01, 1e3), "zeta": st.floats(0.0, 0.29)}


@pytest.mark.parametrize(("design", "zeta", "percent", "width"), TABLE)
def test_published_residuals_and_widths(design, zeta, percent, width):
    omega = 3.7
    shaper = design(omega, zeta)
    np.testing.assert_allclose(100 * shaper.residual(RATIOS * omega, zeta), percent, atol=1e-3)
    assert shaper.insensitivity(omega, zeta) == pytest.approx(width, abs=1.5e-4)


@pytest.mark.parametrize("design", FAMILIES)
@settings(max_examples=50)
@given(**mode)
def test_nothing_is_left_at_the_design_mode(design, omega, zeta):
    assert design(omega, zeta).residual(omega, zeta) < 1e-11


@pytest.mark.parametrize("design", [zvd, zvdd, um_zvd])
@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.2])
def test_robust_shapers_have_no_slope_at_the_design_mode(design, zeta):
    shaper = design(1.0, zeta)
    assert shaper.residual(1.0 + 1e-5, zeta) < 1e-8


def test_zvdd_has_no_curvature_either():
    assert zvdd(1.0).residual(1.0 + 1e-3) < 1e-8


def test_ei_touches_its_tolerance_and_vanishes_on_both_sides():
    shaper = ei(2.0, tolerance=0.05)
    assert shaper.residual(2.0) == pytest.approx(0.05, abs=1e-12)
    for ratio in (0.8599513, 2 - 0.8599513):
        assert shaper.residual(2.0 * ratio) < 1e-7
    assert shaper.insensitivity(2.0) == pytest.approx(0.3995, abs=1e-4)


@pytest.mark.parametrize("zeta", [0.01, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("tolerance", [0.05, 0.1])
def test_damped_ei_fit_is_as_good_as_a_fit_can_be(zeta, tolerance):
    shaper = ei(1.0, zeta, tolerance)
    assert shaper.residual(1.0, zeta) == pytest.approx(tolerance, rel=0.04)
    assert shaper.insensitivity(1.0, zeta, 1.05 * tolerance) > zvd(1.0, zeta).insensitivity(1.0, zeta, tolerance)


def test_undamped_um_zv_acts_at_a_sixth_and_a_third_of_the_period():
    period = 2 * math.pi / 1.3
    assert um_zv(1.3).times == pytest.approx((0.0, period / 6, period / 3), rel=1e-12)


@pytest.mark.parametrize(("exact", "fit"), [(um_zv, um_zv_fit), (um_zvd, um_zvd_fit)])
@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.3])
def test_unity_magnitude_fits_are_near_the_exact_times(exact, fit, zeta):
    assert exact(1.0, zeta).times == pytest.approx(fit(1.0, zeta).times, abs=2e-3 * 2 * math.pi)


@settings(max_examples=50)
@given(omega=st.floats(0.1, 10), zeta=st.floats(0, 0.5), met=st.floats(0.1, 10))
def test_residual_is_the_vibration_a_simulation_leaves(omega, zeta, met):
    # q̈ + 2ζω q̇ + ω² q = ω² impulse train, exactly; against one unit impulse at the last time.
    shaper = zvd(omega, zeta)
    A = np.array([[0, 1], [-(met**2), -2 * zeta * met]])
    state = sum(
        a * expm(A * (shaper.duration - t)) @ [0, met] for a, t in zip(shaper.amplitudes, shaper.times, strict=True)
    )
    damped = met * math.sqrt(1 - zeta**2)
    amplitude = math.hypot(state[0], (state[1] + zeta * met * state[0]) / damped)
    assert shaper.residual(met, zeta) == pytest.approx(amplitude * damped / met, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("zeta", [0.0, 0.1])
@pytest.mark.parametrize("design", [zv, zvd, zvdd, ei])
def test_band_ends_where_the_residual_passes_the_tolerance(design, zeta):
    shaper, tolerance = design(5.0, zeta), 0.06
    low, high = shaper.band(5.0, zeta, tolerance)
    assert (shaper.residual(low, zeta), shaper.residual(high, zeta)) == pytest.approx((0.06, 0.06), rel=1e-6)
    assert shaper.residual(np.linspace(low, high, 5000), zeta).max() <= tolerance * (1 + 1e-6)


def test_a_narrow_hump_ends_the_band():
    # EI at 5 % stands between its zeros at 0.86 and 1.14: at 4.99 % a hump 1.2 % wide lies across.
    _, high = ei(1.0).band(0.86, tolerance=0.0499)
    assert 0.98 < high < 1.0
    assert ei(1.0).band(0.86, tolerance=0.0501)[1] > 1.19


def test_band_is_empty_where_the_residual_is_too_large_and_endless_with_strong_damping():
    assert zv(1.0).band(2.0) == (2.0, 2.0)
    assert zvd(1.0, 0.8).band(1.0, 0.8)[1] == math.inf


# Double-pendulum cranes of reference case C6: rope lengths, payload/hook mass ratio, frequencies in rad/s.
DOUBLE = [
    (1, 1, 1, 2.39719940, 5.78735130),
    (2, 1, 0.5, 1.99799401, 4.25211947),
    (6, 2, 10, 1.11709286, 8.40785963),
    (10, 1.5, 5, 0.93263560, 6.65253266),
    (20, 4, 50, 0.64021032, 12.23450574),
]


def double_pendulum(upper, lower, ratio):
    total = (1 + ratio) * (1 / upper + 1 / lower)
    beta = math.sqrt(total**2 - 4 * (1 + ratio) / (upper * lower))
    return math.sqrt(G / 2 * (total - beta)), math.sqrt(G / 2 * (total + beta))


@pytest.mark.parametrize(("upper", "lower", "ratio", "slow", "fast"), DOUBLE)
@pytest.mark.parametrize("design", [zv, zvd])
def test_two_modes_by_convolution(upper, lower, ratio, slow, fast, design):
    modes = double_pendulum(upper, lower, ratio)
    assert modes == pytest.approx((slow, fast), abs=1e-8)
    shaper = convolve(design(modes[0]), design(modes[1]))
    np.testing.assert_array_less(shaper.residual(np.array(modes)), 1e-10)
    assert shaper.duration == pytest.approx(design(modes[0]).duration + design(modes[1]).duration)
    assert sum(shaper.amplitudes) == pytest.approx(1.0, abs=1e-12)


def test_two_modes_far_apart():
    # D24: the lower rope a thousandth of the upper, the second frequency goes as √(g (1+R)/L₂).
    slow, fast = double_pendulum(10.0, 0.01, 5.0)
    assert fast == pytest.approx(math.sqrt(G * 6.0 / 0.01), rel=1e-3)
    shaper = convolve(zv(slow), zv(fast))
    assert max(shaper.residual(slow), shaper.residual(fast)) < 1e-10
    with pytest.warns(CoarseGridWarning, match="coarser than a twentieth"):
        fir(shaper, 2 * math.pi / fast / 19, source="raw", shaped="smooth")


def test_convolution_merges_impulses_and_does_not_mind_order():
    assert convolve(zv(1.0, 0.1), zv(1.0, 0.1)).times == pytest.approx(zvd(1.0, 0.1).times)
    assert convolve(zv(1.0, 0.1), zv(1.0, 0.1)).amplitudes == pytest.approx(zvd(1.0, 0.1).amplitudes)
    one, other = convolve(zv(1.0), ei(2.6)), convolve(ei(2.6), zv(1.0))
    assert one.times == pytest.approx(other.times)
    assert one.amplitudes == pytest.approx(other.amplitudes)
    assert convolve().amplitudes == (1.0,)


@pytest.mark.parametrize(
    "move",
    [
        MinimumJerk(2.0, 1.5, at=0.3, start=1.0),
        Spline((0.0, 1.0, 1.5, 4.0), (1.0, -1.0, 2.0, 2.5)),
        Ramp(0.5, at=-0.2),
        Sum((Step(1.0, at=0.5), MinimumJerk(2.0, 1.5))),
        Shaped(TrapezoidalVelocity(5.0, 1.0, 0.5), zv(9.0)),
        Constant(3.0),
    ],
)
def test_shaped_is_the_sum_of_delayed_copies(move):
    shaper = zvd(4.0, 0.1)
    shaped = Shaped(move, shaper)
    for t in np.linspace(-1, 9, 97):
        copies = list(zip(shaper.amplitudes, shaper.times, strict=True))
        assert shaped(t) == pytest.approx(sum(a * move(t - d) for a, d in copies), abs=1e-14)
        assert shaped.rate(t) == pytest.approx(sum(a * move.rate(t - d) for a, d in copies), abs=1e-13)


def test_shaped_move_arrives_one_shaper_later():
    move, shaper = MinimumJerk(2.0, 1.5, at=0.3), zvd(4.0, 0.1)
    shaped = Shaped(move, shaper)
    assert shaped(0.3 + 1.5 + shaper.duration) == pytest.approx(2.0, abs=1e-14)
    assert shaped.breaks == pytest.approx(sorted(b + d for b in (0.3, 1.8) for d in shaper.times))
    for path in (shaped, Shaped(Sum((move, move)), shaper)):
        assert path(1.0) == pickle.loads(pickle.dumps(path))(1.0)


@pytest.mark.parametrize("zeta", [0.0, 0.03])
def test_any_shaped_move_leaves_a_linear_load_at_rest(zeta):
    omega = 1.7
    command = Shaped(TrapezoidalVelocity(3.0, 0.8, 0.7), zvd(omega, zeta))

    def slope(t, s):
        return [s[1], -2 * zeta * omega * s[1] - omega**2 * s[0] - command.derivative.rate(t)]

    state = np.zeros(2)
    ends = [*command.breaks]
    for a, b in pairwise(ends):
        inside = (a + 1e-9 * (b - a), b - 1e-9 * (b - a))
        state = solve_ivp(slope, inside, state, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    assert math.hypot(state[0], state[1] / omega) < 1e-7


@pytest.mark.parametrize("design", [zv, zvd])
def test_shaped_move_of_a_real_pendulum(design):
    # Swing of 5° under a unit-speed trolley: θ̈ = −(g sin θ + a cos θ)/ℓ, with the small-angle shaper.
    length, omega = 10.0, math.sqrt(G / 10.0)
    speed = math.radians(5.0) * math.sqrt(G * length)  # a jump to this speed swings out 5°

    def swing(jumps):
        theta, rate, t = 0.0, 0.0, 0.0
        for size, at in jumps:
            if at > t:
                run = solve_ivp(
                    lambda _, s: [s[1], -G / length * math.sin(s[0])], (t, at), [theta, rate], rtol=1e-11, atol=1e-13
                )
                theta, rate, t = *run.y[:, -1], at
            rate -= size * speed * math.cos(theta) / length
        energy = rate**2 / 2 + G / length * (1 - math.cos(theta))
        return math.acos(1 - energy * length / G)

    shaper = design(omega)
    assert swing([(1.0, 0.0)]) == pytest.approx(math.radians(5.0), rel=1e-3)
    assert swing(zip(shaper.amplitudes, shaper.times, strict=True)) < 0.003 * swing([(1.0, 0.0)])


@pytest.mark.parametrize("design", [zv, zvd, zvdd, ei, um_zvd])
@pytest.mark.parametrize(("zeta", "samples"), [(0.0, 20.0), (0.0, 63.7), (0.05, 31.3)])
def test_filter_keeps_gain_and_residual_on_its_grid(design, zeta, samples):
    omega, h = 2.3, 2 * math.pi / 2.3 / samples
    shaper = design(omega, zeta)
    law = fir(shaper, h, source="raw", shaped="smooth")
    assert (law.input_labels, law.output_labels, law.dt) == (["raw"], ["smooth"], h)
    _, taps = ct.impulse_response(law, T=h * np.arange(law.nstates + 3))
    taps = h * np.squeeze(taps)  # python-control's sampled impulse has unit area
    assert np.abs(taps[law.nstates + 1 :]).max() == 0
    assert taps.sum() == pytest.approx(1.0, abs=1e-12)
    assert law.nstates * h == pytest.approx(shaper.duration, abs=h)
    pole = omega * (zeta + 1j * math.sqrt(1 - zeta**2))
    left = abs(taps @ np.exp(pole * (h * np.arange(len(taps)) - shaper.duration)))
    assert left == pytest.approx(shaper.residual(omega, zeta), abs=1e-11)


def test_filter_on_a_matching_grid_is_the_shaper_itself():
    shaper = zvd(2 * math.pi)  # half a second between impulses
    _, taps = ct.impulse_response(fir(shaper, 0.025, source="raw", shaped="smooth"), T=0.025 * np.arange(41))
    taps = 0.025 * np.squeeze(taps)
    np.testing.assert_allclose(taps[[0, 20, 40]], shaper.amplitudes, atol=1e-12)
    assert np.abs(np.delete(taps, [0, 20, 40])).max() < 1e-12


def test_a_coarsely_sampled_shaped_command_warns():
    shaped = Shaped(Step(1.0), zv(10.0))
    law = Tracking(pi(1.0, 1.0, measured="angle", command="torque"), {"angle": shaped})
    with pytest.warns(CoarseGridWarning):
        Sampled(law, 0.1)
    with pytest.warns(CoarseGridWarning):
        Sampled(OpenLoop({"torque": shaped.derivative}), 0.1)
    with pytest.warns(CoarseGridWarning):
        OpenLoop({"torque": shaped}, 0.1)


def test_a_fine_grid_does_not_warn(recwarn):
    law = pi(1.0, 1.0, measured="angle", command="torque")
    Sampled(Tracking(law, {"angle": Shaped(Step(1.0), zv(10.0))}), 0.01)
    Sampled(Tracking(law, {"angle": Constant(1.0)}), 0.1)
    assert not [w for w in recwarn if issubclass(w.category, CoarseGridWarning)]


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: zv(0.0), "frequency 0.0 rad/s must be > 0"),
        (lambda: zv(math.nan), "frequency nan"),
        (lambda: zvd(1.0, 1.0), "damping ratio 1.0"),
        (lambda: ei(1.0, 0.5), "holds up to a damping ratio of 0.3"),
        (lambda: ei(1.0, 0.0, 0.0), "tolerance 0.0 must lie"),
        (lambda: um_zvd(1.0, 0.4), "use zv or zvd"),
        (lambda: Shaper((0.5, 0.4), (0.0, 1.0)), "must sum to 1"),
        (lambda: Shaper((0.5, 0.5), (1.0, 0.0)), "must increase"),
        (lambda: Shaper((), ()), "as many finite amplitudes as times"),
    ],
)
def test_what_cannot_be_is_refused(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()
