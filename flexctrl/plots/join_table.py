"""The join table as a picture: what is tied has one colour."""

from __future__ import annotations

from collections import Counter

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from flexctrl.plots.style import INK, PALE, new_figure
from flexctrl.structure.freedoms import FREEDOMS
from flexctrl.structure.join_table import JoinTable

__all__ = ["draw_join_table", "join_table_figure"]

_HELD, _OWN = "#e5e7eb", "white"
_TIED = ("#bfdbfe", "#fed7aa", "#bbf7d0", "#ddd6fe", "#fde68a", "#99f6e4", "#fbcfe8", "#d6d3d1", "#fecaca", "#c7d2fe")
_MOST_NUMBERS = 60


def join_table_figure(table: JoinTable) -> Figure:
    """Draw a join table in a new figure.

    Parameters
    ----------
    table : JoinTable

    Returns
    -------
    matplotlib.figure.Figure
    """
    rows = len(table.rows) + len(table.drives)
    figure = new_figure(6.0, 1.2 + min(0.26 * rows, 14.0))
    draw_join_table(figure.subplots(), table)
    return figure


def draw_join_table(ax: Axes, table: JoinTable) -> Axes:
    """Draw one row a node, one column a freedom: held grey, tied in one colour, own white, ~ follows a master.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    table : JoinTable

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    rows = (*table.rows, *table.drives)
    often = Counter(n for row in rows for n in row if n)
    tied = [n for n in sorted(often) if often[n] > 1]
    colors = {n: _TIED[i % len(_TIED)] for i, n in enumerate(tied)}
    written = len(rows) <= _MOST_NUMBERS
    for r, row in enumerate(rows):
        for c, n in enumerate(row):
            face = colors.get(n, _OWN) if n else _HELD
            ax.add_patch(Rectangle((c, r), 1.0, 1.0, facecolor=face, edgecolor=PALE, linewidth=0.6))
            if written and not (r >= len(table.rows) and n == 0):
                mark = "~" if (r, c) in table.relative else ""
                ax.text(
                    c + 0.5, r + 0.5, f"{n}{mark}", ha="center", va="center", fontsize=8, color=INK if n else "#6b7280"
                )
    labels = [f"{i + 1}  {table.labels[i] if i < len(table.labels) else ''}" for i in range(len(table.rows))]
    labels += [f"θd {name}" for name in table.drive_labels or ("",) * len(table.drives)]
    step = 1 if written else max(1, len(rows) // 40)
    ax.set_yticks([r + 0.5 for r in range(0, len(rows), step)], labels[::step], fontsize=8, color=INK)
    ax.set_xticks([c + 0.5 for c in range(6)], FREEDOMS, color=INK)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.set(xlim=(0.0, 6.0), ylim=(len(rows), 0.0))
    for side in ax.spines.values():
        side.set_visible(False)
    held = sum(n == 0 for row in table.rows for n in row)
    ax.set_xlabel(f"{table.free} degrees of freedom; grey: held ({held}); colours: tied ({len(tied)})", color=INK)
    return ax
