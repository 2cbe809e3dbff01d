"""``flexctrl compare``: rigid against flexible."""

from __future__ import annotations

from dataclasses import asdict

from flexctrl.cli.answer import Answer, plain, write_json
from flexctrl.cli.loops import noted
from flexctrl.cli.program import Request
from flexctrl.cli.run import beside, draw, interrupted, problem, run_both, shown, told
from flexctrl.dynamics.run import Status
from flexctrl.errors import FlexctrlError
from flexctrl.scene import Scene, load_scene
from flexctrl.study.accuracy import finer_plan
from flexctrl.study.compare import Comparison


def answer(request: Request) -> Answer:
    """Run a scene flexible and rigid and compare the curves."""
    scene = load_scene(request.scene)
    run, twin = run_both(scene, twin=True)
    if twin is None:  # interrupted: what there is, is kept
        return Answer(
            f"{scene.name}: interrupted at t = {run.t[-1]:.4g} s",
            plain(told(run)),
            problem(run, twin),
            interrupted=True,
        )
    comparison, stopped = _known(scene, Comparison.between(run, twin))
    signals = {s.name: {k: v for k, v in asdict(s).items() if k != "name"} for s in comparison.signals}
    for name, known in comparison.known.items():
        signals[name]["rms_difference_known"] = known
    statuses = {"status": run.status.value, "rigid_status": twin.status.value}
    notes = [*scene.notes, *run.report.notes, *beside(run, twin)]
    data = plain({"scene": scene.name, **statuses, "signals": signals, "notes": notes})
    write_json(request.out, "compare.json", data)
    if request.out is not None:
        comparison.save_csv(request.out / "compare.csv")
    draw(request, scene, run, twin)
    ended = stopped or interrupted(run, twin)
    text = "\n".join([f"{scene.name}: flexible against rigid\n\n{comparison}", *noted(notes)])
    return Answer(text, data, problem(run, twin), ended)


def _known(scene: Scene, found: Comparison) -> tuple[Comparison, bool]:
    """A comparison held against one of finer runs, if they come to their end; and whether they were interrupted."""
    if not found.finished:
        return found, False
    finer = []
    for run, model in ((found.flexible, scene.model), (found.rigid, scene.twin)):
        plan = finer_plan(scene.simulation, run)
        try:
            finer.append(shown(scene.with_(controller=scene.law, simulation=plan), model, "held against finer runs"))
        except FlexctrlError:
            return found, False
        if finer[-1].status is not Status.FINISHED:
            return found, finer[-1].status is Status.INTERRUPTED
    return found.held_against(Comparison.between(*finer)), False


__all__ = ["answer"]
