"""``flexctrl rlocus``: root locus of the machine and of its rigid twin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.bode import told
from flexctrl.cli.loops import Cut, cut_of, noted
from flexctrl.cli.program import Request
from flexctrl.plots.root_locus import draw_root_locus
from flexctrl.scene import load_scene
from flexctrl.study.branches import in_s, sided
from flexctrl.study.frequency import margins
from flexctrl.study.loop import Loop
from flexctrl.study.root_locus import CriticalGain, RootLocus, critical_gains, root_locus

_LEAST_GAIN = 1e-9
_LEAST_SHOWN, _SHOWN, _BEYOND, _COUNT = 1e-3, 30.0, 1.5, 120
"""Gains drawn of a controller, whose own gain is 1, and how far beyond the one at which stability is lost."""


def answer(request: Request) -> Answer:
    """Return the root loci of a scene."""
    scene = load_scene(request.scene)
    cut = cut_of(scene, request)
    loops = {name: cut.loop(linear) for name, linear in cut.machines.items() if _moves(cut, linear)}
    critical = {name: _critical(loop) for name, loop in loops.items()}
    loci = {name: root_locus(loop, _gains(critical[name]) if cut.controlled else None) for name, loop in loops.items()}
    data = plain(_data(cut, loops, loci, critical))
    _write(request, cut, loops, loci, critical)
    write_json(request.out, "rlocus.json", data)
    return Answer(_text(cut, data), data)


def _critical(loop: Loop) -> tuple[CriticalGain, ...]:
    """All critical gains without those at which rounding splits the double pole of rigid-body motion."""
    return tuple(c for c in critical_gains(loop) if c.gain > _LEAST_GAIN)


def _gains(critical: tuple[CriticalGain, ...]) -> np.ndarray:
    """The gains drawn: to beyond where stability is lost, however far that is."""
    lost = min((c.gain for c in critical if c.unstable_above and c.gain > 1.0), default=1.0)
    return np.geomspace(_LEAST_SHOWN, max(_SHOWN, _BEYOND * lost), _COUNT)


def _moves(cut: Cut, linear: Any) -> bool:
    return cut.controlled or cut.responds(linear)


def _data(
    cut: Cut, loops: Mapping[str, Loop], loci: Mapping[str, RootLocus], critical: Mapping[str, tuple[CriticalGain, ...]]
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "scene": cut.scene.name,
        "notes": cut.notes,
        "input": cut.input,
        "output": cut.output,
        "controlled": cut.controlled,
        "sample_time": max((loop.dt for loop in loops.values()), default=0.0),
    }
    for name in cut.machines:
        if name not in loops:
            data[name] = {"responds": False}
            continue
        loop, locus = loops[name], loci[name]
        cut_open = margins(loop)
        data[name] = {
            "responds": True,
            "poles": in_s(locus.poles, loop.dt),
            "zeros": in_s(locus.zeros, loop.dt),
            "closed_loop_poles": in_s(loop.closed_poles(), loop.dt),
            "stable": cut_open.verdict == "stable",
            "marginal": loop.is_marginal(),
            "critical_gains": [
                {"gain": c.gain, "hz": c.omega / (2 * np.pi), "unstable_above": c.unstable_above}
                for c in critical[name]
            ],
            "margins": told(cut_open),
        }
    return data


def _write(
    request: Request,
    cut: Cut,
    loops: Mapping[str, Loop],
    loci: Mapping[str, RootLocus],
    critical: Mapping[str, tuple[CriticalGain, ...]],
) -> None:
    for name, locus in loci.items():
        columns, branches = {"gain": locus.gains}, sided(locus.loci, loops[name].dt)
        for k in range(branches.shape[1]):
            columns |= {f"re_{k + 1}": branches[:, k].real, f"im_{k + 1}": branches[:, k].imag}
        write_csv(request.out, f"rlocus_{name}.csv", columns)

    def draw(figure: Any) -> None:
        draw_root_locus(figure, loci, cut.title, critical.get("flexible", ()))

    if loci:
        write_picture(request.out, "rlocus.png", draw, size=(9.0, 6.5))


def _text(cut: Cut, data: Mapping[str, Any]) -> str:
    lines = [cut.title]
    for name in cut.machines:
        side = data[name]
        if not side["responds"]:
            lines.append(f"\n{name}: {cut.input} does not move {cut.output}")
            continue
        lines.append(
            f"\n{name}: closed loop {side['margins']['closed_loop']} at gain 1, "
            f"{len(side['poles'])} poles, {len(side['zeros'])} zeros"
        )
        rows = [(c["gain"], c["hz"], "above" if c["unstable_above"] else "below") for c in side["critical_gains"]]
        if rows:
            lines.append(grid(("critical gain", "Hz", "unstable"), rows, left=0))
    return "\n".join(lines + noted(data["notes"]))


__all__ = ["answer"]
