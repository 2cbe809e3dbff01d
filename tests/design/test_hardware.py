from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

from flexctrl.design import (
    AntiWindup,
    Constant,
    Controller,
    ControllerError,
    Delayed,
    FilteredRate,
    Noisy,
    Quantised,
    RateLimited,
    Sampled,
    Saturated,
    Step,
    Tracking,
    as_controller,
    pd,
    pi,
    pid,
    state_feedback,
)

H = 0.02
PID = {"measured": "angle", "rate": FilteredRate(0.05), "command": "torque"}


def law() -> Controller:
    return Sampled(pid(3.0, 2.0, 1.0, **PID), H)


def replay(controller, measured):
    """Commands for a given sequence of measurements."""
    x, commands = controller.initial(), []
    for k, y in enumerate(measured):
        commands.append(controller.command(k * controller.sample_time, x, np.atleast_1d(y)))
        x = controller.update(k * controller.sample_time, x, np.atleast_1d(y))
    return np.array(commands)


MEASURED = np.sin(0.3 * np.arange(200)) + 0.2 * np.cos(2.1 * np.arange(200))

NOTHING = {
    "Saturated": lambda c: Saturated(c, {"torque": math.inf}),
    "Saturated, no limits": lambda c: Saturated(c),
    "AntiWindup": lambda c: AntiWindup(c, {"torque": math.inf}),
    "RateLimited": lambda c: RateLimited(c, {"torque": math.inf}),
    "Delayed": lambda c: Delayed(c, 0),
    "Quantised": lambda c: Quantised(c, {"angle": 0.0, "torque": 0.0}),
    "Noisy": lambda c: Noisy(c, {"angle": 0.0, "torque": 0.0}, seed=3),
    "Sampled alike": lambda c: Sampled(c, H),
}


@pytest.mark.parametrize("wrap", NOTHING.values(), ids=NOTHING.keys())
def test_a_wrapper_of_no_strength_is_no_wrapper(wrap):
    wrapped = wrap(law())
    assert isinstance(wrapped, Controller)
    assert (wrapped.inputs, wrapped.outputs, wrapped.sample_time) == (("angle",), ("torque",), H)
    np.testing.assert_array_equal(replay(wrapped, MEASURED), replay(law(), MEASURED))


def test_not_sampling_leaves_a_controller_continuous():
    kept = Sampled(pid(3.0, 2.0, 1.0, **PID), 0.0)
    assert kept.sample_time == 0.0
    assert Sampled(kept, 0.1).sample_time == 0.1


def test_saturation_cuts_off_and_nothing_else():
    free = replay(law(), MEASURED)
    np.testing.assert_array_equal(replay(Saturated(law(), {"torque": 1.5}), MEASURED), np.clip(free, -1.5, 1.5))
    np.testing.assert_array_equal(replay(Saturated(law(), {"torque": (0.0, 2.0)}), MEASURED), np.clip(free, 0.0, 2.0))
    assert np.abs(free).max() > 2.5


def test_rate_limit_holds_and_lets_slow_commands_pass():
    limit = 40.0
    limited = replay(RateLimited(law(), {"torque": limit}), MEASURED)
    changes = np.diff(limited[:, 0], prepend=0.0)
    assert np.abs(changes).max() == pytest.approx(limit * H)
    slow = 0.01 * np.arange(200) * H
    np.testing.assert_array_equal(replay(RateLimited(law(), {"torque": limit}), slow), replay(law(), slow))


def test_rate_limited_step_is_a_ramp_from_the_command_before():
    gain = Sampled(ct.ss([], [], [], [[1.0]], inputs=["angle"], outputs=["torque"], dt=0), 0.1)
    ramp = replay(RateLimited(gain, {"torque": (-1.0, 2.0)}, {"torque": 5.0}), [6.0] * 8 + [5.5] * 8)
    up = np.minimum(5.0 + 0.2 * np.arange(1, 9), 6.0)
    down = np.maximum(6.0 - 0.1 * np.arange(1, 9), 5.5)
    np.testing.assert_allclose(ramp[:, 0], [*up, *down], atol=1e-12)


@pytest.mark.parametrize("samples", [1, 2, 5])
def test_delay_shifts_commands_by_whole_samples(samples):
    late = replay(Delayed(law(), samples, {"torque": 7.0}), MEASURED)
    assert (late[:samples] == 7.0).all()
    np.testing.assert_array_equal(late[samples:], replay(law(), MEASURED)[:-samples])


