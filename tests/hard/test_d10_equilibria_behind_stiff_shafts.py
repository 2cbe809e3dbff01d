"""D10: equilibria behind shafts of which doubles hold all, and of what they drive nothing.

A shaft of 10¹² N m/rad behind a reduction of 1000 adds 10¹⁸ N m/rad: as good as rigid. What it drives is then where
rigid shafts would have it: beams in line are one beam, pendulums hang as their torques have them.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import EquilibriumError, LinearizationError
from flexctrl.model.balance import Balance
from flexctrl.model.braked import rest_held
from flexctrl.model.eased import Eased, eased

LEVEL, TILTED = np.eye(3), Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
FRAMES = pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
LARGE, SMALL = (fc.Flexible(), fc.LargeRotation()), (fc.Flexible(),)
STIFF = [1e6, 1e10, 1e12, 1e13, 1e15, 1e18, 1e21]
G, HALF = 9.81, 0.5


def section(EI: float) -> fc.Section:
    return fc.Section(EA=1e6 * EI, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=1e-3)


def arm(k, EI=1.0, ratio=100.0, turned=LEVEL, elements=2, effects=LARGE) -> fc.Model:
    """Two beams of 1 m in line, clamped at the left, with a motor on the hinge between them."""
    x, y, z = (tuple(axis) for axis in turned.T)
    a = fc.Beam("a", (0, 0, 0), x, section(EI), up=z, elements=elements)
    b = fc.Beam("b", x, tuple(2.0 * turned[:, 0]), section(EI), up=z, elements=elements)
    drive = fc.RotaryDrive("d", b.start, a.end, axis=z, stiffness=k / ratio**2, ratio=ratio, inertia=1e-3)
    inputs = [fc.Force("F", b.end, y), fc.Force("G", b.end, z), fc.Force("P", b.end, x), fc.MotorTorque("m", drive)]
    outputs = [fc.Position(f"tip_{name}", b.end, axis) for name, axis in zip("xyz", (x, y, z), strict=True)]
    outputs += [fc.Position("middle", a.end, y), fc.Rotation("turn", a.end, z)]
    joints = [fc.Support(a.start), fc.Hinge(a.end, b.start, axis=z)]
    return fc.assemble(fc.Structure([a, b], joints, [drive], inputs, outputs), effects)


def one_beam(EI: float, turned: np.ndarray) -> fc.Model:
    """The same of one beam."""
    x, y, z = (tuple(axis) for axis in turned.T)
    beam = fc.Beam("a", (0, 0, 0), tuple(2.0 * turned[:, 0]), section(EI), up=z, elements=4)
    outputs = [fc.Position(f"tip_{name}", beam.end, axis) for name, axis in zip("xyz", (x, y, z), strict=True)]
    inputs = [fc.Force("F", beam.end, y), fc.Force("G", beam.end, z)]
    machine = fc.Structure([beam], [fc.Support(beam.start)], [], inputs, outputs)
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])


@FRAMES
@pytest.mark.parametrize("effects", [LARGE, SMALL], ids=["large", "small"])
@pytest.mark.parametrize("EI", [100.0, 0.01])
@pytest.mark.parametrize("k", STIFF)
def test_with_its_motor_held_a_hinged_arm_is_one_cantilever(k, EI, effects, turned):
    """P (2L)³/(3 EI), and what the shaft gives, P L²/(k R²)."""
    model = arm(k * EI, EI, 1000.0, turned, effects=effects)
    rest = fc.equilibrium(model, hold={"d_source": 0.0}, inputs={"F": 1e-5 * EI})
    assert rest.outputs["tip_y"] == pytest.approx(1e-5 * (8.0 / 3.0 + 1.0 / k), rel=1e-6)
    assert rest.state.q[model.coordinate("d_source")] == pytest.approx(0.0, abs=1e-12)
    assert (rest.unstable, rest.residual < 1e-9) == (0, True)


@FRAMES
@pytest.mark.parametrize("k", [1e10, 1e12, 1e15, 1e18, 1e21])
def test_bent_by_its_own_length_it_is_where_one_beam_is(k, turned):
    load = {"F": 1.0, "G": 0.7}
    expected, found = fc.equilibrium(one_beam(1.0, turned), inputs=load), arm(k, turned=turned)
    rest = fc.equilibrium(found, hold={"d_source": 0.0}, inputs=load)
    tip = [f"tip_{name}" for name in "xyz"]
    assert [rest.outputs[name] for name in tip] == pytest.approx([expected.outputs[name] for name in tip], abs=1e-9)
    again = fc.equilibrium(found, hold={"d_source": 0.0}, inputs=load, start=rest.state)
    assert again.state.q == pytest.approx(rest.state.q, abs=1e-11)


@FRAMES
@pytest.mark.parametrize("k", STIFF)
def test_a_free_motor_under_torque_bears_what_hangs_on_its_shaft(k, turned):
    """P at 2L and the motor's torque on the hinge: P L³/3 + P L L²/2 at the end of the first beam; θ_d = R s + T/k."""
    model = arm(k, 1.0, 100.0, turned)
    rest = fc.equilibrium(model, inputs={"F": 1e-4, "m": -1e-6})
    assert rest.outputs["middle"] == pytest.approx(1e-4 * 5.0 / 6.0, rel=1e-6)
    assert rest.outputs["turn"] == pytest.approx(1.5e-4, rel=1e-6)
    twist = rest.state.q[model.coordinate("d_source")] - 100.0 * rest.state.driven[0]
    assert twist == pytest.approx(-1e-6 / (k / 1e4), rel=1e-6, abs=1e-13)


