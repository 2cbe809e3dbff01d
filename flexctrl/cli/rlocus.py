"""``flexctrl rlocus``: root locus of the machine and of its rigid twin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexctrl.cli.answer import Answer, grid, plain, write_csv, write_json, write_picture
from flexctrl.cli.bode import told
from flexctrl.cli.loops import Cut, cut_of, in_s
from flexctrl.cli.program import Request
from flexctrl.plots.frequency import plot_root_locus
from flexctrl.scene import load_scene
from flexctrl.study.frequency import margins
from flexctrl.study.loop import Loop
from flexctrl.study.root_locus import CriticalGain, critical_gains, root_locus

_LEAST_GAIN, _CANCELLED = 1e-9, 0.02
_GAINS = np.geomspace(1e-3, 30.0, 400)  # of a controller, whose own gain is 1


def answer(request: Request) -> Answer:
    """Return the root loci of a scene."""
    scene = load_scene(request.scene)
    cut = cut_of(scene, request)
    loops = {name: cut.loop(linear) for name, linear in cut.machines.items() if _moves(cut, linear)}
    loci = {name: root_locus(loop, _GAINS if cut.controlled else None) for name, loop in loops.items()}
    critical = {name: _critical(loops[name], locus) for name, locus in loci.items()}
    data = plain(_data(cut, loops, loci, critical))
    _write(request, cut, loops, loci, critical)
    write_json(request.out, "rlocus.json", data)
    return Answer(_text(cut, data), data)


def _critical(loop: Loop, locus: Any) -> tuple[CriticalGain, ...]:
    """Critical gains without those at which rounding splits the double pole of rigid-body motion."""
    return tuple(c for c in critical_gains(loop, locus) if c.gain > _LEAST_GAIN)


def _moves(cut: Cut, linear: Any) -> bool:
    return cut.controlled or cut.responds(linear)


def _data(
    cut: Cut, loops: Mapping[str, Loop], loci: Mapping[str, Any], critical: Mapping[str, tuple[CriticalGain, ...]]
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "scene": cut.scene.name,
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
        marginal = loop.is_marginal()
        data[name] = {
            "responds": True,
            "poles": in_s(locus.poles, loop.dt),
            "zeros": in_s(locus.zeros, loop.dt),
            "closed_loop_poles": in_s(loop.closed_poles(), loop.dt),
            "stable": loop.is_stable() and not marginal,
            "marginal": marginal,
            "critical_gains": [
                {"gain": c.gain, "hz": c.omega / (2 * np.pi), "unstable_above": c.unstable_above}
                for c in critical[name]
            ],
            "margins": told(margins(loop)),
        }
    return data


def _write(
    request: Request,
    cut: Cut,
    loops: Mapping[str, Loop],
    loci: Mapping[str, Any],
    critical: Mapping[str, tuple[CriticalGain, ...]],
) -> None:
    for name, locus in loci.items():
        columns, branches = {"gain": locus.gains}, in_s(locus.loci, loops[name].dt)
        for k in range(branches.shape[1]):
            columns |= {f"re_{k + 1}": branches[:, k].real, f"im_{k + 1}": branches[:, k].imag}
        write_csv(request.out, f"rlocus_{name}.csv", columns)
    shown = {name: _in_s(locus, loops[name]) for name, locus in loci.items()}

    def draw(figure: Any) -> None:
        figure.set_layout_engine("constrained")
        ax = plot_root_locus(shown, figure.subplots(), critical=critical.get("flexible", ()), top=_top(shown))
        ax.set_title(cut.title + (", sampled, as ln(z)/T" if loops and _dt(loops) else ""), fontsize=11)

    if shown:
        write_picture(request.out, "rlocus.png", draw, size=(9.0, 6.5))


def _top(loci: Mapping[str, Any]) -> float:
    """As high as there are poles that move: those on a zero of their own are not worth the room."""
    moving = [0.0]
    for locus in loci.values():
        poles, zeros = np.asarray(locus.poles), np.append(locus.zeros, np.inf)
        gap = np.abs(poles[:, None] - zeros).min(axis=1)
        moving += np.abs(poles.imag[gap > _CANCELLED * np.abs(poles)]).tolist()
    return 1.4 * max(moving) or np.inf


def _dt(loops: Mapping[str, Loop]) -> float:
    return next(iter(loops.values())).dt


def _in_s(locus: Any, loop: Loop) -> Any:
    """The locus of a sampled loop drawn in the s-plane."""
    if not loop.dt:
        return locus
    from control.pzmap import PoleZeroData

    poles, zeros, loci = (in_s(points, loop.dt) for points in (locus.poles, locus.zeros, locus.loci))
    jumps = np.abs(np.diff(loci.imag, axis=0, prepend=loci.imag[:1])) > 0.5 * np.pi / loop.dt
    loci = np.where(jumps, np.nan, loci)  # past z = -1 a branch goes on at the other edge: no line between
    return PoleZeroData(poles, zeros, locus.gains, loci, sysname=locus.sysname, sort_loci=False)


def _text(cut: Cut, data: Mapping[str, Any]) -> str:
    lines = [cut.title]
    for name in cut.machines:
        side = data[name]
        if not side["responds"]:
            lines.append(f"\n{name}: {cut.input} does not move {cut.output}")
            continue
        state = "stable" if side["stable"] else "on the verge (undamped)" if side["marginal"] else "UNSTABLE"
        lines.append(f"\n{name}: closed loop {state} at gain 1, {len(side['poles'])} poles, {len(side['zeros'])} zeros")
        rows = [(c["gain"], c["hz"], "above" if c["unstable_above"] else "below") for c in side["critical_gains"]]
        if rows:
            lines.append(grid(("critical gain", "Hz", "unstable"), rows, left=0))
    return "\n".join(lines)


__all__ = ["answer"]
