"""Frequency responses, Nyquist curves, root loci and reduction errors, several models in the same axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import MultipleLocator

from flexctrl.errors import StructureError
from flexctrl.model.reduction import Reduced
from flexctrl.model.response import FrequencyResponse
from flexctrl.plots.style import CYCLE, INK, PALE, tidy
from flexctrl.study.frequency import Margins, loop_grid
from flexctrl.study.loop import Loop
from flexctrl.study.root_locus import CriticalGain

if TYPE_CHECKING:
    import control

__all__ = ["mark_margins", "plot_bode", "plot_nyquist", "plot_reduction", "plot_root_locus"]

HZ = 2.0 * np.pi


def plot_bode(
    responses: Mapping[str, FrequencyResponse | control.FrequencyResponseData],
    axes: Sequence[Axes] | None = None,
    *,
    channel: tuple[str, str] | None = None,
    decibel: bool = True,
) -> np.ndarray:
    """Draw magnitude and phase of several responses over frequency in Hz.

    Parameters
    ----------
    responses : mapping of str to FrequencyResponse or control.FrequencyResponseData
        Label → response, e.g. the rigid twin and the flexible machine.
    axes : sequence of two matplotlib.axes.Axes, optional
        Magnitude and phase; a new figure if left out.
    channel : tuple of str, optional
        (output, input); may be left out for single channels.
    decibel : bool
        Magnitude in dB, else on a logarithmic axis.

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes, shape (2,)
    """
    gain, phase = _two_axes() if axes is None else axes
    for number, (label, response) in enumerate(responses.items()):
        values = _channel(response, channel)
        hertz, style = np.asarray(response.omega) / HZ, _style(number)
        gain.plot(hertz, 20 * np.log10(abs(values)) if decibel else abs(values), label=label, **style)
        phase.plot(hertz, _degrees(values), label=label, **style)
    for ax in (tidy(gain), tidy(phase)):
        ax.set_xscale("log")
    if not decibel:
        gain.set_yscale("log")
    gain.set_ylabel("magnitude (dB)" if decibel else "magnitude")
    phase.set(xlabel="frequency (Hz)", ylabel="phase (°)")
    phase.yaxis.set_major_locator(_phase_ticks(phase))
    if len(responses) > 1:
        gain.legend(frameon=False)
    return np.array([gain, phase])


def mark_margins(axes: Sequence[Axes], margins: Margins) -> np.ndarray:
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
    loops: Mapping[str, Loop], ax: Axes | None = None, *, margins: Margins | None = None, radius: float = 3.0
) -> Axes:
    """Draw L(iω), ω > 0, around the point −1.

    Parameters
    ----------
    loops : mapping of str to Loop
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
    ax = _one_axes((6.0, 5.6)) if ax is None else ax
    ax.add_patch(Circle((0, 0), 1.0, fill=False, color=PALE, linewidth=1.0))
    if margins is not None:
        ax.add_patch(Circle((-1, 0), margins.modulus.value, fill=False, color=INK, linewidth=0.9, linestyle="--"))
    for number, (label, loop) in enumerate(loops.items()):
        values = loop_grid(loop)[1]
        ax.plot(values.real, values.imag, label=label, **_style(number))
    ax.plot(-1.0, 0.0, "+", color=INK, markersize=10, markeredgewidth=1.6)
    tidy(ax).set(xlabel="real part of L", ylabel="imaginary part of L", aspect="equal")
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius))
    if len(loops) > 1:
        ax.legend(frameon=False)
    return ax


