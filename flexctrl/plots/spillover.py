"""Pictures of a spillover certificate."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.plots.machine import add_machine_axes, best_plane, draw_deformed
from flexctrl.plots.modes import mode_pose
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
    place, mode = certificate.linear.place, certificate.mode
    panels = 1 + (mode is not None) + (confirmation is not None) + (mode is not None and place is not None)
    rows, columns = {1: (1, 1), 2: (1, 2), 3: (1, 3), 4: (2, 2)}[panels]
    figure = new_figure(5.4 * columns, 3.9 * rows + 0.4)
    figure.set_layout_engine(None)  # the one that aligns axes gives up on those in space
    figure.subplots_adjust(0.09, 0.16 / rows, 0.97, 1.0 - 0.18 / rows, wspace=0.36, hspace=0.3)
    gain_curve(figure.add_subplot(rows, columns, 1), certificate)
    if mode is not None:
        energy_bars(figure.add_subplot(rows, columns, 2), mode)
    if confirmation is not None:
        growth_curves(figure.add_subplot(rows, columns, 3), confirmation)
    if mode is not None and place is not None:
        pose = mode_pose(place, _largest_moment(mode.shape))
        ax = add_machine_axes(figure, place.model.structure, (pose,), (rows, columns, panels))
        plane = best_plane(place.model.structure, (pose,))
        draw_deformed(ax, place.model.structure, pose, FLEXIBLE, label="the critical mode", plane=plane)
    title = textwrap.fill(str(certificate).splitlines()[0], 62 * columns)
    figure.suptitle(title, fontsize=10, color=INK)
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


def _largest_moment(shape: np.ndarray) -> np.ndarray:
    """A complex shape at the instant at which it is most displaced."""
    turn = np.exp(-0.5j * np.angle(np.sum(shape**2)))
    return np.asarray((turn * shape).real)


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
