"""Pictures of a fidelity ladder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.plots.style import CYCLE, PALE, tidy

if TYPE_CHECKING:
    from flexctrl.study.ladder import Ladder

__all__ = ["ladder_figure", "rungs_chart"]

_LEAST = 1e-6
_MARKS = "osD^v*P"
_KNOWN = ("rigid", "rigid, shafts", "linear", "component modes", "full", "refined")
"""Rungs that look the same in every chart; others take what is left."""


def ladder_figure(ladder: Ladder) -> Figure:
    """Draw error against time, rung by rung.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    rungs_chart(figure.subplots(), ladder)
    return figure


def rungs_chart(ax: Axes, ladder: Ladder) -> Axes:
    """Draw the rungs, with a line through those worth standing on; within the grey band the reference knows no better.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    ladder : Ladder

    Returns
    -------
    matplotlib.axes.Axes
    """
    ran = [r for r in ladder.rungs if np.isfinite(r.error)]
    times, errors = [r.time_ratio for r in ran], [max(r.error, _LEAST) for r in ran]
    climb = [(r.time_ratio, max(r.error, _LEAST)) for r in ladder.climb]
    ax.plot(*zip(*climb, strict=True), color=PALE, linewidth=2.5, zorder=1)
    order = [*_KNOWN, *(r.name for r in ran if r.name not in _KNOWN)]
    for rung, x, y in zip(ran, times, errors, strict=True):
        i = order.index(rung.name)
        mark, colour = _MARKS[i % len(_MARKS)], CYCLE[i % len(CYCLE)]
        ax.plot(x, y, mark, color=colour, markersize=9, alpha=0.85, label=rung.name, zorder=2)
    ax.legend(fontsize="small", frameon=False)
    ax.axhspan(_LEAST / 10, max(ladder.reference.uncertainty, _LEAST), color="#e5e7eb", zorder=0)
    ax.set(xscale="log", yscale="log", title=ladder.name)
    ax.set_xlim(0.5 * min(times), 2.0 * max(times))
    ax.set_ylim(0.3 * max(min(*errors, ladder.reference.uncertainty), _LEAST), 4.0 * max(errors))
    ax.set(
        xlabel="processor time over that of the calibration", ylabel="largest error of an output, over its magnitude"
    )
    return tidy(ax)
