"""Rotations of what tumbles in space: which whole turns go by where the axis passes near its opposite."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import OpenLoop, Table


def ball() -> fc.Model:
    body = fc.RigidBody("ball", (0, 0, 0), 10.0, (1.0, 1.0, 1.0))
    node = body.nodes[0]
    outputs = [fc.Rotation(f"r{axis}", node, axis) for axis in "xyz"]
    return fc.assemble(fc.Structure([body], [fc.Support(node, "u v w")], [], [], outputs), [fc.LargeRotation()])


def twists(t: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """What is left of the rotation of a ball that spins steadily, about each axis, followed without a jump."""
    speed = np.linalg.norm(spin)
    unit, half = spin / speed, 0.5 * speed * t[:, None]
    turns = np.floor((half + np.pi) / (2.0 * np.pi))
    return 2.0 * (np.arctan2(unit * np.sin(half), np.cos(half)) + np.sign(unit) * 2.0 * np.pi * turns)


def spins() -> list[np.ndarray]:
    r = np.random.default_rng(1)
    drawn = [r.normal(size=3) * np.array([1.0, 0.15, 0.03])[r.permutation(3)] for _ in range(8)]
    return [spin * r.uniform(1.0, 6.0) / np.linalg.norm(spin) for spin in drawn]


METHODS = [
    fc.AdaptiveAlpha(largest_step=0.5),
    fc.ExplicitRungeKutta(largest_step=0.5),
    fc.GeneralizedAlpha(0.05),
    fc.ConservingMidpoint(0.05),
]


@pytest.mark.parametrize("every", [None, 0.02, 0.31])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("spin", spins(), ids=lambda spin: f"{np.linalg.norm(spin):.2f}")
def test_a_ball_that_spins_about_a_tilted_axis(spin, method, every):
    """Angles about axes that pass their opposite came out 2π off and worse, told as 4e-15."""
    model = ball()
    run = fc.simulate(model, until=6.0, start=model.rest.with_(v=spin), method=method, every=every)
    assert np.abs(run.y[-1] - twists(run.t[-1:], spin)[0]).max() < 0.05
    far = np.abs(run.y - twists(run.t, spin)) > 1.0
    assert far.mean() < 0.01  # within its errors of the axis a row may be on the other side


@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()])
@pytest.mark.parametrize("spin", spins(), ids=lambda spin: f"{np.linalg.norm(spin):.2f}")
def test_steps_of_more_than_half_a_turn_do_not_tell_whole_turns_silently(spin, method):
    model = ball()
    run = fc.simulate(model, until=6.0, start=model.rest.with_(v=spin), method=method)
    off = np.abs(run.y[-1] - twists(run.t[-1:], spin)[0]).max()
    assert off < 0.05 or run.report.notes


@pytest.mark.parametrize("backend", [None, fc.CasadiVM()])
def test_loops_follow_as_plain_steps_do(backend):
    """A wrist: a link turns about the vertical, a second one about the first."""
    arm = fc.RigidBody("arm", (0.5, 0, 0), 5.0, (0.1, 0.5, 0.5), {"o": (0, 0, 0), "e": (1, 0, 0)})
    hand = fc.RigidBody("hand", (1.2, 0, 0), 2.0, (0.05, 0.08, 0.1), {"o": (1, 0, 0), "e": (1.4, 0, 0)})
    machine = fc.Structure(
        [arm, hand],
        [fc.Support(arm.point("o"), "u v w rx ry"), fc.Hinge(arm.point("e"), hand.point("o"), "x")],
        [],
        [fc.Torque("push", arm.point("o"), "z")],
        [fc.Rotation("x", hand.point("e"), "x"), fc.Rotation("y", hand.point("e"), "y")],
    )
    model = fc.assemble(machine, [fc.LargeRotation()], backend)
    law = OpenLoop({"push": Table((0.0, 4.0), (0.0, 0.0))})
    for method in (None, fc.GeneralizedAlpha(0.01), fc.Richardson(fc.GeneralizedAlpha(0.05))):
        run = fc.simulate(
            model, law, until=4.0, every=0.02, start=model.rest.with_(v=np.array([1.6, 0.11])), method=method
        )
        assert run.y[-1] == pytest.approx([6.1982, 6.2782], abs=5e-3)


def test_a_side_that_nothing_decides_is_told():
    """The jib of a slewing crane nods by a thousandth of a radian when it points the other way."""
    tube = fc.Section.tube(fc.STEEL, radius=0.15, thickness=0.008)
    jib = fc.Beam("jib", (0, 0, 6), (6, 0, 6), tube, elements=2)
    load = fc.PointMass("load", jib.end, 300.0)
    slew = fc.RotaryDrive("slew", jib.start, axis="z", stiffness=5e4, ratio=10, inertia=30.0, damping=20.0)
    machine = fc.Structure(
        [jib, load],
        [fc.Support(jib.start, "u v w rx ry"), fc.Pin(jib.end, load.node)],
        [slew],
        [fc.MotorTorque("torque", slew)],
        [fc.Rotation("nod", jib.end, "y"), fc.Rotation("yaw", jib.end, "z")],
    )
    model = fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.Flexible(), fc.RayleighDamping(beta=1e-3)])
    rest = fc.equilibrium(model, hold={"slew_source": 0.0})
    law = OpenLoop({"torque": Table((0.0, 1.0, 4.0, 5.0, 12.0), (900.0, 900.0, 900.0, 0.0, 0.0))})
    run = fc.simulate(model, law, until=12.0, start=rest, every=0.02)
    assert any(note.startswith("whole turns of nod hang") for note in run.report.notes)
    assert not any(note.startswith("whole turns of yaw") for note in run.report.notes)
