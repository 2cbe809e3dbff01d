"""Pictures of an effect ledger."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from flexctrl.plots.style import FLEXIBLE, INK, PALE, RIGID, tidy
from flexctrl.study.ledger import Entry, Ledger

__all__ = ["change_bars", "cost_bars", "ledger_figure"]

_LEAST = 1e-7
_TICKS = 5
_ROWS = 3


def ledger_figure(ledger: Ledger) -> Figure:
    """Draw what the answer loses without each effect, and what that saves.

    Parameters
    ----------
    ledger : Ledger

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(10.0, 1.6 + 0.34 * max(len(ledger.entries), _ROWS)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    change_bars(left, ledger)
    cost_bars(right, ledger)
    figure.suptitle(f"{ledger.name}: {_found(ledger)}", fontsize=11, color=INK)
    return figure


def _found(ledger: Ledger) -> str:
    all_of_them = len(ledger.entries) + len(ledger.untried)
    if not ledger.complete:
        return f"stopped, {len(ledger.entries)} of {all_of_them} effects were tried"
    held = 100.0 * ledger.minimal_change.outputs_worst
    return f"{len(ledger.minimal_set)} of {all_of_them} effects keep the outputs within {held:.2g} %, {ledger.pace}"


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
    for row, entry in zip(rows, ledger.entries, strict=True):
        if entry.change is None:
            ax.text(2 * _LEAST, float(row), "cannot be left out", va="center", fontsize=8, color=INK)
            continue
        change, known = entry.change.outputs_worst, entry.change.outputs_known
        ax.barh(row, max(change - _LEAST, 0.0), left=_LEAST, color=_colour(entry), height=0.66)
        if np.isfinite(known) and change + known > _LEAST:
            ax.hlines(row, max(change - known, _LEAST), change + known, color=INK, linewidth=1.2)
    if np.isfinite(ledger.within.outputs):
        ax.axvline(ledger.within.outputs, color=RIGID, linewidth=1.2)
    ax.set_xscale("log")
    ax.set_yticks(rows, [e.name.replace("_", " ") for e in ledger.entries])
    ax.set_ylim(max(len(rows), _ROWS) - 0.4, -0.6)
    label = "largest change of an output without it,\nover its magnitude (thin line: to what it is known)"
    tidy(ax).set(xlabel=label, xlim=(_LEAST, max(ax.get_xlim()[1], 10.0 * _LEAST)))
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
    least, most = min([0.5, *0.9 * times]), max([2.0, *1.1 * times])
    ticks = _ratios(least, most)
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_major_formatter(lambda ratio, _: f"{ratio:g}")
    ax.xaxis.set_minor_locator(NullLocator())
    label = "time without it, over that of the full scene\n(grey: none that can be measured)"
    tidy(ax).set(xlabel=label, xlim=(least, most))
    return ax


def _ratios(least: float, most: float) -> list[float]:
    """Round ratios between two, few enough to be written side by side."""
    ticks: list[float] = []
    for digits in ((1, 2, 5), (1, 3), (1,)):
        powers = range(int(np.floor(np.log10(least))), int(np.ceil(np.log10(most))) + 1)
        ticks = [t for t in (float(f"{d}e{p}") for p in powers for d in digits) if least <= t <= most]
        if len(ticks) <= _TICKS:
            break
    return ticks[:: 1 + len(ticks) // (2 * _TICKS)]


def _colour(entry: Entry) -> str:
    return FLEXIBLE if entry.keep else PALE
