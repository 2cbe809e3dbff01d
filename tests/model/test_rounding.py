"""What is only the rounding of large forces is no load, no stiffness and no instability; what is more is refused."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import LinearizationError
from flexctrl.model.balance import Balance

TUBE = fc.Section.tube(fc.STEEL, 0.05, 0.004)
EFFECTS = [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]
SEEDS = range(6)


def arm_with_load(seed: int) -> fc.Structure:
    """An inclined arm that turns about a vertical axis, a load on a rope at its end."""
    tip = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    arm = fc.Beam("arm", (0, 0, 0), tuple(tip), TUBE)
    load = fc.PointMass("load", tuple(tip - [0, 0, 1]), 10.0)
    rope = fc.Rope("rope", arm.end, load.node, EA=2e5)
    joints = [fc.Support(arm.start, "u v w rx ry"), fc.Pin(arm.end, rope.start), fc.Pin(rope.end, load.node)]
    return fc.Structure([arm, load, rope], joints, inputs=[fc.Torque("turn", arm.start, "z")])


def mast_with_jib(seed: int, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> fc.Structure:
    """An inclined jib on a hinge at the top of a mast."""
    tip = np.random.default_rng(seed).uniform(-2.0, 2.0, 3) + np.array([0, 0, 4])
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 4), TUBE, elements=2)
    jib = fc.Beam("jib", (0, 0, 4), tuple(tip), TUBE, elements=2)
    joints = [fc.Support(mast.start), fc.Hinge(mast.end, jib.start, axis)]
    return fc.Structure([mast, jib], joints, inputs=[fc.Torque("turn", jib.start, "z")])


def driven_crane(seed: int) -> fc.Structure:
    """A slewing crane with a geared drive, and a stay of 1e9 N/m from a tower head that turns with it."""
    tip = np.random.default_rng(seed).uniform(-3.0, 3.0, 3) + np.array([0, 0, 4])
    mast, jib = fc.Beam("mast", (0, 0, 0), (0, 0, 4), TUBE), fc.Beam("jib", (0, 0, 4), tuple(tip), TUBE)
    head = fc.RigidBody("head", (0, 0, 5), 20.0, (1, 1, 1), points={"foot": (0, 0, 4)})
    stay = fc.Spring("stay", head.node, jib.end, 1e9)
    foot = head.point("foot")
    joints = [fc.Support(mast.start), fc.Hinge(mast.end, foot, "z"), fc.Weld(foot, jib.start)]
    joints += [fc.Pin(head.node, stay.start), fc.Pin(jib.end, stay.end)]
    drive = fc.RotaryDrive("slew", foot, mast.end, axis="z", stiffness=1e5, ratio=100.0, inertia=1e-2)
    return fc.Structure([mast, jib, head, stay], joints, drives=[drive], inputs=[fc.Torque("turn", foot, "z")])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("machine", [arm_with_load, mast_with_jib, driven_crane])
def test_the_rigid_twin_of_a_slewing_machine_slews_freely(machine, seed):
    """Weights have no moment about a vertical axis, wherever the arm points: one mode at exactly zero."""
    linear = fc.linearize(fc.rigid(fc.assemble(machine(seed), EFFECTS)))
    assert len(linear.certificate.rigid_modes) == 1
    assert linear.modes().unstable == 0
    assert np.count_nonzero(linear.damped_poles() == 0.0) == 2


def test_a_twin_held_in_its_only_coordinate_is_refused_with_the_remedy():
    twin = fc.rigid(fc.assemble(mast_with_jib(0), EFFECTS))
    rest = fc.equilibrium(twin, hold={twin.coordinates[0]: 0.1})
    with pytest.raises(LinearizationError, match=r"every coordinate is held \(jib_0_rz\).*leaves one free"):
        fc.linearize(twin, at=rest)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_torque_however_small_is_no_rounding(seed):
    twin = fc.rigid(fc.assemble(mast_with_jib(seed), EFFECTS))
    assert fc.equilibrium(twin).unstable == 0
    with pytest.raises(LinearizationError, match="not an equilibrium"):
        fc.linearize(twin, at=twin.rest, inputs={"turn": 1e-6})


@pytest.mark.parametrize("seed", SEEDS)
def test_about_an_axis_that_leans_by_a_thousandth_the_twin_is_a_pendulum(seed):
    """m g s sin(tilt) is small, but no rounding: refused as it stands, it comes to rest in the plane of the lean."""
    twin = fc.rigid(fc.assemble(mast_with_jib(seed, (1e-3, 0.0, 1.0)), EFFECTS))
    with pytest.raises(LinearizationError, match="not an equilibrium"):
        fc.linearize(twin, at=twin.rest)
    rest = fc.equilibrium(twin)
    tip = rest.state.x[twin.structure.number(twin.structure.elements[1].end)]
    assert abs(tip[1]) < 1e-4


def oblique_pendulum(end: np.ndarray, elements: int) -> fc.Structure:
    """7 kg at the end of a massless steel rod of 60 mm in short stiff elements, on a pin."""
    E, radius = 2.1e11, 0.03
    area, inertia = np.pi * radius**2, np.pi * radius**4 / 4.0
    section = fc.Section(EA=E * area, EI_y=E * inertia, EI_z=E * inertia, GJ=E * inertia / 1.3, rhoA=0.0, rhoJ=0.0)
    rod = fc.Beam("rod", (0, 0, 0), tuple(end), section, elements=elements)
    bob = fc.PointMass("bob", rod.end, 7.0)
    return fc.Structure([rod, bob], [fc.Support(rod.start, "u v w rz"), fc.Pin(rod.end, bob.node)])


@pytest.mark.parametrize(
    ("end", "elements"),
    [((0.3, 0.4, -1.2), 60), ((0.8, 0.5, -0.4), 80), ((0.8, 0.5, -0.4), 100), ((-0.28, -0.67, -1.06), 55)],
)
def test_a_stiff_pendulum_in_space_hangs_and_swings_however_fine_its_mesh(end, elements):
    model = fc.assemble(oblique_pendulum(np.array(end), elements), EFFECTS)
    rest, length = fc.equilibrium(model), float(np.linalg.norm(end))
    assert rest.stable
    assert fc.linearize(model, at=rest).modes(2).omega_squared == pytest.approx(9.81 / length, rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_free_rods_are_never_taken_to_resist(seed):
    """Unloaded as drawn, a rod on a pin has no stiffness but rounding, of either sign."""
    rng = np.random.default_rng(seed)
    model = fc.assemble(oblique_pendulum(rng.normal(size=3), int(rng.integers(2, 120))), EFFECTS)
    balance = Balance(model, np.zeros(0))
    assert not balance.holds(model.rest, balance.slope(model.rest))
    assert balance.unstable(model.rest) == 0


@pytest.mark.parametrize("wrong", [1e-3, 1e-4])
@pytest.mark.parametrize("elements", [12, 250])
def test_a_pendulum_turned_by_a_thousandth_is_no_equilibrium(elements, wrong):
    """The rounding of 250 stiff elements makes forces of 8e-4 of the weight at single nodes; together they are none."""
    model = fc.assemble(oblique_pendulum(np.array([0.0, 0.0, -1.3]), elements), EFFECTS)
    rest = fc.equilibrium(model)
    swing = fc.linearize(model, at=rest).modes(1).shapes[:, 0]
    turned = model.advance(rest.state, wrong * 1.3 * swing / np.abs(swing[-6:-3]).max(), np.zeros(model.n), 0.0)
    with pytest.raises(LinearizationError, match="not an equilibrium"):
        fc.linearize(model, at=turned)


def five_bar(seed: int) -> fc.Structure:
    """A planar two-arm robot, its links joined at the tip, with two geared motors."""
    x, y = 1.0 + 0.3 * np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 2))
    a, b = fc.Beam("a", (-1, 0, 0), (-x[0], y[0], 0), TUBE), fc.Beam("b", (-x[0], y[0], 0), (0, 1.8, 0), TUBE)
    c, d = fc.Beam("c", (1, 0, 0), (x[1], y[1], 0), TUBE), fc.Beam("d", (x[1], y[1], 0), (0, 1.8, 0), TUBE)
    left = fc.RotaryDrive("left", a.start, axis="z", stiffness=3.0, ratio=100, inertia=1e-3)
    elbow = fc.RotaryDrive("elbow", b.start, a.end, axis="z", stiffness=1.0, ratio=50, inertia=5e-4)
    joints = [fc.Support(a.start, "u v w"), fc.Support(c.start, "u v w"), fc.Pin(a.end, b.start)]
    joints += [fc.Pin(c.end, d.start), fc.Pin(b.end, d.end)]
    inputs, outputs = [fc.MotorTorque("torque", left)], [fc.DriveAngle("angle", left), fc.Position("x", b.end, "x")]
    machine = fc.Structure([a, b, c, d], joints, drives=[left, elbow], inputs=inputs, outputs=outputs)
    return fc.planar(machine, "z")


@pytest.mark.parametrize("seed", SEEDS)
def test_damping_of_strain_leaves_free_motion_undamped(seed):
    """C = β K does no work where K does none: two poles at exactly 0 for each free motion, and no others near."""
    model = fc.assemble(five_bar(seed), [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(0.0, 2e-4)])
    twin, machine = fc.linearize(fc.rigid(model)), fc.linearize(model)
    assert twin.C.nnz == 0
    assert "skew" not in str(twin.certificate)
    for linear in (machine, twin):
        poles = linear.damped_poles()
        assert np.count_nonzero(poles == 0.0) == 4
        assert np.abs(poles[poles != 0.0]).min(initial=np.inf) > 1.0
        assert np.count_nonzero(linear.to_ss().poles() == 0.0) == 4
        assert linear.frequency_response().omega[0] > 1e-3
    assert twin.reduce(fc.RelativeError(1e-6, up_to_hz=20.0)).order == 2


@pytest.mark.parametrize("alpha", [1e-3, 1e-1])
def test_damping_of_motion_however_small_beside_that_of_strain_is_kept(alpha):
    """C = α M + β K: free motion dies away at α, though β ω² is 1e8 times that."""
    model = fc.assemble(five_bar(0), [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha, 2e-4)])
    poles = fc.linearize(model).damped_poles()
    assert np.count_nonzero(poles == 0.0) == 2
    assert poles[2:4].real == pytest.approx(-alpha, rel=1e-6)


def slender_pendulum(EA: float, elements: int) -> fc.Structure:
    """A bar of 1 m, 1 kg and 1 N m² on a pin."""
    section = fc.Section(EA=EA, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
    bar = fc.Beam("bar", (0, 0, 0), (0, 0, -1), section, elements=elements)
    return fc.Structure([bar], [fc.Support(bar.start, "u v w rz")])


@pytest.mark.parametrize(
    ("EA", "elements", "g"), [(1e8, 50, 1e-4), (1e9, 50, 1e-3), (1e10, 50, 1e-2), (1e12, 20, 0.1), (1e12, 50, 0.1)]
)
def test_a_slender_bar_in_light_gravity_swings(EA, elements, g):
    """Its weight is less than the last digits of places make of EA, and stretches it by 1e-13: ω² = 3/2 g/L."""
    effects = [fc.Flexible(), fc.LargeRotation(), fc.Gravity((0, 0, -g))]
    model = fc.assemble(slender_pendulum(EA, elements), effects)
    rest = fc.equilibrium(model)
    linear = fc.linearize(model, at=rest)
    bound = linear.certificate.frequency_error
    assert rest.stable
    assert linear.modes(2).rigid == 0
    assert bound < 0.01
    assert linear.modes(2).omega == pytest.approx(np.sqrt(1.5 * g), rel=max(bound, 1e-3))


@pytest.mark.parametrize(("EA", "elements", "g"), [(1e8, 50, 1e-7), (1e12, 50, 1e-3), (1e12, 20, 0.0)])
def test_a_swing_that_places_do_not_tell_is_refused(EA, elements, g):
    """Stretched by less than the last digit: pulls and pushes of 1e-3 N are rounding, no instability."""
    effects = [fc.Flexible(), fc.LargeRotation(), *([fc.Gravity((0, 0, -g))] if g else [])]
    model = fc.assemble(slender_pendulum(EA, elements), effects)
    rest = fc.equilibrium(model)
    assert rest.stable
    with pytest.raises(LinearizationError, match="lost in the rounding"):
        fc.linearize(model, at=rest)
