"""A free body that tumbles, extrapolated: what Newton's method leaves open adds up where nothing damps it.

A correction d left open is an error 2 d/h of the rate, and random ones add up to d (T/h)^1.5 over a run.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

INERTIAS, SPIN, UNTIL = np.array([1.0, 2.0, 3.0]), np.array([0.1, 5.0, 0.2]), 2.0


@cache
def end() -> np.ndarray:
    """Where the body is turned to, by Euler's equations."""

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R, (p, q, r) = y[:9].reshape(3, 3), y[9:]
        spin = np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
        return np.append((R @ spin).ravel(), -np.cross(y[9:], INERTIAS * y[9:]) / INERTIAS)

    first = np.append(np.eye(3).ravel(), SPIN)
    return solve_ivp(rate, (0.0, UNTIL), first, method="DOP853", rtol=1e-13, atol=1e-14).y[:9, -1].reshape(3, 3)


def error(method) -> float:
    body = fc.RigidBody("body", (0, 0, 0), 1.0, tuple(INERTIAS))
    model = fc.assemble(fc.Structure([body], [fc.Support(body.node, "u v w")]), [fc.LargeRotation()])
    run = fc.simulate(model, until=UNTIL, start=model.rest.with_(v=SPIN), method=method, every=UNTIL)
    assert run.status is fc.Status.FINISHED
    return float(np.abs(run.final.R[0] - end()).max())


@pytest.mark.slow
def test_extrapolation_keeps_its_order_down_to_short_steps():
    errors = [error(fc.Richardson(fc.GeneralizedAlpha(h, rho=1.0))) for h in (16e-3, 8e-3, 4e-3, 2e-3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.5).all()
    assert errors[-1] < 2e-8
