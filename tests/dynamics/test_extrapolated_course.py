"""Between the steps of extrapolated runs: places of order 4, rates of order 3, and energy books of order 4.

A machine that turns has shapes that the sums of steps do not tell: turns in two directions do not commute.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc

UNTIL, STEPS = 0.4, (0.02, 0.01, 0.005)
TIMES = np.random.default_rng(1).uniform(0.0, UNTIL, 40)
INERTIA = np.array([[2.0, 0.1, 0.05], [0.1, 1.5, -0.2], [0.05, -0.2, 1.2]])


def rocket() -> tuple[fc.Model, np.ndarray, dict[str, float]]:
    """A free body driven by a force and a torque that turn with it, in wind."""
    body = fc.RigidBody("body", (0, 0, 0), 3.0, INERTIA, {"tip": (0.3, -0.1, -0.5)})
    tip = body.point("tip")
    machine = fc.Structure(
        [body],
        inputs=[fc.FollowerForce("thrust", tip, (0.2, 1, 0.3)), fc.FollowerTorque("twist", body.node, (1, 0, 1))],
        outputs=_told(tip, body.node),
    )
    wind = fc.Wind({"body.tip": 0.4}, speed=(1, -2, 0))
    return fc.assemble(machine, [fc.LargeRotation(), wind]), np.array([0.5, 0, 0, 3, -2, 4]), {"thrust": 5, "twist": 2}


def hinged() -> tuple[fc.Model, np.ndarray, dict[str, float]]:
    """A rotor hinged to a free body, the axis of which turns with that."""
    body = fc.RigidBody("body", (0, 0, 0), 3.0, INERTIA, {"hub": (0.3, 0.2, 0.1)})
    rotor = fc.RigidBody("rotor", (0.5, 0.1, 0.4), 1.0, (0.3, 0.2, 0.4), {"hub": (0.3, 0.2, 0.1)})
    machine = fc.Structure(
        [body, rotor],
        [fc.Hinge(body.point("hub"), rotor.point("hub"), (0.6, 0, 0.8))],
        inputs=[fc.Torque("twist", rotor.node, "x")],
        outputs=_told(rotor.node, rotor.node),
    )
    return fc.assemble(machine, [fc.LargeRotation()]), np.array([0, 0, 0, 3, -2, 4, 5.0]), {"twist": 2.0}


def hung() -> tuple[fc.Model, np.ndarray, dict[str, float]]:
    """A load on a rigid rope that sways in two directions."""
    rope, load = fc.Rope("rope", (0, 0, 0), (0.6, 0, -0.8), EA=1e6), fc.PointMass("load", (0.6, 0, -0.8), 2.0)
    machine = fc.Structure(
        [rope, load],
        [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("push", load.node, "y")],
        outputs=[t for c in "xyz" for t in (fc.Position(c, load.node, c), fc.Velocity(f"v{c}", load.node, c))],
    )
    return fc.assemble(machine, [fc.LargeRotation(), fc.Gravity()]), np.array([2.0, 3.0]), {"push": 3.0}


def sliding() -> tuple[fc.Model, np.ndarray, dict[str, float]]:
    """A block that slides along a free body."""
    body = fc.RigidBody("body", (0, 0, 0), 3.0, INERTIA, {"rail": (0.3, 0.1, 0)})
    block = fc.RigidBody("block", (0.3, 0.1, 0), 1.0, (0.1, 0.2, 0.1))
    machine = fc.Structure(
        [body, block],
        [fc.Slide(body.point("rail"), block.node, "x")],
        inputs=[fc.Force("push", block.node, "y")],
        outputs=_told(block.node, block.node),
    )
    return fc.assemble(machine, [fc.LargeRotation()]), np.array([0, 0, 0, 3, -2, 4, 1.0]), {"push": 3.0}


def _told(place: fc.Node, spin: fc.Node) -> list:
    return [t for c in "xyz" for t in (fc.Position(c, place, c), fc.AngularVelocity(f"w{c}", spin, c))]


MACHINES = {"rocket": rocket, "hinged": hinged, "hung": hung, "sliding": sliding}


@cache
def run(name: str, method: fc.Integrator) -> tuple[np.ndarray, float]:
    """Return the outputs at the times, rows, and the energy residual."""
    model, v, inputs = MACHINES[name]()
    found = fc.simulate(model, until=UNTIL, start=model.rest.with_(v=v), inputs=inputs, method=method)
    assert found.status is fc.Status.FINISHED
    told = [found.at(float(t)) for t in TIMES]
    return np.array([[at[k] for k in model.outputs] for at in told]), found.report.energy_residual


def alpha(h: float) -> fc.GeneralizedAlpha:
    return fc.GeneralizedAlpha(h, rho=1.0)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("rocket", alpha),
        ("rocket", fc.ConservingMidpoint),
        ("hung", alpha),
        pytest.param("hinged", alpha, marks=pytest.mark.long),
        pytest.param("sliding", alpha, marks=pytest.mark.long),
    ],
)
def test_courses_and_books_keep_their_orders(name, method):
    wanted, _ = run(name, fc.ExplicitRungeKutta(1e-3))
    found = [run(name, fc.Richardson(method(h))) for h in STEPS]
    errors = np.array([[np.abs(y - wanted)[:, i::2].max() for i in (0, 1)] + [books] for y, books in found])
    places, rates, books = np.log2(errors[:-1] / errors[1:]).T
    assert (places > 3.7).all(), errors
    assert (rates > 2.7).all(), errors
    assert (books > 3.6).all(), errors
