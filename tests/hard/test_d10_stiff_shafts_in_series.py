"""D10: stiff shafts in a row and on branches: the second of two holds all that the first drives, and yet drowns it.

Pendulums hang on pendulums, a motor on each hinge. The closed form is that of rigid shafts, angles φ from the vertical:
a motor's inertia J R² turns by φ_i − φ_{i−1}.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import LinearizationError
from flexctrl.linear import eigen
from flexctrl.linear.pencil import DensePencil, faint_shift

G, HALF, OWN, ROTOR = 9.81, 0.5, 0.02, 0.01
LEVEL, TILTED = np.eye(3), Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
EIGH = 3e-8
STIFF = [1e6, 1e10, 1e11, 1e12, 1e14, 1e16, 1e18]


def hanging(stiffness, ratio=1.0, lighter=1.0, turned=LEVEL, order=1) -> fc.Model:
    """Pendulums of 1 m and 1 kg, each next one lighter, behind shafts of some k R² [N m/rad]."""

    def at(z: float) -> tuple[float, ...]:
        return tuple(z * turned[:, 2])

    ground, axis = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1)), tuple(turned[:, 1])
    bodies, hinges, drives, above = [], [], [], ground.node
    for i, k in enumerate(stiffness):
        m, nodes = lighter**i, {"top": at(-i), "end": at(-i - 1)}
        body = fc.RigidBody(f"b{i}", at(-i - HALF), m, (OWN * m,) * 3, nodes)
        top, base = body.point("top"), above if i else None
        hinges.append(fc.Hinge(above, top, axis=axis))
        spring, inertia = k / ratio**2, ROTOR * m / ratio**2
        drives.append(fc.RotaryDrive(f"d{i}", top, base, axis=axis, stiffness=spring, ratio=ratio, inertia=inertia))
        bodies, above = [*bodies, body], body.point("end")
    inputs = [fc.MotorTorque(f"t{i}", drive) for i, drive in enumerate(drives)]
    outputs = [fc.DriveAngle(f"q{i}", drive) for i, drive in enumerate(drives)]
    joints = [fc.Support(ground.node), *hinges]
    machine = fc.Structure([ground, *bodies], joints, drives[::order], inputs, outputs)
    gravity = fc.Gravity(tuple(-G * turned[:, 2]))
    return fc.assemble(machine, [gravity, fc.LargeRotation(), fc.ShaftElasticity()])


def rigid(n: int, lighter: float = 1.0, angles: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """M and K of the same behind rigid shafts, about some angles from the vertical."""
    phi = np.zeros(n) if angles is None else angles
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        m, reach, motor = lighter**i, np.array([1.0] * i + [HALF] + [0.0] * (n - i - 1)), np.eye(n)[i]
        motor[:i] -= np.eye(n)[i - 1][:i]
        K += m * G * np.diag(reach * np.cos(phi))
        M += m * np.outer(reach, reach) * np.cos(phi[:, None] - phi) + m * ROTOR * np.outer(motor, motor)
        M[i, i] += m * OWN
    return M, K


def frequencies(M: np.ndarray, K: np.ndarray) -> np.ndarray:
    return np.sqrt(eigh(K, M, eigvals_only=True)) / (2.0 * np.pi)


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize(
    ("ratio", "lighter", "order"), [(1.0, 1.0, 1), (1.0, 1.0, -1), (100.0, 1.0, 1), (-30.0, 0.01, 1)]
)
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("k", STIFF)
def test_pendulums_in_a_row_swing_as_behind_rigid_shafts(k, n, ratio, lighter, order, turned):
    linear = fc.linearize(hanging([k] * n, ratio, lighter, turned, order))
    assert linear.modes().frequencies[:n] == pytest.approx(frequencies(*rigid(n, lighter)), rel=20.0 / k + 1e-9)
    assert linear.certificate.rigid_modes == ()
    if k > 1e8:
        assert {f"d{i}_twist" for i in range(n)} <= set(linear.coordinates)
        assert linear.certificate.frequency_error < 1e-12


@pytest.mark.parametrize("first", [1e6, 1e9, 1e12, 1e18])
@pytest.mark.parametrize("second", [1e6, 1e9, 1e12, 1e18])
def test_one_shaft_may_be_far_stiffer_than_the_other(first, second):
    linear = fc.linearize(hanging([first, second]))
    assert linear.modes().frequencies[:2] == pytest.approx(frequencies(*rigid(2)), rel=1e-5)


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("k", [1e10, 1e12, 1e14])
def test_under_torques_they_swing_about_where_these_hold_them(k, n, turned):
    model, torques = hanging([k] * n, 100.0, 1.0, turned), 1.5 - 0.4 * np.arange(n)
    rest = fc.equilibrium(model, inputs={f"t{i}": torque / 100.0 for i, torque in enumerate(torques)})
    borne = torques - np.append(torques[1:], 0.0)
    angles = np.arcsin(borne / rigid(n)[1].diagonal())
    found = fc.linearize(model, rest).modes().frequencies[:n]
    assert found == pytest.approx(frequencies(*rigid(n, 1.0, angles)), rel=1e-5)


@pytest.mark.parametrize("k", [1e11, 1e14, 1e18])
def test_a_run_is_that_behind_rigid_shafts(k):
    """A torque of 1 N m on the first of two from rest: the sum over the modes of rigid shafts."""
    run = fc.simulate(fc.linearize(hanging([k, k])), until=3.0, inputs={"t0": 1.0}, every=0.5)
    squares, shapes = eigh(*rigid(2)[::-1])
    moved = (1.0 - np.cos(np.outer(run.t, np.sqrt(squares)))) / squares
    assert run["q0"] == pytest.approx(moved @ shapes[0] ** 2, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("k", [1e10, 1e14, 1e18])
def test_two_pendulums_hang_on_a_cart_that_a_motor_drives(k):
    ground, cart = fc.RigidBody("ground", (0, 0, 0), 1, (1, 1, 1)), {"a": (-1, 0, 0), "b": (1, 0, 0)}
    cart = fc.RigidBody("cart", (0, 0, 0), 4.0, (1, 1, 1), cart)
    hung = [fc.RigidBody(f"p{n}", (x, 0, -HALF), 1.0, (OWN,) * 3, {"top": (x, 0, 0)}) for n, x in (("a", -1), ("b", 1))]
    spring = fc.Spring("spring", (-3, 0, 0), (0, 0, 0), stiffness=50.0)
    drives = [fc.LinearDrive("d", cart.node, direction="x", radius=0.1, ratio=10.0, stiffness=k / 1e4, inertia=1e-4)]
    joints = [fc.Support(ground.node), fc.Support(spring.start), fc.Slide(ground.node, cart.node, along="x")]
    joints.append(fc.Pin(cart.node, spring.end))
    for body, name, inertia in zip(hung, "ab", (0.01, 0.05), strict=True):
        ends, motor = (body.point("top"), cart.point(name)), {"ratio": 100.0, "inertia": inertia / 1e4}
        joints.append(fc.Hinge(*ends[::-1], axis="y"))
        drives.append(fc.RotaryDrive(f"d{name}", *ends, axis="y", stiffness=k / 1e4, **motor))
    machine = fc.Structure([ground, cart, *hung, spring], joints, drives)
    linear = fc.linearize(fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()]))
    M = np.array([[7.0, -HALF, -HALF], [-HALF, 0.28, 0.0], [-HALF, 0.0, 0.32]])
    expected = frequencies(M, np.diag([50.0, HALF * G, HALF * G]))
    assert linear.modes().frequencies[:3] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize("k", [1e10, 1e12, 1e14, 1e16, 1e18])
def test_behind_a_motor_that_is_held_both_swing_as_one(k, turned):
    """The twist of its shaft takes the place of what it drives."""
    model = hanging([k, k], turned=turned)
    linear = fc.linearize(model, fc.equilibrium(model, hold={"d1_source": 0.0}))
    M, K = (A.sum() for A in rigid(2))
    assert linear.modes().frequencies[0] == pytest.approx(float(np.sqrt(K / M)) / (2.0 * np.pi), rel=1e-8)
    assert (linear.certificate.rigid_modes, linear.modes().unstable) == ((), 0)
    assert "d1_twist" in linear.coordinates
    run = fc.simulate(linear, until=3.0, inputs={"t0": 1.0}, every=0.5)
    assert run["q0"] == pytest.approx((1.0 - np.cos(np.sqrt(K / M) * run.t)) / K, rel=1e-5, abs=1e-9)


def spliced(k: float, bending: float, motors: int = 1, ratio: float = 1000.0) -> fc.Model:
    """Two beams of 1 m in line, clamped, and motors on the hinge between them."""
    section = fc.Section(EA=1e6 * bending, EI_y=bending, EI_z=bending, GJ=bending, rhoA=1.0, rhoJ=1e-3)
    near, far = (fc.Beam(name, (x, 0, 0), (x + 1, 0, 0), section, elements=2) for name, x in (("near", 0), ("far", 1)))
    motor = {"stiffness": k / ratio**2, "ratio": ratio, "inertia": 1e-3}
    drives = [fc.RotaryDrive(f"d{i}", far.start, near.end, axis="z", **motor) for i in range(motors)]
    joints = [fc.Support(near.start), fc.Hinge(near.end, far.start, "z")]
    machine = fc.planar(fc.Structure([near, far], joints, drives))
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("motors", [1, 2])
@pytest.mark.parametrize("bending", [100.0, 0.01])
@pytest.mark.parametrize("k", [1e8, 1e12, 1e16, 1e18, 1e21])
def test_beams_that_held_motors_join_are_one_beam(k, bending, motors):
    """A cantilever of 2 m of as many elements, but for what the shaft gives way."""
    model = spliced(k, bending, motors)
    section = model.structure.elements[0].section
    whole = fc.Beam("whole", (0, 0, 0), (2, 0, 0), section, elements=4)
    machine = fc.planar(fc.Structure([whole], [fc.Support(whole.start)]))
    expected = fc.linearize(fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])).modes()
    held = {f"d{i}_source": 0.0 for i in range(motors)}
    found = fc.linearize(model, fc.equilibrium(model, hold=held)).modes()
    assert (found.rigid, found.unstable) == (0, 0)
    assert found.omega[:4] == pytest.approx(expected.omega[:4], rel=10.0 * bending / k + 1e-9)


@pytest.mark.parametrize(("ratio", "spring"), [(1e3, 1e3), (1e4, 1e7)])
def test_a_motor_far_heavier_than_what_it_drives_leaves_it_its_mass(ratio, spring):
    """A wheel of 1e-6 kg m² on a spring behind 1 kg m² · R²: the shaft's own swing is lost in no mass matrix."""
    hub, wheel = fc.RigidBody("hub", (0, 0, 0), 1.0, (1, 1, 1)), fc.RigidBody("wheel", (0, 0, 0), 1.0, (1e-6,) * 3)
    soft = fc.RotaryDrive("soft", wheel.node, axis="z", stiffness=spring, ratio=1.0, inertia=0.0)
    stiff = fc.RotaryDrive("stiff", wheel.node, axis="z", stiffness=1e6, ratio=ratio, inertia=1.0)
    joints = [fc.Support(hub.node), fc.Hinge(hub.node, wheel.node, axis="z")]
    model = fc.assemble(fc.Structure([hub, wheel], joints, [soft, stiff]), [fc.Flexible(), fc.LargeRotation()])
    found = fc.linearize(model, fc.equilibrium(model, hold={"soft_source": 0.0})).modes().omega_squared
    slow, fast = spring / (1e-6 + ratio**2), 1e6 * (ratio**2 / 1e-6 + 1.0)
    assert found == pytest.approx([slow, fast], rel=1e-9 + 2.0 * spring / (1e6 * ratio**2))


