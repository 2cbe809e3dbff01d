"""Work against precision: errors are what they are said to be, and the choice is the cheapest that holds."""

import sys
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scenes import EXAMPLES, TROLLEY

import flexctrl as fc
from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study import tryouts
from flexctrl.study.held_out import load_cases
from flexctrl.study.settings import Fidelity, around, sweep
from flexctrl.study.store import Point, Store, fingerprint


@pytest.fixture(scope="module")
def scene():
    content = tomllib.loads(TROLLEY)
    content["simulation"] |= {"until": 0.1, "step": 5e-3}
    return scene_from(content, Place("trolley.toml"), "trolley")


def settings(scene):
    alpha = fc.GeneralizedAlpha
    return sweep(
        scene, (Fidelity.RIGID, Fidelity.FULL), (1,), [(alpha(h, 0.8), fc.Tolerance()) for h in (1e-2, 5e-3, 2.5e-3)]
    )


@pytest.fixture(scope="module")
def study(scene):
    return fc.work_precision(scene, 0.02, settings=settings(scene), workers=1)


def test_errors_are_those_against_the_reference(scene, study):
    reference = study.reference.run
    for point in study.points:
        run = point.setting.of(scene.with_(controller=scene.law)).run()
        errors = [
            np.abs(np.interp(reference.t, run.t, run[n]) - reference[n]).max() / np.abs(reference[n]).max()
            for n in reference.outputs
        ]
        assert point.error == pytest.approx(max(errors), rel=1e-6)


def test_the_error_of_the_full_model_falls_with_the_square_of_the_step(study):
    full = [p for p in study.points if p.setting.fidelity is Fidelity.FULL]
    steps = [p.setting.method.step for p in full]
    slope = np.polyfit(np.log(steps), np.log([p.error for p in full]), 1)[0]
    assert 1.5 < slope < 3.0


def test_the_reference_is_certified(study):
    assert set(study.reference.agreement) == {"a coarser mesh", "longer steps", "another integrator"}
    assert study.reference.uncertainty <= study.tolerance / 3


def test_nothing_cheaper_that_was_tried_passes(study):
    chosen = study.chosen
    assert chosen.error <= study.tolerance
    assert max(study.held_out[str(chosen.setting)], default=0.0) <= study.tolerance
    for point in study.points:
        if point.time_ratio < chosen.time_ratio and point.error <= study.tolerance:
            assert max(study.held_out[str(point.setting)]) > study.tolerance


def test_no_point_of_the_front_is_beaten(study):
    for a in study.pareto:
        assert not any(b.error <= a.error and b.time_ratio < a.time_ratio for b in study.points)
    assert min(p.error for p in study.points) in [p.error for p in study.pareto]


def test_a_study_goes_on_where_it_was_stopped(scene, tmp_path, monkeypatch):
    """Stopped among the errors, then among the times: nothing is done twice, the end is that of a study in one go."""
    store, tried = tmp_path / "cost.jsonl", settings(scene)
    done = {"errors": [], "times": []}

    def counted(name, kind, function):
        def also(scene, setting, *more):
            done[kind].append(setting)
            return function(scene, setting, *more)

        monkeypatch.setattr(f"flexctrl.study.{name}", also)

    counted("tryouts._tried", "errors", tryouts._tried)
    counted("work_precision.time_of", "times", tryouts.time_of)

    def until(share):
        def stop(done):
            if share < done < 1.0:
                raise KeyboardInterrupt

        return fc.work_precision(scene, 0.02, settings=tried, store=store, workers=1, progress=stop)

    assert until(0.25).points == ()
    assert len(done["errors"]) in range(1, len(tried))
    halfway = until(0.75)
    assert not halfway.complete
    assert 0 < len(halfway.points) < len(tried)
    with store.open("a") as file:
        file.write('{"scene": "trolley", "sett')  # cut off while it was written
    whole = fc.work_precision(scene, 0.02, settings=tried, store=store, workers=1)
    assert whole.complete
    assert whole.chosen is not None
    assert [p.setting for p in whole.points] == list(tried)
    assert done == {"errors": list(tried), "times": list(tried)}


def test_a_study_that_is_complete_runs_nothing_again(scene, study, tmp_path, monkeypatch):
    """Reference and held-out cases are read too; a tighter tolerance asks for a reference of its own."""
    store, tried = tmp_path / "cost.jsonl", settings(scene)
    first = fc.work_precision(scene, 0.02, settings=tried, store=store, workers=1)

    def refused(*anything):
        raise AssertionError("run again")

    with monkeypatch.context() as patched:
        for name in ("reference.finished", "work_precision.finished", "work_precision.time_of", "tryouts._tried"):
            patched.setattr(f"flexctrl.study.{name}", refused)
        again = fc.work_precision(scene, 0.02, settings=tried, store=store, workers=1)
        with pytest.raises(AssertionError, match="run again"):
            fc.work_precision(scene, 0.1 * first.reference.uncertainty, settings=tried, store=store, workers=1)
    assert str(again) == str(first)
    assert again.held_out == first.held_out
    assert np.array_equal(again.reference.run.y, first.reference.run.y)
    assert again.reference.setting == study.reference.setting


