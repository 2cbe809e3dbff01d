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

G, HALF, OWN, ROTOR = 9.81, 0.5, 0.02, 0.01
LEVEL, TILTED = np.eye(3), Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
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


@pytest.mark.parametrize("k", [1e10, 1e11, 1e12, 1e14])
def test_behind_a_motor_that_is_held_a_slow_swing_is_told_by_the_machine_itself(k):
    """Its shaft ties the two in one: K holds their stiffness in its last digits, and the certificate says how well."""
    model = hanging([k, k])
    linear = fc.linearize(model, fc.equilibrium(model, hold={"d1_source": 0.0}))
    M, K = (A.sum() for A in rigid(2))
    assert linear.modes().frequencies[0] == pytest.approx(float(np.sqrt(K / M)) / (2.0 * np.pi), rel=1e-7)
    assert linear.certificate.rigid_modes == ()
    run = fc.simulate(linear, until=3.0, inputs={"t0": 1.0}, every=0.5)
    assert run["q0"] == pytest.approx((1.0 - np.cos(np.sqrt(K / M) * run.t)) / K, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("k", [1e16, 1e18])
def test_where_no_digit_of_the_swing_is_left_it_is_refused(k):
    model = hanging([k, k])
    with pytest.raises(LinearizationError, match=r"lost in the rounding of the stiffest entries.*rigid part"):
        fc.linearize(model, fc.equilibrium(model, hold={"d1_source": 0.0}))
