"""Open loops and their margins: Nyquist, Nichols and sensitivities, several loops in the same axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MultipleLocator

from flexctrl.errors import StructureError, shortened
from flexctrl.plots.frequency import HZ, degrees, line_style, plot_bode
from flexctrl.plots.style import INK, PALE, axes_of, by_label, new_figure, tidy
from flexctrl.structure.freedoms import check_finite, numbers
from flexctrl.study.frequency import Margins, loop_grid
from flexctrl.study.frequency import margins as margins_of
from flexctrl.study.loop import Loop

__all__ = [
    "loop_figure",
    "margins_figure",
    "mark_margins",
    "plot_nichols",
    "plot_nyquist",
    "plot_sensitivities",
]


_EDGE = 0.08
"""Share of the window, at its frame, in which a label would be cut."""


def mark_margins(axes: Sequence[Axes] | np.ndarray, margins: Margins) -> np.ndarray:
    """Mark gain and phase margin of a loop in its Bode plot (in dB).

    Parameters
    ----------
    axes : sequence of two matplotlib.axes.Axes
        From :func:`plot_bode` of the open loop.
    margins : Margins

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes, shape (2,)
    """
    gain, phase = axes
    gain.axhline(0.0, color=INK, linewidth=0.8)
    up, turn = margins.gain_up, margins.phase
    if np.isfinite(up.margin):
        below = -20 * np.log10(up.margin)
        gain.plot([up.omega / HZ] * 2, [below, 0.0], color=INK, linewidth=1.6)
        gain.annotate(f"{-below:.3g} dB", (up.omega / HZ, below / 2), (5, 0), textcoords="offset points", fontsize=9)
    if np.isfinite(turn.margin):
        drawn = np.concatenate([line.get_ydata() for line in phase.lines]) if phase.lines else np.zeros(1)
        level = -180.0 + 360.0 * np.round((np.median(drawn) + 180.0) / 360.0)
        phase.axhline(level, color=INK, linewidth=0.8)
        angle = np.degrees(turn.margin)
        phase.plot([turn.omega / HZ] * 2, [level, level + angle], color=INK, linewidth=1.6)
        phase.annotate(
            f"{angle:.3g}°", (turn.omega / HZ, level + angle / 2), (5, 0), textcoords="offset points", fontsize=9
        )
    return np.array([gain, phase])


def plot_nyquist(
    loops: Mapping[str, Loop] | Loop, ax: Axes | None = None, *, margins: Margins | None = None, radius: float = 3.0
) -> Axes:
    """Draw L(iω), ω > 0, around the point −1.

    Parameters
    ----------
    loops : Loop, or mapping of str to Loop
        Label → open loop.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    margins : Margins, optional
        Draws the circle about −1 that the curve touches (radius 1/Ms).
    radius : float
        Half width of the window.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax, 6.0, 5.6)
    check_finite(radius, "radius", "plot_nyquist", above=0.0)
    ax.add_patch(Circle((0, 0), 1.0, fill=False, color=PALE, linewidth=1.0))
    if margins is not None:
        ax.add_patch(Circle((-1, 0), margins.modulus.value, fill=False, color=INK, linewidth=0.9, linestyle="--"))
    shown = by_label(loops, "loop", Loop)
    for number, (label, loop) in enumerate(shown.items()):
        values = loop_grid(loop)[1]
        ax.plot(values.real, values.imag, label=label, **line_style(number))
    ax.plot(-1.0, 0.0, "+", color=INK, markersize=10, markeredgewidth=1.6)
    tidy(ax).set(xlabel="real part of L", ylabel="imaginary part of L", aspect="equal")
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius))
    if len(shown) > 1:
        ax.legend(frameon=False)
    return ax


