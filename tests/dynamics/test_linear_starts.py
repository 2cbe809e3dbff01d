"""Linear models that start off their equilibrium: in closed loop as without, and refused where they cannot."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.linalg import eigh

import flexctrl as fc


def crane() -> fc.Model:
    """A cart with a load on a rope."""
    cart, rope = fc.PointMass("cart", (0, 0, 0), 1.0), fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e5)
    load = fc.PointMass("load", (0, 0, -1), 2.0)
    joints = [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, load.node)]
    joints.append(fc.Support(load.node, "v"))
    inputs = [fc.Force("push", cart.node, "x")]
    plan = fc.Structure([cart, rope, load], joints, inputs=inputs, outputs=[fc.Position("x", cart.node, "x")])
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-3), fc.AdaptiveAlpha()])
def test_a_linear_model_starts_off_rest_under_a_law(method):
    """It raised a bare ValueError of sizes; against the modes of the closed loop."""
    model = crane()
    linear = fc.linearize(model)
    law = control.ss([], [], [], [[-10.0]], inputs=["x"], outputs=["push"])
    start = model.displace([0.1, 0.05])
    run = fc.simulate(linear, law, until=2.0, start=start, method=method, every=0.01)
    K = linear.K.toarray() + 10.0 * linear.B @ np.asarray(linear.Cq)
    frequencies, modes = eigh(K, linear.M.toarray())
    amplitudes = modes.T @ linear.M @ start.q
    true = np.cos(np.outer(run.t, np.sqrt(frequencies))) * amplitudes @ modes[0]
    assert run["x"][0] == pytest.approx(0.1)
    assert run["x"] == pytest.approx(true, abs=2e-3)


def test_a_start_of_another_size_is_refused():
    model, odd = crane(), fc.State(np.zeros((1, 3)), np.eye(3)[None], *np.zeros((3, 1)))
    with pytest.raises(fc.errors.StructureError, match="degrees of freedom; the linear model has"):
        fc.simulate(fc.linearize(model), until=1.0, start=odd)
