"""What a report says of its own numbers: the run, the linear model, and the references of its studies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexctrl.cli.answer import grid
from flexctrl.dynamics.run import worst_signal
from flexctrl.errors import FlexctrlError
from flexctrl.linear.certificate import Certificate
from flexctrl.scene import Scene

_STUDIES = {"ladder": "Fidelity", "ledger": "Effects", "cost": "Accuracy"}


def health(scene: Scene, run: str, told: Mapping[str, Mapping[str, Any]]) -> str:
    """Return how far the numbers of a report can be trusted.

    Parameters
    ----------
    scene : Scene
    run : str
        What the run has to say; empty without one.
    told : mapping of str to mapping
        Data of the run and of the studies that the report has, by command; empty of those that failed.

    Returns
    -------
    str
    """
    parts = [run, _integrator(told.get("run", {})), _linear(scene), _references(told)]
    return "\n\n".join(part for part in parts if part)


def _integrator(data: Mapping[str, Any]) -> str:
    if not data:
        return ""
    worst = f"; converged last: {data['worst']}" if data["worst"] else ""
    e = data["energy"]
    rows = [(name, e[name]) for name in ("start", "work", "dissipated", "kinetic", "stored")]
    lines = [f"{data['method']}, order {data['order']}, {data['damping']}{worst}"]
    if data["closure_error"]:
        lines.append(f"loops of rigid parts closed to {data['closure_error']:.2g}")
    if data["drift"]:
        lines.append(f"errors of steps add up to {data['drift']:.2g} of the motion of {data['drifted']}")
    if data["error"] != data["drift"]:
        lines.append(f"off by {data['error']:.2g} of the motion, by a coarser run")
    if data["output_errors"]:
        lines.append(worst_signal("outputs", data["output_errors"]))
    if data["command_errors"]:
        lines.append(worst_signal("commands", data["command_errors"]))
    return "\n".join([*lines, grid(("energy", "J"), rows)])


def _linear(scene: Scene) -> str:
    """The certificates of the machine and of its rigid twin, side by side."""
    try:
        models = {"as it is": scene.linear} | ({"rigid": scene.twin_linear} if scene.twin.n else {})
    except FlexctrlError as error:
        return f"linear model: {error}"
    found = {name: linear.certificate for name, linear in models.items() if linear.certificate is not None}
    rows = zip(*map(_certified, found.values()), strict=True)
    lines = [(row[0][0], *(value for _, value, _ in row), row[0][2]) for row in rows]
    table = grid(("linear model", *found, "what is right"), lines, left=len(found) + 2)
    return "\n".join([table, *(line for name, c in found.items() for line in _in_words(name, c))])


def _certified(c: Certificate) -> list[tuple[str, str, str]]:
    """What, how much, and what it should be."""
    return [
        ("residual of the equilibrium", _number(c.residual) if c.residual else "rounding", "far below 1"),
        ("asymmetry of K", _number(c.asymmetry), "below 1e-6, but for loads without a potential"),
        ("skew share of C", _number(c.gyroscopic), "0, but in a rotating frame"),
        ("Taylor slope of the forces", f"{c.taylor_slope:.2f}", "2 or more; inf: they are linear"),
        ("smallest pivot of M", f"{c.definiteness:.1e}", "0 or more"),
        ("condition of M", f"{c.condition_mass:.1e}", "inf: something has no mass"),
        ("condition of K", f"{c.condition_stiffness:.1e}", "inf: something is free to move"),
        ("lowest frequencies within", _number(c.frequency_error), "far below 1"),
    ]


def _in_words(name: str, c: Certificate) -> list[str]:
    lines = [f"{name}: rigid-body modes: {'; '.join(c.rigid_modes)}"] if c.rigid_modes else []
    lines += [f"{name}: loads without a potential: {', '.join(c.loads)}"] if c.loads else []
    lines += [f"{name}: constant forces on {', '.join(c.held)}"] if c.held else []
    return lines + [f"{name}: {note}" for note in c.notes]


def _references(told: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [f"{title}: {_known(name, told[name])}" for name, title in _STUDIES.items() if name in told]
    return "\n".join(["what studies measure against", *lines]) if lines else ""


def _known(name: str, data: Mapping[str, Any]) -> str:
    if name == "ledger" and data:
        full = data["full"]
        own = "ended early" if full["error"] is None else f"is {_number(full['error'])} off"
        beside = f"; the scene's own run {own}" if full["error"] != full["judged_error"] else ""
        return f"full run of {full['judged_steps']} steps, known to {_number(full['judged_error'])}{beside}"
    found = data.get("reference")
    if not found:
        return "no reference was found"
    apart = ", ".join(f"{other} {_number(value)}" for other, value in found["agreement"].items())
    return f"{found['setting']}, known to {_number(max(found['agreement'].values(), default=0.0))}; apart from {apart}"


def _number(value: float | None) -> str:
    if value is None:
        return "nothing: a run ended early"
    return f"{value:.1e}" if value else "0"


__all__ = ["health"]
