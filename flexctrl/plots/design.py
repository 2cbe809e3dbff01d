"""Pictures of a design: how sensitive a shaper is, and what a command asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.design.piecewise import Trajectory
from flexctrl.design.shaper import Shaper
from flexctrl.plots.style import CYCLE, INK, new_figure, tidy

__all__ = [
    "shaper_figure",
    "shaper_impulses",
    "shaper_sensitivity",
    "trajectory_curves",
    "trajectory_figure",
    "trajectory_panels",
]


def shaper_sensitivity(
    ax: Axes,
    shapers: Mapping[str, Shaper],
    omega: float,
    zeta: float = 0.0,
    *,
    span: tuple[float, float] = (0.5, 1.5),
    tolerance: float = 0.05,
) -> Axes:
    """Draw the residual vibration of shapers against the frequency of the mode they meet.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Drawn into.
    shapers : mapping of str to Shaper
        Label → shaper.
    omega : float
        Design frequency, rad/s: the axis is ω/omega.
    zeta : float
        Damping ratio of the vibrating mode.
    span : tuple of float
        Range of ω/omega.
    tolerance : float
        Level drawn as a dashed line.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    ratio = np.linspace(*span, 801)
    for label, shaper in shapers.items():
        ax.plot(ratio, 100 * shaper.residual(ratio * omega, zeta), label=label)
    ax.axhline(100 * tolerance, color="0.5", linestyle="--", linewidth=0.8)
    ax.set(xlabel="frequency / design frequency", ylabel="residual vibration (%)", xlim=span)
    ax.set_ylim(bottom=0)
    if shapers:
        ax.legend()
    return ax


def shaper_impulses(ax: Axes, shaper: Shaper) -> Axes:
    """Draw the impulses of a shaper.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Drawn into.
    shaper : Shaper
        Its amplitudes are drawn at its times.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    ax.stem(shaper.times, shaper.amplitudes, basefmt="k-")
    ax.set(xlabel="time (s)", ylabel="amplitude")
    return ax


def trajectory_curves(
    ax: Axes, curves: Mapping[str, Callable[[float], float]], until: float, *, start: float = 0.0
) -> Axes:
    """Draw functions of time; a jump is drawn as one.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Drawn into.
    curves : mapping of str to Trajectory
        Label → function of t (a trajectory, its ``rate``, …).
    until, start : float
        Range, s.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    for label, curve in curves.items():
        instants = _instants(getattr(curve, "breaks", ()), start, until)
        ax.plot(instants, [curve(t) for t in instants], label=label)
    ax.set(xlabel="time (s)", xlim=(start, until))
    if len(curves) > 1:
        ax.legend()
    return ax


def trajectory_panels(axes: Sequence[Axes], trajectories: Mapping[str, Trajectory], until: float) -> Sequence[Axes]:
    """Draw trajectories and, in the panels that follow, their first and further derivatives.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes
        One per derivative: value, rate, acceleration …
    trajectories : mapping of str to Trajectory
        Label → trajectory.
    until : float
        End of the time axis, s.

    Returns
    -------
    sequence of matplotlib.axes.Axes
        The same axes.
    """
    curves = dict(trajectories)
    names = ["position", "speed", "acceleration", "jerk"]
    for order, ax in enumerate(axes):
        trajectory_curves(ax, curves, until)
        ax.set_ylabel(names[order] if order < len(names) else f"derivative {order}")
        curves = {label: curve.derivative for label, curve in curves.items()}
    return axes


def shaper_figure(shaper: Shaper) -> Figure:
    """Draw a shaper in a new figure: its impulses, and the vibration it leaves over frequency.

    Parameters
    ----------
    shaper : Shaper

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2)
    tidy(shaper_impulses(left, shaper)).set_title("impulses", fontsize=10, color=INK)
    omega = max((mode.omega for mode in shaper.modes), default=np.pi / max(shaper.duration, 1e-9))
    zeta = shaper.modes[0].zeta if shaper.modes else 0.0
    grid = np.linspace(0.0, 2.0 * omega, 1201)[1:]
    right.plot(grid / (2.0 * np.pi), 100.0 * shaper.residual(grid, zeta), color=CYCLE[0])
    for mode in shaper.modes:
        right.axvline(mode.omega / (2.0 * np.pi), color=CYCLE[1], linewidth=1.0)
    tidy(right).set(xlabel="frequency (Hz)", ylabel="residual vibration (%)", xlim=(0.0, grid[-1] / (2.0 * np.pi)))
    right.set_ylim(bottom=0.0)
    right.set_title("vibration left; red: designed for" if shaper.modes else "vibration left", fontsize=10, color=INK)
    return figure


def trajectory_figure(trajectory: Trajectory, until: float | None = None) -> Figure:
    """Draw a trajectory in a new figure: value, rate and acceleration.

    Parameters
    ----------
    trajectory : Trajectory
    until : float, optional
        End of the time axis [s]; default: a tenth past the last break.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(7.0, 6.0)
    end = until or 1.1 * max(trajectory.breaks, default=0.0) or 1.0
    axes = figure.subplots(3, 1, sharex=True)
    trajectory_panels(axes, {"": trajectory}, end)
    for ax in axes:
        tidy(ax).lines[0].set_color(CYCLE[0])
        ax.label_outer()
    return figure


def _instants(breaks: Sequence[float], start: float, until: float) -> np.ndarray:
    """An even grid with an instant just before and at every break."""
    inside = np.array([b for b in breaks if start <= b <= until])
    just_before = inside - 1e-9 * (until - start)
    return np.unique(np.concatenate([np.linspace(start, until, 1001), just_before[just_before >= start], inside]))