def test_delays_add_up():
    np.testing.assert_array_equal(
        replay(Delayed(Delayed(law(), 2), 1), MEASURED), replay(Delayed(law(), samples=3), MEASURED)
    )


def test_quantised_measurement_and_command():
    rounded = replay(Quantised(law(), {"angle": 0.25}), MEASURED)
    np.testing.assert_array_equal(rounded, replay(law(), np.round(MEASURED / 0.25) * 0.25))
    steps = replay(Quantised(law(), {"torque": 0.5}), MEASURED) / 0.5
    np.testing.assert_array_equal(steps, np.round(steps))
    assert np.abs(steps * 0.5 - replay(law(), MEASURED)).max() <= 0.25 + 1e-12


def test_noise_is_the_same_in_every_run_and_order():
    noisy = Noisy(law(), {"angle": 0.1, "torque": 2.0}, seed=11)
    x, y = noisy.initial(), np.zeros(1)
    forwards = [noisy.command(k * H, x, y)[0] for k in range(3000)]
    again = Noisy(law(), {"angle": 0.1, "torque": 2.0}, seed=11)
    backwards = [again.command(k * H, x, y)[0] for k in reversed(range(3000))]
    assert forwards == backwards[::-1]
    assert Noisy(law(), {"angle": 0.1}, seed=12).command(0.0, x, y) != Noisy(law(), {"angle": 0.1}, 11).command(0, x, y)


def test_noise_is_white_with_its_standard_deviation():
    gain = Sampled(ct.ss([], [], [], [[1.0]], inputs=["angle"], outputs=["torque"], dt=0), H)
    noise = replay(Noisy(gain, {"angle": 0.3}, seed=5), np.zeros(20_000))[:, 0]
    assert noise.std() == pytest.approx(0.3, rel=0.02)
    assert abs(noise.mean()) < 4 * 0.3 / math.sqrt(20_000)
    correlation = np.correlate(noise[1024:], noise[1024:], "full")[18_976 - 1 :] / (noise[1024:] ** 2).sum()
    assert np.abs(correlation[1:3000]).max() < 6 / math.sqrt(18_976)  # also across the blocks it is drawn in


def test_command_and_update_see_the_same_noise():
    integral = Sampled(ct.ss([[0.0]], [[1.0]], [[0.0]], [[1.0]], inputs=["angle"], outputs=["torque"]), H)
    noisy, x, y = Noisy(integral, {"angle": 1.0}, seed=2), np.zeros(1), np.zeros(1)
    assert noisy.update(0.14, x, y) == pytest.approx(H * noisy.command(0.14, x, y))


def test_adding_noise_elsewhere_does_not_change_a_signals_noise():
    gain = ct.ss([], [], [], np.eye(2), inputs=["a", "b"], outputs=["u", "v"], dt=0)
    alone = Noisy(Sampled(gain, H), {"b": 1.0}, seed=1)
    among = Noisy(Sampled(gain, H), {"a": 1.0, "b": 1.0, "u": 1.0}, seed=1)
    none = np.zeros(0)
    assert alone.command(0.6, none, np.zeros(2))[1] == among.command(0.6, none, np.zeros(2))[1]


class OwnLinear:
    """A linear law that does not say so."""

    inputs, outputs = ("angle",), ("torque",)

    def __init__(self, law) -> None:
        self.law = law

    def initial(self):
        return self.law.initial()

    def command(self, t, x, y):
        return self.law.command(t, x, y)

    def rate(self, t, x, y):
        return self.law.rate(t, x, y)


STIFF = pid(3.0, 2.0, 1.0, measured="angle", rate=FilteredRate(1e-4), command="torque")
RINGING = ct.ss([[0, 1], [-4e4, -0.1]], [[0], [1]], [[1e4, 10]], 0, inputs=["angle"], outputs=["torque"])


@pytest.mark.parametrize("controller", [STIFF, RINGING], ids=["stiff", "ringing"])
def test_sampling_any_controller_integrates_its_state(controller):
    exact, integrated = Sampled(controller, H), Sampled(OwnLinear(as_controller(controller)), H)
    np.testing.assert_allclose(replay(integrated, MEASURED[:50]), replay(exact, MEASURED[:50]), rtol=1e-6, atol=1e-6)


