"""``flexctrl compare``: rigid against flexible."""

from __future__ import annotations

from dataclasses import asdict

from flexctrl.cli.answer import Answer, plain, write_json
from flexctrl.cli.program import Request
from flexctrl.cli.run import draw, interrupted, problem, run_both, told
from flexctrl.scene import load_scene
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
    comparison = Comparison.between(run, twin)
    signals = {s.name: {k: v for k, v in asdict(s).items() if k != "name"} for s in comparison.signals}
    statuses = {"status": run.status.value, "rigid_status": twin.status.value}
    data = plain({"scene": scene.name, **statuses, "signals": signals})
    write_json(request.out, "compare.json", data)
    if request.out is not None:
        comparison.save_csv(request.out / "compare.csv")
    draw(request, scene, run, twin)
    return Answer(
        f"{scene.name}: flexible against rigid\n\n{comparison}", data, problem(run, twin), interrupted(run, twin)
    )


__all__ = ["answer"]