def plot_root_locus(
    loci: Mapping[str, Any],
    ax: Axes | None = None,
    *,
    critical: Sequence[CriticalGain] = (),
    top: float = np.inf,
) -> Axes:
    """Draw root loci of several models: open-loop poles ×, zeros ○, branches between.

    Parameters
    ----------
    loci : mapping of str to control.PoleZeroData
        Label → what :func:`root_locus` returned, e.g. for the rigid twin and the flexible machine.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    critical : sequence of CriticalGain, optional
        Marked on the imaginary axis; those that end stability with their gains.
    top : float
        Largest imaginary part shown, rad/s; all poles and zeros if left out.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _one_axes((7.0, 5.6)) if ax is None else ax
    for number, (label, locus) in enumerate(loci.items()):
        color = CYCLE[number % len(CYCLE)]
        ax.plot(locus.loci.real, locus.loci.imag, color=color, linewidth=1.3, zorder=2 + 0.1 * number)
        ax.plot([], [], color=color, linewidth=1.3, label=label)
        poles, zeros = np.asarray(locus.poles), np.asarray(locus.zeros)
        ax.plot(poles.real, poles.imag, "x", color=color, markersize=7, markeredgewidth=1.6, zorder=4)
        ax.plot(zeros.real, zeros.imag, "o", color=color, markerfacecolor="white", markersize=6, zorder=3)
    width, height = _window(loci, top)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    tidy(ax).set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)", xlim=width, ylim=(-height, height))
    for crossing in [c for c in critical if c.omega <= height]:
        ax.plot(0.0, crossing.omega, "s", color=INK, markersize=5, zorder=5)
        if crossing.unstable_above:
            note = f"k = {crossing.gain:.3g}"
            ax.annotate(note, (0.0, crossing.omega), (7, -4), textcoords="offset points", fontsize=9)
    if len(loci) > 1:
        ax.legend(frameon=False, loc="upper left")
    return ax


def plot_reduction(reduced: Reduced, ax: Axes | None = None, *, channel: tuple[str, str] | None = None) -> Axes:
    """Draw a full model, its reduction and their difference.

    Parameters
    ----------
    reduced : Reduced
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    channel : tuple of str, optional
        (output, input); may be left out for single channels.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _one_axes((7.5, 4.5)) if ax is None else ax
    full = reduced.full.frequency_response()
    mine, exact = reduced.frequency_response(full.omega), _channel(full, channel)
    small, hertz = _channel(mine, channel), full.omega / HZ
    ax.loglog(hertz, abs(exact), label=f"full, {len(reduced.full.coordinates)} coordinates", **_style(7))
    ax.loglog(hertz, abs(small), label="reduced", **_style(0))
    ax.loglog(hertz, np.maximum(abs(exact - small), np.finfo(float).tiny), label="difference", **_style(1))
    floor = 1e-12 * abs(exact).max()
    ax.set_ylim(bottom=max(floor, abs(exact - small)[abs(exact - small) > floor].min(initial=abs(exact).max())))
    tidy(ax).set(xlabel="frequency (Hz)", ylabel="magnitude")
    ax.legend(frameon=False)
    return ax


def _channel(response: Any, channel: tuple[str, str] | None) -> np.ndarray:
    """One channel as an array over frequency."""
    if isinstance(response, FrequencyResponse):
        values, outputs, inputs = response.values, response.outputs, response.inputs
    else:
        values, outputs, inputs = response.frdata, tuple(response.output_labels), tuple(response.input_labels)
    if channel is None and values.shape[:2] == (1, 1):
        return np.asarray(values[0, 0])
    if channel is None or channel[0] not in outputs or channel[1] not in inputs:
        raise StructureError(f"channel = {channel}: give (output, input) out of {outputs} and {inputs}")
    return np.asarray(values[outputs.index(channel[0]), inputs.index(channel[1])])


def _degrees(values: np.ndarray) -> np.ndarray:
    """Continuous phase that starts between −200° and 160°, so that models line up."""
    if np.abs(values.imag).max(initial=0.0) <= 1e-9 * np.abs(values).max(initial=0.0):
        return np.where(values.real < 0.0, -180.0, 0.0)  # without damping: the limit of a little of it
    phase = np.degrees(np.unwrap(np.angle(values)))
    return np.asarray(phase - 360.0 * np.floor((phase[0] + 200.0) / 360.0))


def _phase_ticks(ax: Axes) -> MultipleLocator:
    low, high = ax.get_ylim()
    return MultipleLocator(45.0 if high - low < 300 else 90.0 if high - low < 800 else 360.0)


def _style(number: int) -> dict[str, Any]:
    return {"color": CYCLE[number % len(CYCLE)], "linewidth": 1.4}


def _window(loci: Mapping[str, Any], top: float) -> tuple[tuple[float, float], float]:
    """Limits that show the poles and zeros and most of the branches between them."""
    fixed = np.concatenate([np.concatenate([locus.poles, locus.zeros]) for locus in loci.values()])
    moving = np.concatenate([locus.loci.ravel() for locus in loci.values()])
    height = min(top, 1.12 * float(abs(fixed.imag).max(initial=0.0)))
    height = height or 1.2 * float(np.quantile(abs(moving.imag), 0.9)) or 1.0
    near = moving[(abs(moving.imag) <= height) & (abs(moving.real) <= 3 * height)].real
    anchors = fixed.real[(abs(fixed.imag) <= height) & (abs(fixed.real) <= height)]
    ends = np.concatenate([np.quantile(near, [0.03, 0.97]) if near.size else np.zeros(1), anchors, [0.0]])
    pad = 0.12 * float(np.ptp(ends)) or 0.1 * height
    return (float(ends.min()) - pad, float(ends.max()) + pad), height


def _two_axes() -> tuple[Axes, Axes]:
    import matplotlib.pyplot as plt

    gain, phase = plt.subplots(2, 1, sharex=True, figsize=(7.5, 5.6), layout="constrained")[1]
    return gain, phase


def _one_axes(size: tuple[float, float]) -> Axes:
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=size, layout="constrained")[1]
