"""The effect ledger: what it says of each effect is what happens without it."""

import tomllib
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scenes import TROLLEY

import flexctrl as fc
import flexctrl.scene.scene as scene_module
import flexctrl.study.bookkeeping as bookkeeping
import flexctrl.study.trials as trials_module
from flexctrl.errors import StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study.answers import Answer, answer_of, change_between, outputs_apart
from flexctrl.study.ledger import Size
from flexctrl.study.omissions import omissions
from flexctrl.study.subject import prepared


def trolley(text=TROLLEY, until=0.1, **changes) -> fc.Scene:
    content = tomllib.loads(text)
    content["simulation"] |= {"until": until, "step": 5e-3}
    content["effects"] |= changes.pop("effects", {})
    return scene_from(content | changes, Place("trolley.toml"), "trolley")


@pytest.fixture(scope="module")
def scene():
    return trolley()


@contextmanager
def even_clock():
    """Every run takes as long: what is counted decides, not what else the machine does."""
    timed = trials_module.timed
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trials_module, "timed", lambda scene, model: (timed(scene, model)[0], 0.01))
        yield


@pytest.fixture(scope="module")
def drawn_up(scene):
    with even_clock():
        return fc.ledger(scene, 0.01)


@pytest.fixture(scope="module")
def longer():
    """Long enough for exact integration to pay by the clock, on a busy machine too; and a short way."""
    return trolley(TROLLEY.replace("distance = 0.5", "distance = 0.005"), until=2.0)


@pytest.fixture(scope="module")
def drawn_up_longer(longer):
    return fc.ledger(longer, 0.01)


def test_every_effect_has_a_line(drawn_up):
    assert [e.name for e in drawn_up.entries] == [
        "gravity",
        "shaft_elasticity",
        "rope_stretch",
        "large_rotation",
        "geometric_stiffness",
        "stiffness_damping",
        "saturated",
        "sampled",
    ]


def test_the_change_is_that_of_a_run_without(scene, drawn_up):
    full = scene.run()
    without = scene.with_(effects=[fc.Gravity(), fc.ShaftElasticity(), fc.LargeRotation(), scene.effects[-1]]).run()
    for name, change in drawn_up["rope_stretch"].change.outputs.items():
        size = np.abs(full[name]).max()
        expected = np.abs(np.interp(full.t, without.t, without[name]) - full[name]).max() / size
        assert change == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_poles_are_those_of_the_closed_loop(scene, drawn_up):
    """The slow pole of the controlled trolley, from the closed loop's own state matrix."""
    from flexctrl.study.broken_loop import broken_loop, linear_law

    loop = broken_loop(scene.linear, linear_law(scene.law), "torque")
    poles = np.log(loop.closed_poles(1.0)) / scene.law.sample_time
    assert drawn_up.full.poles.size >= 4
    for pole in drawn_up.full.poles:
        assert np.abs(poles - pole).min() < 1e-6 * abs(pole)


def test_the_minimal_set_was_run_against_the_full_one(scene, drawn_up):
    again = change_between(answer_of(scene, scene.run()), answer_of(drawn_up.scene, drawn_up.scene.run()))
    assert again.outputs_worst == pytest.approx(drawn_up.minimal_change.outputs_worst, rel=1e-6)
    assert again.outputs_worst <= drawn_up.within.outputs


def test_what_matters_is_kept_and_what_does_not_is_not(drawn_up):
    for entry in drawn_up.entries:
        if entry.change is None or entry.change.outputs_worst > drawn_up.within.outputs:
            assert entry.keep
    assert not drawn_up["saturated"].keep  # the limit is never reached
    assert drawn_up["saturated"].change.outputs_worst == 0.0


def test_a_tight_tolerance_keeps_what_a_loose_one_drops(scene, drawn_up):
    with even_clock():
        tight = fc.ledger(scene, 1e-9)
    assert set(tight.minimal_set) > set(drawn_up.minimal_set)
    assert "saturated" not in tight.minimal_set


@pytest.mark.long
def test_an_effect_of_no_strength_changes_nothing():
    scene = trolley(effects={"rayleigh_damping": {"alpha": 1e-15, "beta": 0.0}})
    entry = fc.ledger(scene, 1e-6)["mass_damping"]
    assert entry.change.outputs_worst < 1e-12


