"""What the ledger leaves out has the names that scenes give it; what needs it goes first, and it has what it keeps."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.errors import ControllerError
from flexctrl.scene.physics import EFFECTS
from flexctrl.study.omissions import omissions, snake
from flexctrl.study.sections import WAYS

HARDWARE = {
    "sampled": lambda law: fc.Sampled(law, 0.01),
    "delayed": lambda law: fc.Delayed(law, 1),
    "rate_limited": lambda law: fc.RateLimited(law, {"torque": 30.0}),
    "noisy": lambda law: fc.Noisy(law, {"angle": 1e-2}, 3),
    "saturated": lambda law: fc.Saturated(law, {"torque": 2.0}),
    "quantised": lambda law: fc.Quantised(law, {"angle": 1e-3}),
}


def cart(*hardware: str) -> fc.Scene:
    """A cart on an elastic drive that a servo sends to one radian, with hardware from the inside out."""
    mass = fc.PointMass("cart", (0, 0, 0), 20.0)
    drive = fc.LinearDrive(
        "travel", mass.node, direction="x", radius=0.1, ratio=10.0, stiffness=50.0, inertia=1e-2, damping=0.02
    )
    structure = fc.Structure(
        [mass],
        [fc.Support(mass.node, "v w")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive), fc.Position("x", mass.node, "x")],
    )
    law = fc.Tracking(pd(3.0, 0.5, measured="angle", rate="speed", command="torque"), {"angle": lambda t: 1.0})
    for name in hardware:
        law = HARDWARE[name](law)
    effects = [fc.Flexible(), fc.LargeRotation()]
    return fc.Scene(structure, effects, law, simulation=fc.Simulation(until=0.2, every=0.02))


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_have_one_name(name):
    assert snake(EFFECTS[name].make) == name


def test_hardware_goes_alone_or_after_what_needs_it_in_every_order():
    """From any nesting each kind goes by itself, or after what counts samples; the law itself is left at the end."""
    tried = 0
    for names in (p for count in (1, 2, 3, 4) for p in permutations(HARDWARE, count)):
        try:
            scene = cart(*names)
        except ControllerError:  # a delay of the samples of a continuous law
            continue
        tried += 1
        items = {o.name: o for o in omissions(scene)}
        for order in (names, names[::-1]):
            less = scene
            for name in order:
                assert items[name].is_in(scene)
                for each in (*items[name].first, name):
                    less = items[each].without(less)
                assert not items[name].is_in(less)
            assert type(less.law) is fc.Tracking
            assert less.law.sample_time == 0.0
    assert tried > 100


@pytest.mark.parametrize("hardware", ["delayed", "rate_limited", "noisy"])
def test_sampling_is_kept_under_what_counts_samples(hardware):
    scene = cart("sampled", "saturated", hardware)
    scene = scene.with_(simulation=replace(scene.simulation, until=0.06))
    found = fc.ledger(scene, 1e-4)
    assert {hardware, "sampled"} <= set(found.minimal_set)
    assert found["sampled"].first == (hardware,)
    assert next(o for o in omissions(scene) if o.name == "sampled").is_in(found.scene)
    chosen = scene.with_(effects=[*scene.effects, fc.Automatic(1e-4)]).settled
    assert chosen.law.sample_time == 0.01


def deep(section: fc.Section) -> fc.Scene:
    """A cantilever of 2 m under a load that grows so slowly that it is still."""
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), section, elements=4)
    push, tip = fc.Force("push", beam.end, "z"), fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[tip])
    plan = fc.Simulation(until=1.0, every=0.1, method=fc.GeneralizedAlpha(0.01))
    return fc.Scene(structure, [fc.BeamFlexibility()], loads={"push": lambda t: 1e3 * t}, simulation=plan)


SHEARING = fc.Section(1e9, 1e7, 1e7, 1e7, 80.0, 1.6, 0.8, 0.8, GA_y=5e6, GA_z=5e6)


def test_shear_is_left_out_as_timoshenko_has_it():
    """Of PL³/3EI + PL/κGA the second; a coupled law that is only diagonal says the same."""
    bending, shearing = 8.0 / 3e7, 2.0 / 5e6
    law = np.diag([1e9, 5e6, 5e6, 1e7, 1e7, 1e7])
    for section in (SHEARING, fc.Section.coupled(law, 80.0, 1.6, 0.8, 0.8)):
        scene = deep(section)
        shear = next(o for o in omissions(scene) if o.name == "beam_shear")
        tips = [s.run()["tip"][-1] for s in (scene, shear.without(scene))]
        assert tips[0] == pytest.approx(1e3 * (bending + shearing), rel=5e-3)
        assert tips[1] == pytest.approx(1e3 * bending, rel=5e-3)


def test_shear_and_rotary_inertia_have_lines_where_sections_have_them():
    found = fc.ledger(deep(SHEARING), fc.Within(outputs=0.05))
    assert found["beam_shear"].change.outputs_worst == pytest.approx(0.6, abs=0.01)
    assert found["beam_shear"].keep
    assert found["rotary_inertia"].change.outputs_worst < 0.01
    slowest = [np.abs(deep(s).linear.damped_poles()).min() for s in (SHEARING, replace(SHEARING, rhoI_y=0, rhoI_z=0))]
    assert found["rotary_inertia"].change.poles >= 1.0 - slowest[0] / slowest[1] > 1e-4  # inertia slows
    plain = deep(fc.Section(1e9, 1e7, 1e7, 1e7, 80.0, 1.6))
    names = [o.name for o in omissions(plain)]
    assert names == ["beam_flexibility", "beam_stretch", "beam_torsion", "beam_bending"]


def test_a_coupled_section_is_stiffened_in_the_way_that_goes():
    """A twist that bends it does so no more when it bends no more; what stays gives as before."""
    law = np.diag([1e9, 5e6, 5e6, 1e7, 1e7, 1e7])
    law[3, 4] = law[4, 3] = 5e6
    section = fc.Section.coupled(law, 80.0, 1.6)
    stiffer = np.array(WAYS["beam_bending"](section).stiffness)
    given, left = np.linalg.inv(law), np.linalg.inv(stiffer)
    assert np.abs(left[4:, :]).max() < 2e-3 * np.abs(given[3:, 3:]).max()
    assert left[3, 3] == pytest.approx(1.0 / law[3, 3], rel=1e-3)  # and no longer its compliance with bending free
    assert np.allclose(left[:3, :3], given[:3, :3])


def modal(*effects: fc.Effect) -> fc.Scene:
    """Two cantilevers, each under a load at its tip."""
    section = fc.Section(1e9, 1e7, 1e7, 1e7, 80.0, 1.6)
    beams = [fc.Beam(name, (0, y, 0), (2, y, 0), section, elements=2) for name, y in (("boom", 0.0), ("mast", 1.0))]
    pushes = [fc.Force(f"push_{b.name}", b.end, "z") for b in beams]
    tips = [fc.Position(b.name, b.end, "z") for b in beams]
    structure = fc.Structure(beams, [fc.Support(b.start) for b in beams], inputs=pushes, outputs=tips)
    return fc.Scene(structure, effects, simulation=fc.Simulation(until=0.01))


@pytest.mark.parametrize(
    "effects",
    [
        [fc.Flexible(), fc.ComponentModes(2, ["boom"])],
        [fc.ComponentModes(2, ["boom"]), fc.Flexible()],
        [fc.BeamFlexibility(["mast"]), fc.ComponentModes(2, ["boom"])],
        [fc.ComponentModes(2)],
    ],
)
def test_a_beam_in_component_modes_is_rigid_like_any_other(effects):
    """Each line stands once. A beam that is left out has no freedoms; without the modes the same beams bend."""
    scene = modal(*effects)
    items = {o.name: o for o in omissions(scene)}
    ways = ["beam_stretch", "beam_torsion", "beam_bending"]
    lines = ["beam_flexibility_boom", "beam_flexibility_mast", "component_modes", *ways]
    assert sorted(o.name for o in omissions(scene)) == sorted(lines)
    alone = modal(fc.BeamFlexibility())
    without = items["component_modes"].without(scene)
    assert without.model.coordinates == alone.model.coordinates
    assert np.allclose(without.linear.K.toarray(), alone.linear.K.toarray(), rtol=1e-12)
    assert not items["component_modes"].is_in(without)
    for name, other in (("boom", "mast"), ("mast", "boom")):
        stiff = items[f"beam_flexibility_{name}"].without(scene)
        assert {c.split("_")[0] for c in stiff.model.coordinates} == {other}
        assert items[f"beam_flexibility_{other}"].without(stiff).model.n == 0
