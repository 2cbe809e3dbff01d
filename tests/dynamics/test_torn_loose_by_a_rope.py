"""A motor that dry friction holds is torn loose where its slack rope is caught: forces jump as it breaks loose."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

G, MASS, RADIUS, RATIO, INERTIA = 9.81, 400.0, 0.3, 6.0, 0.14
PLAIN = fc.Unchecked(fc.AdaptiveAlpha())
METHODS = [
    {"method": PLAIN, "tolerance": fc.Tolerance(1e-7, 1e-10)},
    {"method": PLAIN},
    {"method": fc.Unchecked(fc.GeneralizedAlpha(1e-3))},
    {"method": fc.Unchecked(fc.ExplicitRungeKutta()), "tolerance": fc.Tolerance(1e-6, 1e-9)},
]


def hoist(friction: float) -> fc.Model:
    """A load on a damped rope, whose motor is held by a multiple of what its weight pulls with."""
    frame, load = fc.RigidBody("frame", (0, 0, 20), 1.0, (1, 1, 1)), fc.PointMass("load", (0, 0, 0), MASS)
    winch = fc.Winch("winch", load.node, frame.node, EA=1e8, radius=RADIUS, ratio=RATIO, inertia=INERTIA, damping=14e3)
    outputs = [fc.Position("z", load.node, "z"), fc.DriveSpeed("speed", winch), fc.Tension("tension", winch)]
    plan = fc.Structure([frame, load], [fc.Support(frame.node)], [winch], outputs=outputs)
    held = fc.CoulombFriction({"winch": fc.Coulomb(friction * MASS * G * RADIUS / RATIO)})
    return fc.assemble(plan, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch(), held])


@pytest.mark.parametrize("speed", [(0.0, 0.0, 3.0), (-3.4, 3.8, 2.8)])
def test_friction_brakes_what_the_catch_has_torn_loose(speed):
    """It was gone for the rest of the run, as it was let go just before the catch, where nothing pulled either way."""
    model, friction = hoist(1.03), 1.03 * MASS * G * RADIUS / RATIO
    start = model.rest.with_(v=np.array([*speed, 0.0]))
    tight, *others = (fc.simulate(model, until=2.5, start=start, every=0.002, **how) for how in METHODS)
    late = tight.t > 1.5
    pull = tight["tension"][late] * RADIUS / RATIO
    braked = INERTIA * (tight["speed"][late][-1] - tight["speed"][late][0])
    assert braked < 0.0
    assert braked == pytest.approx(np.trapezoid(pull - friction, tight.t[late]), rel=1e-2)
    for run in others:
        assert run["speed"][-1] == pytest.approx(tight["speed"][-1], rel=1e-3)
        assert run["z"][-1] == pytest.approx(tight["z"][-1], rel=1e-3)


def test_what_is_held_well_stands_after_the_catch():
    model = hoist(1.2)
    start = model.rest.with_(v=np.array([-3.4, 3.8, 2.8, 0.0]))
    tight, *others = (fc.simulate(model, until=2.5, start=start, **how) for how in METHODS[:3])
    assert tight["speed"][-1] == pytest.approx(0.0, abs=1e-6)
    for run in others:
        assert run["speed"][-1] == pytest.approx(0.0, abs=1e-6)
        assert run["z"][-1] == pytest.approx(tight["z"][-1], abs=1e-3)
