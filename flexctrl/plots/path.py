"""Pictures of a path of equilibria."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.model.paths.path import EquilibriumPath
from flexctrl.plots.style import DRIVE, FLEXIBLE, INK, RIGID, new_figure, tidy

__all__ = ["path_figure", "plot_path"]


def path_figure(path: EquilibriumPath, over: str | None = None) -> Figure:
    """Draw the load over an output.

    Parameters
    ----------
    path : EquilibriumPath
    over : str, optional
        The output; default: the one that changes most.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(5.6, 4.0)
    plot_path(figure.subplots(), path, over)
    return figure


def plot_path(ax: Axes, path: EquilibriumPath, over: str | None = None) -> Axes:
    """Draw the load over an output: stable parts drawn through, unstable ones dashed, critical points marked.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    path : EquilibriumPath
    over : str, optional
        The output; default: the one that changes most.

    Returns
    -------
    matplotlib.axes.Axes
    """
    names = list(path.points[0].outputs)
    name = over or (max(names, key=lambda n: np.ptp(path[n])) if names else "")
    across = path[name] if name else np.arange(len(path.points))
    for first, last, stable in _runs(path.unstable == 0):
        style = "-" if stable else "--"
        ax.plot(across[first : last + 1], path.factor[first : last + 1], style, color=FLEXIBLE, linewidth=1.4)
    for points, colour, label in ((path.limits, RIGID, "limit"), (path.branchings, DRIVE, "branching")):
        for i, point in enumerate(points):
            place = point.outputs.get(name, np.nan)
            ax.plot(place, point.factor, "o", color=colour, markersize=5, label=label if not i else None)
    what = " + ".join(f"{value:g} {key}" if value != 1.0 else key for key, value in path.load.items())
    tidy(ax).set(xlabel=name or "point", ylabel=f"λ, factor of {what}")
    ax.axhline(0.0, color=INK, linewidth=0.6)
    if path.limits or path.branchings:
        ax.legend(fontsize="small", frameon=False)
    return ax


def _runs(flags: np.ndarray) -> list[tuple[int, int, bool]]:
    """First and last place of each run of equal flags; a run reaches to the first of the next."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(flags.astype(int))) + 1])
    ends = np.append(starts[1:], len(flags) - 1)
    return [(int(a), int(b), bool(flags[a])) for a, b in zip(starts, ends, strict=True)]
