"""Pictures of a spillover certificate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.plots.style import FLEXIBLE, INK, PALE, RIGID, new_figure, tidy
from flexctrl.study.confirm import Confirmation
from flexctrl.study.critical_mode import CriticalMode
from flexctrl.study.spillover import Spillover

__all__ = ["confirmation_figure", "energy_bars", "gain_curve", "growth_curves", "spillover_figure"]

_SHOWN = 6


def spillover_figure(certificate: Spillover, confirmation: Confirmation | None = None) -> Figure:
    """Draw damping over gain, where the energy of the critical mode is, and the runs that confirm it.

    Parameters
    ----------
    certificate : Spillover
    confirmation : Confirmation, optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    panels = 1 + (certificate.mode is not None) + (confirmation is not None)
    figure = new_figure(4.4 * panels, 3.8)
    axes = list(np.atleast_1d(figure.subplots(1, panels)))
    gain_curve(axes.pop(0), certificate)
    if certificate.mode is not None:
        energy_bars(axes.pop(0), certificate.mode)
    if confirmation is not None:
        growth_curves(axes.pop(0), confirmation)
    figure.suptitle(str(certificate).splitlines()[0], fontsize=10, color=INK, wrap=True)
    return figure


def confirmation_figure(confirmation: Confirmation) -> Figure:
    """Draw the two runs that confirm a critical gain in a new figure.

    Parameters
    ----------
    confirmation : Confirmation

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(6.4, 4.0)
    growth_curves(figure.subplots(), confirmation)
    figure.suptitle(str(confirmation).splitlines()[0], fontsize=9, color=INK, wrap=True)
    return figure


def gain_curve(ax: Axes, certificate: Spillover) -> Axes:
    """Draw the damping ratio of the critical mode over the gain.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    certificate : Spillover

    Returns
    -------
    matplotlib.axes.Axes
    """
    tidy(ax).axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlabel="gain over the controller's own", ylabel="damping ratio of the critical mode (%)")
    if certificate.mode is None:
        ax.text(0.5, 0.5, "stays stable", transform=ax.transAxes, ha="center", color=INK)
        return ax
    s = certificate.branch
    damping = -100.0 * s.real / np.maximum(np.abs(s), 1e-300)
    ax.semilogx(certificate.gains, damping, color=FLEXIBLE)
    ax.axvline(1.0, color=PALE, linestyle="--", label="its own gain")
    if certificate.gain > 0.0:
        ax.axvline(certificate.gain, color=RIGID, label=f"critical: {certificate.gain:.4g} ×")
    low = min(0.0, float(damping.min()))
    ax.axhspan(low - 0.05 * np.ptp(damping) - 1e-3, 0.0, color=RIGID, alpha=0.08)
    ax.legend(fontsize="small", frameon=False)
    return ax


def energy_bars(ax: Axes, mode: CriticalMode) -> Axes:
    """Draw the shares of the parts in strain and kinetic energy of a mode.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    mode : CriticalMode

    Returns
    -------
    matplotlib.axes.Axes
    """
    names = _largest(mode.strain_shares, mode.kinetic_shares)
    rows = np.arange(len(names))[::-1]
    for shares, shift, color, label in (
        (mode.strain_shares, 0.2, FLEXIBLE, "strain energy"),
        (mode.kinetic_shares, -0.2, PALE, "kinetic energy"),
    ):
        ax.barh(rows + shift, [100.0 * shares.get(name, 0.0) for name in names], height=0.38, color=color, label=label)
    tidy(ax).set(xlabel="share of the critical mode (%)", yticks=rows, yticklabels=names)
    ax.set_title(f"{mode.frequency_hz:.4g} Hz", fontsize=10)
    ax.legend(fontsize="small", frameon=False)
    return ax


def _largest(*shares: Mapping[str, float]) -> list[str]:
    total = {name: sum(s.get(name, 0.0) for s in shares) for s in shares for name in s}
    return sorted(total, key=lambda name: -total[name])[:_SHOWN]


def growth_curves(ax: Axes, confirmation: Confirmation) -> Axes:
    """Draw the amplitudes of the two nonlinear runs, dots, and what the eigenvalues predict, lines.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    confirmation : Confirmation

    Returns
    -------
    matplotlib.axes.Axes
    """
    for growth, color in ((confirmation.above, RIGID), (confirmation.below, FLEXIBLE)):
        t = growth.times
        ax.plot(t, np.exp(growth.predicted * (t - t[0])), color=color, linewidth=1.0)
        ax.plot(t, growth.amplitudes, "o", color=color, markersize=3, label=f"simulated at {growth.gain:.4g} ×")
    tidy(ax).set(xlabel="time (s)", ylabel="amplitude over the first")
    if confirmation.above.amplitudes[-1] > 3.0 * confirmation.below.amplitudes[-1]:
        ax.set_yscale("log")
    ax.legend(fontsize="small", frameon=False)
    return ax
