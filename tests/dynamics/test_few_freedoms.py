"""Runs of machines of few freedoms, which march on kernels of the whole machine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

pytest.importorskip("llvmlite")

SHAFTS = [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity(), fc.RayleighDamping(0.0, 1e-3)]
TORQUES = {"shoulder_torque": 0.3, "elbow_torque": -0.1}


def trolley(cart: float, load: float, length: float) -> fc.Model:
    """A cart pushed along x, with a load on a rope that does not stretch."""
    wheels, rope = fc.PointMass("cart", (0, 0, 0), cart), fc.Rope("rope", (0, 0, 0), (0, 0, -length), EA=1e6)
    hung = fc.PointMass("load", (0, 0, -length), load)
    joints = [
        fc.Support(wheels.node, held="v w"),
        fc.Pin(wheels.node, rope.start),
        fc.Pin(rope.end, hung.node),
    ]
    outputs = [fc.Position(name, at=part.node, direction="x") for name, part in (("x", wheels), ("load_x", hung))]
    push = fc.Force("push", at=wheels.node, direction="x")
    structure = fc.Structure([wheels, rope, hung], joints, inputs=[push], outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])


def textbook(cart: float, load: float, length: float, push: float, t: np.ndarray) -> np.ndarray:
    """The same by DOP853: (M + m) x'' + m l (a'' cos a − a'² sin a) = F, l a'' + x'' cos a + g sin a = 0."""

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        _, a, v, w = y
        mass = np.array([[cart + load, load * length * np.cos(a)], [np.cos(a), length]])
        return np.array([v, w, *np.linalg.solve(mass, [push + load * length * w**2 * np.sin(a), -9.81 * np.sin(a)])])

    found = solve_ivp(slope, (0.0, t[-1]), np.zeros(4), method="DOP853", t_eval=t, rtol=1e-11, atol=1e-12)
    return np.column_stack([found.y[0], found.y[0] + length * np.sin(found.y[1])])


@pytest.mark.parametrize("relative", [1e-4, 1e-6])
def test_a_load_on_a_trolley_swings_as_the_textbook_says(relative):
    model = trolley(3.0, 2.0, 1.5)
    run = fc.simulate(model, until=6.0, inputs={"push": 25.0}, tolerance=fc.Tolerance(relative, 1e-3 * relative))
    wanted = textbook(3.0, 2.0, 1.5, 25.0, run.t)
    assert run.report.factorisations == 0  # no tangent is needed
    assert np.abs(run.y - wanted).max() < 30.0 * relative * np.abs(wanted).max()
    assert run.report.energy_residual < 30.0 * relative


@pytest.mark.parametrize("step", [2e-3, 0.02])
def test_shafts_that_are_stiff_for_the_step_are_left_to_tangents(step, monkeypatch):
    """The same motion as by plain steps, whether or not the mass does for a tangent."""
    model = fc.assemble(fc.cranes.flexible_arm(), SHAFTS)
    how = {"until": 0.4, "inputs": TORQUES, "method": fc.GeneralizedAlpha(step, rho=0.5)}
    marched = fc.simulate(model, **how)
    monkeypatch.setattr("flexctrl.dynamics.alpha.method._quickest", lambda plain: plain)
    plain = fc.simulate(model, **how)
    assert (marched.report.factorisations == 0) == (step < 0.01)
    fine = fc.simulate(model, **{**how, "method": fc.GeneralizedAlpha(0.5 * step, rho=0.5)})
    own = np.abs(fine.y[::2] - plain.y).max()
    assert np.abs(marched.y - plain.y).max() < 3e-3 * own  # what Newton's method may leave of a step's error
    assert marched.report.energy.dissipated == pytest.approx(plain.report.energy.dissipated, rel=1e-5)


@pytest.mark.parametrize("step", [2e-3, 0.02])
def test_they_go_on_bit_for_bit(step):
    model = fc.assemble(fc.cranes.flexible_arm(), SHAFTS)
    how = {"inputs": TORQUES, "method": fc.GeneralizedAlpha(step, rho=0.5)}
    whole, half = (fc.simulate(model, until=until, **how) for until in (0.8, 0.4))
    rest = fc.simulate(model, until=0.8, start=half.checkpoint, method=how["method"])
    assert np.array_equal(rest.final.q, whole.final.q)
    assert np.array_equal(rest.final.v, whole.final.v)
