"""``flexctrl cost``: what accuracy costs, and the cheapest setting for the tolerance asked."""

from __future__ import annotations

from pathlib import Path

from flexctrl.cli.answer import Answer, plain, write_json
from flexctrl.cli.program import Request
from flexctrl.cli.progress import progress
from flexctrl.scene import load_scene
from flexctrl.study.store import timed
from flexctrl.study.work_precision import WorkPrecision, work_precision


def answer(request: Request) -> Answer:
    """Try many settings on a scene."""
    scene = load_scene(request.scene)
    store = None if request.out is None else request.out / "cost.jsonl"
    with progress(f"{scene.name}: cost") as tell:
        study = work_precision(scene, request.tolerance, store=store, workers=request.workers, progress=tell)
    data = _data(study)
    write_json(request.out, "cost.json", data)
    if request.out is not None:
        study.plot().savefig(request.out / "cost.png", dpi=150)
    return Answer(f"{scene.name}: error against time\n\n{study}", data, _problem(study, store), not study.complete)


def _problem(study: WorkPrecision, store: Path | None) -> str:
    """How far it came before it was stopped, and how to go on."""
    if study.complete:
        return ""
    times = sum(map(timed, study.points))
    found = f"errors of {len(study.points)} settings and times of {times} were found"
    reached = found if study.reference else "no reference was found yet"
    return f"interrupted: {reached}; {_kept(study, store)}"


def _kept(study: WorkPrecision, store: Path | None) -> str:
    if store is None:
        return "runs so far are lost; --out DIR keeps them"
    if not study.kept:
        return "nothing is kept yet"
    return f"runs so far are kept in {store}; the same command goes on from there"


def _data(study: WorkPrecision) -> dict[str, object]:
    front = set(map(id, study.pareto))
    points = [
        {
            "setting": str(p.setting),
            "order": p.setting.order,
            "error": p.error,
            "time_ratio": p.time_ratio,
            "pareto": id(p) in front,
            "steps": p.steps,
            "failure": p.failure,
        }
        for p in study.points
    ]
    found = study.reference
    reference = None if found is None else {"setting": str(found.setting), "agreement": found.agreement}
    return plain(
        {
            "scene": study.name,
            "tolerance": study.tolerance,
            "points": points,
            "chosen": str(study.chosen.setting) if study.chosen else None,
            "held_out": study.held_out,
            "reference": reference,
            "complete": study.complete,
            "notes": study.notes,
        }
    )


__all__ = ["answer"]
