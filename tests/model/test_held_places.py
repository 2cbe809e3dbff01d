"""What is held is a place, not the sum of steps that led there: equilibria do not hang on the way to them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.model.places import places_of

SECTION = fc.Section(EA=1e6, EI_y=100.0, EI_z=100.0, GJ=80.0, rhoA=1.0, rhoJ=0.01)


@cache
def beam(held: str = "") -> fc.Model:
    """A cantilever; one rotation of its end may be held by a Support."""
    b = fc.Beam("b", (0, 0, 0), (2, 0, 0), SECTION, elements=8)
    joints = [fc.Support(b.start), *([fc.Support(b.end, held)] if held else [])]
    inputs = [fc.Force("F" + a, b.end, a) for a in "xyz"]
    outputs = [fc.Position("p" + a, b.end, a) for a in "xyz"]
    structure = fc.Structure([b], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=2.0, beta=0.02)])


@cache
def carrying(joint: str) -> fc.Model:
    """A cantilever with a body on a hinge or a slide at its end, and a spring that pulls at it."""
    b = fc.Beam("b", (0, 0, 0), (2, 0, 0), SECTION, elements=3)
    car = fc.RigidBody("car", (2, 0, 0), 1.0, (0.1, 0.1, 0.1), {"tip": (2.5, 0, 0)})
    spring = fc.Spring("spring", car.point("tip"), (4, 0, 0), stiffness=20.0, length=1.5)
    own = fc.Slide(b.end, car.node, "x") if joint == "slide" else fc.Hinge(b.end, car.node, "z")
    joints = [fc.Support(b.start), own, fc.Pin(car.point("tip"), spring.start), fc.Support(spring.end)]
    inputs = [fc.Force("F", b.end, "y"), fc.Force("Fz", b.end, "z")]
    structure = fc.Structure([b, car, spring], joints, inputs=inputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


def tumbled(model: fc.Model, seed: int = 0) -> fc.State:
    """A state that several steps about different axes have led to."""
    rng, state = np.random.default_rng(seed), model.rest
    for _ in range(3):
        state = model.advance(state, 0.3 * rng.normal(size=model.n), np.zeros(model.n), 0.0)
    return state


@pytest.mark.parametrize("joint", ["slide", "turn"])
def test_places_are_what_displace_takes(joint):
    model = carrying(joint)
    step = 0.4 * np.random.default_rng(1).normal(size=model.n)
    assert places_of(model).at(model.displace(step)) == pytest.approx(step, abs=1e-12)
    state = tumbled(model)
    assert np.abs(places_of(model).at(state) - state.q).max() > 1e-2
    there = model.displace(places_of(model).at(state))
    assert np.allclose(there.x, state.x, atol=1e-12)
    assert np.allclose(there.R, state.R, atol=1e-12)


@pytest.mark.parametrize("joint", ["slide", "turn"])
def test_rates_of_places_are_their_differences(joint):
    model = carrying(joint)
    places, state, d = places_of(model), tumbled(model), 1e-6

    def at(step: np.ndarray) -> np.ndarray:
        return places.at(model.advance(state, step, np.zeros(model.n), 0.0))

    found = np.array([(at(d * e) - at(-d * e)) / (2.0 * d) for e in np.eye(model.n)]).T
    assert places.rates(state, np.arange(model.n)) == pytest.approx(found, abs=1e-8)


@pytest.mark.parametrize("start", [{}, {"b_8_rx": 1.0}, {"b_8_ry": -0.7}])
def test_an_end_held_by_all_its_rotations_is_held_as_it_is_displaced(start):
    model, hold = beam(), {"b_8_rx": 0.5, "b_8_ry": 0.0, "b_8_rz": 1.0}
    begin = fc.equilibrium(model, hold=start).state if start else None
    rest = fc.equilibrium(model, hold=hold, start=begin)
    assert np.allclose(rest.state.R[8], Rotation.from_rotvec([0.5, 0.0, 1.0]).as_matrix(), atol=1e-10)
    assert list(rest.outputs.values()) == pytest.approx([1.6879, 0.8960, 0.1733], abs=1e-3)


def test_searches_and_paths_that_hold_a_rotation_lead_to_the_same():
    """By the search 0.336, by the path 0.484, each without a word."""
    model, hold = beam(), {"b_8_rz": 1.0}
    rest = fc.equilibrium(model, hold=hold, inputs={"Fz": 80.0})
    path = fc.equilibrium_path(model, {"Fz": 80.0}, 1.0, hold=hold)
    other = fc.equilibrium(
        model, hold=hold, inputs={"Fz": 80.0}, start=fc.equilibrium(model, inputs={"Fy": -60.0, "Fz": 20.0}).state
    )
    assert path.end is fc.PathEnd.REACHED
    for found in (path.points[-1].rest, other):
        assert found.outputs == pytest.approx(rest.outputs, abs=1e-7)
        assert Rotation.from_matrix(found.state.R[8]).as_rotvec()[2] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("joint", ["slide", "turn"])
@pytest.mark.parametrize("at", [0.0, 0.3])
def test_what_rides_on_a_beam_is_held_in_one_place(joint, at):
    """A slide stood at −0.112, −0.147 or −0.050 m, by where the search began."""
    model, hold, loads = carrying(joint), {f"car_0_{joint}": at}, {"F": 60.0, "Fz": 40.0}
    rest = fc.equilibrium(model, hold=hold, inputs=loads)
    path = fc.equilibrium_path(model, loads, 1.0, hold=hold)
    starts = [fc.equilibrium(model, hold=hold, inputs=inputs) for inputs in ({"F": -60.0}, {"Fz": 60.0})]
    others = [fc.equilibrium(model, hold=hold, inputs=loads, start=start.state) for start in starts]
    for found in (*others, path.points[-1].rest):
        assert np.allclose(found.state.x, rest.state.x, atol=1e-7)
        assert places_of(model).at(found.state)[model.coordinate(f"car_0_{joint}")] == pytest.approx(at, abs=1e-9)


def test_a_linear_model_about_a_held_rotation_is_the_slope_of_what_is_held_there():
    """What holds turns with the machine: by differences of equilibria under a force beside."""
    model, hold = beam(), {"b_8_rz": 1.0}
    rest = fc.equilibrium(model, hold=hold, inputs={"Fz": 40.0})
    linear = fc.linearize(model, at=rest)
    pushed = [fc.equilibrium(model, hold=hold, inputs={"Fz": 40.0, "Fy": d}, start=rest.state) for d in (1e-4, -1e-4)]
    moved = (pushed[0].outputs["py"] - pushed[1].outputs["py"]) / 2e-4
    flexible = linear.Cq @ np.linalg.solve(linear.K.toarray(), linear.B)
    fy, py = model.inputs.index("Fy"), model.outputs.index("py")
    assert flexible[py, fy] == pytest.approx(moved, rel=1e-5)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.2])
def test_holding_two_of_three_rotations_does_not_hang_on_how_the_frame_is_turned(turn):
    """A circular arc of √5 rad under a constant moment, its plane turned about the beam; the twist is left free."""
    away = np.sqrt(5.0) * np.array([np.sin(turn), np.cos(turn)])
    rest = fc.equilibrium(beam(), hold={"b_8_ry": away[0], "b_8_rz": away[1]})
    size = np.hypot(*away)
    along, across = 2.0 * np.sin(size) / size, 2.0 * (1.0 - np.cos(size)) / size
    side = np.array([away[1], -away[0]]) / size
    assert list(rest.outputs.values()) == pytest.approx([along, *(across * side)], abs=2e-3)
    assert rest.iterations < 100


def test_a_rotation_that_a_support_holds_alone_is_told_where_it_wanders():
    """It was 0.63, 0.36 or 0.91 m to the side, by where the search began, and bent without any load."""
    model, loads = beam("rz"), {"Fy": 60.0, "Fz": 80.0}
    with pytest.raises(fc.errors.EquilibriumError, match="b_8_rz is held, but the node turns about two other axes"):
        fc.equilibrium(model, inputs=loads)
    assert fc.equilibrium_path(model, loads, 1.0).end is fc.PathEnd.WANDERED
    run = fc.simulate(model, until=3.0, inputs=loads, start=fc.equilibrium(model, inputs={"Fy": 30.0}))
    assert any("b_8_rz is held" in note for note in run.report.notes)


def test_a_rotation_that_a_support_holds_alone_is_an_angle_in_a_plane():
    model = beam("rz")
    rest = fc.equilibrium(model, inputs={"Fz": 80.0})
    run = fc.simulate(model, until=0.5, inputs={"Fz": 80.0})
    assert rest.outputs["py"] == pytest.approx(0.0, abs=1e-12)
    assert not any("is held" in note for note in run.report.notes)


def hub(shaft: float) -> tuple[fc.Structure, tuple[fc.effects.Effect, ...]]:
    """A beam on a hub that a motor turns; its shaft is rigid (0), or of some stiffness."""
    base = fc.RigidBody("hub", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    b = fc.Beam("b", (0, 0, 0), (1.5, 0, 0), SECTION, elements=3)
    motor = fc.RotaryDrive("m", base.node, axis="z", stiffness=shaft or 1.0, inertia=0.1)
    joints = [fc.Support(base.node, "u v w rx ry"), fc.Weld(base.node, b.start)]
    structure = fc.Structure(
        [base, b],
        joints,
        [motor],
        [fc.Force("F", b.end, "z")],
        [fc.Position("p" + a, b.end, a) for a in "xyz"],
    )
    elastic = (fc.ShaftElasticity(),) if shaft else ()
    return structure, (fc.BeamFlexibility(), fc.LargeRotation(), *elastic)


@pytest.mark.parametrize("hold", [{"b.end.rx": 0.5, "b.end.rz": 0.2}, {"b.end.ry": -0.7}, {"b.end.rx": 0.4}])
def test_a_motor_behind_a_rigid_shaft_is_held_beside_rotations_as_behind_a_stiff_one(hold):
    """0.24 m off on 1.5 m: beside a brake, rotations were held by moments about axes of space."""
    rests = []
    for shaft in (0.0, 1e8):
        structure, effects = hub(shaft)
        scene = fc.Scene(structure, effects, hold={"m_source": 0.8, **hold}, rest_inputs={"F": 15.0})
        rests.append((scene.rest, scene.linear.modes().frequencies))
    (rigid, slow), (stiff, same) = rests
    assert list(rigid.outputs.values()) == pytest.approx(list(stiff.outputs.values()), abs=1e-5)
    assert slow[:3] == pytest.approx(same[: len(slow)][:3], rel=1e-4, abs=1e-3)


def test_a_rotation_that_follows_from_others_is_not_held_alone():
    b = fc.Beam("b", (0, 0, 0), (2, 0, 0), SECTION, elements=3)
    arm = fc.Beam("arm", (2, 0, 0), (3, 0, 0), SECTION, elements=2)
    joints = [fc.Support(b.start), fc.Hinge(b.end, arm.start, "z")]
    spring = fc.Spring("spring", arm.end, (4, 1, 0.5), stiffness=40.0, length=1.0)
    joints += [fc.Pin(arm.end, spring.start), fc.Support(spring.end)]
    scene = fc.Scene(
        fc.Structure([b, arm, spring], joints),
        (fc.BeamFlexibility(), fc.LargeRotation()),
        hold={"arm.start.rx": 0.5},
    )
    with pytest.raises(fc.errors.EquilibriumError, match="would hold a spin, no angle"):
        _ = scene.rest
