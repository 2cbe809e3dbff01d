"""What an equilibrium holds stays held where rigid parts and shafts take its coordinate away."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import SceneError
from flexctrl.structure.refine import coarsen, refine

WIND = fc.Wind({"load": 1.0}, speed=(10.0, 0.0, 0.0))
PUSH, WEIGHT = 0.5 * 1.25 * 10.0**2, 50.0 * 9.81


def cart(*effects, hold=0.0):
    """A cart on a geared motor that holds it against the wind on its load."""
    body, load = fc.PointMass("cart", (0, 0, 0), 100.0), fc.PointMass("load", (0, 0, -2), 50.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=1e6, damping=500.0)
    drive = fc.LinearDrive("travel", body.node, direction="x", radius=0.1, ratio=20.0, stiffness=50.0, inertia=0.01)
    structure = fc.Structure(
        [body, rope, load],
        [fc.Support(body.node, "v w"), fc.Pin(body.node, rope.start), fc.Pin(rope.end, load.node)],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Position("x", body.node, "x"), fc.SwayAngle("sway", rope.start, rope.end, "x")],
    )
    given = [fc.Gravity(), fc.LargeRotation(), WIND, *effects]
    plan = fc.Simulation(0.1, fc.GeneralizedAlpha(5e-3), start=fc.Start.EQUILIBRIUM)
    return fc.Scene(fc.planar(structure, "y"), given, simulation=plan, hold={"travel_source": hold})


@pytest.mark.parametrize("turned", [0.0, 4.0])
@pytest.mark.parametrize("effects", [[fc.RopeStretch()], []])
def test_a_motor_behind_a_rigid_shaft_is_held(effects, turned):
    """θ_d = R x / r: at 4 rad the cart stands at 20 mm, and the rope hangs in line with wind and weight."""
    scene = cart(*effects, hold=turned)
    for rest in (scene.rest, scene.twin_rest):
        assert rest.outputs["x"] == pytest.approx(turned * 0.1 / 20.0, abs=1e-12)
        assert abs(math.tan(rest.outputs["sway"])) == pytest.approx(PUSH / WEIGHT, rel=1e-9)


def test_the_rigid_twin_of_a_held_machine_is_compared_and_climbed():
    scene = cart(fc.Flexible())
    assert np.isfinite([d.rms_difference for d in fc.compare(scene).signals]).all()
    assert not [r.failure for r in fc.ladder(scene, tolerance=0.1).rungs if r.failure]


def test_two_motors_on_a_rigid_girder_hold_its_travel_and_its_turn():
    """Each moves with both; one alone holds its own end, and the girder swings round it until it lies in the push."""
    girder = fc.Beam("girder", (0, 0, 0), (0, 6, 0), fc.Section(1e8, 1e6, 1e6, 1e6, 50.0, 1.0), elements=2)
    wheels = {"left": girder.node(0), "right": girder.end}
    drives = [
        fc.LinearDrive(n, at, direction="x", radius=0.1, ratio=10.0, stiffness=80.0, inertia=0.01)
        for n, at in wheels.items()
    ]
    structure = fc.Structure(
        [girder],
        [fc.Support(girder.start, "v w ry"), fc.Support(girder.end, "w")],
        drives,
        [fc.Force("push", girder.node(1), "x")],
        [fc.Position("x", girder.node(1), "x"), fc.DriveAngle("right", drives[1])],
    )
    twin = fc.rigid(fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()]))

    def held(**hold):
        return fc.Scene(structure, hold={f"{n}_source": at for n, at in hold.items()}, rest_inputs={"push": 100.0})

    assert held(left=0.0, right=0.0).twin_rest.outputs["x"] == pytest.approx(0.0, abs=1e-12)
    assert held(left=1.0, right=1.0).twin_rest.outputs["x"] == pytest.approx(0.01, rel=1e-9)
    assert len(held(left=0.0, right=0.0).twin_rest.held) == twin.n == 2
    swung = held(right=0.0).twin_rest
    assert swung.stable
    assert swung.outputs == pytest.approx({"x": 3.0, "right": 0.0}, abs=1e-12)


MASS, LENGTH, EA = 1000.0, 10.0, 1e7


def hoist(speed: float, turned: float, small: bool = False) -> fc.Scene:
    """A load on a rope that a braked winch has paid out, in a side wind."""
    crab, load = fc.PointMass("crab", (0, 0, LENGTH), 50.0), fc.PointMass("load", (0, 0, 0), MASS)
    winch = fc.Winch("winch", load.node, crab.node, EA=EA, radius=0.2, ratio=4.0, inertia=0.05)
    structure = fc.Structure(
        [crab, load],
        [fc.Support(crab.node)],
        [winch],
        [fc.MotorTorque("torque", winch)],
        [fc.Position(axis, load.node, axis) for axis in "xyz"],
    )
    wind = fc.Wind({"load": 8.0}, (speed, 0.0, 0.0))
    plan = fc.Simulation(0.1, fc.GeneralizedAlpha(1e-2), start=fc.Start.EQUILIBRIUM)
    effects = (fc.Gravity(), fc.Flexible(), fc.GeometricStiffness() if small else fc.LargeRotation(), wind)
    return fc.Scene(structure, effects, hold={"winch_source": turned}, simulation=plan)


@pytest.mark.parametrize("turned", [0.0, 20.0, -20.0])
@pytest.mark.parametrize("speed", [0.0, 20.0, 40.0])
def test_a_held_winch_leans_its_load_into_a_side_wind(speed, turned):
    """tan φ = k w²/(m g), at the length ℓ + r θ/R that is paid out; an elastic rope is longer by the share T/EA."""
    mass, length, out, scene = MASS, LENGTH, 0.2 * turned / 4.0, hoist(speed, turned)
    push, weight = 0.5 * 1.25 * 8.0 * speed**2, mass * 9.81
    lean, pull = math.atan2(push, weight), math.hypot(push, weight)
    for rest, rope in ((scene.twin_rest, length + out), (scene.rest, (length + out) * (1.0 + pull / EA))):
        assert rest.outputs["x"] == pytest.approx(rope * math.sin(lean), rel=1e-9, abs=1e-9)
        assert rest.outputs["z"] == pytest.approx(length - rope * math.cos(lean), abs=1e-9)
        assert rest.outputs["y"] == pytest.approx(0.0, abs=1e-9)
    start = scene.run(scene.twin)
    assert (start["x"][0], start["z"][0]) == pytest.approx((scene.twin_rest.outputs["x"], scene.twin_rest.outputs["z"]))


@pytest.mark.parametrize("turned", [0.0, 20.0])
@pytest.mark.parametrize(("speed", "small"), [(0.0, False), (20.0, False), (0.0, True)])
def test_on_a_braked_winch_a_load_sways_as_on_a_rope_of_that_length(speed, turned, small):
    """Both ways ω² = T/(m ℓ), T all that the brake holds, along wind and weight; along the rope it is free."""
    scene, out = hoist(speed, turned, small), 0.2 * turned / 4.0
    pull = math.hypot(0.5 * 1.25 * 8.0 * speed**2, MASS * 9.81)
    for linear, rope in ((scene.twin_linear, LENGTH + out), (scene.linear, (LENGTH + out) * (1.0 + pull / EA))):
        found = linear.modes().omega_squared
        assert found[0] == pytest.approx(0.0, abs=1e-9)
        assert found[1:3] == pytest.approx(pull / (MASS * rope), rel=1e-6)
        assert linear.inputs == ("torque",)


def test_linearised_with_its_brake_on_the_twin_still_sways():
    """Hanging straight, sway is what the brake leaves free: √(g/ℓ), and stable; the torque is weight times r/R."""
    rest = hoist(0.0, 20.0).twin_rest
    assert dict(rest.brakes) == pytest.approx({"winch_source": -MASS * 9.81 * 0.2 / 4.0}, rel=1e-9)
    linear = fc.linearize(rest.model, at=rest)
    assert linear.modes().omega_squared == pytest.approx([9.81 / 11.0] * 2, rel=1e-9)
    assert linear.certificate is not None
    assert rest.stable


def propped(name: str) -> fc.Scene:
    """A cantilever of four elements that is held up in its middle, or elsewhere."""
    beam = fc.Beam("beam", (0, 0, 0), (4, 0, 0), fc.Section(1e6, 1e3, 1e3, 1e3, 2.0, 0.1), elements=4)
    outputs = [fc.Position("tip", beam.end, "z"), fc.Position("middle", beam.node(2), "z")]
    structure = fc.Structure([beam], [fc.Support(beam.start, "u v w rx ry rz")], outputs=outputs)
    plan = fc.Simulation(0.1, fc.GeneralizedAlpha(1e-2), start=fc.Start.EQUILIBRIUM)
    return fc.Scene(structure, hold={name: 0.1}, simulation=plan)


@pytest.mark.parametrize("name", ["beam.2.w", "beam.-3.w", "beam_2_w"])
def test_a_node_within_a_beam_is_held_where_it_is_on_every_mesh(name):
    """Held at 0.1 m the middle stays there, and the tip where it was but for the mesh."""
    scene = propped(name)
    laid = scene.with_(effects=[fc.Gravity(), fc.Flexible(), fc.GeometricStiffness({name: 0.1})])
    for factor in (2, 3):
        finer = scene.with_(structure=refine(scene.structure, factor))
        assert finer.rest.outputs["middle"] == pytest.approx(0.1, abs=1e-12)
        assert finer.rest.outputs["tip"] == pytest.approx(scene.rest.outputs["tip"], rel=1e-4)
        small = laid.with_(structure=finer.structure).model
        assert small.measure(small.rest)[1] == pytest.approx(0.1, abs=1e-12)


def test_a_held_node_that_a_coarser_mesh_has_not_is_told():
    scene = propped("beam.2.w")
    with pytest.raises(
        fc.errors.StructureError, match=r"hold 'beam.2.w': beam 'beam' has no node there with 1 elements"
    ):
        scene.with_(structure=coarsen(scene.structure.with_(outputs=[])))


def test_a_drive_that_is_named_itself_is_told_its_motors_angle():
    """Not what an effect adds under a name that is nearer: the torque of a lag is nothing to hold."""
    scene = replace(cart(fc.MotorLag({"travel": 0.05})), hold={"travel": 0.0})
    with pytest.raises(SceneError, match=r"no free coordinate 'travel'; did you mean 'travel_source'\?"):
        _ = scene.rest
    with pytest.raises(SceneError, match=r"no free coordinate 'cart'; did you mean 'cart_0_u'\?"):
        _ = replace(scene, hold={"cart": 0.0}).rest
