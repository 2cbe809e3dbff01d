from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

from flexctrl.design import (
    Commanded,
    Constant,
    ControllerError,
    FeedForward,
    FilteredRate,
    MinimumJerk,
    OpenLoop,
    Ramp,
    Sampled,
    Saturated,
    Shaped,
    Step,
    Together,
    Tracking,
    as_controller,
    pd,
    pi,
    pid,
    zv,
)

NONE = np.zeros(0)
PD = {"measured": "angle", "rate": "angle_rate", "command": "torque"}


def test_tracking_pd_is_the_textbook_law():
    kp, kd, move = 30.0, 7.0, MinimumJerk(2.0, 1.5)
    law = Tracking(pd(kp, kd, **PD), {"angle": move, "angle_rate": move.derivative})
    for t in (0.0, 0.4, 1.1, 3.0):
        angle, rate = 0.3 * t, 0.1
        wanted = kp * (move(t) - angle) + kd * (move.rate(t) - rate)
        assert law.command(t, NONE, np.array([angle, rate])) == pytest.approx([wanted])


def test_tracking_leaves_the_measurement_untouched():
    y = np.array([1.0, 2.0])
    Tracking(pd(1.0, 1.0, **PD), {"angle": Constant(5.0)}).command(0.0, NONE, y)
    assert y.tolist() == [1.0, 2.0]


def test_a_constant_reference_and_feed_forward_are_an_operating_point():
    law = FeedForward(Tracking(pd(4.0, 1.0, **PD), {"angle": Constant(0.2)}), {"torque": Constant(9.0)})
    assert law.command(1.0, NONE, np.array([0.2, 0.0])) == pytest.approx([9.0])
    assert law.command(1.0, NONE, np.array([0.3, 0.0])) == pytest.approx([9.0 - 0.4])


def test_any_function_of_time_is_a_reference():
    law = Tracking(pd(2.0, 0.0, **PD), {"angle": math.sin})
    assert law.command(0.5, NONE, np.zeros(2)) == pytest.approx([2 * math.sin(0.5)])


def test_tracked_integral_follows_a_ramp_without_lag(continuous_loop):
    law = Tracking(pid(20.0, 10.0, 8.0, **PD), {"angle": (r := Ramp(0.5, at=0.3)), "angle_rate": r.derivative})
    run = continuous_loop(lambda x, u: np.array([x[1], u[0] - 1.0]), np.eye(2), law, 25.0, [0.0, 0.0])
    assert run.x[-1] == pytest.approx([r(25.0), 0.5], abs=1e-5)


def test_reference_signals_of_a_two_input_law_are_bound():
    law = ct.ss([], [], [], [[3.0, -3.0, 1.0]], inputs=["wanted", "angle", "extra"], outputs=["torque"], dt=0)
    bound = Commanded(law, {"wanted": Step(2.0, at=1.0), "extra": math.cos})
    assert bound.inputs == ("angle",)
    assert as_controller(bound, ["torque"], ["angle"]) is bound
    assert bound.command(0.5, NONE, np.array([0.1])) == pytest.approx([-0.3 + math.cos(0.5)])
    assert bound.command(1.5, NONE, np.array([0.1])) == pytest.approx([5.7 + math.cos(1.5)])


def test_python_control_state_feedback_system_runs_bound():
    # create_statefbk_iosystem: u = ud − K (x − xd), its references being named inputs.
    plant = ct.ss([[0, 1], [0, 0]], [[0], [1]], np.eye(2), 0, inputs=["torque"], outputs=["angle", "angle_rate"])
    made, _ = ct.create_statefbk_iosystem(plant, np.array([[2.0, 3.0]]), xd_labels=["xd", "vd"], ud_labels=["ud"])
    move = MinimumJerk(1.0, 1.0)
    law = Commanded(made, {"xd": move, "vd": move.derivative, "ud": move.derivative.derivative})
    twin = FeedForward(
        Tracking(pd(2.0, 3.0, **PD), {"angle": move, "angle_rate": move.derivative}),
        {"torque": move.derivative.derivative},
    )
    assert (law.inputs, law.outputs) == (twin.inputs, twin.outputs)
    for t in (0.0, 0.3, 2.0):
        y = np.array([0.1 * t, 0.2])
        assert law.command(t, NONE, y) == pytest.approx(twin.command(t, NONE, y))


