"""Equilibria far from where the machine is drawn, in a shape that it leaves by itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import flexctrl as fc

G, ARM, MASS, EA = 9.81, 1.0, 3.0, 1e4


def hoist(spin: float, drawn: float = 0.0) -> fc.Model:
    """A load on a winch at the end of an arm of 1 m, drawn in some direction, in a frame that turns."""
    tip = (ARM * np.cos(drawn), ARM * np.sin(drawn))
    arm, load = fc.PointMass("arm", (*tip, 0), 1.0), fc.PointMass("load", (*tip, -2.0), MASS)
    winch = fc.Winch("winch", load.node, arm.node, EA=EA, radius=0.1, ratio=2.0, inertia=0.1)
    outputs = [fc.Position("x", load.node, "x"), fc.Position("z", load.node, "z")]
    plan = fc.Structure([arm, load], [fc.Support(arm.node)], [winch], outputs=outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.RotatingFrame((0, 0, spin)), fc.RopeStretch()])


@pytest.mark.parametrize("wound", [0.0, 6.0])
@pytest.mark.parametrize("spin", [2.0, 2.5, 3.5])
def test_a_load_is_thrown_out_by_a_turning_arm(spin, wound):
    """Above √(g/l) = 2.2 rad/s it leaves the vertical by itself; the search went to and fro, and found nothing."""
    rest = fc.equilibrium(hoist(spin), hold={"winch_source": wound})
    drawn = 2.0 + 0.05 * wound

    def length(lean: float) -> float:
        return drawn * (1.0 + MASS * G / np.cos(lean) / EA)

    def left(lean: float) -> float:
        return np.tan(lean) - spin**2 * (ARM + length(lean) * np.sin(lean)) / G

    lean = brentq(left, 0.0, 1.55)
    assert rest.outputs["x"] == pytest.approx(ARM + length(lean) * np.sin(lean), abs=1e-9)
    assert rest.outputs["z"] == pytest.approx(-length(lean) * np.cos(lean), abs=1e-9)
    assert not rest.unstable


@pytest.mark.parametrize("drawn", [0.0, 0.5, 1.5])
def test_what_lasts_is_found_in_every_direction(drawn):
    """Drawn at half a radian it was found hanging inwards, where it does not stay."""
    rest = fc.equilibrium(hoist(4.0, drawn), hold={"winch_source": 20.0})
    assert np.linalg.norm(rest.state.x[1, :2]) == pytest.approx(4.0237077725, rel=1e-9)  # as `left` above has it
    assert rest.stable


@pytest.mark.parametrize("turn", [(0.3, 0.2, 0.5), (2.0, -1.0, 1.5), (5.0, -4.0, 3.0)])
def test_a_weight_on_a_hinge_whose_carrier_is_held_turned(turn):
    """It hangs as low as the hinge lets it; that took thousands of steps, or nothing was found."""
    base = fc.RigidBody("base", (0, 0, 0), 2.0, (0.3, 0.5, 0.7), points={"tip": (1, 0, 0)})
    link = fc.RigidBody("link", (1, 0, 0), 1.0, (0.3, 0.5, 0.7), points={"end": (1, 0, -1)})
    load = fc.PointMass("load", (1, 0, -1), 3.0)
    hinge = fc.Hinge(base.point("tip"), link.node, axis="y")
    joints = [fc.Support(base.node, "u v w"), hinge, fc.Pin(link.point("end"), load.node)]
    plan = fc.Structure([base, link, load], joints, outputs=[fc.Position("z", load.node, "z")])
    model = fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])
    rest = fc.equilibrium(model, hold=dict(zip(("base_0_rx", "base_0_ry", "base_0_rz"), turn, strict=True)))
    along, _, up = Rotation.from_rotvec(turn).as_matrix()[2]
    assert rest.outputs["z"] == pytest.approx(along - np.hypot(along, up), abs=1e-9)
    assert rest.iterations <= 20
    assert not rest.unstable


@pytest.mark.parametrize("slender", [1e4, 1e6])
@pytest.mark.parametrize("pressed", [0.01, 0.05, 0.2, 0.7])
def test_a_column_pressed_down_bends_to_the_side_it_is_pushed_to(slender, pressed):
    """One stable branch, as a path of loads follows it; it was found straight and unstable, or not at all."""
    stiffness, length = 100.0, 2.0
    section = fc.Section(
        EA=slender * stiffness / length**2, EI_y=stiffness, EI_z=stiffness, GJ=stiffness, rhoA=1.0, rhoJ=1e-3
    )
    beam = fc.Beam("c", (0, 0, 0), (0, 0, length), section, elements=16, up=(1, 0, 0))
    joints = [fc.Support(beam.start), *(fc.Support(node, "v rx rz") for node in beam.nodes[1:])]
    inputs = [fc.Force("press", beam.end, "-z"), fc.Force("push", beam.end, "x")]
    outputs = [fc.Position("x", beam.end, "x"), fc.Position("z", beam.end, "z")]
    model = fc.assemble(
        fc.Structure([beam], joints, inputs=inputs, outputs=outputs), [fc.Flexible(), fc.LargeRotation()]
    )
    euler = np.pi**2 * stiffness / (4.0 * length**2)
    push = {"push": 0.01 * euler}
    path = fc.equilibrium_path(model, {"press": euler}, until={"z": (1.0 - pressed) * length}, inputs=push)
    for start in (None, fc.equilibrium(model, inputs=push).state):
        rest = fc.equilibrium(model, hold={"c_16_w": -pressed * length}, inputs=push, start=start)
        assert rest.outputs["x"] == pytest.approx(path.points[-1].outputs["x"], rel=1e-6)
        assert rest.stable


@pytest.mark.parametrize("lean", [0.15, 0.5, 1.0, 1.3, 2.0])
def test_a_pendulum_let_go_far_from_upright_hangs(lean):
    """Where it hangs nothing is at work: what was left of a search was measured by itself, and it went back upright."""
    body = fc.RigidBody("body", (0, 0, 1), 3.0, (0.1, 0.1, 0.1), {"hub": (0, 0, 0)})
    plan = fc.Structure([body], [fc.Support(body.point("hub"), "u v w rx rz")])
    model = fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])
    rest = fc.equilibrium(model, start=model.displace([lean]))
    assert rest.stable
    assert rest.state.q[0] == pytest.approx(np.pi, abs=1e-9)
    assert fc.equilibrium(model).unstable == 1
