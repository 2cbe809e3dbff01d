from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

from flexctrl.design import (
    ControllerError,
    FilteredRate,
    as_controller,
    observer,
    observer_feedback,
    pd,
    pi,
    pid,
    state_feedback,
)

NAMES = {"measured": "angle", "rate": "angle_rate", "command": "torque"}


def double_integrator() -> ct.StateSpace:
    return ct.StateSpace(
        [[0, 1], [0, 0]], [[0], [1]], np.eye(2), 0, 0, inputs=["torque"], outputs=["angle", "angle_rate"]
    )


def by_poles(values):
    return sorted(np.asarray(values, dtype=complex), key=lambda z: (round(z.real, 6), z.imag))


def test_pd_connected_by_name_has_the_poles_of_its_polynomial():
    kp, kd = 7.0, 2.0
    loop = ct.interconnect([double_integrator(), pd(kp, kd, **NAMES)], inputs=["torque"], outputs=["angle"])
    assert by_poles(loop.poles()) == pytest.approx(by_poles(np.roots([1, kd, kp])))
    again = ct.feedback(double_integrator(), pd(kp, kd, **NAMES), sign=1)
    assert by_poles(again.poles()) == pytest.approx(by_poles(np.roots([1, kd, kp])))


def test_margins_of_pd_on_a_double_integrator():
    # Reference case C11: kp = 1, kd = √2.
    loop_gain = -pd(1.0, math.sqrt(2), **NAMES) * double_integrator()
    _, phase_margin, _, _, crossing, _ = ct.stability_margins(loop_gain)
    assert phase_margin == pytest.approx(65.53020, abs=1e-5)
    assert crossing == pytest.approx(1.553774, abs=1e-6)
    assert math.radians(phase_margin) / crossing == pytest.approx(0.736090, abs=1e-6)


@pytest.mark.parametrize("ki", [0.0, 3.0])
@pytest.mark.parametrize("kd", [0.0, 0.7])
def test_pid_response_is_that_of_its_formula(ki, kd):
    kp, T, w = 2.0, 0.05, 4.0
    s = 1j * w
    law = pid(kp, ki, kd, measured="angle", rate=FilteredRate(T), command="torque")
    assert law(s) == pytest.approx(-(kp + ki / s + kd * s / (T * s + 1)), rel=1e-12)
    assert law.nstates == bool(ki) + bool(kd)
    assert (law.input_labels, law.output_labels) == (["angle"], ["torque"])
    if ki:
        assert pi(kp, ki, measured="angle", command="torque")(s) == pytest.approx(-(kp + ki / s))


def test_a_signal_is_not_its_own_rate():
    with pytest.raises(ControllerError, match="pid: rate = 'angle' is the measured signal itself"):
        pd(2.0, 0.7, measured="angle", rate="angle", command="torque")


def test_pid_with_a_measured_rate_adds_only_the_integrator():
    law = pid(2.0, 3.0, 0.7, **NAMES)
    np.testing.assert_allclose(law(2j), [[-(2.0 + 3.0 / 2j), -0.7]])
    assert law.state_labels == ["integral"]


def test_static_laws_are_continuous():
    assert pd(1.0, 1.0, **NAMES).dt == 0


def machine(seed: int = 4) -> ct.StateSpace:
    """Four states, all told by four outputs, in coordinates that are not the outputs."""
    rng = np.random.default_rng(seed)
    T = rng.standard_normal((4, 4))
    A, B = rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    outputs = ["angle", "rate", "position", "speed"]
    return ct.StateSpace(A, B, T, np.zeros((4, 2)), 0, inputs=["torque", "force"], outputs=outputs)