WHEELS = [((41.9,), 92.1, 202.0, 0.0), ((0.322, 1.61), 19.3, 15.8, 5.19e-4), ((0.00732, 0.469), 150.0, 963.0, 0.191)]


def wheels(inertias, stiffness, ratio, rotor, turned=LEVEL) -> fc.Model:
    """One wheel behind a motor on the ground, or two with the motor between them; nothing else holds them."""
    bodies = [fc.RigidBody(f"w{i}", (0, 0, 0), 1.0, (inertia,) * 3) for i, inertia in enumerate(inertias)]
    ground, axis = fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1)), tuple(turned[:, 2])
    joints = [fc.Support(ground.node), *(fc.Hinge(ground.node, body.node, axis=axis) for body in bodies)]
    base = bodies[0].node if len(bodies) > 1 else None
    motor = {"stiffness": stiffness, "ratio": ratio, "inertia": rotor}
    drive = fc.RotaryDrive("d", bodies[-1].node, base, axis=axis, **motor)
    push, seen = fc.MotorTorque("m", drive), fc.DriveAngle("a", drive)
    machine = fc.Structure([ground, *bodies], joints, [drive], [push], [seen])
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize(
    "machine", [*WHEELS, ((1e-6,), 1e3, 1e3, 1.0), ((1e-5, 1e3), 1e3, 1e5, 1.0), ((2.0, 3.0), 1e12, 1e3, 1e-3)], ids=str
)
def test_wheels_that_nothing_else_holds_keep_the_angle_of_the_motor(machine, turned):
    """ω² = k (R² Σ 1/J + 1/J_m), and 0 for every wheel: beside soft springs of a shaft there is nothing to be lost."""
    inertias, k, ratio, rotor = machine
    linear = fc.linearize(wheels(*machine, turned))
    swing = [k * (ratio**2 * sum(1.0 / J for J in inertias) + 1.0 / rotor)] if rotor else []
    found = linear.modes()
    assert found.rigid == len(inertias)
    assert found.omega_squared == pytest.approx([0.0] * len(inertias) + swing, rel=1e-9, abs=0.0)
    assert linear.coordinates[-1] == "d_source"
    assert found.massless == (not rotor)


