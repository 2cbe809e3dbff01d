"""``flexctrl table``: join table, element list, audit of freedoms."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.loops import noted
from flexctrl.cli.program import Request
from flexctrl.effects.rope_mass import RopeMass
from flexctrl.linear.condense import Audit, Freedom
from flexctrl.linear.model import LinearModel
from flexctrl.model.model import Model
from flexctrl.plots.machine import add_machine_axes, draw_machine
from flexctrl.scene import Scene, load_scene
from flexctrl.structure.beams import Beam
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import IDENTIFIERS
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.structure import Structure


def answer(request: Request) -> Answer:
    """Return the join table of a scene's machine."""
    scene = load_scene(request.scene)
    machine, audit = scene.structure, _audit(scene.model)
    table = machine.join_table
    light = _light(scene)
    elements = [_element(machine, part) | ({"mass": 0.0} if part in light else {}) for part in machine.elements]
    left_out = [
        f"mass of rope {p.name}, {p.mass:.5g} {scene.units.mass}, is left out: no effect rope_mass gives it any"
        for p in light
    ]
    data = plain(
        {
            "scene": scene.name,
            "nodes": len(machine.nodes),
            "dofs": table.free,
            "model_dofs": scene.model.n,
            "join_table": {
                "columns": IDENTIFIERS,
                "rows": table.rows,
                "labels": table.labels,
                "drives": table.drives,
                "drive_labels": table.drive_labels,
                "relative": sorted(table.relative),
            },
            "elements": elements,
            "audit": {kind.name.lower(): audit.named(kind) for kind in Freedom} | {"mechanisms": audit.mechanisms},
            "notes": [*scene.notes, *scene.model.notes, *left_out],
        }
    )
    columns = {"node": range(1, len(table.rows) + 1), "label": table.labels}
    columns |= {name: [row[i] for row in table.rows] for i, name in enumerate(IDENTIFIERS)}
    write_csv(request.out, "join_table.csv", columns)
    write_json(request.out, "table.json", data)

    def draw(figure: Any) -> None:
        draw_machine(add_machine_axes(figure, machine), machine, length=scene.units.length)

    write_picture(request.out, "machine.png", draw, size=(9.0, 6.5))
    heads = ("element", "kind", "nodes", f"length ({scene.units.length})", f"mass ({scene.units.mass})")
    parts = grid(heads, [tuple(row.values()) for row in elements], left=2)
    effects = "" if table.free == scene.model.n else f" in the join table, {scene.model.n} under the scene's effects"
    text = "\n\n".join([f"{scene.name}: {table.free} degrees of freedom{effects}", str(table), parts, str(audit)])
    return Answer("\n".join([text, *noted(data["notes"])]), data)


def _light(scene: Scene) -> list[Rope]:
    """Ropes with a mass that the scene's effects leave out."""
    masses = [part for effect in scene.effects for part in effect.parts() if isinstance(part, RopeMass)]
    ropes = [p for p in scene.structure.elements if isinstance(p, Rope) and p.mass]
    return [p for p in ropes if not any(e.weighs(p) for e in masses)]


def _element(machine: Structure, part: Part) -> dict[str, Any]:
    numbers = [machine.number(n) + 1 for n in part.nodes]
    mass = part.section.rhoA * part.length if isinstance(part, Beam) else getattr(part, "mass", 0.0)
    return {
        "name": part.name,
        "kind": type(part).__name__,
        "nodes": f"{numbers[0]}…{numbers[-1]}" if len(numbers) > 1 else str(numbers[0]),
        "length": part.length if isinstance(part, Beam | Rope | Spring) else 0.0,
        "mass": mass,
    }


def _audit(model: Model) -> Audit:
    """The audit of the machine as drawn: masses, stiffness without prestress, damping."""
    still, n = np.zeros(model.n), model.n
    C = -model.slope(model.rest, still, still, (0.0, 1.0, 0.0), np.zeros(len(model.inputs)))
    none = np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, 0))
    linear = LinearModel(model.mass(), C.tocsc(), model.stiffness(), *none, model.coordinates, (), ())
    return linear.audit()


__all__ = ["answer"]
