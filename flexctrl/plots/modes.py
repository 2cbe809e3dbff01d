"""Mode shapes drawn on the machine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.mechanics.rotation import exponential
from flexctrl.model.linear import LinearModel
from flexctrl.model.model import Model
from flexctrl.model.modes import Modes
from flexctrl.model.motion import State
from flexctrl.plots.machine import Drawn, add_machine_axes, draw_deformed
from flexctrl.plots.style import CYCLE


def mode_pose(model: Model, linear: LinearModel, at: State, shape: np.ndarray, fraction: float = 0.12) -> Drawn:
    """Return the machine displaced by a mode shape, enlarged to be seen.

    Parameters
    ----------
    model : Model
    linear : LinearModel
        The model linearised at ``at``; freedoms it lacks do not move.
    at : State
    shape : numpy.ndarray, shape (n,)
        In the linear model's coordinates.
    fraction : float
        Largest displacement over the size of the machine.

    Returns
    -------
    Drawn
    """
    full = np.zeros(model.n)
    full[[model.coordinate(name) for name in linear.coordinates]] = shape
    moved = model.rates(at.with_(v=full))[: model.motion.source_base].reshape(-1, 6)
    largest = np.abs(moved[:, :3]).max(initial=0.0) or np.abs(moved[:, 3:]).max(initial=0.0) * model.structure.size
    scale = fraction * model.structure.size / largest if largest else 0.0
    turn = scale * moved[:, 3:]
    turn *= min(1.0, 0.6 / max(float(np.abs(turn).max(initial=0.0)), 1e-300))
    return Drawn(at.x + scale * moved[:, :3], exponential(turn) @ at.R)


def mode_label(modes: Modes, k: int) -> str:
    """Return what a mode is called: its number, frequency and the part that moves most."""
    kind, part = modes.kinds[k], modes.dominant_part(k) or modes.dominant_coordinate(k)
    speed = f"{modes.frequencies[k]:.4g} Hz" if kind == "flexible" else kind
    return f"{k + 1}: {speed} · {part}"


def modes_figure(
    figure: Figure, model: Model, linear: LinearModel, at: State, modes: Modes, chosen: Sequence[int]
) -> list[Axes]:
    """Draw mode shapes side by side.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty; it is sized for them.
    model : Model
    linear : LinearModel
    at : State
        The equilibrium.
    modes : Modes
    chosen : sequence of int
        Mode numbers from 0.

    Returns
    -------
    list of matplotlib.axes.Axes
    """
    poses = [mode_pose(model, linear, at, modes.shapes[:, k]) for k in chosen]
    columns = min(3, max(1, len(poses)))
    rows = -(-len(poses) // columns)
    figure.set_size_inches(4.2 * columns, 3.6 * max(rows, 1))
    axes = []
    for i, (k, pose) in enumerate(zip(chosen, poses, strict=True)):
        ax = add_machine_axes(figure, model.structure, poses, (rows, columns, i + 1))
        draw_deformed(ax, model.structure, pose, CYCLE[i % len(CYCLE)], label=mode_label(modes, k))
        axes.append(ax)
    figure.subplots_adjust(left=0.04, right=0.96, bottom=0.06, top=0.93, wspace=0.15, hspace=0.25)
    return axes


__all__ = ["mode_label", "mode_pose", "modes_figure"]
