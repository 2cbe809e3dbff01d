"""``flexctrl bode``: frequency responses, rigid and flexible, and the margins of the scene's controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.loops import DRIFT, Cut, cut_of, noted
from flexctrl.cli.program import Request
from flexctrl.linear.model import LinearModel
from flexctrl.linear.response import FrequencyResponse
from flexctrl.plots.frequency import plot_bode
from flexctrl.plots.loops import mark_margins
from flexctrl.scene import load_scene
from flexctrl.study.branches import in_s
from flexctrl.study.frequency import Margins, loop_grid, margins
from flexctrl.study.loop import Loop


def answer(request: Request) -> Answer:
    """Return responses and margins of a scene."""
    scene = load_scene(request.scene)
    cut = cut_of(scene, request)
    responses = {
        name: linear.select([cut.input], [cut.output]).frequency_response(span=cut.span)
        for name, linear in cut.machines.items()
        if cut.responds(linear)
    }
    loops = {name: cut.loop(linear) for name, linear in cut.machines.items()} if cut.controlled else {}
    found = {name: margins(loop) for name, loop in loops.items()}
    data = plain(_data(cut, responses, loops, found))
    _write(request, cut, responses, loops, found)
    write_json(request.out, "bode.json", data)
    return Answer(_text(cut, data, found), data)


def _data(
    cut: Cut, responses: Mapping[str, FrequencyResponse], loops: Mapping[str, Loop], found: Mapping[str, Margins]
) -> dict[str, Any]:
    data: dict[str, Any] = {"scene": cut.scene.name, "input": cut.input, "output": cut.output}
    data["notes"] = cut.notes
    for name, linear in cut.machines.items():
        side: dict[str, Any] = {"responds": name in responses, "poles": linear.damped_poles()}
        if name in responses:
            side["resonance"] = _peak(cut, linear)
        if name in loops:
            side["margins"] = told(found[name])
            side["closed_loop_poles"] = in_s(loops[name].closed_poles(), loops[name].dt)
        data[name] = side
    return data


def _peak(cut: Cut, linear: LinearModel) -> dict[str, float | None]:
    """The highest resonance: |H| at the damped frequencies of the modes; nothing where none is damped."""
    modes = linear.modes()
    omega, damping = modes.omega[modes.flexible], modes.damping[modes.flexible]
    heard = (omega > DRIFT * omega.max(initial=0.0)) & (damping > 1e-9) & (damping < 1.0)
    if not heard.any():
        return {"hz": None, "magnitude": None}
    damped = omega[heard] * np.sqrt(1.0 - damping[heard] ** 2)
    response = linear.select([cut.input], [cut.output]).frequency_response(np.sort(damped))
    best = int(np.argmax(response.magnitude[0, 0]))
    return {"hz": float(response.frequencies[best]), "magnitude": float(response.magnitude[0, 0, best])}


def told(m: Margins) -> dict[str, Any]:
    """Return margins as numbers; what is unlimited is null in JSON.

    Parameters
    ----------
    m : Margins

    Returns
    -------
    dict
    """
    return {
        "stable": m.verdict == "stable",
        "closed_loop": m.verdict,
        "gain": m.gain_up.margin,
        "gain_db": 20.0 * np.log10(m.gain_up.margin),
        "gain_hz": m.gain_up.omega / (2 * np.pi),
        "gain_down": m.gain_down.margin,
        "phase_deg": np.degrees(m.phase.margin),
        "phase_hz": m.phase.omega / (2 * np.pi),
        "delay_s": m.delay.margin,
        "modulus": m.modulus.value,
        "modulus_hz": m.modulus.omega / (2 * np.pi),
        "Ms": m.sensitivity.value,
        "Mt": m.complementary.value,
    }


def _write(
    request: Request,
    cut: Cut,
    responses: Mapping[str, FrequencyResponse],
    loops: Mapping[str, Loop],
    found: Mapping[str, Margins],
) -> None:
    for name, response in responses.items():
        _curve(request, f"bode_{name}.csv", response.omega, response.values[0, 0])

    def plant(figure: Any) -> None:
        figure.set_layout_engine("constrained")
        axes = plot_bode(responses, figure.subplots(2, 1, sharex=True))
        axes[0].set_title(f"{cut.scene.name}: {cut.output} from {cut.input}", fontsize=11)

    if responses:
        write_picture(request.out, "bode.png", plant, size=(9.0, 6.5))
    if not loops or request.out is None:
        return
    curves = {name: loop.frd(_from(loop_grid(loop)[0], cut.span[0])) for name, loop in loops.items()}

    def broken(figure: Any) -> None:
        figure.set_layout_engine("constrained")
        axes = plot_bode(curves, figure.subplots(2, 1, sharex=True))
        mark_margins(list(axes), found["flexible"])
        axes[0].set_title(cut.title, fontsize=11)

    for name, curve in curves.items():
        _curve(request, f"loop_{name}.csv", curve.omega, curve.frdata[0, 0])
    write_picture(request.out, "loop.png", broken, size=(9.0, 6.5))


def _from(omega: np.ndarray, low: float) -> np.ndarray:
    """The part of a grid that is worth showing; below it a loop goes on as it comes."""
    return omega[omega >= low]


def _curve(request: Request, name: str, omega: np.ndarray, values: np.ndarray) -> None:
    columns = {"omega_rad_s": omega, "hz": omega / (2 * np.pi), "magnitude": np.abs(values)}
    write_csv(request.out, name, columns | {"phase_deg": np.degrees(np.unwrap(np.angle(values)))})


def _text(cut: Cut, data: Mapping[str, Any], found: Mapping[str, Margins]) -> str:
    lines = [f"{cut.scene.name}: {cut.output} from {cut.input}"]
    for name in cut.machines:
        if not data[name]["responds"]:
            lines.append(f"{name}: {cut.input} does not move {cut.output}")
        elif data[name]["resonance"]["hz"]:
            peak = data[name]["resonance"]
            lines.append(f"{name}: highest resonance {peak['magnitude']:.4g} at {peak['hz']:.5g} Hz")
        else:
            lines.append(f"{name}: no damped resonance")
    if found:
        keys = ("closed_loop", "gain_db", "phase_deg", "delay_s", "modulus", "Ms", "Mt")
        columns = [told(m) for m in found.values()]
        rows = [(key, *(column[key] for column in columns)) for key in keys]
        lines += ["", f"loop cut at {cut.input}", grid(("margin", *found), rows)]
    return "\n".join(lines + noted(data["notes"]))


__all__ = ["answer", "told"]