def test_points_of_another_scene_are_not_taken_up(scene, tmp_path):
    store, tried = tmp_path / "cost.jsonl", settings(scene)[:2]
    base = scene.with_(controller=scene.law)
    heavier = base.with_(effects=[fc.Gravity((0, 0, -5.0)), *scene.effects[1:]])
    longer = base.with_(simulation=replace(scene.simulation, until=0.2))
    marks = [fingerprint(s) for s in (base, heavier, longer, base.with_())]
    assert len(set(marks)) == 3
    Store(store, marks[0]).keep(Point(tried[0], 0.1, 1.0, 3))
    assert Store(store, marks[0]).known(tried[0]) == Point(tried[0], 0.1, 1.0, 3)
    assert Store(store, marks[1]).known(tried[0]) is None


@pytest.mark.slow
def test_errors_are_the_same_from_several_processes(scene, study):
    pytest.importorskip("joblib")
    shared = fc.work_precision(scene, 0.02, settings=settings(scene), workers=2)
    assert [p.error for p in shared.points] == pytest.approx([p.error for p in study.points], rel=1e-9)
    assert all(np.isfinite(p.time_ratio) for p in shared.points)


def test_without_joblib_one_process_does_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "joblib", None)
    assert tryouts.workers_of(None) == tryouts.workers_of(1) == 1
    with pytest.raises(StructureError, match=r"flexctrl\[parallel\]"):
        tryouts.workers_of(2)
    with pytest.raises(StructureError, match="whole number"):
        tryouts.workers_of(0)


def test_the_sweep_is_physics_mesh_integrator_accuracy_and_order():
    """Every combination on the paper's crane; orders of elements, and of the linear machine by exact steps."""
    crane = fc.load_scene(str(EXAMPLES / "ceiling_crane.toml"))
    found = sweep(crane)
    assert len(set(found)) == len(found)
    modal = [s for s in found if s.fidelity is Fidelity.COMPONENT_MODES]
    full = [s for s in found if s.fidelity is Fidelity.FULL]
    assert {s.mesh for s in full} == {1, 2, 4}
    assert {type(s.method) for s in full} == {fc.GeneralizedAlpha, fc.AdaptiveAlpha}
    assert len(modal) == 2 * len(full)
    assert {s.order for s in modal} == {1, 3}
    assert {s.order for s in found if isinstance(s.method, fc.Exact)} == {4, 12, None}
    chosen = sweep(
        crane, (Fidelity.COMPONENT_MODES, Fidelity.LINEAR), (1,), [(fc.AdaptiveAlpha(), fc.Tolerance())], [2]
    )
    ways = [("component modes", 2), ("linear", None), ("linear", 2), ("linear", None)]
    assert [(s.fidelity.value, s.order) for s in chosen] == ways
    sizes = {s.order: s.of(crane).model.n for s in modal if s.mesh == 1}
    beams = sum(1 for e in crane.structure.elements)
    assert sizes[3] - sizes[1] == 2 * 2 * (beams + 1)  # the girder keeps two elements: a node is in use amid it


@pytest.mark.slow
@pytest.mark.parametrize(("name", "until"), [("bridge_crane", 0.4), ("ceiling_crane", 0.004), ("flexible_arm", 0.06)])
def test_every_scene_shipped_has_its_cost(name, until):
    """A few settings of every kind, on every scene: a certified reference, a front, a choice that is held out."""
    scene = fc.load_scene(str(EXAMPLES / f"{name}.toml"))
    scene = scene.with_(controller=scene.law, simulation=replace(scene.simulation, until=until))
    kinds = (Fidelity.RIGID, Fidelity.COMPONENT_MODES, Fidelity.FULL)
    ways = [around(scene.simulation.method, scene.simulation.tolerance)[2]]
    linear = sweep(scene, (Fidelity.LINEAR,), (1,), orders=(6,))
    tried = (*sweep(scene, kinds, (1,), ways, (2,)), *(s for s in linear if s.order == 6))
    found = fc.work_precision(scene, 0.1, settings=tried, workers=1)
    assert found.complete
    assert found.reference.uncertainty <= 0.1 / 3
    assert not any(p.failure for p in found.points)
    assert {p.setting.order for p in found.points} == {None, 2, 6}
    assert found.pareto
    by_kind = {p.setting.fidelity: p.error for p in found.points}
    assert by_kind[Fidelity.FULL] < by_kind[Fidelity.RIGID]
    if found.chosen is not None:
        assert max((*found.held_out[str(found.chosen.setting)], found.chosen.error)) <= 0.1


def test_held_out_cases_scale_the_commanded_move(scene):
    base = scene.with_(controller=scene.law)
    for case, factor in zip(load_cases(base, (0.5, 2.0)), (0.5, 2.0), strict=True):
        rigid = [s.with_(effects=[fc.Gravity(), fc.LargeRotation()]) for s in (base, case)]
        ends = [s.run()["angle"][-1] for s in rigid]
        assert ends[1] == pytest.approx(factor * ends[0], rel=0.05)


@pytest.mark.slow
def test_a_scene_that_cannot_be_certified_says_so(scene):
    with pytest.raises(FlexctrlError, match=r"the reference .* more than a third"):
        fc.work_precision(scene, 1e-14, settings=settings(scene)[-1:])


def test_its_words_and_picture(study):
    assert "reference:" in str(study)
    assert study.plot().axes


def test_wrong_questions_are_answered(scene):
    with pytest.raises(StructureError, match="tolerance"):
        fc.work_precision(scene, -1.0)
    with pytest.raises(StructureError, match="no simulation"):
        fc.work_precision(replace(scene, simulation=None))
