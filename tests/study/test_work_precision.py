"""Work against precision: errors are what they are said to be, and the choice is the cheapest that holds."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study.held_out import load_cases
from flexctrl.study.settings import Fidelity, sweep


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
    return fc.work_precision(scene, 0.02, settings=settings(scene))


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


def test_a_study_goes_on_where_it_was_stopped(scene, study, tmp_path):
    store = tmp_path / "cost.jsonl"
    tried = settings(scene)[-2:]
    first = fc.work_precision(scene, 0.02, settings=tried, store=store)
    lines = store.read_text().splitlines()
    assert len(lines) == len(tried)
    again = fc.work_precision(scene, 0.02, settings=tried, store=store)
    assert again.points == first.points
    assert store.read_text().splitlines() == lines


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