def pendulums(stiffness, upright: bool, ratio=100.0, turned=LEVEL) -> fc.Model:
    """In a row, of 1 m and 1 kg each, upright or hanging, a motor on each hinge."""
    ground, way = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1)), turned[:, 2] * (1.0 if upright else -1.0)
    bodies, joints, drives, above, axis = [], [fc.Support(ground.node)], [], ground.node, tuple(turned[:, 1])
    for i, k in enumerate(stiffness):
        ends = {"top": tuple(i * way), "end": tuple((i + 1) * way)}
        body = fc.RigidBody(f"b{i}", tuple((i + HALF) * way), 1.0, (0.02,) * 3, ends)
        joints.append(fc.Hinge(above, body.point("top"), axis=axis))
        motor = {"stiffness": k / ratio**2, "ratio": ratio, "inertia": 1e-6}
        drives.append(fc.RotaryDrive(f"d{i}", body.point("top"), above if i else None, axis=axis, **motor))
        bodies, above = [*bodies, body], body.point("end")
    inputs = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives)]
    outputs = [fc.Rotation(f"turn{i}", body.node, axis) for i, body in enumerate(bodies)]
    machine = fc.Structure([ground, *bodies], joints, drives, inputs, outputs)
    return fc.assemble(machine, [fc.Gravity(tuple(-G * turned[:, 2])), fc.LargeRotation(), fc.ShaftElasticity()])


@FRAMES
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("k", STIFF)
def test_upright_pendulums_fall_with_their_motors(k, n, turned):
    rest = fc.equilibrium(pendulums([k] * n, True, turned=turned))
    assert rest.unstable == n
    held = fc.equilibrium(pendulums([k] * n, True, turned=turned), hold={f"d{i}_source": 0.0 for i in range(1, n)})
    assert held.unstable == 1


@FRAMES
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("k", STIFF)
def test_pendulums_hang_where_torques_and_weights_have_them(k, n, turned):
    """Σ weights beyond a hinge, on its arm: m g (n − i − ½) sin φ_i = T_i − T_{i+1}."""
    model, torques = pendulums([k] * n, False, turned=turned), 1.5 - 0.4 * np.arange(n)
    rest = fc.equilibrium(model, inputs={f"t{i}": torque / 100.0 for i, torque in enumerate(torques)})
    borne = torques - np.append(torques[1:], 0.0)
    expected = np.arcsin(borne / (G * (n - np.arange(n) - HALF)))
    assert [rest.outputs[f"turn{i}"] for i in range(n)] == pytest.approx(expected, abs=1e-9)
    assert rest.unstable == 0
    shafts = np.diff(expected, prepend=0.0) + torques / k
    motors = [rest.state.q[model.coordinate(f"d{i}_source")] / 100.0 for i in range(n)]
    assert motors == pytest.approx(shafts, abs=1e-9)


@pytest.mark.parametrize("stiff", [1e6, 1e12, 1e15, 1e18, 1e21])
@pytest.mark.parametrize("soft", [1e2, 1e6, 1e12])
def test_a_shaft_that_alone_holds_another_is_not_lost_beside_it(soft, stiff):
    """Two wheels, a shaft from the ground to the first and one on to the second, motors held: T/k each."""
    ground = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1))
    wheels = [fc.RigidBody(name, (0, 0, 0), 1.0, (1, 1, 1)) for name in ("w1", "w2")]
    joints = [fc.Support(ground.node), *(fc.Hinge(ground.node, wheel.node, "z") for wheel in wheels)]
    bases, motor = (ground.node, wheels[0].node), {"axis": "z", "ratio": 10.0, "inertia": 1e-3}
    drives = [
        fc.RotaryDrive(f"d{i}", wheel.node, base, stiffness=k / 100.0, **motor)
        for i, (wheel, base, k) in enumerate(zip(wheels, bases, (soft, stiff), strict=True))
    ]
    outputs = [fc.Rotation(wheel.name, wheel.node, "z") for wheel in wheels]
    machine = fc.Structure([ground, *wheels], joints, drives, [fc.Torque("T", wheels[1].node, "z")], outputs)
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity()])
    rest = fc.equilibrium(model, hold={"d0_source": 3.0, "d1_source": 4.0}, inputs={"T": 20.0})
    assert rest.outputs["w1"] == pytest.approx(0.3 + 20.0 / soft, abs=1e-9)
    assert rest.outputs["w2"] == pytest.approx(0.7 + 20.0 / soft + 20.0 / stiff, abs=1e-9)
    assert rest.unstable == 0


