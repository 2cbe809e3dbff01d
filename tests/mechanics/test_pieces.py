"""Lines, bodies and drives: minus the gradients of their energies, Lagrange's equations, rates from places."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from moving_nodes import SLOT, gradient, kernel, lagrange, random_slots, slot
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.mechanics import pieces

LINE = ca.SX(ca.DM([30.0, 1.2, 0.7]))
BODY = {"mass": 2.5, "xx": 1.0, "yy": 1.4, "zz": 2.0, "xy": 0.1, "xz": -0.2, "yz": 0.3}
ENDS = np.array([[0.1, 0.2, 0.3], [0.4, 0.9, 1.6]])
STATES = [random_slots(seed, ENDS, 0.8, 0.1, 1.0) for seed in range(4)]
BEAM = fc.Beam("b", ENDS[0], ENDS[1], fc.Section(EA=1, EI_y=1, EI_z=1, GJ=1, rhoA=1, rhoJ=1))
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ROTARY = fc.RotaryDrive("r", BEAM.end, BEAM.start, axis=AXIS, stiffness=7.0, ratio=3.0, damping=0.4)
LINEAR = fc.LinearDrive("l", BEAM.end, BEAM.start, direction=AXIS, stiffness=7.0, ratio=3.0, radius=0.5, damping=0.4)


def close(found, expected, tolerance=1e-11):
    assert np.abs(np.asarray(found) - expected).max() < tolerance * max(1.0, np.abs(expected).max())


def line(a, b):
    return pieces.line_motion(a, b, LINE)


@pytest.mark.parametrize("slots", STATES)
def test_spring_force_is_minus_the_gradient_of_its_energy(slots):
    still = slots.reshape(2, SLOT).copy()
    still[:, 12:] = 0.0
    force = kernel(lambda a, b: pieces.line_force(line(a, b), pieces.spring_tension(line(a, b))), 2)
    slope = gradient(lambda a, b: pieces.spring_energy(line(a, b)), 2)(still.ravel())
    close(force(still.ravel()), -np.concatenate([slope[0:3], slope[6:9]]))
    close(slope[[3, 4, 5, 9, 10, 11]], np.zeros(6))


@pytest.mark.parametrize("slots", STATES)
def test_line_rate_is_how_fast_the_length_grows(slots):
    later = slots.copy()
    h = 1e-6
    for start in (0, SLOT):
        later[start : start + 3] += h * slots[start + 12 : start + 15]
    length, rate = (kernel(lambda a, b, name=name: getattr(line(a, b), name), 2) for name in ("length", "rate"))
    assert (length(later) - length(slots)) / h == pytest.approx(float(rate(slots)), abs=1e-5)


@pytest.mark.parametrize(
    ("length", "speed", "tension"),
    [(1.5, 0.0, 9.0), (1.5, 1.0, 9.7), (1.1, 0.0, 0.0), (1.1, 10.0, 0.0), (1.3, -10.0, 0.0), (1.2, 0.0, 0.0)],
)
def test_a_rope_pulls_while_taut_and_never_pushes(length, speed, tension):
    slots = np.concatenate([slot((0, 0, 0), np.eye(3)), slot((0, 0, length), np.eye(3), v=(0, 0, speed))])
    found = kernel(lambda a, b: pieces.unilateral(line(a, b), pieces.spring_tension(line(a, b))), 2)(slots)
    assert float(found) == pytest.approx(tension, abs=1e-10)
    energy = float(kernel(lambda a, b: pieces.rope_energy(line(a, b)), 2)(slots))
    assert energy == pytest.approx(15.0 * max(length - 1.2, 0.0) ** 2)


def body(n):
    return {name: ca.SX(value) for name, value in BODY.items()}


@pytest.mark.parametrize("slots", STATES)
def test_inertia_of_a_body_is_lagranges(slots):
    slots = slots[:SLOT]
    force = kernel(lambda n: pieces.body_inertia(n, body(n)), 1)(slots)
    close(force, -lagrange(lambda n: pieces.body_energy(n, body(n)), 1)(slots))


def test_inertia_of_a_body_is_eulers_in_its_own_axes():
    """J ω̇ + ω × J ω with everything resolved in the body, as in the textbooks."""
    slots = STATES[1][:SLOT]
    R, w, b = slots[3:12].reshape(3, 3), slots[15:18], slots[21:24]
    J = np.array([[1.0, 0.1, -0.2], [0.1, 1.4, 0.3], [-0.2, 0.3, 2.0]])
    own, rate = R.T @ w, R.T @ b
    force = kernel(lambda n: pieces.body_inertia(n, body(n)), 1)(slots)
    close(force[3:], -R @ (J @ rate + np.cross(own, J @ own)))
    close(force[:3], -2.5 * slots[18:21])


def parameters(drive):
    rest = np.subtract(drive.node.position, drive.against.position)
    return ca.SX(ca.DM([drive.stiffness, drive.damping, 0.0, drive.effective_ratio, *drive.direction, *rest]))


def drive_motion(drive, a, b, source=(0.0, 0.0), turns=0):
    """a is the side that carries the motor, b the driven one."""
    angle = ca.vertcat(*source, 0.0)
    if drive is ROTARY:
        return pieces.rotary_motion(b, a, ca.SX(angle), ca.SX(turns), parameters(drive))
    return pieces.linear_motion(b, a, ca.SX(angle), parameters(drive))


def still(slots):
    rows = slots.reshape(2, SLOT).copy()
    rows[:, 12:] = 0.0
    return rows.ravel()


@pytest.mark.parametrize("slots", STATES)
@pytest.mark.parametrize("drive", [ROTARY, LINEAR], ids=["rotary", "linear"])
def test_shaft_force_is_minus_the_gradient_of_its_energy(drive, slots):
    """However the two sides are turned: the axis may tilt between them where other rotations are free."""
    source = (0.6, 0.0)
    force = kernel(lambda a, b: pieces.shaft_force(drive_motion(drive, a, b, source)), 2)(still(slots))
    slope = gradient(lambda a, b: pieces.shaft_energy(drive_motion(drive, a, b, source)), 2)(still(slots))
    close(np.concatenate([force[6:12], force[0:6]]), -slope)


@pytest.mark.parametrize("slots", STATES)
@pytest.mark.parametrize("drive", [ROTARY, LINEAR], ids=["rotary", "linear"])
def test_driven_rate_is_how_fast_the_driven_coordinate_grows(drive, slots):
    h = 1e-6

    def after(h):
        rows = slots.reshape(2, SLOT).copy()
        for row in rows:
            turn = Rotation.from_rotvec(h * row[15:18]).as_matrix()
            row[:3] += h * row[12:15]
            row[3:12] = (turn @ row[3:12].reshape(3, 3)).ravel()
        return rows.ravel()

    driven = kernel(lambda a, b: drive_motion(drive, a, b).driven, 2)
    rate = kernel(lambda a, b: drive_motion(drive, a, b).driven_rate, 2)
    assert (driven(after(h)) - driven(after(-h))) / (2 * h) == pytest.approx(float(rate(slots)), abs=1e-8)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, -3.1, 3.14])
def test_across_a_hinge_the_driven_angle_is_the_plain_one(angle):
    """Both sides turned together, then one against the other about the axis."""
    base = Rotation.random(random_state=5).as_matrix()
    node = base @ Rotation.from_rotvec(angle * AXIS).as_matrix()
    slots = np.concatenate([slot(ENDS[0], base), slot(ENDS[1], node)])
    found = kernel(lambda a, b: drive_motion(ROTARY, a, b, turns=2).driven, 2)(slots)
    assert float(found) == pytest.approx(angle + 4 * np.pi, abs=1e-14)
    gradient_ = kernel(lambda a, b: drive_motion(ROTARY, a, b).gradient, 2)(slots)
    close(gradient_, np.concatenate([np.zeros(3), base @ AXIS, np.zeros(3), -base @ AXIS]), 1e-14)


@pytest.mark.parametrize("drive", [ROTARY, LINEAR], ids=["rotary", "linear"])
def test_the_hessian_of_the_shaft_energy_at_rest_is_eq_4(drive):
    """Over the driven freedom, that of the other side, and the source angle."""
    s = ca.SX.sym("s", 3)
    z = [ca.SX(slot(x, np.eye(3))) for x in (ENDS[1], ENDS[0])]
    turned = drive is ROTARY
    nodes = []
    for k, row in enumerate(z):
        shift = AXIS * s[k]
        R = ca.reshape(row[3:12], 3, 3).T
        zero = ca.SX(3, 1)
        x = row[:3] if turned else row[:3] + shift
        S = ca.skew(shift)
        nodes.append(pieces.NodeMotion(x, R + S + 0.5 * S @ S if turned else R, zero, zero, zero, zero))
    angle = ca.vertcat(s[2], 0, 0)
    m = (
        pieces.rotary_motion(nodes[0], nodes[1], angle, ca.SX(0), parameters(drive))
        if turned
        else pieces.linear_motion(nodes[0], nodes[1], angle, parameters(drive))
    )
    hessian = ca.Function("h", [s], [ca.hessian(pieces.shaft_energy(m), s)[0]])
    r = drive.effective_ratio
    eq_4 = drive.stiffness * np.array([[r**2, -(r**2), -r], [-(r**2), r**2, r], [-r, r, 1.0]])
    close(np.array(hessian(np.zeros(3))), eq_4, 1e-12)


def test_the_shaft_resists_its_own_twisting():
    slots = STATES[2]
    torque = float(kernel(lambda a, b: pieces.shaft_torque(drive_motion(ROTARY, a, b, (0.2, 0.5))), 2)(slots))
    driven, rate = (
        float(kernel(lambda a, b, n=name: getattr(drive_motion(ROTARY, a, b), n), 2)(slots))
        for name in ("driven", "driven_rate")
    )
    assert torque == pytest.approx(7.0 * (3.0 * driven - 0.2) + 0.4 * (3.0 * rate - 0.5))
