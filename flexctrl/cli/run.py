"""``flexctrl run``: the simulation, with the rigid twin beside it if the scene asks."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.loops import noted
from flexctrl.cli.program import Request
from flexctrl.cli.progress import progress
from flexctrl.dynamics.run import Run, Status
from flexctrl.model.model import Model
from flexctrl.plots.machine import add_machine_axes, draw_moved
from flexctrl.plots.pose import pose_of
from flexctrl.plots.run import comparison_curves, panels, run_curves, units
from flexctrl.plots.style import FLEXIBLE
from flexctrl.scene import Scene, load_scene
from flexctrl.study.compare import Comparison, numbers
from flexctrl.study.rounding import beyond, of_signal


def answer(request: Request) -> Answer:
    """Run a scene."""
    scene = load_scene(request.scene).settled
    wanted = scene.simulation is not None and scene.simulation.rigid_twin
    run, twin = run_both(scene, twin=wanted)
    notes = [*scene.notes, *run.report.notes]
    data = plain({"scene": scene.name, **told(run), "notes": notes} | ({"rigid": told(twin)} if twin else {}))
    write_json(request.out, "run.json", data)
    write_csv(request.out, "run.csv", curves(run))
    if twin:
        write_csv(request.out, "rigid.csv", curves(twin))
    draw(request, scene, run, twin)
    text = "\n".join([_text(scene, run, twin), *noted([*notes, *beside(run, twin)])])
    return Answer(text, data, problem(run, twin), interrupted(run, twin))


def beside(run: Run, twin: Run | None) -> list[str]:
    """Return the notes of the rigid twin's run that are not those of the machine's."""
    notes = twin.report.notes if twin else ()
    return [f"rigid twin: {note}" for note in notes if note not in run.report.notes]


def run_both(scene: Scene, twin: bool) -> tuple[Run, Run | None]:
    """Run a scene's machine and, unless that was interrupted, its rigid twin.

    Parameters
    ----------
    scene : Scene
    twin : bool
        Whether the twin is wanted.

    Returns
    -------
    tuple of Run and (Run or None)
    """
    run = shown(scene, scene.model, f"{scene.name}")
    return run, shown(scene, scene.twin, "rigid twin") if twin and run.status is not Status.INTERRUPTED else None


def shown(scene: Scene, model: Model, what: str) -> Run:
    """Run a scene's machine, or its twin, and show how far it is.

    Parameters
    ----------
    scene : Scene
    model : Model
    what : str
        Is run, in words.

    Returns
    -------
    Run
    """
    with progress(what) as tell:
        return scene.run(model, tell)


def told(run: Run) -> dict[str, Any]:
    """Return the health and the numbers of a run.

    Parameters
    ----------
    run : Run

    Returns
    -------
    dict
    """
    report = asdict(run.report)
    measured = {name: asdict(numbers(run.t, run[name])) for name in run.outputs}
    applied = {name: asdict(numbers(run.t, run[name])) for name in run.inputs}
    return {"status": run.status.value, "end_s": float(run.t[-1]), **report, "outputs": measured, "inputs": applied}


def curves(run: Run) -> dict[str, np.ndarray]:
    """Return time, outputs and inputs of a run as columns."""
    return {"t": run.t} | {name: run[name] for name in (*run.outputs, *run.inputs)}


def problem(run: Run, twin: Run | None) -> str:
    """Return why a run did not finish; empty if all did."""
    for label, one in (("", run), ("rigid twin: ", twin)):
        if one is not None and one.status is not Status.FINISHED:
            return f"{label}{one.status.value}: {one.report.message}"
    return ""


def interrupted(run: Run, twin: Run | None) -> bool:
    """Return whether one of the runs was interrupted."""
    return any(one is not None and one.status is Status.INTERRUPTED for one in (run, twin))


def draw(request: Request, scene: Scene, run: Run, twin: Run | None) -> None:
    """Write the pictures of a run: its curves, and the machine at the end."""
    unit = units(scene.structure, scene.units)
    for name, signals in (("outputs.png", run.outputs), ("inputs.png", run.inputs)):
        if not signals:
            continue

        def paint(figure: Any, signals: tuple[str, ...] = signals) -> None:
            axes = panels(figure, len(signals))
            if twin:
                comparison_curves(axes, Comparison.between(run, twin), signals, unit)
            else:
                run_curves(axes, run, signals, unit)

        write_picture(request.out, name, paint, size=(9.0, 6.5))

    def final(figure: Any) -> None:
        title = f"{scene.name} at t = {run.t[-1]:.4g} s"
        pose = pose_of(scene.structure, scene.model.coordinates, run.final)
        ax = add_machine_axes(figure, scene.structure, [pose])
        draw_moved(ax, scene.structure, pose, FLEXIBLE, label=title, length=scene.units.length)

    write_picture(request.out, "final.png", final, size=(9.0, 6.5))


def _text(scene: Scene, run: Run, twin: Run | None) -> str:
    r = run.report
    head = (
        f"{scene.name}: {run.status.value} at t = {run.t[-1]:.6g} s, {r.steps} steps ({r.rejected_steps} rejected), "
        f"{r.newton_iterations} Newton iterations, {r.dofs} degrees of freedom, {r.wall_s:.2f} s\n"
        f"energy residual {r.energy_residual:.2g}: made or lost by the integrator, over the largest energy turned over"
    )
    names = (*run.outputs, *run.inputs)
    if twin is None:
        rows = [(name, *_row(name, [run])) for name in names]
        return f"{head}\n\n{grid(('signal', 'final', 'largest', 'rms'), rows)}"
    beside = (*twin.outputs, *twin.inputs)
    rows = []
    for name in names:
        found = _row(name, [run, twin] if name in beside else [run])
        rows.append((name, *(found if name in beside else [cell for value in found for cell in (value, "–")])))
    heads = ("signal", "final", "rigid", "largest", "rigid", "rms", "rigid")
    return f"{head}\n\n{grid(heads, rows)}"


def _row(name: str, runs: list[Run]) -> list[float]:
    """Each number of a signal, run by run; 0 where it is but rounding."""
    rounding = of_signal(name, runs)
    each = [asdict(numbers(run.t, run[name])).values() for run in runs]
    return [beyond(rounding, value) for number in zip(*each, strict=True) for value in number]


__all__ = ["answer", "beside", "curves", "draw", "interrupted", "problem", "run_both", "shown", "told"]
