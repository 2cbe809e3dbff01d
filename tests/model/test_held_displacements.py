"""Equilibria of beams whose end is held away from where it was drawn, with no load that would say what is large."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def cantilever(elements: int, EA: float = 1e6, effects: tuple[fc.effects.Effect, ...] = ()) -> fc.Model:
    section = fc.Section(EA=EA, EI_y=200.0, EI_z=100.0, GJ=80.0, rhoA=1.0, rhoJ=0.01)
    beam = fc.Beam("b", (0, 0, 0), (1, 0, 0), section, elements=elements)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("push", beam.end, "z")],
        outputs=[fc.Position("x", beam.end, "x"), fc.Position("z", beam.end, "z")],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), *effects])


@pytest.mark.parametrize("elements", [2, 4, 16])
@pytest.mark.parametrize("angle", [0.1, 1.0, 4.0])
def test_a_twisted_wire_is_twisted_evenly(elements, angle):
    """From four elements on none was found: nothing is at work at the start, and all is large beside it."""
    model = cantilever(elements)
    rest = fc.equilibrium(model, hold={f"b_{elements}_rx": angle})
    turns = [rest.state.q[model.coordinate(f"b_{i}_rx")] for i in range(1, elements + 1)]
    assert turns == pytest.approx(angle * np.arange(1, elements + 1) / elements)
    assert rest.iterations < 100


@pytest.mark.parametrize("elements", [4, 16])
@pytest.mark.parametrize("angle", [-0.01, 0.5, 2.0, 3.0])
def test_an_end_held_at_an_angle_bends_the_beam_to_an_arc(elements, angle):
    rest = fc.equilibrium(cantilever(elements), hold={f"b_{elements}_ry": -angle})
    arc = np.array([np.sin(angle), 1.0 - np.cos(angle)]) / angle
    assert list(rest.outputs.values()) == pytest.approx(arc, abs=4e-3 / elements)
    assert bool(rest.notes) == (not rest.stable)  # held so far round, it falls out of its plane


@pytest.mark.parametrize(("angle", "told"), [(0.9, False), (1.2, True)])
def test_an_element_that_bends_too_far_is_told(angle, told):
    model = cantilever(1)
    rest = fc.equilibrium(model, hold={"b_1_ry": -angle})
    run = fc.simulate(model, until=1e-3, start=rest)
    for notes in (rest.notes, run.report.notes):
        assert any("element 1 of b is turned by 1.2 rad" in note for note in notes) == told


@pytest.mark.parametrize("effects", [(), (fc.Gravity(),)], ids=["alone", "with its weight"])
@pytest.mark.parametrize("EA", [1e6, 1e9])
@pytest.mark.parametrize("force", [5.0, 300.0])
def test_held_where_a_force_has_it_it_is_where_the_force_has_it(force, EA, effects):
    model = cantilever(6, EA, effects)
    pushed = fc.equilibrium(model, inputs={"push": force})
    held = fc.equilibrium(model, hold={"b_6_w": float(pushed.state.q[model.coordinate("b_6_w")])})
    assert held.state.q == pytest.approx(pushed.state.q, abs=1e-9)
    assert held.iterations < 100


def test_what_is_stretched_is_longer_throughout():
    rest = fc.equilibrium(cantilever(5), hold={"b_5_u": 0.01})
    model = rest.model
    assert [rest.state.q[model.coordinate(f"b_{i}_u")] for i in range(1, 6)] == pytest.approx(
        0.002 * np.arange(1, 6), rel=1e-9
    )


@pytest.mark.parametrize("effects", [(), (fc.Gravity(),), (fc.Gravity((0, 0, 0)),)], ids=["none", "carried", "nothing"])
@pytest.mark.parametrize(("ratio", "stiffness"), [(1.0, 1.0), (1.0, 2000.0), (10.0, 200.0), (100.0, 2000.0)])
@pytest.mark.parametrize("angle", [0.01, 0.3, 1.0, 2.0])
def test_a_motor_held_elsewhere_takes_its_link_along(ratio, stiffness, effects, angle):
    """Where it rests nothing is at work at all: a third of such were refused, and more with a weight it bears."""
    link = fc.RigidBody("link", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=stiffness, ratio=ratio, inertia=0.05)
    outputs = [fc.Rotation("turn", link.node, "z")]
    structure = fc.Structure([link], [fc.Support(hinge, "u v w rx ry")], [motor], outputs=outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Flexible(), *effects])
    rest = fc.equilibrium(model, hold={"motor_source": angle * ratio})
    assert rest.outputs["turn"] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize("angle", [1e-3, 0.5, 2.0])
def test_a_flexible_jib_slews_with_its_motor_whatever_its_weight(angle):
    tube = fc.Section.tube(fc.STEEL, radius=0.1, thickness=0.005)
    jib = fc.Beam("jib", (0, 0, 0), (8, 0, 0), tube, elements=3)
    drive = fc.RotaryDrive("slew", jib.start, axis="z", stiffness=1e3, ratio=200.0, inertia=0.02)
    structure = fc.planar(
        fc.Structure([jib], [fc.Support(jib.start, "u v")], [drive], outputs=[fc.Position("y", jib.end, "y")]), "z"
    )
    scene = fc.Scene(structure, (fc.Gravity(), fc.Flexible(), fc.LargeRotation()), hold={"slew_source": 200.0 * angle})
    assert scene.rest.outputs["y"] == pytest.approx(8.0 * np.sin(angle), abs=1e-9)


@pytest.mark.parametrize("lag", [(), (fc.MotorLag({"motor": 0.02, "other": 0.01}),)], ids=["at once", "lagging"])
@pytest.mark.parametrize(("ratio", "stiffness", "inertia"), [(1.0, 0.01, 0.3), (1.0, 500.0, 0.0), (100.0, 1e9, 0.3)])
@pytest.mark.parametrize(("angle", "torque"), [(1e-3, 0.0), (0.3, 3.0), (2.0, 0.0), (6.0, 3.0)])
def test_a_motor_held_elsewhere_leaves_what_is_free_beside_it_alone(angle, torque, ratio, stiffness, inertia, lag):
    """Nothing pushes what may turn as it likes, which has no stiffness: no search got through its singular K."""
    wheels = [fc.RigidBody(name, (x, 0, 0), 1.0, (1.0, 1.0, 2.0)) for name, x in (("held", 0.0), ("free", 5.0))]
    drives = [
        fc.RotaryDrive(name, wheel.node, axis="z", stiffness=stiffness, ratio=ratio, inertia=inertia)
        for name, wheel in zip(("motor", "other"), wheels, strict=True)
    ]
    supports = [fc.Support(wheel.node, "u v w rx ry") for wheel in wheels]
    structure = fc.Structure(wheels, supports, drives, [fc.MotorTorque("torque", "motor")])
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), *lag])
    rest = fc.equilibrium(model, hold={"motor_source": ratio * angle}, inputs={"torque": torque})
    there = {"held_0_rz": angle, "free_0_rz": 0.0, "motor_source": ratio * angle, "other_source": 0.0}
    assert [rest.state.q[model.coordinate(name)] for name in there] == pytest.approx([*there.values()], abs=1e-5)
    assert rest.holding["motor_source"] == pytest.approx(-torque, abs=1e-5)
