"""The fidelity ladder: rungs are the same scene with other effects, errors are those of their runs."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study.ladder import rungs


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
