"""Springs and ropes that vibrate on machines that travel: steps damp that away, where places are right."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

CART, LOAD, TURNS = 10.0, 1.0, 100.0
STIFFNESS = TURNS**2 * CART * LOAD / (CART + LOAD)
SWING = 0.05 * STIFFNESS / TURNS
"""Of the spring's tension [N], for 0.05 m/s between the two."""


def travelling(damping: float = 0.0, large: bool = True) -> fc.Model:
    """Two masses on a spring that are free to travel along x."""
    cart, load = fc.PointMass("cart", (0, 0, 0), CART), fc.PointMass("load", (1, 0, 0), LOAD)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS, damping=damping)
    joints = [fc.Pin(spring.start, cart.node), fc.Pin(spring.end, load.node)]
    joints += [fc.Support(cart.node, "v w"), fc.Support(load.node, "v w")]
    outputs = [fc.Position("x", cart.node, "x"), fc.Tension("tension", spring)]
    outputs += [fc.Velocity("parting", load.node, "x", cart.node)]
    plan = fc.Structure([cart, load, spring], joints, outputs=outputs)
    return fc.assemble(plan, [fc.LargeRotation()] if large else [])


def rides(model: fc.Model, until: float, method: fc.GeneralizedAlpha | None) -> fc.Run:
    return fc.simulate(model, until=until, start=model.rest.with_(v=np.array([1.0, 1.05])), method=method)


@pytest.mark.parametrize("large", [True, False], ids=["large rotations", "small motion"])
@pytest.mark.parametrize(
    ("until", "method", "kept"),
    [(20.0, None, 0.1), (60.0, None, 0.01), (60.0, fc.GeneralizedAlpha(0.01), 0.8)],
    ids=["chosen", "chosen, long", "fixed"],
)
def test_a_vibration_that_steps_take_away(until, method, kept, large):
    """Its cart is right to 1e-4, and nothing was said of the 4.5 N that were 0.2 N after 20 s and 0 after 60 s."""
    run = rides(travelling(large=large), until, method)
    assert np.abs(run["tension"][run.t > 0.8 * until]).max() < kept * SWING
    for name, swing in ("tension", SWING), ("parting", 0.05):
        assert any(note.startswith(f"{name} rings by up to {swing:.2g} from the start on") for note in run.report.notes)


def test_steps_that_keep_it():
    run = rides(travelling(), 1.0, fc.GeneralizedAlpha(2e-4))
    assert np.abs(run["tension"] - SWING * np.sin(TURNS * run.t)).max() < 0.05 * SWING
    assert not run.report.notes


def test_what_rings_out_by_itself_is_not_named():
    run = rides(travelling(damping=0.5 * STIFFNESS / TURNS), 20.0, fc.GeneralizedAlpha(2e-3))
    assert not run.report.notes


@pytest.mark.parametrize("stiffness", [1e6, 1e7, 1e8], ids="{:.0e}".format)
@pytest.mark.parametrize("later", [0.0, 1.0], ids=["at once", "later"])
def test_a_hoist_whose_torque_jumps_by_little(stiffness, later):
    """By a third of the weight: the rope rings by 49 N, half of what it goes through, a twentieth of its tension."""
    sheave, load = fc.PointMass("sheave", (0, 0, 10), 1e3), fc.PointMass("load", (0, 0, 0), 100.0)
    hoist = fc.Winch("hoist", load.node, sheave.node, EA=stiffness, radius=0.1, ratio=10.0, inertia=0.05)
    joints = [fc.Support(sheave.node, "u v w"), fc.Support(load.node, "u v")]
    inputs, outputs = [fc.MotorTorque("torque", hoist)], [fc.Tension("tension", hoist)]
    plan = fc.Structure([sheave, load], joints, [hoist], inputs, outputs)
    model = fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    rest, weight = fc.equilibrium(model, hold={"hoist_source": 0.0}), 100.0 * 9.81
    held = -weight * 0.01 * (1.0 + weight / (2.0 * stiffness))
    law = fc.OpenLoop({"torque": lambda t: held * (1.3 if t >= later else 1.0)})
    run = fc.simulate(model, law, until=3.0, start=rest.state)
    since = f"t = {later:.3g} s" if later else "the start"
    assert any(note.startswith(f"tension rings by up to 49 from {since} on") for note in run.report.notes)