def adrift(k: float, axis: tuple[float, float, float], length: float, elements: int, shafts: int = 2) -> fc.Model:
    """Free bodies in a row, motors between them with shafts of some k R² [N m/rad], and a beam welded to the first."""
    hub = fc.RigidBody("hub", (0, 0, 0), 40.0, (3, 5, 4), {"front": (1, 0, 0), "back": (-1, 0, 0)})
    arm = fc.RigidBody("arm", (1, 0, 0), 3.0, (0.3, 0.5, 0.4), {"tip": (1.7, 0.2, -0.4)})
    hand = fc.RigidBody("hand", (1.7, 0.2, -0.4), 2.0, (0.3, 0.5, 0.4))
    section = fc.Section(EA=1e7, EI_y=2e3, EI_z=3e3, GJ=1e3, rhoA=2.0, rhoJ=0.01)
    boom = fc.Beam("boom", (-1, 0, 0), (-1 - length, 0, 0), section, elements=elements)
    joints, drives = [fc.Weld(hub.point("back"), boom.start)], []
    between = [(hub.point("front"), arm.node, (0, 1, 0), 1000.0, 10.0), (arm.point("tip"), hand.node, axis, 100.0, 2.0)]
    for i, (base, moved, about, ratio, rotor) in enumerate(between[:shafts]):
        motor = {"stiffness": k / ratio**2, "ratio": ratio, "inertia": rotor / ratio**2}
        joints.append(fc.Hinge(base, moved, axis=about))
        drives.append(fc.RotaryDrive(f"d{i}", moved, base, axis=about, **motor))
    bodies = [hub, arm, hand][: shafts + 1]
    return fc.assemble(fc.Structure([*bodies, boom], joints, drives), [fc.LargeRotation(), fc.Flexible()])


