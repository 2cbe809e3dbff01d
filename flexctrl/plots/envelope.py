"""Pictures of a linear-validity envelope."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.errors import check_kind
from flexctrl.plots.style import FLEXIBLE, INK, RIGID, axes_of, new_figure, tidy
from flexctrl.study.envelope import Envelope

__all__ = ["compared_curves", "envelope_figure", "plot_envelope"]


def envelope_figure(envelope: Envelope) -> Figure:
    """Draw the error over the amplitude and, where runs were compared, the curves at the limit.

    Parameters
    ----------
    envelope : Envelope

    Returns
    -------
    matplotlib.figure.Figure
    """
    panels = 2 if envelope.last.t.size else 1
    figure = new_figure(5.0 * panels, 3.6)
    axes = np.atleast_1d(figure.subplots(1, panels))
    plot_envelope(envelope, axes[0])
    if panels > 1:
        compared_curves(axes[1], envelope)
    figure.suptitle(str(envelope), fontsize=9, color=INK, wrap=True)
    return figure


def plot_envelope(envelope: Envelope, ax: Axes | None = None) -> Axes:
    """Draw the error of the linear prediction over the amplitude.

    Parameters
    ----------
    envelope : Envelope
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    StructureError
        For something else than one envelope.
    """
    check_kind(envelope, Envelope, "plot_envelope: envelope", "one from validity_envelope, each with its own ax")
    ax = axes_of(ax, 6.0, 4.0)
    finite = [tried for tried in envelope.trials if np.isfinite(tried.error) and tried.error > 0.0]
    ax.loglog([x.amplitude for x in finite], [100.0 * x.error for x in finite], "o-", color=FLEXIBLE, markersize=3)
    ax.axhline(100.0 * envelope.error, color=RIGID, linewidth=1.0)
    if np.isfinite(envelope.limit) and envelope.limit > 0.0:
        ax.axvline(envelope.limit, color=RIGID, linewidth=1.0, label=f"{envelope.limit:.4g} {envelope.unit.symbol}")
        ax.legend(fontsize="small", frameon=False)
    tidy(ax).set(
        xlabel=f"{envelope.unit.words} ({envelope.unit.symbol})", ylabel=f"error of the {envelope.quantity} (%)"
    )
    return ax


def compared_curves(ax: Axes, envelope: Envelope) -> Axes:
    """Draw the linear and the nonlinear curve at the limit, as deviations from rest.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    envelope : Envelope

    Returns
    -------
    matplotlib.axes.Axes
    """
    last = envelope.last
    ax.plot(last.t, last.nonlinear, color=FLEXIBLE, label="nonlinear")
    ax.plot(last.t, last.linear, "--", color=RIGID, label="linear")
    output = getattr(envelope.quantity, "output", "")
    tidy(ax).set(
        xlabel="time (s)", ylabel=f"{output}, from rest", title=f"at {last.amplitude:.4g} {envelope.unit.symbol}"
    )
    ax.legend(fontsize="small", frameon=False)
    return ax