def test_bound_and_tracked_laws_with_states_see_the_same_error():
    error_law = ct.ss([[-2.0]], [[1.0]], [[3.0]], [[0.5]], inputs=["angle"], outputs=["torque"])
    two_input = ct.ss([[-2.0]], [[1.0, -1.0]], [[3.0]], [[0.5, -0.5]], inputs=["angle", "wanted"], outputs=["torque"])
    move = MinimumJerk(1.0, 1.0)
    for wrap in (lambda c: c, lambda c: Sampled(c, 0.05)):
        one, other = wrap(Tracking(error_law, {"angle": move})), wrap(Commanded(two_input, {"wanted": move}))
        x, y = np.array([0.7]), np.array([0.2])
        assert one.command(0.4, x, y) == pytest.approx(other.command(0.4, x, y))
        step = "update" if one.sample_time else "rate"
        assert getattr(one, step)(0.4, x, y) == pytest.approx(getattr(other, step)(0.4, x, y))


def test_open_loop_drives_inputs_and_measures_nothing():
    law = OpenLoop({"torque": Step(2.0, at=1.0), "push": Constant(-1.0)})
    assert (law.inputs, law.outputs) == ((), ("torque", "push"))
    assert law.command(0.5, NONE, NONE).tolist() == [0.0, -1.0]
    assert law.command(1.0, NONE, NONE).tolist() == [2.0, -1.0]
    assert Sampled(law, 0.1).sample_time == 0.1


def test_controllers_together_keep_their_own_states_and_add_up():
    left = pi(2.0, 1.0, measured="angle", command="torque")
    right = pid(3.0, 4.0, 0.5, measured="position", rate=FilteredRate(0.1), command="force")
    both = Together(left, right, OpenLoop({"torque": Constant(10.0)}))
    assert (both.inputs, both.outputs) == (("angle", "position"), ("torque", "force"))
    one, other = as_controller(left), as_controller(right)
    x, y = np.array([0.3, -0.2, 0.5]), np.array([1.5, -0.7])
    wanted = [one.command(0, x[:1], y[:1])[0] + 10.0, other.command(0, x[1:], y[1:])[0]]
    assert both.command(0.0, x, y) == pytest.approx(wanted)
    assert both.rate(0.0, x, y) == pytest.approx([*one.rate(0, x[:1], y[:1]), *other.rate(0, x[1:], y[1:])])
    assert len(both.initial()) == 3


def test_sampling_together_is_together_sampled():
    laws = [pi(2.0, 1.0, measured=name, command="torque") for name in ("angle", "position")]
    one, other = Sampled(Together(*laws), 0.1), Together(*(Sampled(law, 0.1) for law in laws))
    x, y = np.array([0.3, -0.2]), np.array([1.5, -0.7])
    assert one.update(0.0, x, y) == pytest.approx(other.update(0.0, x, y))
    assert one.command(0.0, x, y) == pytest.approx(other.command(0.0, x, y))


def test_breaks_of_references_reach_the_simulator_once_each():
    move = Shaped(Step(1.0, at=0.5), zv(math.pi))  # a second copy 1 s later
    law = Tracking(pd(1.0, 1.0, **PD), {"angle": move, "angle_rate": move.derivative})
    outer = Together(FeedForward(law, {"torque": Step(1.0, at=0.1)}), OpenLoop({"push": Ramp(1.0, at=0.5 + 1e-15)}))
    assert outer.breaks == pytest.approx((0.1, 0.5, 1.5))


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (
            lambda: Tracking(pd(1, 1, **PD), {"angel": Step(1.0)}),
            r"Tracking: .* no signal 'angel'; did you mean 'angle'",
        ),
        (lambda: Tracking(pd(1, 1, **PD), {"angle": 1.0}), r"use Constant\(1.0\)"),
        (lambda: FeedForward(pd(1, 1, **PD), {"angle": Step(1.0)}), "FeedForward: .* no signal 'angle'"),
        (lambda: Commanded(pd(1, 1, **PD), {"wanted": Step(1.0)}), "Commanded: .* no signal 'wanted'"),
        (lambda: OpenLoop({"torque": 3.0}), r"use Constant\(3.0\)"),
        (lambda: OpenLoop(lambda t: 1.0), "OpenLoop: <function .*; expected values by name of signal"),
        (lambda: Saturated(pd(1, 1, **PD), 5.0), "Saturated: 5.0; expected values by name of signal"),
        (lambda: Together(pd(1, 1, **PD), Sampled(pd(1, 1, **PD), 0.1)), r"one sample time, not \[0.0, 0.1\]"),
        (lambda: Sampled(Sampled(pd(1, 1, **PD), 0.1), 0.2), "already sampled every 0.1 s"),
    ],
)
def test_wrong_names_and_values_are_refused(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()
