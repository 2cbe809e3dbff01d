"""Pictures of an effect ledger."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.plots.style import FLEXIBLE, INK, PALE, RIGID, tidy
from flexctrl.study.ledger import Entry, Ledger

__all__ = ["change_bars", "cost_bars", "ledger_figure"]

_LEAST = 1e-7


def ledger_figure(ledger: Ledger) -> Figure:
    """Draw what the answer loses without each effect, and what that saves.

    Parameters
    ----------
    ledger : Ledger

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(10.0, 1.6 + 0.34 * max(len(ledger.entries), 3)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    change_bars(left, ledger)
    cost_bars(right, ledger)
    held = 100.0 * ledger.minimal_change.outputs_worst
    figure.suptitle(
        f"{ledger.name}: {len(ledger.minimal_set)} of {len(ledger.entries)} effects keep the outputs within "
        f"{held:.2g} %, {ledger.pace}",
        fontsize=11,
        color=INK,
    )
    return figure


def change_bars(ax: Axes, ledger: Ledger) -> Axes:
    """Draw the change of the outputs without each effect, on a logarithmic scale.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    ledger : Ledger

    Returns
    -------
    matplotlib.axes.Axes
    """
    rows = np.arange(len(ledger.entries))
    changes = [_LEAST if e.change is None else max(e.change.outputs_worst, _LEAST) for e in ledger.entries]
    ax.barh(rows, changes, left=_LEAST, color=[_colour(e) for e in ledger.entries], height=0.66)
    for row, entry in zip(rows, ledger.entries, strict=True):
        if entry.change is None:
            ax.text(2 * _LEAST, float(row), "cannot be left out", va="center", fontsize=8, color=INK)
    if np.isfinite(ledger.within.outputs):
        ax.axvline(ledger.within.outputs, color=RIGID, linewidth=1.2)
    ax.set_xscale("log")
    ax.set_yticks(rows, [e.name.replace("_", " ") for e in ledger.entries])
    ax.invert_yaxis()
    tidy(ax).set(xlabel="largest change of an output without it, over its magnitude", xlim=(_LEAST, None))
    return ax


def cost_bars(ax: Axes, ledger: Ledger) -> Axes:
    """Draw the time of a run without each effect over that of the full scene, from 1 on a logarithmic scale.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    ledger : Ledger

    Returns
    -------
    matplotlib.axes.Axes
    """
    rows = np.arange(len(ledger.entries))
    times = np.array([1.0 / e.cost_ratio if np.isfinite(e.cost_ratio) else 1.0 for e in ledger.entries])
    ax.barh(rows, times - 1.0, left=1.0, color=[_colour(e) for e in ledger.entries], height=0.66)
    ax.axvline(1.0, color=INK, linewidth=0.8)
    ax.axvspan(1.0 / (1.0 + ledger.noise), 1.0 + ledger.noise, color=INK, alpha=0.12, linewidth=0)
    ax.set_xscale("log")
    tidy(ax).set(xlabel="time without it, over that of the full scene (grey: none that can be measured)")
    return ax


def _colour(entry: Entry) -> str:
    return FLEXIBLE if entry.keep else PALE