def test_leaving_out_flexibility_takes_states_away(drawn_up):
    full = drawn_up.size.states
    assert drawn_up["shaft_elasticity"].size.states == full - 2
    assert drawn_up["rope_stretch"].size.states == full - 2
    assert drawn_up["saturated"].size == drawn_up.size


@pytest.fixture(scope="module")
def rubbing():
    """A trolley with friction and play, which no linear machine can have."""
    scene = trolley()
    rough = [fc.CoulombFriction({"travel_drive": 1e-3}), fc.Backlash({"travel_drive": 1e-4})]
    return scene.with_(effects=[*scene.effects, *rough])


@pytest.mark.long
def test_large_rotation_is_examined_without_what_cannot_be_linear(rubbing):
    entry = fc.ledger(rubbing, 0.01)["large_rotation"]
    assert entry.first == ("coulomb_friction", "backlash")
    smooth = rubbing.with_(effects=rubbing.effects[:-2])
    alone = change_between(*(answer_of(s, s.run()) for s in (smooth, omission(smooth, "large_rotation"))))
    assert entry.change.outputs_worst == pytest.approx(alone.outputs_worst, rel=1e-6)
    assert entry.size.instructions == 0


def omission(scene, name):
    return next(o for o in omissions(scene.with_(controller=scene.law)) if o.name == name).without(scene)


def test_a_linear_minimal_set_is_integrated_exactly_with_no_more_modes_than_it_needs(longer, drawn_up_longer):
    """Half as many would not do; poles and margins are the machine's own."""
    method = drawn_up_longer.scene.simulation.method
    assert "large_rotation" not in drawn_up_longer.minimal_set
    assert isinstance(method, fc.Exact)
    assert "integrated exactly" in str(drawn_up_longer)
    for fewer in (1, 2):
        if drawn_up_longer.modes is None or fewer < drawn_up_longer.modes:
            plan = replace(drawn_up_longer.scene.simulation, method=replace(method, modes=fewer))
            apart = outputs_apart(drawn_up_longer.full.run, drawn_up_longer.scene.with_(simulation=plan).run())
            assert max(apart.values()) > 0.01
    assert drawn_up_longer.minimal_change.outputs_worst <= 0.01
    strict = fc.ledger(longer, 1e-9)
    assert strict.modes is None
    assert "exactly" not in str(strict)


def test_every_effect_of_a_machine_that_has_them_all_has_a_line():
    """The list of the issue: what the machine has can be left out, one by one, and something is gone each time."""
    beam = fc.Beam("boom", (0, 0, 0), (2, 0, 0), fc.Section.tube(fc.STEEL, 0.05, 0.004))
    rope = fc.Rope("rope", beam.end, (2, 0, -1), EA=1e5, rhoA=0.5, elements=2, damping=10.0)
    spring = fc.Spring("spring", beam.start, (0, 0, 3), stiffness=1e3, damping=1.0)
    load, hook = fc.PointMass("load", (2, 0, -1), 5.0), fc.PointMass("hook", (0, 1, 3), 4.0)
    crab = fc.PointMass("crab", (0, 1, 5), 10.0)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=50.0, ratio=20.0, inertia=1e-3, damping=0.1)
    winch = fc.Winch("winch", hook.node, crab.node, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02)
    structure = fc.Structure(
        [beam, rope, spring, load, hook, crab],
        [
            fc.Support(beam.start, held="u v w rx ry"),
            fc.Pin(beam.end, rope.start),
            fc.Pin(rope.end, load.node),
            fc.Support(crab.node),
            fc.Support(spring.end),
        ],
        [motor, winch],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", "motor")],
    )
    effects = [
        fc.Gravity(),
        fc.Flexible(),
        fc.RopeMass(),
        fc.LargeRotation(),
        fc.RayleighDamping(0.1, 1e-3),
        fc.Backlash({"motor": 1e-3}),
        fc.CoulombFriction({"motor": 0.05}),
        fc.ViscousFriction({"motor": 0.05}),
        fc.MotorLag({"motor": 0.01}),
        fc.Wind({"load": 0.5}, (5, 0, 0)),
    ]
    law = fc.design.pid(0.5, 0.0, 0.1, measured="angle", rate=fc.design.FilteredRate(0.01), command="torque")
    law = fc.Delayed(fc.Quantised(fc.Saturated(fc.Sampled(law, 0.01), {"torque": 2.0}), {"angle": 1e-4}), 1)
    scene = fc.Scene(structure, effects, law, simulation=fc.Simulation(until=0.01))
    scene = scene.with_(controller=scene.law)
    found = {o.name: o for o in omissions(scene)}
    assert set(found) >= {
        "gravity",
        "beam_bending",
        "beam_stretch",
        "beam_torsion",
        "rotary_inertia",
        "shaft_elasticity",
        "rope_stretch_rope",
        "rope_stretch_winch",
        "rope_mass",
        "large_rotation",
        "geometric_stiffness",
        "mass_damping",
        "stiffness_damping",
        "drive_damping",
        "rope_damping",
        "spring_damping",
        "viscous_friction",
        "coulomb_friction",
        "backlash",
        "motor_lag",
        "wind",
        "sampled",
        "saturated",
        "quantised",
        "delayed",
    }
    assert found["sampled"].first == ("delayed",)  # a delay of whole samples cannot be without them
    for name, each in found.items():
        base = scene
        for before in each.first:
            base = found[before].without(base)
        without, whole = each.without(base), (base.structure, base.effects, base.controller)
        same = [
            a is b or a == b
            for a, b in zip(whole, (without.structure, without.effects, without.controller), strict=True)
        ]
        assert not all(same), name


