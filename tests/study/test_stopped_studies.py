"""Ctrl-C in a study: what was found until then is kept, and no run that was stopped is taken for one that ended."""

from __future__ import annotations

import dataclasses
import json
import tomllib

import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.cli.program import main
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study import predictions
from flexctrl.study.omissions import omissions


@pytest.fixture(scope="module")
def scene():
    content = tomllib.loads(TROLLEY)
    content["simulation"] |= {"until": 0.1, "step": 5e-3}
    return scene_from(content, Place("trolley.toml"), "trolley")


def stopped_at(share):
    """A progress that is stopped where so much has been done."""

    def tell(done):
        if done >= share:
            raise KeyboardInterrupt

    return tell


def deflected():
    """A cantilever that a small force pushes down."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    push, tip = fc.Force("push", beam.end, "z"), fc.Position("tip", beam.end, "z")
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[push], outputs=[tip])
    effects = [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(1e-3, 1e-9)]
    simulation = fc.Simulation(until=0.02, method=fc.GeneralizedAlpha(1e-3))
    return fc.Scene(structure, effects, loads={"push": 10.0}, simulation=simulation)


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_ledger_that_is_stopped_has_what_was_tried_and_keeps_all(share):
    scene = deflected()
    found = fc.ledger(scene, fc.Within(outputs=0.02), progress=stopped_at(share))
    tried, names = [entry.name for entry in found.entries], [o.name for o in omissions(scene)]
    assert not found.complete
    assert tried
    assert [*tried, *found.untried] == names
    assert bool(found.untried) == (share < 0.5)
    assert found["beam_bending"].change.outputs_worst > 0.9
    assert set(found.minimal_set) == set(names)
    assert found.scene.effects == scene.effects
    assert found.stopped.endswith("what may be left out together is not known, so all is kept")
    assert str(found).endswith(f"note: {found.stopped}")
    assert "no smaller one" not in str(found)
    found.plot()


def test_a_ladder_that_is_stopped_has_the_rungs_that_were_run(scene):
    found = fc.ladder(scene, tolerance=0.05, progress=stopped_at(0.2))
    ran = [rung for rung in found.rungs if not rung.failure]
    assert not found.complete
    assert 0 < len(ran) < len(found.rungs)
    assert all(rung.time_ratio > 0.0 for rung in ran)
    assert {rung.failure for rung in found.rungs} == {"", "stopped before it was run"}
    assert set(found.climb) <= set(ran)
    assert str(found).count("stopped before") == len(found.rungs) - len(ran) + 1
    found.plot()


@pytest.mark.parametrize("study", [fc.ledger, fc.ladder])
def test_what_is_stopped_before_anything_was_found_is_stopped(study):
    with pytest.raises(KeyboardInterrupt):
        study(deflected(), progress=stopped_at(0.0))


@pytest.mark.parametrize("command", ["ledger", "ladder"])
def test_commands_that_are_stopped_write_what_there_is(tmp_path, capsys, monkeypatch, command):
    path = tmp_path / "trolley.toml"
    path.write_text(TROLLEY, encoding="utf-8")
    name = {"ledger": "flexctrl.study.bookkeeping._Auditor._choice", "ladder": "flexctrl.study.ladder._Tried.again"}
    calls = iter(range(100))
    before = {"ledger": 0, "ladder": 2}[command]
    again = fc.study.ladder._Tried.again

    def stopped(*given):
        if next(calls) >= before:
            raise KeyboardInterrupt
        again(*given)

    monkeypatch.setattr(name[command], stopped)
    assert main([command, str(path), "--json", "--out", str(tmp_path)]) == 1
    out, err = capsys.readouterr()
    assert "flexctrl: interrupted: " in err
    assert json.loads(out)["complete"] is False
    assert json.loads((tmp_path / f"{command}.json").read_text(encoding="utf-8")) == json.loads(out)
    assert (tmp_path / f"{command}.png").stat().st_size > 10_000


def test_an_envelope_takes_no_run_that_was_stopped_for_one_that_failed(monkeypatch):
    mass = fc.PointMass("mass", (0, 0, -1), 1.0)
    rod = fc.Rope("rod", (0, 0, 0), (0, 0, -1), EA=1e6)
    joints = [fc.Support(rod.start), fc.Pin(rod.end, mass.node), fc.Support(mass.node, "v")]
    outputs = [fc.Position("x", mass.node, "x")]
    model = fc.assemble(fc.Structure([rod, mass], joints, outputs=outputs), [fc.Gravity(), fc.LargeRotation()])
    simulate = predictions.simulate

    def stopped(*given, **named):
        return dataclasses.replace(simulate(*given, **named), status=fc.Status.INTERRUPTED)

    monkeypatch.setattr(predictions, "simulate", stopped)
    with pytest.raises(KeyboardInterrupt):
        fc.validity_envelope(model, fc.InitialDisplacement("rod_0_ry"), fc.Period("x"))
