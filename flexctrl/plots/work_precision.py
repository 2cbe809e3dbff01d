"""Pictures of work against precision."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.plots.style import CYCLE, INK, RIGID, tidy
from flexctrl.study.settings import Fidelity
from flexctrl.study.work_precision import WorkPrecision

__all__ = ["points_chart", "work_precision_figure"]

_MARKS = "osD^v*"


def work_precision_figure(study: WorkPrecision) -> Figure:
    """Draw error against time of every setting, the front, and the choice.

    Parameters
    ----------
    study : WorkPrecision

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    points_chart(figure.subplots(), study)
    none = "no setting is accurate enough" if study.complete else "stopped before a setting was chosen"
    chosen = f"chosen: {study.chosen.setting}" if study.chosen else none
    figure.suptitle(f"{study.name}: {chosen}", fontsize=10, color=INK)
    return figure


def points_chart(ax: Axes, study: WorkPrecision) -> Axes:
    """Draw the points: colour for fidelity, shape for mesh.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    study : WorkPrecision

    Returns
    -------
    matplotlib.axes.Axes
    """
    ran = [p for p in study.points if np.isfinite(p.error) and np.isfinite(p.time_ratio)]
    meshes = sorted({p.setting.mesh for p in ran})
    for colour, fidelity in zip(CYCLE, Fidelity, strict=False):
        for mark, mesh in zip(_MARKS, meshes, strict=False):
            some = [p for p in ran if p.setting.fidelity is fidelity and p.setting.mesh == mesh]
            if some:
                label = f"{fidelity.value}, mesh × {mesh}"
                x, y = [p.time_ratio for p in some], [max(p.error, 1e-12) for p in some]
                ax.plot(x, y, mark, color=colour, markersize=6, label=label, alpha=0.85)
    front = [p for p in study.pareto if np.isfinite(p.error)]
    ax.plot([p.time_ratio for p in front], [max(p.error, 1e-12) for p in front], color=INK, linewidth=1.0)
    ax.axhline(study.tolerance, color=RIGID, linewidth=1.0)
    if study.reference is not None:
        ax.axhspan(0.0, study.reference.uncertainty, color="#e5e7eb", zorder=0)
    if study.chosen:
        ax.plot(study.chosen.time_ratio, study.chosen.error, "o", markersize=15, markerfacecolor="none", color=RIGID)
    ax.set(xscale="log", yscale="log")
    tidy(ax).set(xlabel="time over that of the calibration", ylabel="largest error of an output, over its magnitude")
    if ran:
        ax.legend(fontsize="small", frameon=False)
    else:
        ax.set(xlim=(0.1, 10.0), ylim=(0.01 * study.tolerance, 1.0))
        ax.text(0.5, 0.5, "no setting was timed", transform=ax.transAxes, ha="center", color=INK)
    return ax
