from __future__ import annotations

import math
import warnings
from functools import partial

import control as ct
import numpy as np
import pytest

from flexctrl.design import (
    ControllerError,
    DesignError,
    IdleInputWarning,
    Sampled,
    as_controller,
    bryson,
    kalman,
    lqg,
    lqr,
    state_feedback,
)

G = 9.81


def double_integrator(outputs=("x", "v")) -> ct.StateSpace:
    C = np.eye(2)[: len(outputs)]
    return ct.StateSpace([[0, 1], [0, 0]], [[0], [1]], C, 0, 0, inputs=["u"], outputs=list(outputs), states=["x", "v"])


def bridge_crane(load: float = 32e3, trolley: float = 41e3, rope: float = 10.0) -> ct.StateSpace:
    """Force model of a crane (C5), x and sway, its two poles at zero; the masses are assumed catalogue figures."""
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    A[2, 1] = load * G / trolley
    A[3, 1] = -(trolley + load) * G / (trolley * rope)
    B = np.array([[0.0], [0.0], [1 / trolley], [-1 / (trolley * rope)]])
    names = ["travel", "sway", "travel_rate", "sway_rate"]
    return ct.StateSpace(A, B, np.eye(4), 0, 0, inputs=["force"], outputs=names, states=names)


@pytest.fixture(params=["as installed", "without slicot"])
def solver(request, monkeypatch):
    if request.param == "without slicot":
        monkeypatch.setattr(ct, "lqr", partial(ct.lqr, method="scipy"))
        monkeypatch.setattr(ct, "dlqr", partial(ct.dlqr, method="scipy"))


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize("q", [1.0, 1e-4, 1e6])
def test_double_integrator_in_closed_form(q):
    # Q = diag(q, 0), R = 1: K = (√q, √2 q^¼).
    found = lqr(double_integrator(), np.diag([q, 0.0]), [[1.0]])
    np.testing.assert_allclose(found.gain, [[math.sqrt(q), math.sqrt(2) * q**0.25]], rtol=1e-9)
    np.testing.assert_allclose(found.cost[0, 0], math.sqrt(2) * q**0.75, rtol=1e-9)
    assert found.residual < 1e-12


@pytest.mark.usefixtures("solver")
def test_kalman_of_a_double_integrator_in_closed_form():
    # Noise of intensity w on the acceleration, v on the position: L = (√2 (w/v)^¼, (w/v)^½).
    w, v = 3.0, 0.2
    found = kalman(double_integrator(("x",)), np.diag([0.0, w]), [[v]])
    np.testing.assert_allclose(found.gain, [[math.sqrt(2) * (w / v) ** 0.25], [math.sqrt(w / v)]], rtol=1e-9)
    assert found.poles.real.max() < 0


@pytest.mark.usefixtures("solver")
def test_sampled_scalar_in_closed_form():
    # x⁺ = a x + u, q = r = 1: s² − a² s − 1 = 0 for the cost s, K = a s/(1 + s).
    a = 1.3
    s = (a**2 + math.sqrt(a**4 + 4)) / 2
    found = lqr(ct.StateSpace([[a]], [[1]], [[1]], 0, 0.1, inputs=["u"], outputs=["x"]), [[1.0]], [[1.0]])
    assert found.gain.item() == pytest.approx(a * s / (1 + s))
    assert abs(found.poles[0]) < 1


@pytest.mark.usefixtures("solver")
@pytest.mark.parametrize(("load", "trolley", "rope"), [(32e3, 41e3, 10.0), (65e3, 59008.0, 25.0), (1.0, 1.155, 0.5)])
def test_crane_with_two_poles_at_zero(load, trolley, rope):
    # D25: Riccati residual below 1e-8, all poles stable.
    plant = bridge_crane(load, trolley, rope)
    Q, R = bryson(plant, {"travel": 0.1, "sway": 0.02}, {"force": 0.3 * trolley})
    found = lqr(plant, Q, R)
    assert found.residual < 1e-8
    assert found.poles.real.max() < 0
    np.testing.assert_allclose(sorted(found.poles), sorted(np.linalg.eigvals(plant.A - plant.B @ found.gain)))
    hamiltonian = np.block([[plant.A, -plant.B @ np.linalg.solve(R, plant.B.T)], [-Q, -plant.A.T]])
    stable = [p for p in np.linalg.eigvals(hamiltonian) if p.real < 0]
    np.testing.assert_allclose(
        np.sort_complex(np.round(found.poles, 9)), np.sort_complex(np.round(stable, 9)), rtol=1e-5, atol=1e-7
    )


