"""Reference loops, written independently of the simulator: exact between samples, DOP853 in continuous time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from flexctrl.design import Controller


@dataclass(frozen=True)
class Loop:
    """What a closed loop did: instants, plant states, commands."""

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray


def run_sampled(A, B, C, controller: Controller, steps: int, start) -> Loop:
    """ẋ = A x + B u, y = C x with the command held: exact at the samples."""
    A, B, C = np.atleast_2d(A), np.atleast_2d(B), np.atleast_2d(C)
    n, m, h = len(A), B.shape[1], controller.sample_time
    step = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * h)[:n]
    x, z = np.array(start, dtype=float), controller.initial()
    xs, us = np.zeros((steps, n)), np.zeros((steps, m))
    for k in range(steps):
        y = C @ x
        u = controller.command(k * h, z, y)
        xs[k], us[k] = x, u
        z = controller.update(k * h, z, y)
        x = step @ np.concatenate([x, u])
    return Loop(h * np.arange(steps), xs, us)


def run_continuous(f: Callable, C, controller: Controller, until: float, start) -> Loop:
    """ẋ = f(x, u), y = C x, a continuous controller; every break of its command ends an integration."""
    C = np.atleast_2d(C)
    n, z0 = len(start), controller.initial()

    def slope(t, s):
        y = C @ s[:n]
        return np.concatenate([f(s[:n], controller.command(t, s[n:], y)), controller.rate(t, s[n:], y)])

    inside = [b for b in getattr(controller, "breaks", ()) if 0 < b < until]
    ends = [0.0, *inside, until]
    state, ts, ss = np.concatenate([start, z0]), [], []
    for a, b in pairwise(ends):
        run = solve_ivp(slope, (a, b), state, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.05)
        state = run.y[:, -1]
        ts.append(run.t)
        ss.append(run.y.T)
    t, s = np.concatenate(ts), np.concatenate(ss)
    u = np.array([controller.command(tk, sk[n:], C @ sk[:n]) for tk, sk in zip(t, s, strict=True)])
    return Loop(t, s[:, :n], u)


@pytest.fixture
def sampled_loop():
    return run_sampled


@pytest.fixture
def continuous_loop():
    return run_continuous
