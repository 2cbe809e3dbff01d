"""Sampled models against closed forms and finely integrated inputs, with whole and broken delays."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from fixtures import structures as s

from flexctrl.errors import StructureError
from flexctrl.linear.discrete import FirstOrderHold, ZeroOrderHold


def run(system: control.StateSpace, u: np.ndarray) -> np.ndarray:
    """Outputs of the sampled system from rest, shape (p, N)."""
    x, ys = np.zeros(system.nstates), []
    for sample in u.T:
        ys.append(system.C @ x + system.D @ sample)
        x = system.A @ x + system.B @ sample
    return np.array(ys).T


def fine_run(linear, u, dt, delay, first_order, parts=60):
    """Outputs at the samples with the held, delayed input cut into `parts` linear pieces per step."""
    ss = linear.to_ss()
    n, m = ss.B.shape
    h = dt / parts
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m], whole[n : n + m, n + m :] = ss.A, ss.B, np.eye(m)
    E = la.expm(whole * h)
    steps = u.shape[1]

    def held(t: float, side: float) -> np.ndarray:
        at = (t - delay) / dt
        i = int(np.floor(at + side * 1e-9))
        old, new = (u[:, j] if 0 <= j < steps else np.zeros(m) for j in (i, i + 1))
        return old + (new - old) * (at - i) * first_order

    x, ys = np.zeros(n), []
    for k in range(steps):
        ys.append(ss.C @ x + ss.D @ held(k * dt, 1.0))
        for j in range(parts):
            start, end = held(k * dt + j * h, 1.0), held(k * dt + (j + 1) * h, -1.0)
            x = E[:n, :n] @ x + E[:n, n : n + m] @ start + E[:n, n + m :] @ (end - start) / h
    return np.array(ys).T


def machine(kind: str):
    if kind == "classical":
        linear = s.chain(4, mass=2.0, stiffness=300.0, beta=2e-3)
        return replace(linear, D=np.array([[0.003]]))
    if kind == "free":
        return s.crane(3.355, 1.0, 0.5)
    if kind == "relaxing":
        return s.model(np.diag([0.0, 5.0]), [[1500, -1000], [-1000, 1000]], C=np.diag([30.0, 1.0]), Cq=np.eye(2))
    linear = s.geared(0.02, 10.0, 5.0, 1000.0)
    return replace(linear, C=sp.csc_matrix(np.diag([0.01, 0.7])))


@pytest.mark.parametrize("kind", ["classical", "free", "general", "relaxing"])
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.013, 0.05])
@pytest.mark.parametrize("first_order", [False, True])
def test_sampled_outputs_are_exact(kind, delay, first_order):
    """Delays of 0, 1, 0.65 and 2.5 samples of 0.02 s, random samples (from zero, so that lines start there)."""
    linear, dt = machine(kind), 0.02
    u = np.random.default_rng(3).standard_normal((1, 25))
    u[:, 0] = 0.0
    hold = FirstOrderHold(delay) if first_order else ZeroOrderHold(delay)
    ours = run(linear.discretize(dt, hold), u)
    reference = fine_run(linear, u, dt, delay, first_order)
    assert np.abs(ours - reference).max() < 1e-10 * np.abs(reference).max()


def test_against_python_control():
    linear = s.chain(4, mass=2.0, stiffness=300.0, beta=2e-3)
    ours = linear.discretize(0.05)
    theirs = control.c2d(linear.to_ss(), 0.05, "zoh")
    assert ours.dt == 0.05
    assert ours.input_labels == ["force1"]
    np.testing.assert_allclose(ours.A, theirs.A, atol=1e-13)
    np.testing.assert_allclose(ours.B, theirs.B, atol=1e-13)


def test_rigid_motion_is_exact_for_any_number_of_steps():
    """1000 steps of a constant force on a free mass: x = F t²/2m to rounding, from 0.25 s steps (exact in binary)."""
    system = s.model(np.array([[4.0]]), np.zeros((1, 1))).discretize(0.25)
    np.testing.assert_array_equal(system.A, [[1.0, 0.25], [0.0, 1.0]])
    y = run(system, np.ones((1, 1001)))
    assert y[0, -1] == 250.0**2 / 8.0


def test_oscillator_closed_form():
    """cos and sin of ω dt, also for a step of many periods and for one 1e-7 of a period."""
    for dt in (1e-7, 0.3, 47.0):
        system = s.model(np.eye(1), np.array([[9.0]])).discretize(dt)
        c, sn = np.cos(3 * dt), np.sin(3 * dt)
        np.testing.assert_allclose(system.A, [[c, sn], [-sn, c]], atol=3e-14)
        expected = np.array([[2 * np.sin(1.5 * dt) ** 2 / 3], [sn / 3]])
        np.testing.assert_allclose(system.B, expected, rtol=1e-12, atol=1e-14 * dt)


@pytest.mark.parametrize("delay_steps", [0, 1, 2, 3, 4])
def test_integrator_with_delay_is_stable_up_to_the_known_gain(delay_steps):
    """u = -K x, limit 2 sin(π / 2(2d + 1)); one hidden sample of delay would move it."""
    dt = 0.1
    integrator = s.model(np.zeros((1, 1)), np.zeros((1, 1)), C=[[1.0]])
    plant = integrator.discretize(dt, ZeroOrderHold(delay_steps * dt))
    limit = 2 * np.sin(np.pi / (2 * (2 * delay_steps + 1))) / dt
    for factor, grows in ((0.999, False), (1.001, True)):
        closed = plant.A - factor * limit * plant.B @ plant.C
        assert bool(np.abs(np.linalg.eigvals(closed)).max() > 1) is grows
    if delay_steps in (1, 2):
        edge = {1: 0.9995, 2: 0.99971}[delay_steps]
        closed = plant.A - 0.999 * limit * plant.B @ plant.C
        assert np.abs(np.linalg.eigvals(closed)).max() == pytest.approx(edge, abs=5e-7)


def test_past_samples_are_named_states():
    system = s.crane(3.355, 1.0, 0.5).discretize(0.01, ZeroOrderHold(0.025))
    assert system.state_labels[-3:] == ["force_past1", "force_past2", "force_past3"]


def test_impossible_times_are_refused():
    linear = s.six_mass_chain()
    with pytest.raises(StructureError, match="positive"):
        linear.discretize(0.0)
    with pytest.raises(StructureError, match="delay"):
        linear.discretize(0.1, ZeroOrderHold(-0.01))
