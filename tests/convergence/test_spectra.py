"""C12: what methods do to an undamped oscillator: its damping and its frequency; and the exact method, to round-off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.scene import load_scene

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
OMEGA = 10.0
ALPHA = {0.9: (7.28e-8, -8.42e-4), 0.8: (6.84e-7, -8.78e-4), 0.5: (1.842e-5, -1.247e-3), 0.0: (4.83e-4, -4.481e-3)}
"""Spectral radius → damping ratio and relative error of the frequency at ω h = 0.1."""
MIDPOINT = {0.1: 0.99916791, 0.5: 0.97991465, 1.0: 0.92729522}
"""ω h → frequency over the true one: (2/x) atan(x/2)."""


def oscillator(*effects: fc.RayleighDamping) -> fc.Model:
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), OMEGA**2)
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    push, x = fc.Force("push", mass.node, "x"), fc.Position("x", mass.node, "x")
    return fc.assemble(fc.Structure([spring, mass], joints, inputs=[push], outputs=[x]), [fc.Flexible(), *effects])


def swing(method, h: float, steps: int = 600) -> tuple[float, float]:
    """Damping ratio and frequency (over ω) of a swing: the numbers λ for which its samples are Re c λᵏ."""
    model = oscillator()
    run = fc.simulate(model, until=steps * h, start=model.displace(np.ones(1)), method=method(h))
    q = run["x"][100:]
    a, b = np.linalg.lstsq(np.column_stack([q[1:-1], q[:-2]]), q[2:], rcond=None)[0]
    exponent = np.log(np.roots([1.0, -a, -b])[0])
    return -exponent.real / abs(exponent), abs(exponent.imag) / (OMEGA * h)


@pytest.mark.parametrize("rho", ALPHA)
def test_generalised_alpha(rho):
    damping, shift = ALPHA[rho]
    found = swing(lambda h: fc.GeneralizedAlpha(h, rho), 0.1 / OMEGA)
    assert found[0] == pytest.approx(damping, rel=0.01)
    assert found[1] - 1.0 == pytest.approx(shift, rel=0.01)


@pytest.mark.parametrize("x", MIDPOINT)
@pytest.mark.parametrize("method", ["trapezoidal", "midpoint"])
def test_undamped_methods(method, x):
    make = fc.ConservingMidpoint if method == "midpoint" else lambda h: fc.GeneralizedAlpha(h, 1.0)
    damping, frequency = swing(make, x / OMEGA, 500)
    assert abs(damping) < 1e-9
    assert frequency == pytest.approx(MIDPOINT[x], rel=1e-7)


@pytest.mark.parametrize("h", [0.01, 0.3, 2.5])
def test_the_exact_method_makes_no_error(h):
    """A free swing and a step of force, with steps as long as one likes."""
    linear = fc.linearize(oscillator())
    run = fc.simulate(linear, until=10.0, inputs={"push": 3.0}, method=fc.Exact(h))
    assert run["x"] == pytest.approx(3.0 / OMEGA**2 * (1.0 - np.cos(OMEGA * run.t)), abs=1e-11)


@pytest.mark.slow
def test_generalised_alpha_tends_to_the_exact_method_under_a_sampled_controller():
    """The linear arm of the example under its servos, with limits: each output as the square of the step."""
    scene = load_scene(EXAMPLES / "flexible_arm.toml")
    exact = fc.simulate(scene.linear, scene.law, until=0.1, method=fc.Exact(2e-3), every=0.01)
    moving = np.abs(exact.y).max(axis=0) > 1e-9
    steps = (1e-3, 5e-4)
    runs = [fc.simulate(scene.linear, scene.law, until=0.1, method=fc.GeneralizedAlpha(h), every=0.01) for h in steps]
    errors = np.array([np.abs(run.y - exact.y).max(axis=0)[moving] for run in runs])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.1)