def test_sampling_reaches_through_wrappers():
    # Order does not matter where nothing between the wrappers has a memory.
    one = Sampled(Saturated(Tracking(pid(3.0, 2.0, 1.0, **PID), {"angle": Step(1.0)}), {"torque": 2.0}), H)
    other = Saturated(Tracking(Sampled(pid(3.0, 2.0, 1.0, **PID), H), {"angle": Step(1.0)}), {"torque": 2.0})
    np.testing.assert_array_equal(replay(one, MEASURED), replay(other, MEASURED))


def test_faster_sampling_approaches_the_continuous_loop(sampled_loop, continuous_loop):
    A, B, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    controller, start = pid(4.0, 1.0, 3.0, **PID), [1.0, 0.0]
    exact = continuous_loop(lambda x, u: A @ x + B @ u, C, as_controller(controller), 2.0, start).x[-1]
    errors = []
    for h in (0.01, 0.005, 0.0025):
        end = sampled_loop(A, B, C, Sampled(controller, h), round(2.0 / h) + 1, start).x[-1]
        errors.append(np.abs(end - exact).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


# Reference case C11: integrator ẋ = u, u = −K x, d samples late. K h = 2 sin(π/(2 (2d + 1))) is the limit.
LIMITS = {0: 2.0, 1: 1.0, 2: 0.6180339887, 3: 0.4450418679, 4: 0.3472963554}


def integrator_with_delay(sampled_loop, samples, relative_gain, steps):
    gain = relative_gain * 2 * math.sin(math.pi / (2 * (2 * samples + 1))) / H
    proportional = ct.ss([], [], [], [[-gain]], inputs=["x"], outputs=["u"], dt=0)
    late = Delayed(Sampled(proportional, H), samples=samples)
    return sampled_loop([[0.0]], [[1.0]], [[1.0]], late, steps, [1.0]).x[:, 0]


@pytest.mark.parametrize(("samples", "limit"), LIMITS.items())
def test_delay_limits_in_closed_form(samples, limit):
    assert 2 * math.sin(math.pi / (2 * (2 * samples + 1))) == pytest.approx(limit, abs=1e-10)
    z = np.roots([1.0, -1.0, *[0.0] * (samples - 1), limit] if samples else [1.0, limit - 1.0])
    assert np.abs(z).max() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_loop_decays_just_below_the_limit_and_grows_just_above(sampled_loop, samples):
    window = 2 * (2 * samples + 1) * 100  # whole periods
    for relative, sign in ((0.999, -1), (1.001, 1)):
        x = integrator_with_delay(sampled_loop, samples, relative, 4 * window)
        early, late = np.abs(x[window : 2 * window]).max(), np.abs(x[3 * window :]).max()
        assert sign * math.log(late / early) > 0.1


@pytest.mark.parametrize(("samples", "below", "above"), [(1, 0.999500, 1.000500), (2, 0.999710, 1.000290)])
def test_growth_per_sample_is_that_of_the_root(sampled_loop, samples, below, above):
    for relative, root in ((0.999, below), (1.001, above)):
        x = integrator_with_delay(sampled_loop, samples, relative, 1000)[200:]
        # Once the other roots have died out, x[k+2] = 2 ρ cos φ x[k+1] − ρ² x[k].
        _, square = np.linalg.lstsq(np.column_stack([x[1:-1], -x[:-2]]), x[2:], rcond=None)[0]
        assert math.sqrt(square) == pytest.approx(root, abs=1e-6)


@pytest.mark.parametrize("samples", [1, 2])
def test_oscillation_at_the_limit_takes_its_known_period(sampled_loop, samples):
    x = integrator_with_delay(sampled_loop, samples, 1.0, 2000)
    period = 2 * (2 * samples + 1)
    np.testing.assert_allclose(x[1000 + period :], x[1000:-period], atol=1e-9)
    assert np.abs(x[1000 + period // 2 :] - x[1000 : -(period // 2)]).max() > 0.5


def test_delay_margin_of_a_double_integrator_is_where_the_sampled_loop_turns(sampled_loop):
    # C11: kp = 1, kd = √2, delay margin 0.736090 s; sampling adds half a sample.
    h = 0.002
    controller = Sampled(pd(1.0, math.sqrt(2), measured="x", rate="v", command="u"), h)
    A, B = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]]
    for margin, grows in ((0.98, False), (1.02, True)):
        late = Delayed(controller, round((margin * 0.736090 - h / 2) / h))
        x = sampled_loop(A, B, np.eye(2), late, 40_000, [1.0, 0.0]).x[:, 0]
        assert (np.abs(x[-5000:]).max() > np.abs(x[15_000:20_000]).max()) == grows


def servo(sampled_loop, wrap):
    """A unit step of a double integrator against a constant load, torque limited to 1.5."""
    controller = wrap(Sampled(pid(6.0, 4.0, 5.0, measured="x", rate="v", command="u"), 0.01))
    A = np.zeros((3, 3))
    A[0, 1] = A[1, 2] = 1.0
    C, B = np.eye(3)[:2], np.array([[0.0], [1.0], [0.0]])
    return sampled_loop(A, B, C, Tracking(controller, {"x": Constant(3.0)}), 4000, [0.0, 0.0, -0.5]).x[:, 0]


def test_stopping_the_integral_at_the_limit_prevents_overshoot(sampled_loop):
    limits = {"u": 1.5}
    wound = servo(sampled_loop, lambda c: Saturated(c, limits))
    guarded = servo(sampled_loop, lambda c: AntiWindup(c, limits))
    assert wound.max() - 3 > 1.0
    assert guarded.max() - 3 < 0.3 * (wound.max() - 3)
    assert guarded[-1] == pytest.approx(3.0, abs=1e-6)  # and the load is still integrated out


def test_guarded_and_plain_limits_agree_while_nothing_saturates(sampled_loop):
    wide = {"u": 1e3}
    np.testing.assert_array_equal(
        servo(sampled_loop, lambda c: Saturated(c, wide)), servo(sampled_loop, lambda c: AntiWindup(c, wide))
    )


def test_integral_resumes_when_it_leads_back():
    guarded = as_controller(AntiWindup(pi(1.0, 1.0, measured="angle", command="torque"), {"torque": 1.0}))
    wound = np.array([-5.0])  # u = −kp y + 5, at the upper limit
    assert guarded.rate(0.0, wound, np.array([-0.1])) == [0.0]
    assert guarded.rate(0.0, wound, np.array([0.1])) == [0.1]


def test_sampled_and_guarded_commute():
    controller = pid(3.0, 2.0, 1.0, **PID)
    one = Sampled(AntiWindup(controller, {"torque": 1.0}), H)
    other = AntiWindup(Sampled(controller, H), {"torque": 1.0})
    np.testing.assert_array_equal(replay(one, MEASURED), replay(other, MEASURED))


@pytest.mark.parametrize("wrap", [lambda c: RateLimited(c, {}), lambda c: Delayed(c, 1), lambda c: Noisy(c, {}, 0)])
def test_what_counts_samples_needs_them(wrap):
    with pytest.raises(ControllerError, match=r"counts samples.*Sampled\(controller, 0.01\)"):
        wrap(pid(3.0, 2.0, 1.0, **PID))


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: Saturated(law(), {"torq": 1.0}), "Saturated: .* no signal 'torq'; did you mean 'torque'"),
        (lambda: Saturated(law(), {"torque": -1.0}), r"limits of 'torque' are \(1.0, -1.0\)"),
        (lambda: Saturated(law(), {"torque": math.nan}), "the limit of 'torque' is nan; give a magnitude > 0"),
        (lambda: Saturated(law(), {"torque": "5 N m"}), "the limit of 'torque' is '5 N m'; give a magnitude > 0"),
        (lambda: Saturated(law(), {"torque": (1.0,)}), r"the limit of 'torque' is \(1.0,\); give a magnitude > 0"),
        (lambda: Quantised(law(), {"angle": "fine"}), "'angle' is given fine, which must be 0 or more"),
        (lambda: AntiWindup(Tracking(law(), {}), {}), "needs a linear controller, not Tracking"),
        (lambda: Delayed(law(), -1), "samples = -1 must be a whole number"),
        (lambda: Delayed(law(), 1, {"speed": 1.0}), "Delayed.before: .* no signal 'speed'"),
        (lambda: Quantised(law(), {"angle": -0.1}), "'angle' is given -0.1"),
        (lambda: Noisy(law(), {"angle": 0.1}, seed=-1), "seed = -1"),
        (lambda: Sampled(law(), -0.1), "sample time -0.1"),
        (
            lambda: Quantised(
                state_feedback([[1.0]], ct.ss(0, 1, 1, 0, inputs=["same"], outputs=["same"])), {"same": 1.0}
            ),
            "both read and commanded",
        ),
    ],
)
def test_wrong_names_and_values_are_refused(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()
