"""Where nothing is measured nothing is judged: no error of nought, no effect that changes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

import flexctrl as fc
from flexctrl.cli.program import main

STEEL_TUBE = fc.Section.tube(fc.STEEL, radius=0.02, thickness=0.002)


def unseen() -> fc.Scene:
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), STEEL_TUBE, elements=2)
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[fc.Force("push", beam.end, "z")])
    return fc.Scene(structure, loads={"push": 3.0}, simulation=fc.Simulation(until=0.02, every=0.002))


@pytest.mark.parametrize("study", [fc.ledger, fc.work_precision, fc.ladder], ids=lambda s: s.__name__)
def test_a_study_of_a_machine_without_outputs_is_refused(study):
    with pytest.raises(fc.errors.StructureError, match="has no outputs, and nothing to judge by; give some"):
        study(unseen(), tolerance=0.01) if study is fc.ladder else study(unseen(), 0.01)


def test_inputs_alone_can_be_compared_and_nothing_cannot():
    scene = unseen()
    assert "push" in str(fc.compare(scene))
    bare = scene.structure.with_(inputs=[])
    with pytest.raises(fc.errors.StructureError, match="compare: the machine has no outputs and no inputs"):
        fc.compare(fc.Scene(bare, simulation=scene.simulation))


def test_a_report_says_what_it_has_no_answer_for(tmp_path, capsys):
    file = tmp_path / "unseen.py"
    file.write_text(
        "import flexctrl as fc\n"
        "beam = fc.Beam('beam', (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.02, 0.002))\n"
        "machine = fc.Structure([beam], [fc.Support(beam.start)])\n"
        "scene = fc.Scene(machine, simulation=fc.Simulation(until=0.02, every=0.002))\n",
        encoding="utf-8",
    )
    assert main(["report", str(file), "--out", str(tmp_path)]) == 1
    assert "no answer for: Simulation, Fidelity, Effects, Accuracy" in capsys.readouterr().err
    assert "has no outputs, and nothing to judge by" in (tmp_path / "structure.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", ["report", "ledger", "cost", "ladder"])
@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf"])
def test_a_tolerance_is_a_positive_number(command, tolerance, capsys):
    assert main([command, "no_such_scene.toml", "--tolerance", tolerance]) == 2
    assert "expected a relative change > 0" in capsys.readouterr().err


def test_a_plan_is_not_yet_a_controller():
    scene = fc.load_scene(Path(__file__).parents[2] / "examples" / "flexible_arm.toml")
    with pytest.raises(fc.errors.ControllerError, match="give the scene's law"):
        fc.simulate(scene.model, scene.controller, until=1.0)
