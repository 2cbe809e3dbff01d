"""``flexctrl ladder``: the scene from rigid to refined, what each rung is worth and what it costs."""

from __future__ import annotations

from flexctrl.cli.answer import Answer, plain, write_json
from flexctrl.cli.program import Request
from flexctrl.cli.progress import progress
from flexctrl.scene import load_scene
from flexctrl.study.ladder import Ladder, ladder


def answer(request: Request) -> Answer:
    """Run a scene at every fidelity."""
    scene = load_scene(request.scene)
    with progress(f"{scene.name}: ladder") as tell:
        study = ladder(scene, tolerance=request.tolerance, progress=tell)
    data = _data(study)
    write_json(request.out, "ladder.json", data)
    if request.out is not None:
        study.plot().savefig(request.out / "ladder.png", dpi=150)
    problem = "" if study.complete else "interrupted: not all rungs were run, or as often as they should be"
    return Answer(f"{scene.name}: from rigid to refined\n\n{study}", data, problem, not study.complete)


def _data(study: Ladder) -> dict[str, object]:
    rungs = [
        {
            "name": r.name,
            "setting": str(r.setting),
            "error": r.error,
            "time_ratio": r.time_ratio,
            "freedoms": r.freedoms,
            "steps": r.steps,
            "failure": r.failure,
        }
        for r in study.rungs
    ]
    reference = {"setting": str(study.reference.setting), "agreement": study.reference.agreement}
    climb = [rung.name for rung in study.climb]
    found = {"scene": study.name, "rungs": rungs, "gains": study.gains, "climb": climb, "reference": reference}
    return plain({**found, "complete": study.complete})


__all__ = ["answer"]
