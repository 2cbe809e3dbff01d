"""How wrong reduced models are over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.linear.reduction import Reduced
from flexctrl.plots.frequency import HZ, channel_values, line_style
from flexctrl.plots.style import CYCLE, INK, axes_of, by_label, new_figure, tidy

__all__ = ["plot_reduction", "reduction_figure"]

_FLOOR = 1e-12


def plot_reduction(
    reduced: Reduced | Mapping[str, Reduced], ax: Axes | None = None, *, channel: tuple[str, str] | None = None
) -> Axes:
    """Draw a full model and how far reductions of it are from it.

    Parameters
    ----------
    reduced : Reduced or mapping of str to Reduced
        One reduction is drawn itself, too; of several (label → reduction) of one model the differences only.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    channel : tuple of str, optional
        (output, input); may be left out for single channels.

    Returns
    -------
    matplotlib.axes.Axes
    """
    several: Mapping[str, Reduced] = {"difference": reduced} if isinstance(reduced, Reduced) else {}
    several = several or by_label(reduced, "reduction", Reduced)
    ax = axes_of(ax, 7.5, 4.5)
    full = next(iter(several.values())).full
    response = full.frequency_response()
    exact, hertz = channel_values(response, channel), response.omega / HZ
    ax.loglog(hertz, abs(exact), label=f"full, {len(full.coordinates)} coordinates", color=INK, linewidth=2.2)
    least = _FLOOR * abs(exact).max()
    bottom = float(abs(exact).min())
    for number, (label, one) in enumerate(several.items()):
        mine = channel_values(one.frequency_response(response.omega), channel)
        if isinstance(reduced, Reduced):
            ax.loglog(hertz, abs(mine), label=f"reduced, order {one.order}", **line_style(0))
        gap = np.maximum(abs(exact - mine), least)
        style = line_style(1) if isinstance(reduced, Reduced) else _apart(number, len(several))
        ax.loglog(hertz, gap, label=label, **style)
        bottom = min(bottom, float(np.quantile(gap, 0.02)))
    ax.set_ylim(bottom=max(least, 0.3 * bottom))
    tidy(ax).set(xlabel="frequency (Hz)", ylabel="magnitude")
    ax.legend(frameon=False, fontsize="small")
    return ax


def _apart(number: int, count: int) -> dict[str, Any]:
    """A style of its own for each of many curves, thinner and thinner, so that one shows under another."""
    dashes = ("-", (0, (5, 1.5)), (0, (2, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
    turn = number // len(CYCLE) + number
    width = 3.4 - 2.4 * number / max(count - 1, 1) if count > 1 else 1.4
    return {"color": CYCLE[number % len(CYCLE)], "linewidth": width, "linestyle": dashes[turn % len(dashes)]}


def reduction_figure(reduced: Reduced) -> Figure:
    """Draw every channel of a reduction in a new figure, up to nine.

    Parameters
    ----------
    reduced : Reduced

    Returns
    -------
    matplotlib.figure.Figure
    """
    full = reduced.full
    channels = [(output, name) for output in full.outputs for name in full.inputs][:9]
    columns = min(len(channels), 1 if len(channels) < 2 else 2 if len(channels) <= 4 else 3)
    rows = -(-len(channels) // columns)
    figure = new_figure(3.0 + 3.8 * columns, 1.4 + 2.6 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, channel in zip(axes, channels, strict=False):
        plot_reduction(reduced, ax, channel=channel)
        ax.set_title(f"{channel[0]} from {channel[1]}", fontsize=9, color=INK)
        if ax is not axes[0]:
            ax.get_legend().remove()
    for ax in axes[len(channels) :]:
        ax.set_visible(False)
    title = f"{full.name}: order {reduced.order}, error {reduced.error.worst:.2g} of the peak at worst"
    figure.suptitle(title, fontsize=10, color=INK)
    return figure
