"""What an equilibrium holds, whatever bends: it stands where it is held, and its linear model bears what held it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.errors import EquilibriumError, SceneError, StructureError

G = 9.81
TUBE = fc.Section.tube(fc.STEEL, radius=0.1, thickness=0.005)
BASE = (fc.Gravity(), fc.LargeRotation())
BENDING = {fc.BeamFlexibility(): "beams", fc.ShaftElasticity(): "shafts", fc.RopeStretch(): "ropes"}
CHOICES = [tuple(e for e, there in zip(BENDING, mask, strict=True) if there) for mask in product((0, 1), repeat=3)]


def named(choice):
    return "+".join(BENDING[e] for e in choice) or "rigid"


def hoisting(*effects, stiffer=1.0):
    """The crane of the how-to page on hoisting, its winch held."""
    trolley, load = fc.PointMass("trolley", (0, 0, 40), mass=50e3), fc.PointMass("load", (0, 0, 10), mass=30e3)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=5e7 * stiffer, radius=0.75, ratio=30.0, inertia=30.0)
    crane = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [hoist],
        [fc.Force("push", trolley.node, "x"), fc.MotorTorque("torque", hoist)],
        [fc.Position("height", load.node, "z"), fc.SwayAngle("sway", trolley.node, load.node, "x")],
    )
    return fc.Scene(crane, (*BASE, *effects), hold={"hoist_source": 0.0})


def jib_crane(*effects, slew=0.0, hoist=0.0, shaft=1.0, rope=1.0, wind=(3.0, 6.0, 0.0)):
    """A jib that a motor on its mast slews, its load on a winch, in the wind."""
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 3), TUBE, elements=2)
    jib = fc.Beam("jib", (0, 0, 3), (4, 0, 3), TUBE, elements=2)
    load = fc.PointMass("load", (4, 0, 1), 200.0)
    drives = [
        fc.RotaryDrive("slew", jib.start, mast.end, axis="z", stiffness=30.0 * shaft, ratio=100.0, inertia=0.05),
        fc.Winch("hoist", load.node, jib.end, EA=3e6 * rope, radius=0.15, ratio=40.0, inertia=0.1),
    ]
    crane = fc.Structure(
        [mast, jib, load],
        [fc.Support(mast.start), fc.Hinge(mast.end, jib.start, axis="z")],
        drives,
        [fc.MotorTorque(f"{d.name}_torque", d) for d in drives],
        [fc.DriveAngle(d.name, d) for d in drives] + [fc.Position(a, load.node, a) for a in "xyz"],
    )
    blown = (*BASE, *effects, fc.Wind({"jib": 2.0, "load": 1.0}, speed=wind))
    return fc.Scene(crane, blown, hold={"slew_source": slew, "hoist_source": hoist})


def weathervane(*effects, shaft=1.0, wind=(3.0, 6.0, 0.0)):
    """A jib without a load on a mast that bends: all that the wind turns is held by the motor."""
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 3), TUBE, elements=2)
    jib = fc.Beam("jib", (0, 0, 3), (4, 0, 3), TUBE, elements=2)
    drive = fc.RotaryDrive("slew", jib.start, mast.end, axis="z", stiffness=30.0 * shaft, ratio=100.0, inertia=0.05)
    vane = fc.Structure(
        [mast, jib],
        [fc.Support(mast.start), fc.Hinge(mast.end, jib.start, axis="z")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("slew", drive), fc.Position("y", jib.end, "y")],
    )
    return fc.Scene(vane, (*BASE, *effects, fc.Wind({"jib": 2.0}, speed=wind)), hold={"slew_source": 0.0})


def lowest(linear, count):
    poles = linear.damped_poles()
    poles = poles[poles.imag >= -1e-9]
    return np.sort_complex(poles[np.argsort(abs(poles), kind="stable")][:count])


def test_the_rigid_twin_of_a_held_hoist_swings_as_under_the_torque_that_carries_its_load():
    """ω² = g/ℓ (1 + m/M), as by hand and as with the balancing torque given as an input."""
    scene = hoisting(fc.Flexible())
    found = scene.twin_linear
    carried = fc.equilibrium(scene.twin, inputs={"torque": -30e3 * G * 0.75 / 30.0})
    expected = fc.linearize(scene.twin, at=carried)
    assert found.inputs == expected.inputs == scene.twin.inputs
    assert np.abs(found.damped_poles() - expected.damped_poles()).max() < 1e-9
    assert 2.0 * np.pi * found.modes().frequencies[-1] == pytest.approx(math.sqrt(G / 30.0 * 1.6), rel=1e-9)
    for name in ("M", "K", "B", "Cq"):
        there, here = (np.asarray(getattr(m, name) @ np.eye(getattr(m, name).shape[1])) for m in (expected, found))
        assert np.abs(here - there).max() <= 1e-9 * np.abs(there).max()


def test_a_rope_that_leans_in_the_wind_swings_under_its_whole_tension():
    """Across the rope ω² = T/(m ℓ); along it nothing but the motor's inertia, as the torque stays what it is."""
    crab, load = fc.PointMass("crab", (0, 0, 10), 50.0), fc.PointMass("load", (0, 0, 0), 1000.0)
    winch = fc.Winch("winch", load.node, crab.node, EA=1e7, radius=0.2, ratio=4.0, inertia=0.05)
    machine = fc.Structure([crab, load], [fc.Support(crab.node)], [winch], [fc.MotorTorque("torque", winch)])
    effects = (*BASE, fc.Wind({"load": 8.0}, (40.0, 0.0, 0.0)))
    scene = fc.Scene(machine, effects, hold={"winch_source": 20.0})
    tension = math.hypot(0.5 * 1.25 * 8.0 * 40.0**2, 1000.0 * G)
    squared = scene.linear.modes().omega_squared
    assert squared == pytest.approx([0.0, tension / 11e3, tension / 11e3], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_what_is_held_stands_where_it_is_held_whatever_bends(choice):
    scene = jib_crane(*choice, slew=20.0, hoist=-30.0)
    rest = scene.rest
    assert rest.outputs["slew"] == pytest.approx(20.0, abs=1e-9)
    assert rest.outputs["hoist"] == pytest.approx(-30.0, abs=1e-9)
    assert set(rest.held) == {"slew_source", "hoist_source"}
    assert rest.stable
    assert set(scene.linear.certificate.held) == set(rest.held)
    assert len(scene.linear.coordinates) == scene.model.n


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_the_forces_that_hold_are_those_of_motors(choice):
    """Given as torques of the motors they leave no force over, and the linear models are one and the same."""
    scene = jib_crane(*choice)
    rest = scene.rest
    still = np.zeros(scene.model.n)
    left = scene.model.balance(rest.state, still, still)
    reach = scene.model.motion.jacobian(rest.state).T @ scene.model.reach(rest.state, rest.inputs)
    torques = np.linalg.lstsq(reach.toarray(), -left, rcond=None)[0]
    other = fc.linearize(scene.model, at=rest.state, inputs=dict(zip(scene.model.inputs, torques, strict=True)))
    assert np.abs(other.damped_poles() - scene.linear.damped_poles()).max() < 1e-9 * abs(other.damped_poles()).max()


CASES = {
    "hoisting": (
        lambda s: hoisting(fc.RopeStretch(), stiffer=s),
        hoisting,
        5,
        "height",
    ),
    "jib crane": (
        lambda s: jib_crane(fc.BeamFlexibility(), fc.ShaftElasticity(), fc.RopeStretch(), shaft=s, rope=s),
        lambda: jib_crane(fc.BeamFlexibility()),
        8,
        "y",
    ),
    "weathervane": (
        lambda s: weathervane(fc.BeamFlexibility(), fc.ShaftElasticity(), shaft=s),
        lambda: weathervane(fc.BeamFlexibility()),
        4,
        "y",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_hardly_gives_way_tends_to_what_is_rigid(case):
    """The gap in poles and places is as 1/k."""
    elastic, stiff, count, output = CASES[case]
    limit, gaps = stiff(), []
    poles = lowest(limit.linear, count)
    for stiffness in (1e2, 1e3):
        scene = elastic(stiffness)
        away = np.abs(lowest(scene.linear, count) - poles).max()
        gaps.append([away, abs(scene.rest.outputs[output] - limit.rest.outputs[output])])
    assert np.divide(*gaps) == pytest.approx(10.0, rel=0.1)


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_a_vane_that_points_into_the_wind_is_stable_while_it_is_held(choice):
    """Against the wind it would turn round; the linear model, which lets go of it, says so."""
    scene = weathervane(*choice, wind=(-8.0, 0.0, 0.0))
    assert scene.rest.unstable == 0
    assert scene.linear.modes().unstable == 1


@pytest.mark.parametrize("choice", [(), (fc.BeamFlexibility(),), (fc.Flexible(),)], ids=["rigid", "ropes", "flexible"])
def test_small_motion_about_what_is_held_is_that_of_the_linear_model(choice):
    """And what held it pushes no more: the motor begins to turn under the load it carried."""
    large = jib_crane(*choice)
    effects = [fc.GeometricStiffness() if e == fc.LargeRotation() else e for e in large.effects]
    small = large.with_(effects=effects)
    poles = large.linear.damped_poles()
    assert np.abs(small.linear.damped_poles() - poles).max() < 1e-9 * np.abs(poles).max()
    assert small.rest.outputs == pytest.approx(large.rest.outputs, abs=1e-9)
    still = np.zeros(large.model.n)
    let_go = [s.model.balance(s.rest.state, still, still) for s in (small, large)]
    assert np.abs(let_go[0] - let_go[1]).max() < 1e-9 * 200.0 * G
    assert np.abs(let_go[1]).max() > 1.0


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_modes_about_what_is_held_are_damped_as_asked(choice):
    scene = jib_crane(*choice, fc.ModalDamping(0.03), wind=(0.0, 0.0, 0.0))
    modes = scene.linear.modes()
    first = modes.unstable + modes.rigid
    assert modes.decay[first:] == pytest.approx(2.0 * 0.03 * modes.omega[first:], rel=1e-8)
    assert np.abs(modes.decay[:first]).max(initial=0.0) < 1e-8


def test_the_damping_of_modes_fades_with_its_ratio():
    """C is as the ratio, down to none."""
    matrices = {
        z: jib_crane(fc.Flexible(), fc.ModalDamping(z)).model.viscous.toarray() / (z or 1.0) for z in (0.0, 1e-12, 0.02)
    }
    scale = np.abs(matrices[0.02]).max()
    assert scale > 0.0
    assert np.abs(matrices[1e-12] - matrices[0.02]).max() < 1e-12 * scale
    assert not matrices[0.0].any()


def test_modal_damping_of_its_own_equilibrium():
    """Outside a scene the effect names what is held itself; without, the load falls."""
    scene = hoisting(fc.Flexible())
    own = fc.ModalDamping(0.02, hold={"hoist_source": 0.0})
    model = fc.assemble(scene.structure, [*scene.effects, own])
    inside = scene.with_(effects=[*scene.effects, fc.ModalDamping(0.02)]).model
    assert np.abs((model.viscous - inside.viscous).toarray()).max() == 0.0
    with pytest.raises(EquilibriumError):
        fc.assemble(scene.structure, [*scene.effects, fc.ModalDamping(0.02)])


def rod(at):
    """A rod that hangs from a hinge, pulled aside at its free end."""
    bar = fc.Beam("rod", (0, 0, 0), (0, 0, -2), fc.Section(1e8, 1e6, 1e6, 1e6, 5.0, 0.0), elements=1)
    structure = fc.Structure([bar], [fc.Support(bar.start, "u v w rx rz")], outputs=[fc.Position("x", bar.end, "x")])
    return fc.Scene(structure, BASE, hold={"rod.end.u": at})


@pytest.mark.parametrize("at", [0.0, 0.5, 1.5])
def test_a_point_of_a_rigid_part_is_held_where_it_is_asked_to_be(at):
    """A uniform rod held aside at its end by a level force: ω² = 3 g/(2 ℓ cos φ), sin φ = u/ℓ."""
    scene = rod(at)
    assert scene.rest.outputs["x"] == pytest.approx(at, abs=1e-12)
    squared = 1.5 * G / (2.0 * math.cos(math.asin(at / 2.0)))
    assert scene.linear.modes().omega_squared == pytest.approx([squared], rel=1e-9)


def test_what_cannot_be_held_there_is_refused():
    """A motor whose joint is clamped, and two motors that one shaft would have to obey."""
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), TUBE, elements=1)
    drives = [
        fc.RotaryDrive(n, arm.start, axis="z", stiffness=50.0, ratio=10.0, inertia=0.1) for n in ("left", "right")
    ]
    structure = fc.Structure([arm], [fc.Support(arm.start, "u v w rx ry")], drives)
    clamped = structure.with_(joints=[*structure.joints, fc.Support(arm.end, "u v w")])
    assert fc.Scene(clamped, (fc.LargeRotation(),), hold={"left_source": 0.0}).rest.held == ("left_source",)
    with pytest.raises(EquilibriumError, match=r"left_source held at 0\.3: it stays at 0"):
        _ = fc.Scene(clamped, (fc.LargeRotation(),), hold={"left_source": 0.3}).rest
    with pytest.raises(EquilibriumError, match=r"_source held at .* only with what is held elsewhere"):
        _ = fc.Scene(structure, (fc.LargeRotation(),), hold={"left_source": 0.3, "right_source": 0.2}).rest
    both = fc.Scene(structure, (fc.LargeRotation(),), hold={"left_source": 0.3, "right_source": 0.3}).rest
    assert both.state.driven == pytest.approx([0.03, 0.03], abs=1e-12)


def test_what_is_named_twice_is_held_in_one_place():
    scene = rod(0.0)
    twice = replace(scene, effects=(*BASE, fc.Flexible()), hold={"rod.end.u": 0.1, "rod_1_u": 0.2})
    with pytest.raises(SceneError, match="rod_1_u is held in two places"):
        _ = twice.rest


def test_a_state_space_of_the_machine_refuses_what_is_no_coordinate():
    scene = jib_crane()
    with pytest.raises(StructureError, match="to_nlsys: the equilibrium holds slew_source, hoist_source"):
        scene.model.to_nlsys(scene.rest)


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_linearised_with_its_motors_held_it_moves_as_their_angles_let_it(choice):
    """One freedom less for each motor: K and M on what moves no motor, the null space of the angles' slopes."""
    scene = jib_crane(*choice)
    held, free = fc.linearize(scene.model, at=scene.rest), scene.linear
    still = la.null_space(free.Cq[:2] / np.abs(free.Cq[:2]).max(axis=1, keepdims=True))
    K, M = (still.T @ (A @ still) for A in (free.K, free.M))
    assert len(held.coordinates) == scene.model.n - 2
    assert held.modes().omega_squared[:2] == pytest.approx(la.eigh(K, M, eigvals_only=True)[:2], rel=1e-6)
    assert held.certificate is not None


@pytest.mark.parametrize("inertia", [1.0, 1e4, 1e7])
@pytest.mark.parametrize("wind", [(3.0, 6.0, 0.0), (0.0, 0.0, 0.0)], ids=["blown", "calm"])
@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_modes_of_a_load_on_a_heavy_winch(choice, wind, inertia):
    """The rope pays out freely, and in calm air the jib turns freely: these two and nothing else have no stiffness."""
    scene = jib_crane(*choice, wind=wind)
    light, heavy = scene.structure.drives[0], replace_inertia(scene.structure.drives[1], inertia)
    linear = scene.with_(structure=scene.structure.with_(drives=[light, heavy])).linear
    modes = linear.modes()
    K, M = 0.5 * (linear.K + linear.K.T).toarray(), linear.M.toarray()
    dense = la.eigh(K, M, eigvals_only=True)
    assert modes.unstable == 0
    assert modes.rigid == (1 if any(wind) else 2)
    assert modes.omega_squared == pytest.approx(dense, rel=1e-5, abs=1e-8 * dense[2])


def replace_inertia(winch, inertia):
    rope = {"EA": winch.EA, "radius": winch.radius, "ratio": winch.ratio}
    return fc.Winch(winch.name, winch.node, winch.against, **rope, inertia=inertia)
