"""Ledger and ladder of every shipped scene, over a short stretch of time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.study.answers import outputs_apart
from flexctrl.study.ladder import rungs
from flexctrl.study.omissions import omissions

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STRETCH = {"bridge_crane": 1.2, "ceiling_crane": 0.01, "flexible_arm": 0.2}


def short(name: str) -> fc.Scene:
    scene = fc.load_scene(str(EXAMPLES / f"{name}.toml"))
    plan = replace(scene.simulation, until=STRETCH[name], rigid_twin=False)
    return scene.with_(controller=scene.law, simulation=plan)


def test_every_scene_is_here():
    assert {path.stem for path in EXAMPLES.glob("*.toml")} == set(STRETCH)


@pytest.mark.slow
@pytest.mark.parametrize("name", STRETCH)
def test_the_ledger_keeps_what_matters(name):
    """The minimal set holds outputs, poles and margins, run against the full one, and is not dearer."""
    scene = short(name)
    found = fc.ledger(scene, 0.01)
    assert not found.minimal_change.poles > 0.01
    assert not found.minimal_change.margins > 0.01
    minimal = (
        found.accuracy.of(found.scene) if found.scene.simulation.method == scene.simulation.method else found.scene
    )
    again = outputs_apart(found.accuracy.of(scene).run(), minimal.run())
    assert max(again.values()) <= 0.01
    assert found.minimal_size.states <= found.size.states
    assert found.minimal_size.work <= 1.05 * found.size.work


@pytest.mark.slow
@pytest.mark.parametrize("name", STRETCH)
def test_every_rung_of_every_scene_runs(name):
    """To its end; what bends is nearer to the truth than what does not."""
    scene = short(name)
    runs = {rung: setting.of(scene).run() for rung, setting in rungs(scene)}
    assert {run.status for run in runs.values()} == {fc.Status.FINISHED}
    apart = {rung: max(outputs_apart(runs["refined"], run).values()) for rung, run in runs.items() if rung != "refined"}
    assert apart["full"] < 0.5 * apart["rigid"]
    assert np.isfinite(list(apart.values())).all()


@pytest.mark.slow
def test_the_bridge_crane_costs_a_fifth_without_what_it_does_not_need(monkeypatch):
    """Its whole cycle of 60 s: what the full ledger leaves out, left out together; work is counted, not timed."""
    idle = {"rope_stretch", "large_rotation", "stiffness_damping", "saturated"}
    scene = fc.load_scene(str(EXAMPLES / "bridge_crane.toml"))
    assert scene.simulation.until == 60.0
    items = [o for o in omissions(scene.with_(controller=scene.law)) if o.name in idle]
    assert len(items) == len(idle)
    monkeypatch.setattr("flexctrl.study.bookkeeping.omissions", lambda scene: items)
    found = fc.ledger(scene, fc.Within(outputs=0.01))
    assert found.minimal_set == ()
    assert found.minimal_change.outputs_worst <= 0.01
    assert max(outputs_apart(found.full.run, found.minimal.run).values()) <= 0.01
    assert found.minimal_size.work <= 0.2 * found.size.work
    assert found.modes is not None