def test_the_work_of_exact_steps_is_counted():
    """They need no iterations: their steps count."""
    still = Size(states=4, nonzeros=8, instructions=0, steps=50, newton_iterations=0)
    assert still.work == 400.0


@pytest.mark.slow
def test_what_takes_longer_without_stays(monkeypatch):
    """Whatever the counts say: a controller that reads all the time is asked by Python at every step."""
    timed, names = trials_module.timed, []

    def slowly(scene, model):
        run = timed(scene, model)[0]
        sampled = scene.law is not None and scene.law.sample_time
        names.append(bool(sampled))
        return run, (1.0 if sampled else 60.0)

    monkeypatch.setattr(trials_module, "timed", slowly)
    found = fc.ledger(trolley(), fc.Within(outputs=0.9))
    assert not all(names)
    assert found["sampled"].change.outputs_worst <= 0.9
    assert found["sampled"].keep


@pytest.mark.long
def test_what_is_kept_does_not_hang_on_times_that_scatter(monkeypatch):
    """Runs that all take as long, but for up to 18 %: whatever chance makes of their times, the set is the same."""
    timed, verdicts = trials_module.timed, set()
    for seed in range(3):
        chance = np.random.default_rng(seed)
        monkeypatch.setattr(
            trials_module, "timed", lambda scene, model, c=chance: (timed(scene, model)[0], 1.0 + 0.18 * c.random())
        )
        found = fc.ledger(trolley(), 0.01)
        verdicts.add(tuple((e.name, e.keep, e.stays) for e in found.entries))
        assert found.pace == "as fast"
        assert not [e.name for e in found.entries if e.change and found.told_apart(e)]
    assert len(verdicts) == 1


def test_what_saves_nothing_stays():
    """Torsion of a beam that nothing twists: the stiffer one has all its freedoms."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    push, tip = fc.Force("push", beam.end, "z"), fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[tip])
    simulation = fc.Simulation(until=0.02, method=fc.GeneralizedAlpha(1e-3))
    scene = fc.Scene(structure, effects=[fc.BeamFlexibility()], loads={"push": 10.0}, simulation=simulation)
    entry = fc.ledger(scene, 0.02)["beam_torsion"]
    assert entry.change.outputs_worst < 1e-6
    assert entry.keep


def deflected() -> fc.Scene:
    """A cantilever that a small force pushes down."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    push, tip = fc.Force("push", beam.end, "z"), fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[tip])
    simulation = fc.Simulation(until=0.02, method=fc.GeneralizedAlpha(1e-3))
    effects = [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(1e-3, 1e-9)]
    return fc.Scene(structure, effects, loads={"push": 10.0}, simulation=simulation)