def test_bryson_weighs_by_largest_values():
    plant = double_integrator()
    Q, R = bryson(plant, {"x": 0.1}, {"u": 5.0})
    np.testing.assert_allclose(Q, np.diag([100.0, 0.0]))
    np.testing.assert_allclose(R, [[0.04]])


def test_optimal_cost_is_what_a_simulation_costs(continuous_loop):
    plant = bridge_crane()
    Q, R = bryson(plant, {"travel": 0.5, "sway": 0.05}, {"force": 2e4})
    found = lqr(plant, Q, R)
    law = as_controller(state_feedback(found.gain, plant))
    start = np.array([1.0, 0.05, 0.0, 0.0])
    run = continuous_loop(lambda x, u: plant.A @ x + plant.B @ u, np.eye(4), law, 80.0, start)
    spent = np.einsum("ti,ij,tj->t", run.x, Q, run.x) + R[0, 0] * run.u[:, 0] ** 2
    assert np.trapezoid(spent, run.t) == pytest.approx(start @ found.cost @ start, rel=1e-3)


def test_a_wrong_answer_of_the_solver_is_mended(monkeypatch):
    right = ct.lqr

    def sloppy(*arguments):
        K, S, E = right(*arguments)
        return 1.05 * K, 1.1 * S, E

    wanted = lqr(double_integrator(), np.eye(2), [[1.0]])
    monkeypatch.setattr(ct, "lqr", sloppy)
    found = lqr(double_integrator(), np.eye(2), [[1.0]])
    np.testing.assert_allclose(found.gain, wanted.gain, rtol=1e-9)
    assert found.residual < 1e-12


def test_a_hopeless_answer_of_the_solver_is_refused(monkeypatch):
    monkeypatch.setattr(ct, "lqr", lambda A, B, Q, R: (np.array([[-1.0, -1.0]]), np.eye(2), np.zeros(2)))
    with pytest.raises(DesignError, match=r"Riccati residual is .* outside the stable region"):
        lqr(double_integrator(), np.eye(2), [[1.0]])


def uncontrollable() -> ct.StateSpace:
    return ct.StateSpace(
        np.diag([0.5, -1.0]), [[0], [1]], [[1, 1]], 0, 0, inputs=["u"], outputs=["y"], states=["jib", "trolley"]
    )


@pytest.mark.usefixtures("solver")
def test_a_mode_no_input_moves_is_named():
    with pytest.raises(DesignError, match=r"lqr: .*no input moves the mode at 0.5 .*'jib'"):
        lqr(uncontrollable(), np.eye(2), [[1.0]])


@pytest.mark.usefixtures("solver")
def test_a_drifting_mode_the_cost_does_not_see_is_named():
    with pytest.raises(DesignError, match=r"state cost does not see the mode at 0 .*'x'"):
        lqr(double_integrator(), np.diag([0.0, 1.0]), [[1.0]])


@pytest.mark.usefixtures("solver")
def test_a_position_no_output_tells_is_named():
    blind = ct.StateSpace([[0, 1], [0, 0]], [[0], [1]], [[0, 1]], 0, 0, inputs=["u"], outputs=["v"], states=["x", "v"])
    with pytest.raises(DesignError, match=r"kalman: .*no output sees the mode at 0 .*'x'"):
        kalman(blind, np.eye(2), [[1.0]])


def test_lqg_designed_on_the_rigid_machine_runs_the_flexible_one():
    # Rigid mass 3 kg; flexible: 2 kg and 1 kg on a stiff, lightly damped spring, driven and measured at the first.
    rigid = ct.StateSpace([[0, 1], [0, 0]], [[0], [1 / 3]], [[1, 0]], 0, 0, inputs=["force"], outputs=["travel"])
    k, c = 4e3, 2.0
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-k / 2, k / 2, -c / 2, c / 2], [k, -k, c, -c]])
    flexible = ct.StateSpace(A, [[0], [0], [0.5], [0]], [[1, 0, 0, 0]], 0, 0, inputs=["force"], outputs=["travel"])
    law = lqg(rigid, np.diag([25.0, 1.0]), [[1.0]], rigid.B @ rigid.B.T, [[1e-4]])
    assert (law.input_labels, law.output_labels) == (["travel"], ["force"])
    rigid_poles = ct.feedback(rigid, law, sign=1).poles()
    flexible_poles = ct.interconnect([flexible, law], inputs=["force"], outputs=["travel"]).poles()
    assert rigid_poles.real.max() < 0
    assert flexible_poles.real.max() < 0
    for pole in rigid_poles:  # the rigid design survives, moved by little
        assert np.abs(flexible_poles - pole).min() < 0.05 * abs(pole)


