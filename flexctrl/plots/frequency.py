"""Frequency responses: magnitude and phase, several models in the same axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from flexctrl.errors import StructureError, shortened
from flexctrl.linear.model import LinearModel
from flexctrl.linear.response import FrequencyResponse
from flexctrl.plots.modes import modes_picture
from flexctrl.plots.style import CYCLE, INK, by_label, new_figure, tidy, two_axes

if TYPE_CHECKING:
    import control

__all__ = ["HZ", "channel_values", "degrees", "line_style", "linear_figure", "plot_bode", "response_figure"]

HZ = 2.0 * np.pi


def plot_bode(
    responses: FrequencyResponse
    | control.FrequencyResponseData
    | Mapping[str, FrequencyResponse | control.FrequencyResponseData],
    axes: Sequence[Axes] | None = None,
    *,
    channel: tuple[str, str] | None = None,
    decibel: bool = True,
) -> np.ndarray:
    """Draw magnitude and phase of several responses over frequency in Hz.

    Parameters
    ----------
    responses : FrequencyResponse or control.FrequencyResponseData, or mapping of str to one
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
    shown = by_label(responses, "response")
    gain, phase = new_figure(7.5, 5.6).subplots(2, 1, sharex=True) if axes is None else two_axes(axes)
    for number, (label, response) in enumerate(shown.items()):
        values = channel_values(response, channel)
        hertz, style = np.asarray(response.omega) / HZ, line_style(number)
        gain.plot(hertz, 20 * np.log10(abs(values)) if decibel else abs(values), label=label, **style)
        phase.plot(hertz, degrees(values), label=label, **style)
    for ax in (tidy(gain), tidy(phase)):
        ax.set_xscale("log")
    if not decibel:
        gain.set_yscale("log")
    gain.set_ylabel("magnitude (dB)" if decibel else "magnitude")
    phase.set(xlabel="frequency (Hz)", ylabel="phase (°)")
    phase.yaxis.set_major_locator(_phase_ticks(phase))
    if len(shown) > 1:
        gain.legend(frameon=False)
    return np.array([gain, phase])


def response_figure(response: FrequencyResponse) -> Figure:
    """Draw a response in a new figure: magnitude and phase of one output, the magnitudes of several.

    Parameters
    ----------
    response : FrequencyResponse

    Returns
    -------
    matplotlib.figure.Figure
    """
    if len(response.outputs) > 1:
        return _magnitudes(response)
    figure = new_figure(7.5, 5.6)
    axes = figure.subplots(2, 1, sharex=True)
    output = response.outputs[0]
    one = {name: _single(response, output, name) for name in response.inputs}
    plot_bode(one, axes)
    axes[0].set_title(f"{response.name}: {output}" + _from(response), fontsize=10, color=INK)
    return figure


def linear_figure(linear: LinearModel) -> Figure:
    """Draw the frequency response of a linear model, its modes marked; the modes where it has no channel.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    matplotlib.figure.Figure
    """
    modes = linear.modes()
    if not (linear.inputs and linear.outputs):
        return modes_picture(modes)
    figure = response_figure(linear.frequency_response())
    for ax in figure.axes:
        low, high = ax.get_xlim()
        for hertz in modes.frequencies[modes.flexible]:
            if low < hertz < high:
                ax.axvline(hertz, ymax=0.03, color=INK, linewidth=0.8)
    return figure


def _magnitudes(response: FrequencyResponse) -> Figure:
    """One axes an output, one line an input."""
    count = len(response.outputs)
    columns = 1 if count <= 2 else 2 if count <= 8 else 3
    rows = -(-count // columns)
    figure = new_figure(3.0 + 2.9 * columns, 1.0 + 1.9 * rows)
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for ax, output in zip(axes, response.outputs, strict=False):
        for number, name in enumerate(response.inputs):
            size = abs(response.channel(output, name))
            if size.any():
                ax.loglog(response.frequencies, np.where(size > 0.0, size, np.nan), label=name, **line_style(number))
        tidy(ax).set_title(output, fontsize=9, color=INK)
    for ax in axes[count:]:
        ax.set_visible(False)
    for ax in axes[max(count - columns, 0) : count]:
        ax.set_xlabel("frequency (Hz)")
        ax.tick_params(labelbottom=True)
    if len(response.inputs) > 1:
        axes[0].legend(frameon=False, fontsize="small", title="from", title_fontsize="small")
    figure.suptitle(f"{response.name}: magnitudes{_from(response)}", fontsize=10, color=INK)
    return figure


def _single(response: FrequencyResponse, output: str, input: str) -> FrequencyResponse:
    values = response.channel(output, input)[None, None]
    return FrequencyResponse(response.omega, values, (input,), (output,), response.name)


def _from(response: FrequencyResponse) -> str:
    return f" from {response.inputs[0]}" if len(response.inputs) == 1 else ""


def channel_values(response: Any, channel: tuple[str, str] | None) -> np.ndarray:
    """One channel as an array over frequency."""
    if isinstance(response, FrequencyResponse):
        values, outputs, inputs = response.values, response.outputs, response.inputs
    else:
        if not hasattr(response, "frdata"):
            raise StructureError(f"a response = {shortened(response)}; expected what linear.frequency_response() gives")
        values, outputs, inputs = response.frdata, tuple(response.output_labels), tuple(response.input_labels)
    if channel is None and values.shape[:2] == (1, 1):
        return np.asarray(values[0, 0])
    pair = channel if isinstance(channel, tuple | list) and len(channel) == 2 else ("", "")
    if pair[0] not in outputs or pair[1] not in inputs:
        raise StructureError(f"channel = {channel}: give (output, input) out of {outputs} and {inputs}")
    return np.asarray(values[outputs.index(pair[0]), inputs.index(pair[1])])


def degrees(values: np.ndarray) -> np.ndarray:
    """Continuous phase that starts between −200° and 160°, so that models line up."""
    if np.abs(values.imag).max(initial=0.0) <= 1e-9 * np.abs(values).max(initial=0.0):
        return np.where(values.real < 0.0, -180.0, 0.0)  # without damping: the limit of a little of it
    phase = np.degrees(np.unwrap(np.angle(values)))
    return np.asarray(phase - 360.0 * np.floor((phase[0] + 200.0) / 360.0))


def _phase_ticks(ax: Axes) -> MultipleLocator:
    low, high = ax.get_ylim()
    return MultipleLocator(45.0 if high - low < 300 else 90.0 if high - low < 800 else 360.0)


def line_style(number: int) -> dict[str, Any]:
    return {
        "color": CYCLE[number % len(CYCLE)],
        "linewidth": 1.4,
        "linestyle": ("-", "--", ":")[number // len(CYCLE) % 3],
    }