def behind_rigid_shafts(linear: fc.LinearModel, zeros: int) -> np.ndarray:
    """The frequencies of a free machine [Hz], its twists struck out of M and K; so many of them are 0."""
    kept = np.flatnonzero([not name.endswith("_twist") for name in linear.coordinates])
    M, K = (A.toarray()[np.ix_(kept, kept)] for A in (linear.M, linear.K))
    squares = eigh(K, M, eigvals_only=True)[zeros:]
    return np.append(np.zeros(zeros), np.sqrt(squares) / (2.0 * np.pi))


@pytest.mark.parametrize(("length", "elements"), [(3.0, 4), (30.0, 4), (3.0, 12)])
@pytest.mark.parametrize("axis", [(0, 1, 0), (0, 0.6, 0.8), (0, 0, 1)], ids=["y", "oblique", "z"])
@pytest.mark.parametrize("k", [1e12, 1e15, 1e17])
def test_adrift_with_a_beam_every_rigid_body_mode_is_found_and_no_other_is_mixed_with_it(k, axis, length, elements):
    """Six of the whole and a turn of each motor: K and M hold them, whatever the span of ω²."""
    linear = fc.linearize(adrift(k, axis, length, elements))
    expected = behind_rigid_shafts(linear, 8)[:14]
    found = linear.modes()
    assert (found.rigid, found.unstable) == (8, 0)
    assert found.frequencies[:14] == pytest.approx(expected, rel=EIGH)
    for poles in (linear.damped_poles(), linear.to_ss().poles()):
        assert np.sort(np.abs(poles))[:28:2] / (2.0 * np.pi) == pytest.approx(expected, rel=EIGH)
    assert len(linear.certificate.rigid_modes) == 8


