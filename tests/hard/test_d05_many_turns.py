"""D5: half a turn, whole turns, a thousand turns: no singular rotation, and an angle that does not wrap."""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError

PAGE = "hard"


def rolled(turns: float, elements: int) -> fc.Rest:
    section = fc.Section(EA=1e8, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=elements)
    planar = [fc.Support(node, held="w rx ry") for node in beam.nodes[1:]]
    outputs = [*[fc.Position(axis, beam.end, axis) for axis in "xyz"], fc.Rotation("turn", beam.end, "z")]
    structure = fc.Structure(
        [beam], [fc.Support(beam.start), *planar], inputs=[fc.Torque("moment", beam.end, "z")], outputs=outputs
    )
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])
    return fc.equilibrium(model, inputs={"moment": 2.0 * np.pi * turns})


@pytest.mark.parametrize("turns", [0.5, 1, 1.5, 2, 3, -1])
def test_exact_multiples_of_half_a_turn(turns):
    rest = rolled(turns, 16)
    assert rest.outputs["turn"] == pytest.approx(2.0 * np.pi * turns, rel=1e-9)
    if turns == int(turns):
        assert np.hypot(rest.outputs["x"], rest.outputs["y"]) < 1e-9


def test_ten_turns():
    rest = rolled(10, 40)
    assert rest.outputs["turn"] == pytest.approx(20.0 * np.pi, rel=1e-9)
    assert np.hypot(rest.outputs["x"], rest.outputs["y"]) < 1e-9
    assert all(np.isfinite(rest.state.x).ravel())


def test_three_elements_make_a_turn():
    rest = rolled(1, 3)
    assert rest.outputs["turn"] == pytest.approx(2.0 * np.pi, rel=1e-9)
    assert np.hypot(rest.outputs["x"], rest.outputs["y"]) < 1e-9


def single() -> fc.Model:
    section = fc.Section(EA=1e8, EI_y=1.0, EI_z=1.0, GJ=2.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section)
    return fc.assemble(fc.Structure([beam], [fc.Support(beam.start)]), [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("angle", [np.pi / 2, 2.5, 2.73])
def test_one_element_twisted_by_nearly_half_a_turn(angle):
    """½ GJ/L φ²."""
    model = single()
    assert model.energy(model.displace({"beam_1_rx": angle}))[1] == pytest.approx(angle**2, rel=1e-12)


@pytest.mark.parametrize("way", ["rx", "ry", "rz"])
def test_one_element_turned_by_half_a_turn_is_refused(way):
    """Beyond it the frame turns over, and what holds it back would drive it on."""
    assert np.isfinite(single().energy(single().displace({f"beam_1_{way}": 2.73}))).all()
    for angle in (2.75, 3.1, np.pi, -3.1, 3.5):
        with pytest.raises(StructureError, match=r"element 1 of beam is turned by .* give beam more elements"):
            single().displace({f"beam_1_{way}": angle})


def test_an_element_without_length_is_refused():
    with pytest.raises(StructureError, match="no length"):
        single().displace({"beam_1_u": -1.0})


@pytest.mark.slow
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.04), fc.AdaptiveAlpha()], ids=lambda m: type(m).__name__)
def test_a_thousand_turns(record, method):
    """A body at a constant rate of ten turns a second about an axis askew, on a hinge, and free."""
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    frame = fc.RigidBody("frame", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    structure = fc.Structure(
        [frame, body],
        [fc.Support(frame.node), fc.Hinge(frame.node, body.node, tuple(axis))],
        outputs=[fc.Rotation("turn", body.node, tuple(axis), minus=frame.node)],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    rate = 20.0 * np.pi
    run = fc.simulate(model, start=model.rest.with_(v=np.array([rate])), until=100.0, method=method)
    name = type(method).__name__
    record(
        f"D5 body on a hinge after 1000 turns, {name}: angle [rad]",
        ours=run["turn"][-1],
        reference=6283.185307179586,
        source="2000 π",
        tolerance=1e-9,
    )
    R = run.final.R[1]
    record(
        f"D5 body on a hinge after 1000 turns, {name}: orientation less that at the start",
        ours=np.abs(R - np.eye(3)).max(),
        reference=0,
        source="whole turns",
        tolerance=Absolute(1e-6),
    )
    record(
        f"D5 body on a hinge after 1000 turns, {name}: RᵀR less one",
        ours=np.abs(R.T @ R - np.eye(3)).max(),
        reference=0,
        source="a rotation",
        tolerance=Absolute(1e-12),
    )


@pytest.mark.slow
def test_a_free_body_spun_a_thousand_turns(record):
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    model = fc.assemble(fc.Structure([body]), [fc.LargeRotation()])
    spin = 20.0 * np.pi * np.array([1.0, 2.0, 2.0]) / 3.0
    start = model.rest.with_(v=np.concatenate([np.zeros(3), spin]))
    run = fc.simulate(model, start=start, until=100.0, method=fc.GeneralizedAlpha(0.01))
    R = run.final.R[0]
    record(
        "D5 free body after 1000 turns: orientation less that at the start, RᵀR less one",
        ours=[np.abs(R - np.eye(3)).max(), 1e6 * np.abs(R.T @ R - np.eye(3)).max()],
        reference=[0, 0],
        source="whole turns; the second times 10⁶",
        tolerance=Absolute(1e-6),
    )


@pytest.mark.parametrize("axis", [(1, 1, 0), (1, 2, -1)])
@pytest.mark.parametrize("turns", [1, 50])
def test_rows_within_a_step_of_whole_turns(axis, turns):
    """A ball is right in steps of any length; within one of fifty turns round-off across the axis was all there was."""
    along, spin = np.array(axis) / np.linalg.norm(axis), 100.0
    ball = fc.RigidBody("ball", (0, 0, 0), 2.0, (0.4, 0.4, 0.4), {"mark": (0, 0, 1)})
    outputs = [fc.Position(c, ball.point("mark"), c) for c in "xyz"] + [fc.Velocity("vx", ball.point("mark"), "x")]
    model = fc.assemble(fc.Structure([ball], outputs=outputs), [fc.LargeRotation()])
    until = 2.0 * np.pi * turns / spin
    start = model.rest.with_(v=np.append(np.zeros(3), spin * along))
    for method in (fc.AdaptiveAlpha(), fc.GeneralizedAlpha(until)):
        run = fc.simulate(model, until=until, start=start, every=until / 200, method=method)
        places = Rotation.from_rotvec(np.outer(spin * run.t, along)).apply([0.0, 0.0, 1.0])
        assert np.abs(run.y[:, :3] - places).max() < 1e-8
        assert np.abs(run["vx"] - np.cross(spin * along, places)[:, 0]).max() < 1e-6
