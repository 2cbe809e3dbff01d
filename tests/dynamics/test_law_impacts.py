"""Buffers written as continuous laws: what hits them comes back with its speed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_sliding_laws import Law, carts

import flexctrl as fc


def buffer(stiffness: float, damping: float = 0.0) -> Law:
    """Stops at ±1 m."""

    def says(t: float, x: np.ndarray, y: np.ndarray) -> float:
        inside = max(y[0] - 1.0, 0.0) + min(y[0] + 1.0, 0.0)
        return -stiffness * inside - damping * (y[1] if inside else 0.0)

    return Law(("x0", "v0"), ("f0",), says)


def thrown(law: Law, speed: float, until: float, **how) -> fc.Run:
    model = carts(2.0)
    return fc.simulate(model, law, until=until, start=model.rest.with_(v=np.array([speed])), **how)


@pytest.mark.parametrize("speed", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("stiffness", [1e5, 1e6, 1e7, 1e9])
@pytest.mark.parametrize("tolerance", [fc.Tolerance(), fc.Tolerance(1e-5, 1e-8)])
def test_it_comes_back_as_fast_as_it_came(stiffness, speed, tolerance):
    """The law's corner was passed by long steps: 0.05 m/s on 1e7 N/m came back 1.9 times as fast."""
    run = thrown(buffer(stiffness), speed, 1.5 / speed, tolerance=tolerance)
    assert run["v0"][-1] == pytest.approx(-speed, rel=5e-3)
    assert run.report.energy_residual < 2e-3


def test_ten_times_to_and_fro():
    run = thrown(buffer(1e7), 0.2, 105.0)
    assert abs(run["v0"][-1]) == pytest.approx(0.2, rel=0.01)
    assert run.report.steps < 1500


@pytest.mark.parametrize("damping", [100.0, 500.0])
def test_damped_buffers_take_what_they_should(damping):
    """By two hundredths of the speed that comes in; against fine steps of an independent method."""

    def slope(t, y):
        return [y[1], (-1e5 * y[0] - damping * y[1]) / 2.0 if y[0] > 0.0 else 0.0]

    left = solve_ivp(slope, (0.0, 0.1), [1e-15, 0.2], rtol=1e-10, atol=1e-14, max_step=1e-4).y[1, -1]
    run = thrown(buffer(1e5, damping), 0.2, 5.5)
    assert run["v0"][-1] == pytest.approx(left, abs=4e-3)


def test_a_stiff_law_that_is_smooth_takes_no_more_steps_for_it():
    """No step is cut where the law is as stiff before as after."""
    law = Law(("x0", "v0"), ("f0",), lambda t, x, y: -1e4 * (y[0] - 1.0) - 3e2 * y[1])
    run = fc.simulate(carts(2.0), law, until=10.0)
    assert run["x0"][-1] == pytest.approx(1.0, abs=1e-6)
    assert run.report.steps < 150
