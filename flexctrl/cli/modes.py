"""``flexctrl modes``: the equilibrium and the modes about it."""

from __future__ import annotations

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.loops import left_out, noted, without_law
from flexctrl.cli.program import Request
from flexctrl.errors import SceneError
from flexctrl.linear.modes import Modes
from flexctrl.plots.modes import modes_figure
from flexctrl.scene import Scene, load_scene

_PICTURES = 9


def answer(request: Request) -> Answer:
    """Return the equilibrium and the lowest modes of a scene."""
    if request.count < 1:
        raise SceneError(f"--count {request.count}: ask for at least one mode")
    scene = load_scene(request.scene)
    every = scene.linear.modes()
    modes = every.select(list(range(min(request.count, len(every)))))
    counts = {"rigid_body_modes": every.rigid, "unstable_modes": every.unstable, "massless_freedoms": every.massless}
    data = plain(_data(scene, modes) | counts)
    keys = ("frequencies_hz", "damping", "kinds", "parts", "shares")
    write_csv(request.out, "modes.csv", {"mode": range(1, len(modes) + 1)} | {key: data[key] for key in keys})
    write_json(request.out, "modes.json", data)
    rigid, shown = every.rigid + every.unstable, min(_PICTURES, len(modes))
    first = max(0, min(rigid, len(modes) - shown))

    def draw(figure: object) -> None:
        chosen = range(first, first + shown)
        assert modes.place is not None
        modes_figure(figure, modes.place, modes, chosen)  # type: ignore[arg-type]

    write_picture(request.out, "modes.png", draw, size=(12.0, 10.0))
    return Answer(_text(scene, data), data)


def _data(scene: Scene, modes: Modes) -> dict[str, object]:
    parts = [modes.dominant_part(k) for k in range(len(modes))]
    shares = [_share(modes, k, part) for k, part in enumerate(parts)]
    return {
        "scene": scene.name,
        "notes": [*left_out(scene.model, scene.rest), *without_law(scene)],
        "equilibrium": {"residual": scene.rest.residual, "outputs": scene.rest.outputs},
        "dofs": scene.model.n,
        "frequencies_hz": modes.frequencies,
        "damping": modes.damping,
        "kinds": modes.kinds,
        "parts": parts,
        "shares": shares,
        "coordinates": [modes.dominant_coordinate(k) for k in range(len(modes))],
    }


def _share(modes: Modes, k: int, part: str) -> float:
    return float(np.clip(modes.part_shares(k)[part], 0.0, 1.0)) if part else 0.0


def _text(scene: Scene, data: dict) -> str:
    rest = data["equilibrium"]
    left = f"residual {rest['residual']:.2g}" if rest["residual"] else "balanced to rounding"
    head = f"{scene.name}: equilibrium of {data['dofs']} degrees of freedom, {left}"
    outputs = grid(("output", "at rest"), rest["outputs"].items())
    columns = zip(*(data[k] for k in ("frequencies_hz", "damping", "kinds", "parts", "shares")), strict=True)
    rows = [(k, f, z, kind, part, f"{100 * share:.0f} %") for k, (f, z, kind, part, share) in enumerate(columns, 1)]
    modes = grid(("mode", "Hz", "damping", "kind", "part", "its share"), rows)
    count = data["rigid_body_modes"]
    more = f"{count} rigid-body mode{'s' * (count != 1)}" + (
        f", {data['unstable_modes']} unstable" if data["unstable_modes"] else ""
    )
    return "\n".join([f"{head}\n\n{outputs}\n\n{modes}\n\n{more}", *noted(data["notes"])])


__all__ = ["answer"]