def plot_nichols(
    loops: Mapping[str, Loop] | Loop, ax: Axes | None = None, *, gain: tuple[float, float] = (-40.0, 40.0)
) -> Axes:
    """Draw loops as gain over phase, with curves of constant |L/(1 + L)| around the critical points.

    Parameters
    ----------
    loops : Loop, or mapping of str to Loop
        Label → open loop.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    gain : tuple of two floats
        Range shown, dB.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax, 6.4, 5.6)
    if not (len(limits := numbers(gain)) == 2 and limits[0] < limits[1]):
        raise StructureError(f"plot_nichols: gain = {shortened(gain)}; expected (lowest, highest) in dB")
    seen = [np.array([-180.0])]
    shown = by_label(loops, "loop", Loop)
    for number, (label, loop) in enumerate(shown.items()):
        values = loop_grid(loop)[1]
        size, angle = _decibel(values), degrees(values)
        ax.plot(angle, size, label=label, **line_style(number))
        seen.append(angle[(size > gain[0]) & (size < gain[1])])
    angles = np.concatenate(seen)
    low, high = 90.0 * np.floor(angles.min() / 90.0 - 0.5), 90.0 * np.ceil(angles.max() / 90.0 + 0.5)
    _closed_loop_grid(ax, (low, high), gain)
    turns = -180.0 + 360.0 * np.arange(np.ceil((low + 180.0) / 360.0), np.floor((high + 180.0) / 360.0) + 1.0)
    ax.plot(turns, 0.0 * turns, "+", color=INK, markersize=10, markeredgewidth=1.6, clip_on=False)
    tidy(ax).set(xlabel="phase of L (°)", ylabel="|L| (dB)", xlim=(low, high), ylim=gain)
    ax.xaxis.set_major_locator(
        MultipleLocator(90.0 if high - low <= 540.0 else 180.0 if high - low <= 1260.0 else 360.0)
    )
    if len(shown) > 1:
        ax.legend(frameon=False)
    return ax


def _closed_loop_grid(ax: Axes, phase: tuple[float, float], gain: tuple[float, float]) -> None:
    angle, size = np.meshgrid(np.linspace(*phase, 721), np.linspace(*gain, 321))
    L = 10 ** (size / 20) * np.exp(1j * np.radians(angle))
    closed = _decibel(L / np.where(abs(1 + L) > 1e-9, 1 + L, 1e-9))
    lines = ax.contour(angle, size, closed, levels=[-20, -12, -6, -3, 0, 3, 6, 12], colors=PALE, linewidths=0.7)
    margins = _EDGE * (phase[1] - phase[0]), _EDGE * (gain[1] - gain[0])
    for text in ax.clabel(lines, fmt="%g dB", fontsize=7):
        x, y = text.get_position()
        near = min(x - phase[0], phase[1] - x) < margins[0] or min(y - gain[0], gain[1] - y) < margins[1]
        text.set_visible(not near)


def plot_sensitivities(
    loops: Mapping[str, Loop] | Loop, ax: Axes | None = None, *, margins: Margins | None = None
) -> Axes:
    """Draw |S| = 1/|1 + L| as lines and |T| = |L/(1 + L)| dashed, over frequency in Hz.

    Parameters
    ----------
    loops : Loop, or mapping of str to Loop
        Label → open loop.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    margins : Margins, optional
        Marks the peaks Ms and Mt.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax, 6.4, 4.0)
    shown = by_label(loops, "loop", Loop)
    for number, (label, loop) in enumerate(shown.items()):
        omega, L = loop_grid(loop)
        prefix = f"{label}: " if len(shown) > 1 else ""
        ax.plot(omega / HZ, _decibel(1 / (1 + L)), label=f"{prefix}|S|", **line_style(number))
        dashed = line_style(number) | {"linestyle": "--"}
        ax.plot(omega / HZ, _decibel(L / (1 + L)), label=f"{prefix}|T|", **dashed)
    for name, peak in (("Ms", margins.sensitivity), ("Mt", margins.complementary)) if margins else ():
        if np.isfinite(peak.value):
            at = peak.omega / HZ, 20 * np.log10(peak.value)
            ax.plot(*at, "o", color=INK, markersize=4)
            ax.annotate(f"{name} = {peak.value:.3g}", at, (5, 3), textcoords="offset points", fontsize=9)
    tidy(ax).set(xscale="log", xlabel="frequency (Hz)", ylabel="magnitude (dB)")
    ax.set_ylim(bottom=max(ax.get_ylim()[0], -60.0))
    ax.legend(frameon=False, fontsize="small")
    return ax


def loop_figure(loop: Loop) -> Figure:
    """Draw a loop with its margins in a new figure.

    Parameters
    ----------
    loop : Loop

    Returns
    -------
    matplotlib.figure.Figure
    """
    return margins_figure(margins_of(loop))


def margins_figure(margins: Margins) -> Figure:
    """Draw a loop with its margins in a new figure: Bode left, Nyquist and sensitivities right.

    Parameters
    ----------
    margins : Margins

    Returns
    -------
    matplotlib.figure.Figure
    """
    loop, figure = margins.loop, new_figure(11.0, 6.4)
    axes = figure.subplot_mosaic([["gain", "nyquist"], ["phase", "sensitivity"]], height_ratios=[1.2, 1.0])
    axes["phase"].sharex(axes["gain"])
    curves = {loop.name: loop.frd(loop_grid(loop)[0])}
    mark_margins(plot_bode(curves, (axes["gain"], axes["phase"])), margins)
    plot_nyquist({loop.name: loop}, axes["nyquist"], margins=margins, radius=2.0)
    plot_sensitivities({loop.name: loop}, axes["sensitivity"], margins=margins)
    figure.suptitle(f"{loop.name}: {str(margins).splitlines()[0]}", fontsize=10, color=INK)
    return figure


def _decibel(values: np.ndarray) -> np.ndarray:
    return np.asarray(20 * np.log10(np.maximum(abs(values), 1e-300)))
