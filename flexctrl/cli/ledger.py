"""``flexctrl ledger``: what each effect changes and costs."""

from __future__ import annotations

from dataclasses import asdict

from flexctrl.cli.answer import Answer, plain, write_json
from flexctrl.cli.program import Request
from flexctrl.cli.progress import progress
from flexctrl.effects.automatic import Within
from flexctrl.scene import load_scene
from flexctrl.study.bookkeeping import ledger
from flexctrl.study.ledger import Entry, Ledger


def answer(request: Request) -> Answer:
    """Leave every effect out in turn."""
    scene = load_scene(request.scene)
    asked = Within(outputs=request.tolerance) if request.outputs_only else Within.of(request.tolerance, "ledger")
    with progress(f"{scene.name}: ledger") as tell:
        found = ledger(scene, asked, progress=tell)
    data = _data(found)
    write_json(request.out, "ledger.json", data)
    if request.out is not None:
        found.plot().savefig(request.out / "ledger.png", dpi=150)
    text = f"{scene.name}: what each effect changes and costs\n\n{found}"
    return Answer(text, data, f"interrupted: {found.stopped}" if found.stopped else "", not found.complete)


def _data(found: Ledger) -> dict[str, object]:
    minimal = {
        "output_change": found.minimal_change.outputs_worst,
        "output_change_known": found.minimal_change.outputs_known,
        "outputs": found.minimal_change.outputs,
        "poles_change": found.minimal_change.poles,
        "pole": found.minimal_change.pole,
        "margins_change": found.minimal_change.margins,
        "speedup": found.speedup,
        "noise": found.noise,
        "states": found.minimal_size.states,
        "nonzeros": found.minimal_size.nonzeros,
    }
    return plain(
        {
            "scene": found.name,
            "tolerance": found.within.outputs,
            "within": asdict(found.within),
            "effects": [_entry(found, e) for e in found.entries],
            "minimal_set": found.minimal_set,
            "minimal": minimal,
            "full": {
                "states": found.size.states,
                "nonzeros": found.size.nonzeros,
                "steps": found.size.steps,
                "error": found.accuracy.own,
                "judged_steps": found.accuracy.steps,
                "judged_error": found.accuracy.known,
            },
            "complete": found.complete,
            "untried": found.untried,
            "notes": found.notes,
        }
    )


def _entry(found: Ledger, e: Entry) -> dict[str, object]:
    base: dict[str, object] = {
        "name": e.name,
        "output_change": None,
        "cost_ratio": e.cost_ratio,
        "keep": e.keep,
        "stays": e.stays,
    }
    base |= {"against_without": list(e.first)}
    if e.change is None or e.size is None:
        return {**base, "failure": e.failure}
    base |= {"cost_told": found.told_apart(e)}
    base |= {"output_change_known": e.change.outputs_known}
    change = {"output_change": e.change.outputs_worst, "outputs": e.change.outputs, "poles_change": e.change.poles}
    change |= {"pole": e.change.pole}
    size = {"states": e.size.states, "nonzeros": e.size.nonzeros, "instructions": e.size.instructions}
    return {**base, **change, "margins_change": e.change.margins, **size}


__all__ = ["answer"]
