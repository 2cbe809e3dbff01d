"""What spins beside a pendulum, not coupled to it, does not spoil the pendulum's error.

Tolerances are relative to the largest travel: a rotor of 1000 rad/s travels 10⁴ rad in ten seconds.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

METHODS = {
    "AdaptiveAlpha": (fc.AdaptiveAlpha(), 1e-5),
    "ExplicitRungeKutta": (fc.ExplicitRungeKutta(), 1e-5),
    "Richardson": (fc.Richardson(fc.AdaptiveAlpha(rho=1.0)), 1e-4),
}
UNTIL = 5.0


@cache
def machine() -> fc.Model:
    rotor = fc.RigidBody("rotor", (5, 0, 0), 1.0, (1, 1, 1))
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    supports = [fc.Support(rotor.node, "u v w rx ry"), fc.Support(bob.point("top"), "u v w rx rz")]
    structure = fc.Structure([rotor, bob], supports, outputs=[fc.Rotation("angle", bob.node, "y")])
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])


@cache
def error(name: str, spin: float) -> float:
    """Largest error of the pendulum's angle over its largest."""
    model, (method, share) = machine(), METHODS[name]
    v = np.zeros(2)
    v[model.coordinate("rotor_0_rz")], v[model.coordinate("bob_0_ry")] = spin, 0.3
    run = fc.simulate(
        model, until=UNTIL, start=model.rest.with_(v=v), every=0.05, method=method, tolerance=fc.Tolerance(share, 1e-9)
    )
    assert run.status is fc.Status.FINISHED
    swing = solve_ivp(
        lambda t, y: [y[1], -9.81 / 1.001 * np.sin(y[0])], (0, UNTIL), [0, 0.3], t_eval=run.t, rtol=1e-11, atol=1e-12
    )
    return float(np.abs(run["angle"] - swing.y[0]).max() / np.abs(swing.y[0]).max())


@pytest.mark.parametrize("spin", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("name", METHODS)
def test_the_pendulum_is_as_right_as_without_the_rotor(name, spin):
    """The rotor turns at a constant rate, which every method makes exactly: it asks for no steps of its own.

    The radian that its travel counts for is ten times what the pendulum travels, so steps may be ten times as wrong,
    and errors add up.
    """
    assert error(name, spin) < 0.02
    assert error(name, spin) < 30.0 * error(name, 0.0)
    assert error(name, spin) == pytest.approx(error(name, 10.0), rel=0.5)