def test_state_feedback_runs_on_outputs_in_any_coordinates():
    plant, K = machine(), np.array([[1.0, 2.0, 3.0, 4.0], [-1.0, 0.5, 0.0, 2.0]])
    law = state_feedback(K, plant)
    loop = ct.interconnect([plant, law], inputs=["torque", "force"], outputs=["angle"])
    assert by_poles(loop.poles()) == pytest.approx(by_poles(np.linalg.eigvals(plant.A - plant.B @ K)), rel=1e-9)
    x = np.array([0.3, -1.0, 2.0, 0.1])
    np.testing.assert_allclose(as_controller(law).command(0.0, np.zeros(0), plant.C @ x), -K @ x)


def test_state_feedback_needs_only_the_outputs_its_gain_uses():
    plant = double_integrator()
    law = state_feedback([[5.0, 0.0]], plant[["angle"], :])
    assert (law.input_labels, law.output_labels) == (["angle"], ["torque"])
    np.testing.assert_allclose(law.D, [[-5.0]])


def test_state_feedback_is_not_misled_by_units():
    scaled = ct.StateSpace([[0, 1], [0, 0]], [[0], [1]], np.diag([1e-9, 1e9]), 0, 0, inputs=["u"], outputs=["a", "b"])
    np.testing.assert_allclose(state_feedback([[2.0, 3.0]], scaled).D, [[-2e9, -3e-9]], rtol=1e-12)


def test_states_that_outputs_do_not_tell_are_named():
    plant = ct.StateSpace(
        [[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0, 0, inputs=["torque"], outputs=["angle"], states=["q", "v"]
    )
    with pytest.raises(ControllerError, match=r"do not tell state 'v': add outputs .* observer_feedback"):
        state_feedback([[1.0, 1.0]], plant)


def test_an_output_with_feedthrough_is_no_state():
    plant = ct.StateSpace([[0, 1], [0, 0]], [[0], [1]], np.eye(2), [[0], [1]], 0, inputs=["u"], outputs=["a", "b"])
    with pytest.raises(ControllerError, match="depends on its inputs directly"):
        state_feedback([[1.0, 1.0]], plant)


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("feedthrough", [0.0, 0.7])
def test_regulator_and_observer_poles_are_kept_apart(dt, feedthrough):
    rng = np.random.default_rng(1)
    A, B, C = rng.standard_normal((3, 3)), rng.standard_normal((3, 1)), rng.standard_normal((2, 3))
    plant = ct.StateSpace(A, B, C, feedthrough * np.ones((2, 1)), dt, inputs=["u"], outputs=["a", "b"])
    K, L = rng.standard_normal((1, 3)), rng.standard_normal((3, 2))
    law = observer_feedback(K, L, plant)
    assert (law.input_labels, law.output_labels, law.dt) == (["a", "b"], ["u"], dt)
    poles = ct.feedback(plant, law, sign=1).poles()
    wanted = [*np.linalg.eigvals(A - B @ K), *np.linalg.eigvals(A - L @ C)]
    assert by_poles(poles) == pytest.approx(by_poles(wanted), rel=1e-8, abs=1e-10)


def test_observer_of_the_true_plant_keeps_the_true_state():
    plant = machine()
    L = np.linalg.solve(plant.C, 3 * np.eye(4) + plant.A.T).T  # any gain
    watch = observer(plant, L)
    assert watch.output_labels[0].endswith("_hat")
    assert all(name.isidentifier() for name in watch.output_labels)
    x, u = np.array([0.3, -1.0, 2.0, 0.1]), np.array([0.5, -0.2])
    y = plant.C @ x + plant.D @ u
    np.testing.assert_allclose(watch.A @ x + watch.B @ np.concatenate([u, y]), plant.A @ x + plant.B @ u, atol=1e-12)


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: FilteredRate(0.0), "must be > 0"),
        (lambda: state_feedback([[1.0]], double_integrator()), r"shape \(1, 2\), not \(1, 1\)"),
        (lambda: observer_feedback([[1.0, math.nan]], np.eye(2), double_integrator()), "must be finite"),
        (lambda: observer(double_integrator(), np.eye(3)), r"shape \(2, 2\), not \(3, 3\)"),
    ],
)
def test_what_cannot_be_is_refused(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()