@pytest.mark.long
def test_what_changes_nothing_has_its_reason_where_the_full_set_is_handed_out(monkeypatch):
    """No smaller set is as fast by the clock: each line is over what is borne, or says why the effect stays."""
    monkeypatch.setattr(bookkeeping._Auditor, "_gain", lambda self, trial: 1.0 if trial is self.full else 0.0)
    found = fc.ledger(deflected(), fc.Within(outputs=0.02))
    assert all(e.keep for e in found.entries)
    assert found["beam_torsion"].stays == "as much to compute without it"
    assert found["mass_damping"].stays == "dearer without it"
    assert not found["beam_bending"].stays
    for e in found.entries:
        assert e.change is None or e.change.outputs_worst > 0.02 or e.stays, e.name


def test_a_run_has_the_effects_that_the_answer_needs(monkeypatch):
    """Those of the smallest set; a model that is given is run as it is, and a study is of all that are named."""
    scene = deflected()
    small = scene.with_(effects=[fc.LargeRotation()])
    drawn = SimpleNamespace(scene=small, summary="left out: much", notes=(), complete=True)
    monkeypatch.setattr(scene_module, "ledger", lambda full, tolerance: drawn)
    chosen = scene.with_(effects=[*scene.effects, fc.Automatic(0.01)])
    assert chosen.run().report.dofs == small.model.n == 0 < scene.model.n
    assert chosen.run(chosen.model).report.dofs == scene.model.n
    assert chosen.run(chosen.twin).report.dofs == 0
    drawn.complete = False
    with pytest.raises(KeyboardInterrupt):
        scene.with_(effects=[*scene.effects, fc.Automatic(0.01)]).run()
    assert prepared(chosen, 0.01, "ledger").effects == scene.effects


def test_a_scene_gives_away_its_controller_and_its_simulation():
    scene = trolley()
    assert scene.with_(controller=None).law is None
    assert scene.with_(simulation=None).simulation is None
    kept = scene.with_(loads={})
    assert kept.controller is scene.controller
    assert kept.simulation is scene.simulation
    assert np.abs(scene.with_(controller=None).run()["torque"]).max() == 0.0 < np.abs(scene.run()["torque"]).max()


def test_a_pole_that_moves_far_is_named():
    """Over the larger magnitude of both: one from near rest has changed wholly, not 70000 %."""
    run = fc.simulate(trolley().model, until=0.01)
    first, second = Answer(run, np.array([1e-3 + 0j, 2 + 3j])), Answer(run, np.array([-0.7 + 0j, 2 + 3j]))
    change = change_between(first, second)
    assert change.poles == pytest.approx(1.0, abs=2e-3)
    assert change.pole == 1e-3
    assert change_between(first, replace(first, poles=np.zeros(0))).poles == 1.0  # all of them are gone
    assert np.isnan(change_between(replace(first, poles=np.zeros(0)), first).pole)


def test_a_limit_that_appears_or_is_gone_is_a_change_as_large_as_can_be():
    """The rigid twin has no upper gain margin at all; one that doubles has changed by half of what it is then."""
    run = fc.simulate(trolley().model, until=0.01)
    limited, free = (Answer(run, np.zeros(0, complex), {"torque": (g, 0.5)}) for g in (8.0, np.inf))
    assert change_between(limited, free).margins == change_between(free, limited).margins == 1.0
    assert change_between(free, free).margins == 0.0
    assert change_between(limited, replace(limited, margins={"torque": (16.0, 0.5)})).margins == 0.5
    assert change_between(limited, replace(limited, margins={})).margins == 1.0  # no linear answer any more
    assert np.isnan(change_between(replace(limited, margins={}), limited).margins)
    assert change_between(limited, replace(limited, margins={"torque": (8.0, -0.5)})).margins == 2.0


@pytest.mark.slow
def test_what_is_asked_for_is_held(scene, drawn_up):
    """Poles and margins by default; curves only, or the linear loop only, where that is asked."""
    for asked, names in ((0.01, {"outputs", "poles", "margins"}), (fc.Within(margins=1e-9), {"margins"})):
        with even_clock():
            found = drawn_up if asked == 0.01 else fc.ledger(scene, asked)
        changes = {
            "outputs": found.minimal_change.outputs_worst,
            "poles": found.minimal_change.poles,
            "margins": found.minimal_change.margins,
        }
        for name in names:
            assert changes[name] <= getattr(found.within, name)
    with even_clock():
        curves = fc.ledger(scene, fc.Within(outputs=0.01))
    assert set(curves.minimal_set) <= set(drawn_up.minimal_set)