@pytest.mark.parametrize("k", [1e6, 1e12, 1e15, 1e18, 1e21])
def test_a_start_that_a_spring_pulls_on_is_no_equilibrium_however_stiff_the_shaft(k):
    """The last digit of the shaft's torque is more than the spring's: nothing is told by it."""
    ground, wheel = (fc.RigidBody(name, (0, 0, 0), 1.0, (1, 1, 1), {"rim": (1, 0, 0)}) for name in ("ground", "wheel"))
    spring = fc.Spring("spring", (1, -1, 0), (1, 0, 0), stiffness=10.0)
    drive = fc.RotaryDrive("d", wheel.node, axis="z", stiffness=k / 1e4, ratio=100.0, inertia=1e-3)
    joints = [fc.Support(ground.node), fc.Support(spring.start), fc.Hinge(ground.node, wheel.node, "z")]
    joints.append(fc.Pin(wheel.point("rim"), spring.end))
    machine = fc.Structure([ground, wheel, spring], joints, [drive], (), [fc.Rotation("turn", wheel.node, "z")])
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity()])
    start = model.displace({"wheel_0_rz": 0.1, "d_source": 10.0})
    assert fc.equilibrium(model, start=start).outputs["turn"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("k", [1e6, 1e12, 1e15, 1e18, 1e21])
def test_a_brake_on_a_motor_behind_a_rigid_shaft_bears_what_stiff_shafts_pass_on(k):
    """The tip's moment about the first hinge, F 2L, through the reduction."""
    ground = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1))
    links = [fc.RigidBody(f"b{i}", (i, 0, 0), 1.0, (1, 1, 1), {"end": (i + 1, 0, 0)}) for i in range(2)]
    ends = [ground.node, links[0].point("end")]
    joints = [fc.Support(ground.node), *(fc.Hinge(e, link.node, "z") for e, link in zip(ends, links, strict=True))]
    motor = {"axis": "z", "ratio": 100.0, "inertia": 1e-3}
    drives = [
        fc.RotaryDrive(f"d{i}", link.node, end, stiffness=k / 1e4, **motor)
        for i, (link, end) in enumerate(zip(links, ends, strict=True))
    ]
    spring = fc.Spring("spring", (2, -1, 0), (2, 0, 0), stiffness=1.0)
    joints += [fc.Support(spring.start), fc.Pin(links[1].point("end"), spring.end)]
    push = fc.Force("F", links[1].point("end"), "y")
    machine = fc.Structure([ground, *links, spring], joints, drives, [push])
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity(of=["d1"])])
    rest = rest_held(model, {"d0_source": 0.0, "d1_source": 30.0}, {"F": 3.0})
    reach = np.array([1.0 + np.cos(0.3), np.sin(0.3)])
    stretched = np.array([reach[0] - 2.0, reach[1] + 1.0])
    pull = np.array([0.0, 3.0]) - stretched * (1.0 - 1.0 / np.linalg.norm(stretched))
    moment = reach[0] * pull[1] - reach[1] * pull[0]
    assert dict(rest.brakes)["d0_source"] == pytest.approx(-moment / 100.0, rel=2.0 / k + 1e-8)


@pytest.mark.parametrize("k", [1e6, 1e10, 1e12, 1e15, 1e18, 1e21])
def test_a_column_on_a_held_motor_buckles_at_eulers_load(k):
    """π² EI/(4 (2L)²); the path of its bent shapes ends where loads alone lead to."""
    model, euler = arm(k, elements=4), np.pi**2 / 16.0
    straight = {"hold": {"d_source": 0.0}, "most": 60}
    planar = fc.assemble(fc.planar(model.structure), model.effects)
    path = fc.equilibrium_path(planar, {"P": -1.0}, 0.7, **straight)
    assert [point.factor for point in path.branchings] == pytest.approx([euler], rel=1e-5)
    assert (path.unstable[0], path.unstable[-1]) == (0, 1)
    assert all(point.rest.model is planar for point in path.points)
    bent = fc.equilibrium_path(planar, {"P": -1.0}, 0.8, start=path.branchings[0], **straight).points[-1]
    assert bent.unstable == 0
    there = fc.equilibrium(planar, {"d_source": 0.0}, {"P": -0.8}, bent.rest.state)
    assert abs(bent.outputs["tip_y"]) > 1.0
    assert there.outputs == pytest.approx(bent.outputs, abs=1e-6)