def test_modes_that_the_solver_did_not_reach_are_refused(monkeypatch):
    """Left beside a shift so faint that doubles do not span the rest, motions are mixed: none of them is let out."""

    def faint(pencil, values, phi):
        return pencil.below_all(faint_shift(pencil.K, pencil.M)), 0.0

    model = adrift(1e17, (0, 1, 0), 3.0, 4)
    monkeypatch.setattr(eigen, "_scouted", faint)
    with pytest.raises(LinearizationError, match=r"the motion of \w+ with .* misses K φ = ω² M φ.*stiffest part rigid"):
        fc.linearize(model)


@pytest.mark.parametrize("angle", [1e-1, 1e-3, 1e-6])
def test_a_misfit_is_that_of_two_motions_mixed(angle):
    """Along each of them the residual is its share times λ − σ − θ, and weighs as one over λ − σ."""
    first, second, sigma = 3.0, 700.0, -2.0
    x = np.array([[np.cos(angle)], [np.sin(angle)]])
    share, size = DensePencil(np.diag([first, second]), np.eye(2)).at(sigma).misfit(x)
    a, b = first - sigma, second - sigma
    theta = a * np.cos(angle) ** 2 + b * np.sin(angle) ** 2
    rest = np.array([(a - theta) * np.cos(angle), (b - theta) * np.sin(angle)])
    assert size == pytest.approx([theta], rel=1e-12)
    assert share == pytest.approx([np.sqrt((rest**2 / [a, b]).sum() / theta)], rel=1e-6)


@pytest.mark.parametrize("length", [3.0, 30.0])
@pytest.mark.parametrize("k", [1e8, 1e13, 1e18])
def test_adrift_behind_one_shaft_nothing_is_refused(k, length):
    assert fc.linearize(adrift(k, (0, 1, 0), length, 4, shafts=1)).modes().rigid == 7


@pytest.mark.parametrize(
    "held", [("hoist", "wheels"), ("hoist",), ("wheels",), ()], ids=["both", "hoist", "wheels", "free"]
)
@pytest.mark.parametrize("k", [1e8, 1e11])
def test_a_rope_on_a_winch_is_no_shaft(k, held):
    """Under a trolley on stiff wheels: pendulum √(g (1/m + 1/M) m/ℓ) and rope √(EA/ℓ m), what moves along added."""
    trolley, load = fc.PointMass("trolley", (0, 0, 10), 60.0), fc.PointMass("load", (0, 0, 5), 300.0)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=1e5, radius=0.1, ratio=15.0, inertia=0.02)
    motor = {"radius": 0.1, "ratio": 20.0, "stiffness": k, "inertia": 0.01}
    wheels = fc.LinearDrive("wheels", trolley.node, direction="x", **motor)
    machine = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [hoist, wheels],
        [fc.MotorTorque("lift", hoist)],
    )
    model = fc.assemble(machine, [fc.LargeRotation(), fc.Gravity(), fc.Flexible()])
    weight, arm = 300.0 * 9.81, 0.1 / 15.0
    lift = {} if "hoist" in held else {"lift": -weight * (1.0 + 0.5 * weight / 1e5) * arm}
    rest = fc.equilibrium(model, hold={f"{name}_source": 0.0 for name in held}, inputs=lift)
    rolling, turning = 60.0 + 0.01 * 200.0**2, 0.02 / (arm * (1.0 + weight / 1e5)) ** 2
    lighter = 1.0 / 300.0 + (0.0 if "wheels" in held else 1.0 / rolling)
    length = 10.0 - rest.state.x[1, 2]
    pendulum = np.sqrt(weight * lighter / length)
    rope = np.sqrt(1e5 * (1.0 + weight / 1e5) / length * (1.0 / 300.0 + (0.0 if "hoist" in held else 1.0 / turning)))
    found = fc.linearize(model, rest).modes()
    assert found.rigid == 2 - len(held)
    assert found.omega[found.rigid :][:2] == pytest.approx([pendulum, rope], rel=1e-6)
