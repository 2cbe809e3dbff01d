"""Rigid-body poles are zero in every export: to_ss, reduce, discretize and condense, in any units."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.sparse as sp

import flexctrl as fc
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import ModalForm

STEEL = {"EA": 2.1e8, "EI_y": 2e5, "EI_z": 3e5, "GJ": 1.5e5, "rhoA": 8.0, "rhoJ": 0.02}


def machine(held: str, drives: bool) -> LinearModel:
    """A bent frame of two beams in space whose foot is held in some directions; a motor on a soft shaft at its end."""
    section = fc.Section(**STEEL)
    mast = fc.Beam("mast", start=(0.0, 0.0, 0.0), end=(0.0, 0.3, 4.0), section=section, elements=3)
    boom = fc.Beam("boom", start=(0.0, 0.3, 4.0), end=(3.0, 0.1, 4.2), section=section, elements=3)
    joints = [fc.Weld(mast.end, boom.start)]
    joints += [fc.Support(mast.start, held=held)] if held else []
    elements, motors = [mast, boom], []
    if drives:
        arm = fc.Beam("arm", start=(3.0, 0.1, 4.2), end=(4.0, 0.1, 4.2), section=section, elements=2)
        elements.append(arm)
        joints.append(fc.Hinge(boom.end, arm.start, axis="y"))
        motors = [fc.RotaryDrive("motor", boom.end, arm.start, axis="y", stiffness=2e4, ratio=50.0, inertia=1e-3)]
    structure = fc.Structure(
        elements=elements,
        joints=joints,
        drives=motors,
        inputs=[fc.Force("push", at=boom.end, direction="x"), fc.Force("lift", at=boom.end, direction="z")],
        outputs=[fc.Position("x", at=boom.end, direction="x"), fc.Position("z", at=boom.end, direction="z")],
    )
    return fc.linearize(fc.assemble(structure, effects=[fc.Flexible(), fc.RayleighDamping(0.0, 1e-5)]))


def in_millimetres_and_tonnes(linear: LinearModel) -> LinearModel:
    """The same machine in mm, t, s (N stays N; moments in N mm): q' = T q."""
    turns = np.array([any(tag in name for tag in ("_rx", "_ry", "_rz", "motor")) for name in linear.coordinates])
    scale = np.where(turns, 1.0, 1e-3)
    T = sp.diags(scale)
    units = {name: sp.csc_matrix(1e3 * (T @ getattr(linear, name) @ T)) for name in ("M", "C", "K")}
    # virtual work in N mm: forces on millimetres stay newtons
    return replace(linear, **units, B=1e3 * scale[:, None] * linear.B, Cq=1e3 * linear.Cq * scale, parts={}, place=None)


CASES = [("", 6), ("u", 5), ("u v", 4), ("u v w", 3), ("u v w rx", 2), ("u v w rx ry", 1)]


def zeros_among(poles: np.ndarray, first: float) -> int:
    """How many poles are 0 to 1e-9 of the first flexible frequency; none may lie between that and the first."""
    size = np.abs(poles)
    small = size < 1e-9 * first
    assert (size[~small] > 0.5 * first).all(), np.sort(size)[:16]
    return int(np.count_nonzero(small))


@pytest.mark.parametrize(
    ("drives", "metric"), [(False, True), (True, True), (True, False)], ids=["SI", "drive, SI", "drive, mm-t-s"]
)
@pytest.mark.parametrize(("held", "rigid"), CASES)
def test_rigid_poles_are_zero(held, rigid, drives, metric):
    linear = machine(held, drives)
    linear = linear if metric else in_millimetres_and_tonnes(linear)
    count = rigid + drives
    modes = linear.modes()
    first = modes.omega[modes.flexible][0]
    assert modes.rigid == count
    assert zeros_among(linear.damped_poles(), first) == 2 * count
    assert zeros_among(linear.condense().damped_poles(), first) == 2 * count
    for method in (
        fc.ModalTruncation(count + 4, static_correction=True),
        fc.ModalTruncation(count + 6),
        fc.MomentMatching((0.0, 1j * first), count + 8),
    ):
        reduced = linear.reduce(method)
        assert zeros_among(reduced.damped_poles(), first) == 2 * count
        assert zeros_among(np.linalg.eigvals(reduced.to_ss().A), first) >= 2 * count
    system = linear.to_ss(ModalForm())
    # blocks of the state matrix: a double integrator each, its column of positions exactly empty
    assert np.count_nonzero(~system.A.any(axis=0)) == count
    assert zeros_among(system.poles(), first) == 2 * count
    dt = 0.05 / first
    sampled = linear.discretize(dt)
    assert isinstance(sampled, control.StateSpace)
    assert np.count_nonzero(np.abs(np.log(sampled.poles().astype(complex)) / dt) < 1e-9 * first) == 2 * count