def test_its_words_and_picture(drawn_up):
    text = str(drawn_up)
    assert "rope_stretch" in text
    assert replace(drawn_up, speedup=2.0, noise=0.2).pace == "2.0 × faster"
    assert replace(drawn_up, speedup=0.5, noise=0.2).pace == "2.0 × slower"
    assert replace(drawn_up, speedup=1.3, noise=0.4).pace == replace(drawn_up, speedup=0.8, noise=0.4).pace == "as fast"
    assert drawn_up.noise > 0.0
    assert "≈ 1 " in str(replace(drawn_up, noise=1e9)).splitlines()[1]
    dearer = tuple(replace(e, cost_ratio=1.5) for e in drawn_up.entries)
    assert "≈ 1 " not in str(replace(drawn_up, noise=0.0, entries=dearer)).splitlines()[1]


@pytest.mark.parametrize("ratios", [[0.9, 1.0, 1.1], [0.02, 1.0, 40.0], [1e-4, 1.0, 1e4], [0.3, 1.0, 2.6]])
def test_nothing_overlaps_in_its_picture(drawn_up, ratios):
    """Labels of both axes and their numbers, whatever was measured; none is cut off."""
    times = np.resize(ratios, len(drawn_up.entries)).tolist()
    timed = [replace(e, cost_ratio=ratio) for e, ratio in zip(drawn_up.entries, times, strict=True)]
    figure = replace(drawn_up, entries=tuple(timed)).plot()
    FigureCanvasAgg(figure).draw()
    shown = [label for ax in figure.axes for label in _labels(ax)]
    boxes = [label.get_window_extent() for label in shown]
    assert len(shown) >= 2 + 3 + 3 + len(timed)
    for box in boxes:
        assert figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 <= box.y1 <= figure.bbox.y1
    assert not [(a, b) for a, b in combinations(boxes, 2) if a.overlaps(b)]


def _labels(ax):
    low, high = sorted(ax.get_xlim())
    numbers = [t for t, x in zip(ax.get_xticklabels(), ax.get_xticks(), strict=True) if low <= x <= high]
    minor = [t for t in ax.get_xticklabels(minor=True) if low <= t.get_position()[0] <= high]
    names = [t for t in ax.get_yticklabels() if t.get_visible()]
    return [t for t in (ax.xaxis.label, *numbers, *minor, *names) if t.get_text()]


def test_what_changes_nothing_has_no_bar(drawn_up):
    bars = [patch for patch in drawn_up.plot().axes[0].patches if patch.get_height() == pytest.approx(0.66)]
    for entry, bar in zip(drawn_up.entries, bars, strict=True):
        assert bar.get_width() + 1e-7 == pytest.approx(max(entry.change.outputs_worst, 1e-7))


def test_wrong_questions_are_answered(scene, drawn_up):
    with pytest.raises(StructureError, match="tolerance"):
        fc.ledger(scene, 0.0)
    with pytest.raises(StructureError, match="did you mean 'rope_stretch'"):
        drawn_up["rope_strech"]
    with pytest.raises(StructureError, match="no simulation"):
        fc.ledger(replace(scene, simulation=None))


@pytest.mark.slow
def test_what_cannot_be_left_out_is_kept_with_the_reason():
    """Without its rope's stretch the crane has no tension to measure: the output is gone."""
    outputs = tomllib.loads(TROLLEY)["outputs"] | {"pull": {"kind": "tension", "line": "rope"}}
    entry = fc.ledger(trolley(outputs=outputs), 0.01)["rope_stretch"]
    assert entry.keep
    assert entry.change.outputs["pull"] == 1.0


@pytest.mark.slow
def test_automatic_picks_the_minimal_set(longer, drawn_up_longer):
    chosen = longer.with_(effects=[*longer.effects, fc.Automatic(0.01)])
    assert chosen.settled.effects == drawn_up_longer.scene.effects
    assert chosen.settled.simulation == replace(longer.simulation, method=drawn_up_longer.scene.simulation.method)
    assert longer.settled is longer
    told = [note for note in chosen.settled.notes if note.startswith("automatic: left out: ")]
    assert told == [f"automatic: {drawn_up_longer.summary}"]
    gone = {e.name for e in drawn_up_longer.entries if not e.keep}
    assert gone
    assert all(name in told[0] for name in gone)
    assert chosen.model.effects == longer.model.effects  # by itself it adds nothing
