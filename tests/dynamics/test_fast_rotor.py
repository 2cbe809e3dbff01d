"""What spins or travels beside a pendulum, not coupled to it, does not spoil the pendulum's error.

Tolerances are relative to the largest travel: a rotor of 1000 rad/s travels 10⁴ rad in ten seconds.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.dynamics.scales import components

METHODS = {
    "AdaptiveAlpha": (fc.AdaptiveAlpha(), 1e-5),
    "ExplicitRungeKutta": (fc.ExplicitRungeKutta(), 1e-5),
    "Richardson": (fc.Richardson(fc.AdaptiveAlpha(rho=1.0)), 3e-3),
}
UNTIL = 5.0


@cache
def machine(neighbour: str) -> fc.Model:
    rotor = fc.RigidBody("rotor", (5, 0, 0), 1.0, (1, 1, 1))
    cart = fc.PointMass("cart", (5, 0, 0), 1.0)
    wheel = fc.LinearDrive("wheel", cart.node, direction="x", radius=0.1, stiffness=10.0, ratio=1.0, inertia=1.0)
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    beside = {"rotor": (rotor, "u v w rx ry", ()), "cart": (cart, "v w", ()), "driven": (cart, "v w", (wheel,))}
    part, held, drives = beside[neighbour]
    supports = [fc.Support(part.node, held), fc.Support(bob.point("top"), "u v w rx rz")]
    structure = fc.Structure([part, bob], supports, drives, outputs=[fc.Rotation("angle", bob.node, "y")])
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()])


@cache
def error(name: str, neighbour: str, speed: float) -> float:
    """Largest error of the pendulum's angle over its largest."""
    model, (method, share) = machine(neighbour), METHODS[name]
    shares = {"rotor_0_rz": 1.0, "cart_0_u": 1.0, "wheel_source": 10.0}
    v = np.array([shares.get(coordinate, 0.0) * speed for coordinate in model.coordinates])
    v[model.coordinate("bob_0_ry")] = 0.3
    run = fc.simulate(
        model, until=UNTIL, start=model.rest.with_(v=v), every=0.05, method=method, tolerance=fc.Tolerance(share, 1e-9)
    )
    assert run.status is fc.Status.FINISHED
    swing = solve_ivp(
        lambda t, y: [y[1], -9.81 / 1.001 * np.sin(y[0])], (0, UNTIL), [0, 0.3], t_eval=run.t, rtol=1e-11, atol=1e-12
    )
    return float(np.abs(run["angle"] - swing.y[0]).max() / np.abs(swing.y[0]).max())


@pytest.mark.parametrize("neighbour", ["rotor", "cart", "driven"])
@pytest.mark.parametrize("name", METHODS)
def test_the_pendulum_is_as_right_as_without_the_neighbour(name, neighbour):
    """What moves at a constant rate is made exactly by every method; its rounding may ask for shorter steps."""
    alone = error(name, neighbour, 0.0)
    assert alone < 0.02
    assert error(name, neighbour, 1000.0) <= 1.01 * alone


def test_parts_are_what_is_coupled():
    """A rope couples, and so do gears and welds; what stands beside does not."""
    assert len(set(components(machine("driven")))) == 2
    one, other = fc.PointMass("one", (0, 0, 0), 1.0), fc.PointMass("other", (1, 0, 0), 1.0)
    rope = fc.Rope("rope", (0, 0, 0), (1, 0, 0), EA=1e3)
    pins = [fc.Pin(rope.start, one.node), fc.Pin(rope.end, other.node)]
    effects = [fc.LargeRotation(), fc.RopeStretch()]
    assert len(set(components(fc.assemble(fc.Structure([one, other, rope], pins), effects)))) == 1
    apart = fc.Structure([one, other], [fc.Support(one.node, "v"), fc.Support(other.node, "v")])
    assert components(fc.assemble(apart, effects)).tolist() == [0, 0, 1, 1]
    crane = fc.assemble(fc.cranes.ceiling_crane(), [fc.Flexible()])
    assert not components(crane).any()
