"""D25: two poles at zero: Riccati and Lyapunov equations of a crane whose trolley is free.

The crane of 3.355 and 1 kg on 0.5 m; without friction, then with so little of it that poles come close to zero.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import lqr

PAGE = "hard"


def crane(friction: float) -> fc.LinearModel:
    cart, load = fc.PointMass("cart", (0, 0, 0), 3.355), fc.PointMass("load", (0, 0, -0.5), 1.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -0.5), EA=1.0)
    structure = fc.Structure(
        [cart, rope, load],
        [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=[fc.Position("x", cart.node, "x"), fc.SwayAngle("sway", cart.node, load.node, "x")],
    )
    effects = [fc.LargeRotation(), fc.Gravity(), *([fc.ViscousFriction({"cart.u": friction})] if friction else [])]
    return fc.linearize(fc.assemble(fc.planar(structure, "y"), effects))


@pytest.mark.parametrize("friction", [0.0, 1e-9, 1e-6, 1e-3])
def test_regulator(record, friction):
    model = crane(friction)
    regulator = lqr(model.to_ss(), np.eye(4), np.eye(1))
    record(
        f"D25 crane, friction {friction:g} N s/m: residual of the Riccati equation",
        ours=regulator.residual,
        reference=0,
        source="CARE",
        tolerance=Absolute(1e-8),
    )
    assert regulator.poles.real.max() < 0.0
    assert fc.peak_gain(model).value == np.inf