def slewing_crane(elements: int) -> LinearModel:
    """Mast, jib and counterweight on a geared slew drive that turns freely; a rope with damping holds the load."""
    box = fc.Section.box(fc.STEEL, width=0.4, height=0.4, web=0.006, flange=0.006)
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 10), box, elements=elements)
    jib = fc.Beam("jib", (0, 0, 10), (12, 0, 10), box, elements=elements)
    rope = fc.Rope("rope", jib.end, (12, 0, 4), EA=5e6, damping=2e3)
    load, hub = fc.PointMass("load", rope.end, 800.0), fc.RigidBody("hub", (0, 0, 10), 200.0, (20, 20, 20))
    drive = fc.RotaryDrive("slew", hub.node, mast.end, axis="z", stiffness=40.0, ratio=200, inertia=0.02, damping=0.02)
    structure = fc.Structure(
        [mast, jib, rope, load, hub],
        [
            fc.Support(mast.start),
            fc.Hinge(mast.end, hub.node, "z"),
            fc.Weld(hub.node, jib.start),
            fc.Pin(jib.end, rope.start),
            fc.Pin(rope.end, load.node),
        ],
        [drive],
        inputs=[fc.MotorTorque("torque", drive), fc.Force("wind", load.node, "y")],
        outputs=[fc.DriveAngle("angle", drive), fc.Position("tip", jib.end, "y"), fc.Velocity("rate", jib.end, "y")],
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.01, beta=5e-4)]
    return fc.linearize(fc.assemble(structure, effects))


def in_forty_digits(linear: LinearModel, omega: float) -> np.ndarray:
    """The response of the matrices, K without what rounding sets against the rigid-body modes."""
    mp = pytest.importorskip("mpmath", reason="forty digits need mpmath")
    mp.mp.dps = 40
    M, C, K = (mp.matrix(A.toarray().tolist()) for A in (linear.M, linear.C, linear.K))
    modes = linear.modes()
    R = mp.matrix(modes.shapes[:, : modes.rigid].tolist())
    P = mp.eye(K.rows) - R * (R.T * M * R) ** -1 * R.T * M
    Z, s = P.T * K * P, mp.mpc(0, omega)
    Z = Z + s * C + s * s * M
    columns = [mp.lu_solve(Z, mp.matrix(b.tolist())) for b in linear.B.T]
    rows = mp.matrix(linear.Cq.tolist()) + s * mp.matrix(linear.Cv.tolist())
    return np.array([[complex(x) for x in rows * column] for column in columns]).T


@pytest.mark.parametrize("omega", [1e-3, 0.3])
def test_rounding_of_the_stiffness_does_not_hold_free_motion_at_low_frequencies(omega):
    linear = slewing_crane(1)
    ours, exact = linear.frequency_response([omega]).values[:, :, 0], in_forty_digits(linear, omega)
    assert np.abs(ours / exact - 1.0).max() < 1e-12


def test_nor_in_models_too_large_for_all_their_modes():
    """Against the state space, one frequency alone and among many (a projection)."""
    linear = slewing_crane(24)
    omega = np.geomspace(1e-3, 1.0, 40)
    exact = linear.to_ss()(1j * omega)
    many = linear.frequency_response(omega).values
    assert np.abs(many / exact - 1.0).max() < 1e-8
    few = linear.frequency_response(omega[:2]).values
    assert np.abs(few / exact[..., :2] - 1.0).max() < 1e-9


@pytest.mark.parametrize("order", [20, 22, 30])
def test_moments_that_light_and_stiff_directions_carry_keep_their_mass(order):
    """Matched at high points, a Krylov space holds directions beside whose mass that of others is rounding."""
    reduced = slewing_crane(1).reduce(fc.MomentMatching((0.0, 100j, 500j), order))
    assert reduced.error_up_to(20.0).worst < 1e-4
    assert np.linalg.eigvalsh(reduced.linear.M.toarray())[0] > 1e-3
