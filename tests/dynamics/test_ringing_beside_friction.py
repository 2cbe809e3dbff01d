"""Dry friction elsewhere, or in what rings, hides nothing of loads that are put on at once: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.notes.contacts import Contacts

OMEGA, MASS, LENGTH = 40.0, 500.0, 3.0
WEIGHT = MASS * 9.81


def bouncing(friction: bool) -> fc.Model:
    """A load on an elastic rope that is let go unstretched, and a cart by itself that is pushed."""
    cart, load = fc.PointMass("cart", (5, 0, 0), MASS), fc.PointMass("load", (0, 0, -LENGTH), MASS)
    rope = fc.Rope("rope", (0, 0, 0), load.node.position, EA=MASS * OMEGA**2 * LENGTH)
    joints = [fc.Support(cart.node, "v w"), fc.Support(rope.start), fc.Support(load.node, "u v")]
    joints.append(fc.Pin(rope.end, load.node))
    inputs = [fc.Force("push", cart.node, "x")]
    outputs = [fc.Velocity("bounce", load.node, "z"), fc.Tension("tension", rope)]
    dry = [fc.CoulombFriction({"cart.u": 100.0})] if friction else []
    plan = fc.Structure([cart, rope, load], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch(), *dry])


@pytest.mark.parametrize("friction", [False, True])
def test_a_cart_with_friction_beside_a_load_that_bounces(friction):
    """T = m g (1 − cos ω t), ż = −(g/ω) sin ω t: off by an eighth after 4 s, and named with its size."""
    run = fc.simulate(bouncing(friction), until=4.0, every=0.005, inputs={"push": 500.0})
    off = np.abs(run["tension"] - WEIGHT * (1.0 - np.cos(OMEGA * run.t))).max() / (2.0 * WEIGHT)
    said = " ".join(run.report.notes)
    assert off > 0.05
    assert f"tension rings by up to {WEIGHT:.2g} from the start on" in said
    assert f"bounce rings by up to {9.81 / OMEGA:.2g} from the start on" in said


def motor(friction: float, torque: float) -> fc.Run:
    """A light motor with friction that turns a heavy body by a stiff shaft, in steps that do not see it ring."""
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (3.0, 3.0, 5.0), {"hub": (0, 0, 0)})
    hub = body.point("hub")
    drive = fc.RotaryDrive("motor", hub, axis="z", stiffness=1e6, ratio=1.0, inertia=1e-4)
    dry = [fc.CoulombFriction({"motor": friction})] if friction else []
    outputs, inputs = [fc.DriveSpeed("speed", drive)], [fc.MotorTorque("torque", drive)]
    plan = fc.Structure([body], [fc.Support(hub, "u v w rx ry")], [drive], inputs, outputs)
    model = fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity(), *dry])
    return fc.simulate(model, until=1.0, inputs={"torque": torque}, method=fc.GeneralizedAlpha(1e-2))


@pytest.mark.parametrize("friction", [0.0, 1e-2])
def test_a_motor_with_little_friction_rings_by_what_is_left(friction):
    """(T − F)/(J ω) beside speeds of some 0.2 rad/s that it gets to."""
    ripple = (1.0 - friction) / (1e-4 * np.sqrt(1e6 * (1.0 / 1e-4 + 1.0 / 5.0)))
    assert f"speed rings by up to {ripple:.2g} from the start on" in " ".join(motor(friction, 1.0).report.notes)


def test_what_friction_holds_does_not_ring():
    assert not [note for note in motor(2.0, 1.0).report.notes if "rings" in note]


def test_friction_takes_what_a_vibration_loses():
    """An oscillator of amplitude A loses 4 F A a turn: (2/π) F ω A."""
    mass, spring = fc.PointMass("mass", (1, 0, 0), 2.0), fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=800.0)
    joints = [fc.Support(spring.start), fc.Support(mass.node, "v w"), fc.Pin(spring.end, mass.node)]
    plan = fc.Structure([mass, spring], joints, outputs=[fc.Position("x", mass.node, "x")])
    model = fc.assemble(plan, [fc.Flexible(), fc.LargeRotation(), fc.CoulombFriction({"mass.u": 3.0})])
    run = fc.simulate(model, until=0.1, start=model.rest.with_(v=np.array([20.0])), method=fc.GeneralizedAlpha(1e-5))
    contacts = Contacts.of(model, run.final, [])
    lost = contacts.rubbed(np.array([40.0]))
    assert lost == pytest.approx(2.0 / np.pi * 3.0 * 40.0)
    assert lost * (2.0 * np.pi / 20.0) == pytest.approx(4.0 * 3.0 * 2.0)
    assert contacts.rubbed(np.array([1e-3 * np.abs(run.final.v[0])])) == 0.0


@pytest.mark.parametrize(("speed", "named"), [(1e-13, False), (1.0, True)])
def test_round_off_does_not_ring(speed, named):
    """A mass on a spring of 20 rad/s, in steps of 0.1 s, moved by nothing but the last digits."""
    mass, spring = fc.PointMass("mass", (1, 0, 0), 2.0), fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=800.0)
    joints = [fc.Support(spring.start), fc.Support(mass.node, "v w"), fc.Pin(spring.end, mass.node)]
    plan = fc.Structure([mass, spring], joints, outputs=[fc.Velocity("speed", mass.node, "x")])
    model = fc.assemble(plan, [fc.Flexible(), fc.LargeRotation()])
    start = model.rest.with_(v=np.array([speed]))
    run = fc.simulate(model, until=2.0, start=start, method=fc.GeneralizedAlpha(0.1))
    assert any("speed rings" in note for note in run.report.notes) == named