def test_sampled_design_runs_as_the_controller_of_its_plant(sampled_loop):
    plant = double_integrator(("x",))
    h = 0.05
    digital = ct.sample_system(plant, h)
    law = lqg(digital, np.eye(2), [[1.0]], 1e-3 * np.eye(2), [[1e-4]])
    x = sampled_loop(plant.A, plant.B, plant.C, as_controller(law), 600, [1.0, 0.0]).x
    assert np.abs(x[-1]).max() < 1e-8
    assert as_controller(law).sample_time == Sampled(law, h).sample_time == h


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: lqr(double_integrator(), np.eye(3), [[1.0]]), r"state cost must be of shape \(2, 2\), not \(3, 3\)"),
        (lambda: lqr(double_integrator(), np.diag([1.0, np.nan]), [[1.0]]), r"finite; its entry \[1, 1\] is nan"),
        (lambda: lqr(double_integrator(), np.diag([1.0, -3.0]), [[1.0]]), "semidefinite; its least eigenvalue is -3"),
        (lambda: lqr(double_integrator(), [[0.0, 2.0], [2.0, 0.0]], [[1.0]]), "state cost .* least eigenvalue is -2"),
        (lambda: lqr(double_integrator(), np.eye(2), [[0.0]]), "input cost must be positive definite; .* is 0"),
        (lambda: kalman(double_integrator(), -np.eye(2), [[1.0]]), "process noise must be positive semidefinite"),
        (lambda: kalman(double_integrator(), np.eye(2), -2.0 * np.eye(2)), "noise must be positive definite; .* is -2"),
        (lambda: lqr(double_integrator(), [[1.0, 1.0], [0.0, 1.0]], [[1.0]]), "state cost must be symmetric"),
        (lambda: kalman(double_integrator(), np.eye(2), np.eye(3)), "measurement noise must be"),
        (lambda: bryson(double_integrator(), {"y": 1.0}, {"u": 1.0}), "no signal 'y'"),
        (lambda: bryson(double_integrator(), {"x": 1.0}, {}), "inputs: u: every input needs a largest command"),
        (lambda: bryson(double_integrator(), {"x": 0.0}, {"u": 1.0}), "the largest value of 'x' = 0; expected"),
        (lambda: bryson(double_integrator(), {"x": 1.0}, {"u": -2.0}), "the largest value of 'u' = -2; expected"),
    ],
)
def test_what_cannot_be_is_refused(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()


def test_costs_are_definite_in_whatever_units():
    """R of a motor in kN m beside one in mN m is definite, and Q of outputs less than states is so but for rounding."""
    plant = ct.ss(np.diag([-1.0, -2.0, -3.0]), np.ones((3, 2)), np.ones((1, 3)), np.zeros((1, 2)))
    ratio, units = np.array([[1.0, 0.5], [0.5, 1.0]]), np.diag([1e3, 1e-3])
    row = np.array([[1.0, 1e3, 1e-3]])
    law = lqr(plant, row.T @ row, units @ ratio @ units)
    same = lqr(ct.ss(plant.A, plant.B @ np.linalg.inv(units), plant.C, plant.D), row.T @ row, ratio)
    np.testing.assert_allclose(units @ law.gain, same.gain, rtol=1e-6, atol=1e-9 * np.abs(same.gain).max())


@pytest.mark.parametrize("sampled", [False, True])
def test_inputs_that_no_state_feels_are_told(sampled):
    """A motor that is held: the other input's gains are those of the plant without it, its own are zero."""
    A, B = np.array([[0.0, 1.0], [-1.0, -0.1]]), np.array([[0.0, 0.0], [0.0, 1.0]])
    plant = ct.ss(A, B, np.eye(2), np.zeros((2, 2)), inputs=["hoist", "travel"], outputs=["x", "v"])
    alone = ct.ss(A, B[:, 1:], np.eye(2), np.zeros((2, 1)), inputs=["travel"], outputs=["x", "v"])
    if sampled:
        plant, alone = (ct.sample_system(one, 0.1, copy_names=True) for one in (plant, alone))
    with pytest.warns(IdleInputWarning, match=r"no state feels hoist, so gains there are zero.*rest\.holding"):
        found = lqr(plant, np.eye(2), np.eye(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = lqr(alone, np.eye(2), np.eye(1))
    assert not found.gain[0].any()
    assert found.gain[1] == pytest.approx(expected.gain[0], rel=1e-9)