@FRAMES
@pytest.mark.parametrize("k", [1e12, 1e18])
def test_a_path_leads_to_where_its_last_load_does(k, turned):
    model, load = arm(k, turned=turned), {"F": 1.0, "G": 0.7}
    point = fc.equilibrium_path(model, load, 1.0, hold={"d_source": 0.0}).points[-1]
    rest = fc.equilibrium(model, hold={"d_source": 0.0}, inputs=load)
    assert point.outputs == pytest.approx(rest.outputs, abs=1e-7)
    assert point.unstable == 0


@pytest.mark.parametrize("k", [1e2, 1e6, 1e8])
def test_shafts_beside_which_doubles_hold_all_are_left_as_they_are(k):
    for model in (arm(k), pendulums([k, k], True)):
        assert eased(Balance(model, np.zeros(len(model.inputs))), model.rest) is None


@pytest.mark.parametrize("k", [1e2, 1e12, 1e21])
def test_free_wheels_have_nothing_that_a_shaft_could_hide(k):
    ground, wheel = (fc.RigidBody(name, (0, 0, 0), 1.0, (1, 1, 1)) for name in ("ground", "wheel"))
    drive = fc.RotaryDrive("d", wheel.node, axis="z", stiffness=k, ratio=1.0, inertia=1e-3)
    machine = fc.Structure([ground, wheel], [fc.Support(ground.node), fc.Hinge(ground.node, wheel.node, "z")], [drive])
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity()])
    assert eased(Balance(model, np.zeros(0)), model.rest) is None
    assert fc.equilibrium(model).unstable == 0


def test_what_does_not_stay_in_one_place_behind_softer_shafts_is_refused(monkeypatch):
    drawn = iter(10.0 ** np.arange(-9.0, 3.0))
    monkeypatch.setattr(Eased, "turned", lambda self, state: np.full(len(self.motors), next(drawn)))
    with pytest.raises(EquilibriumError, match=r"behind the shafts of d: .* leave them out of ShaftElasticity"):
        fc.equilibrium(arm(1e18), hold={"d_source": 0.0}, inputs={"F": 1.0})


def test_torques_that_no_digit_tells_are_refused_by_name_where_modes_are_asked_for():
    model = pendulums([1e18] * 2, False)
    rest = fc.equilibrium(model, inputs={"t0": 0.015, "t1": 0.011})
    with pytest.raises(LinearizationError, match=r"shafts of d0 and d1 .* leave them out of ShaftElasticity"):
        fc.linearize(model, rest)


@FRAMES
@pytest.mark.parametrize("turn", [0.0, 0.3])
@pytest.mark.parametrize(
    "stiff", [(1e3, 1e12), (1e8, 1e10), (1e9, 1e11), (1e10, 8e10), (1e13, 1e10), (1e10, 3e10, 1e15)], ids=str
)
def test_held_motors_side_by_side_are_as_one_of_their_stiffness(stiff, turn, turned):
    """However unlike their shafts are, and by whatever reductions."""
    ratios = (100.0, 7.0, 300.0)[: len(stiff)]
    several, one = side_by_side(stiff, ratios, turned), side_by_side((sum(stiff),), (50.0,), turned)
    rest = fc.equilibrium(several, hold={f"d{i}_source": turn * ratio for i, ratio in enumerate(ratios)}, inputs=PUSHED)
    expected = fc.equilibrium(one, hold={"d0_source": turn * 50.0}, inputs=PUSHED)
    assert rest.outputs["tip"] == pytest.approx(expected.outputs["tip"], abs=1e-9)
    found, known = (fc.linearize(rest.model, rest).modes().omega[:4] for rest in (rest, expected))
    assert found == pytest.approx(known, rel=1e-8)


PUSHED = {"F": 0.3}


def side_by_side(stiff, ratios, turned) -> fc.Model:
    """Two beams of 1 m in line, clamped at the left, with motors on the hinge between them."""
    x, y, z = (tuple(axis) for axis in turned.T)
    a = fc.Beam("a", (0, 0, 0), x, section(1.0), up=z, elements=2)
    b = fc.Beam("b", x, tuple(2.0 * turned[:, 0]), section(1.0), up=z, elements=2)
    drives = [
        fc.RotaryDrive(f"d{i}", b.start, a.end, axis=z, stiffness=k / ratio**2, ratio=ratio, inertia=1e-3)
        for i, (k, ratio) in enumerate(zip(stiff, ratios, strict=True))
    ]
    joints = [fc.Support(a.start), fc.Hinge(a.end, b.start, axis=z)]
    machine = fc.Structure([a, b], joints, drives, [fc.Force("F", b.end, y)], [fc.Position("tip", b.end, y)])
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])
