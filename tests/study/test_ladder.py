"""The fidelity ladder: rungs are the same scene with other effects, errors are those of their runs."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import control
import numpy as np
import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study.ladder import Ladder, Rung, rungs
from flexctrl.study.reference import Reference
from flexctrl.study.settings import Fidelity, Setting
from flexctrl.study.subject import prepared


@pytest.fixture(scope="module")
def scene():
    content = tomllib.loads(TROLLEY)
    content["simulation"] |= {"until": 0.1, "step": 5e-3}
    return scene_from(content, Place("trolley.toml"), "trolley")


@pytest.fixture(scope="module")
def climbed(scene):
    return fc.ladder(scene, tolerance=0.05)


def test_rungs_go_from_rigid_to_refined(scene, climbed):
    """The trolley has no beams: modes would change nothing of it."""
    assert [r.name for r in climbed.rungs] == ["rigid", "rigid, shafts", "linear", "full", "refined"]
    assert climbed["linear"].setting.method == fc.Exact(scene.law.sample_time)
    assert climbed["full"].setting.method == scene.simulation.method
    assert climbed["refined"].setting.method.step == 0.5 * scene.simulation.method.step


def test_rungs_worth_standing_on():
    """Each is twice as fast as the next at least, and none that is left out is better than the one chosen."""
    times = {
        "rigid": (1.0, 1.0),
        "shafts": (1.1, 0.9),
        "linear": (0.9, 0.4),
        "off": (0.2, 1.7),
        "modes": (5.0, 1e-2),
        "full": (8.0, 1e-3),
    }
    setting = Setting(Fidelity.FULL, 1, fc.AdaptiveAlpha(), fc.Tolerance())
    rungs = [Rung(name, setting, error, time, 1, 1) for name, (time, error) in times.items()]
    failed = Rung("refined", setting, np.inf, np.inf, 0, 0, "it cannot be")
    exact, rough = (Reference(None, setting, {"mesh": known}) for known in (0.0, 0.5))
    assert [r.name for r in Ladder("made up", (*rungs, failed), exact).climb] == ["linear", "full"]
    assert [r.name for r in Ladder("made up", tuple(rungs[:1]), exact).climb] == ["rigid"]
    assert Ladder("made up", (failed,), exact).climb == ()
    quick = Rung("quick", setting, 0.45, 0.8, 1, 1)  # as good as the linear one, as far as can be told
    assert [r.name for r in Ladder("made up", (quick, *rungs), rough).climb] == ["quick", "full"]
    assert "quick" not in [r.name for r in Ladder("made up", (quick, *rungs), exact).climb]
    assert "< 5.0e-01" in str(Ladder("made up", (quick, *rungs), rough))


def test_a_rung_looks_the_same_in_every_chart():
    setting = Setting(Fidelity.FULL, 1, fc.AdaptiveAlpha(), fc.Tolerance())
    exact = Reference(None, setting, {"mesh": 1e-6})
    names = ["rigid", "linear", "full", "mine"]
    looks = []
    for start in (0, 1):
        rungs = [Rung(name, setting, 0.1 / (i + 1), i + 1.0, 1, 1) for i, name in enumerate(names[start:])]
        ax = Ladder("made up", tuple(rungs), exact).plot().axes[0]
        looks.append({line.get_label(): (line.get_marker(), line.get_color()) for line in ax.lines})
    assert all(looks[0][name] == looks[1][name] for name in names[1:])
    assert len({looks[0][name] for name in names}) == len(names)


def test_every_rung_has_its_own_freedoms():
    crane = fc.Scene(
        fc.cranes.ceiling_crane(),
        (fc.Gravity(), fc.Flexible(), fc.LargeRotation()),
        simulation=fc.Simulation(0.01, fc.GeneralizedAlpha(1e-3)),
    )
    sizes = {name: setting.of(crane).model.n for name, setting in rungs(crane)}
    assert sizes["rigid"] < sizes["component modes"] < sizes["full"] == sizes["linear"] < sizes["refined"]


def test_errors_are_those_against_the_reference(scene, climbed):
    reference = climbed.reference.run
    for name in ("rigid", "linear", "full"):
        run = climbed[name].setting.of(scene.with_(controller=scene.law)).run()
        errors = [
            np.abs(np.interp(reference.t, run.t, run[n]) - reference[n]).max() / np.abs(reference[n]).max()
            for n in reference.outputs
        ]
        assert climbed[name].error == pytest.approx(max(errors), rel=1e-6)


def test_more_physics_is_nearer_to_the_truth(climbed):
    assert climbed["refined"].error < climbed["full"].error < climbed["rigid"].error
    assert climbed.gains == pytest.approx(
        [b.time_ratio / a.time_ratio for a, b in zip(climbed.rungs, climbed.rungs[1:], strict=False)]
    )


def test_its_words_and_picture(climbed):
    assert "next takes" in str(climbed)
    figure = climbed.plot()
    assert [t.get_text() for t in figure.axes[0].get_legend().get_texts()] == [r.name for r in climbed.rungs]


def test_wrong_questions_are_answered(scene, climbed):
    with pytest.raises(StructureError, match="tolerance"):
        fc.ladder(scene, tolerance=0.0)
    with pytest.raises(StructureError, match="no rung 'modes'"):
        climbed["modes"]
    with pytest.raises(StructureError, match="no simulation"):
        fc.ladder(replace(scene, simulation=None))


def slider(*effects):
    """A cart that a geared motor drives along a rail, a load on a rope under it."""
    cart, load = fc.PointMass("cart", (0, 0, 2), 8.0), fc.PointMass("load", (0, 0, 0), 5.0)
    rope = fc.Rope("rope", (0, 0, 2), (0, 0, 0), EA=2e4, damping=20.0)
    drive = fc.LinearDrive(
        "travel", cart.node, direction="x", radius=0.05, ratio=4.0, stiffness=30.0, inertia=2e-3, damping=0.02
    )
    structure = fc.Structure(
        [cart, rope, load],
        [fc.Support(cart.node, "v w"), fc.Pin(rope.start, cart.node), fc.Pin(rope.end, load.node)],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Position("x", load.node, "x"), fc.DriveAngle("angle", drive)],
    )
    given = (fc.Gravity(), fc.Flexible(), fc.LargeRotation(), *effects)
    plan = fc.Simulation(0.03, fc.GeneralizedAlpha(2e-3))
    return fc.Scene(fc.planar(structure, "y"), given, loads={"torque": 1.5}, simulation=plan)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "named"),
    [
        (fc.CoulombFriction({"travel": 0.3}), "CoulombFriction"),
        (fc.LuGreFriction({"travel": fc.LuGre(50.0, 0.3)}), "LuGreFriction"),
        (fc.Backlash({"travel": 0.02}), "Backlash"),
    ],
)
def test_a_rung_that_cannot_be_is_told_and_the_others_stand(effect, named):
    """No linear machine has dry friction or backlash; each other rung is that of its own run."""
    scene = slider(effect)
    found = fc.ladder(scene, tolerance=0.1)
    failed = [r for r in found.rungs if r.failure]
    assert [r.name for r in failed] == ["linear"]
    assert named in failed[0].failure
    assert failed[0].failure in str(found)
    assert (failed[0].error, failed[0].time_ratio) == (np.inf, np.inf)
    names = [r.name for r in found.rungs]
    assert names == ["rigid", "rigid, shafts", "linear", "full", "refined"]
    for name in ("rigid", "full"):
        run = found[name].setting.of(prepared(scene, 0.1, "ladder")).run()
        reference = found.reference.run
        errors = [np.abs(run[n] - reference[n]).max() / np.abs(reference[n]).max() for n in reference.outputs]
        assert found[name].error == pytest.approx(max(errors), rel=1e-6)
    assert found.plot().axes


def test_gains_pass_over_rungs_that_did_not_run(climbed):
    def ladder_of(*times):
        return replace(climbed, rungs=tuple(replace(climbed.rungs[0], time_ratio=t) for t in times))

    assert ladder_of(1.0, np.inf, 3.0, 12.0).gains == (3.0, np.inf, 4.0)
    assert ladder_of(1.0, 2.0, np.inf).gains == (2.0, np.inf)
    told = str(ladder_of(100.0, 3.0, 12.0))
    assert "0.03 ×" in told  # not 0.0
    assert "4.0 ×" in told


def test_a_machine_without_an_equilibrium_has_the_rungs_that_need_none():
    """A hook on a free winch falls; nothing can be linearised about it."""
    crab, hook = fc.PointMass("crab", (0, 0, 5), 20.0), fc.PointMass("hook", (0, 0, 2), 4.0)
    winch = fc.Winch("winch", hook.node, crab.node, EA=2e4, radius=0.1, ratio=2.0, inertia=0.02, damping=50.0)
    joints = [fc.Support(crab.node, "u v w"), fc.Support(hook.node, "u v")]
    structure = fc.Structure(
        [crab, hook], joints, [winch], [fc.MotorTorque("lift", winch)], [fc.Position("z", hook.node, "z")]
    )
    plan = fc.Simulation(0.2, fc.GeneralizedAlpha(2e-3), every=0.01)
    effects = (fc.Gravity(), fc.RopeStretch(), fc.LargeRotation())
    found = fc.ladder(fc.Scene(structure, effects, simulation=plan), tolerance=0.05)
    assert found["linear"].failure
    assert all(np.isfinite(r.error) for r in found.rungs if r.name != "linear")
    assert found["full"].error < 0.05


def test_small_motion_begins_as_drawn_too():
    """A mass let go on a spring that hangs straight falls 2 m g / k in every rung that has the spring."""
    load = fc.PointMass("load", (0, 0, -1), 2.0)
    spring = fc.Spring("spring", (0, 0, 0), (0, 0, -1), 400.0)
    joints = [fc.Support(spring.start), fc.Support(load.node, "u v"), fc.Pin(spring.end, load.node)]
    structure = fc.Structure([load, spring], joints, outputs=[fc.Position("z", load.node, "z")])
    plan = fc.Simulation(0.5, fc.GeneralizedAlpha(1e-3), every=0.001)
    scene = fc.Scene(structure, (fc.Gravity(), fc.LargeRotation()), simulation=plan)
    linear = dict(rungs(scene))["linear"].of(scene).run()
    fall = 2.0 * 2.0 * 9.81 / 400.0
    assert linear["z"] == pytest.approx(-1.0 - 0.5 * fall * (1.0 - np.cos(np.sqrt(200.0) * linear.t)), abs=1e-9)
    entries = {entry.name: entry for entry in fc.ledger(scene, 0.05).entries}
    assert entries["large_rotation"].change.outputs["z"] < 1e-3


def test_under_a_continuous_law_the_linear_rung_is_run_as_the_scene_is(scene):
    """`Exact` would have to find commands that change within its steps, and is not marched then."""
    law = control.ss([], [], [], [[-50.0]], inputs=["travel"], outputs=["push"])
    smooth = scene.with_(controller=law)
    assert dict(rungs(smooth))["linear"].method == scene.simulation.method


def test_a_scene_whose_ropes_have_mass_has_component_modes_too():
    """Four elements of the girder become one with modes on either side of the rope, whose pieces stay."""
    section = fc.Section(EA=2e8, EI_y=4e5, EI_z=3e5, GJ=2e5, rhoA=4.0, rhoJ=0.05)
    beam = fc.Beam("girder", (0, 0, 0), (8, 0, 0), section, 8)
    rope = fc.Rope("rope", beam.node(4), (4, 0, -5), EA=1e6, rhoA=2.0, elements=3)
    joints = [fc.Support(beam.start), fc.Support(beam.end), fc.Pin(beam.node(4), rope.start)]
    structure = fc.Structure([beam, rope], joints, outputs=[fc.Position("z", beam.node(4), "z")])
    effects = (fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RopeMass())
    scene = fc.Scene(structure, effects, simulation=fc.Simulation(0.1, fc.GeneralizedAlpha(1e-3)))
    own = dict(rungs(scene))["component modes"].of(scene).model
    amplitudes = [name for name in own.coordinates if "_y" in name or "_z" in name]
    assert len(own.coordinates) - len(amplitudes) == 6 + 3 * 3
    assert len(amplitudes) == 2 * 2 * next(e.count for e in own.effects if isinstance(e, fc.ComponentModes))


def test_a_scene_in_component_modes_keeps_its_rung():
    """The rung's modes take the place of the scene's own, and the same beams bend."""
    section = fc.Section(EA=2e8, EI_y=4e5, EI_z=3e5, GJ=2e5, rhoA=4.0, rhoJ=0.05)
    boom = fc.Beam("boom", (0, 0, 0), (4, 0, 0), section, 1)
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 3), section, 1)
    joints = [fc.Support(boom.start), fc.Weld(boom.start, mast.start)]
    structure = fc.Structure([boom, mast], joints, outputs=[fc.Position("z", boom.end, "z")])
    plain = [fc.Gravity(), fc.LargeRotation()]
    for own in ([fc.Flexible(), fc.ComponentModes(2, ["boom"], 1)], [fc.ComponentModes(2, ["boom"], 1)]):
        scene = fc.Scene(structure, [*plain, *own], simulation=fc.Simulation(0.1, fc.GeneralizedAlpha(1e-3)))
        rung = dict(rungs(scene))["component modes"].of(scene)
        modes = next(e for e in rung.effects if isinstance(e, fc.ComponentModes))
        assert (modes.of, modes.along) == (("boom",), 1)
        bending = [{b.name for b in (boom, mast) if any(e.bends(b) for e in s.model.effects)} for s in (scene, rung)]
        assert bending[0] == bending[1]
        assert rung.model.n == scene.model.n + 2 * (modes.count - 2)
