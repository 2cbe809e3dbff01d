"""Curves over time: one run, or rigid beside flexible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.dynamics.run import Run
from flexctrl.linear.matfile import SI, Units
from flexctrl.plots.style import FLEXIBLE, INK, RIGID, new_figure, tidy
from flexctrl.structure.freedoms import listed
from flexctrl.structure.inputs import FollowerForce, FollowerTorque, Force, Input, MotorTorque, Torque, WindSpeed
from flexctrl.structure.outputs import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    Output,
    Position,
    Rotation,
    SwayAngle,
    Tension,
    Velocity,
)
from flexctrl.structure.structure import Structure
from flexctrl.study.compare import Comparison

_UNITS: dict[type, str] = {
    Position: "{length}",
    Velocity: "{length}/{time}",
    Rotation: "{angle}",
    AngularVelocity: "{angle}/{time}",
    DriveAngle: "{angle}",
    DriveSpeed: "{angle}/{time}",
    SwayAngle: "{angle}",
    Tension: "{force}",
    Force: "{force}",
    FollowerForce: "{force}",
    Torque: "{force} {length}",
    FollowerTorque: "{force} {length}",
    MotorTorque: "{force} {length}",
    WindSpeed: "{length}/{time}",
}


def units(structure: Structure, written_in: Units = SI) -> dict[str, str]:
    """Return the unit of every signal of a machine.

    Parameters
    ----------
    structure : Structure
    written_in : Units
        Of the machine's numbers.

    Returns
    -------
    dict of str to str
    """
    names = asdict(written_in)
    return {signal.name: _unit(signal).format(**names) for signal in (*structure.outputs, *structure.inputs)}


def _unit(signal: Input | Output) -> str:
    return next(unit for kind, unit in _UNITS.items() if isinstance(signal, kind))


def run_figure(run: Run, signals: str | Sequence[str] | None = None) -> Figure:
    """Draw a run in a new figure, one axes a signal.

    Parameters
    ----------
    run : Run
    signals : str or sequence of str, optional
        Default: all outputs.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, names = new_figure(8.0, 4.0), _asked(signals, run.outputs)
    run_curves(panels(figure, len(names)), run, names)
    return figure


def comparison_figure(comparison: Comparison, signals: str | Sequence[str] | None = None) -> Figure:
    """Draw a comparison in a new figure.

    Parameters
    ----------
    comparison : Comparison
    signals : str or sequence of str, optional
        Default: all outputs.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(8.0, 4.0)
    names = _asked(signals, comparison.flexible.outputs)
    comparison_curves(panels(figure, len(names)), comparison, names)
    return figure


def _asked(signals: str | Sequence[str] | None, outputs: tuple[str, ...]) -> tuple[str, ...]:
    """The signals to be drawn, one of them by its name alone; all outputs where none is asked for."""
    asked = [signals] if isinstance(signals, str) else listed(() if signals is None else signals, "plot: signals")
    return tuple(asked) or outputs


def panels(figure: Figure, count: int) -> np.ndarray:
    """Lay out axes for so many signals that share their time axis, and size the figure for them.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    count : int

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes
    """
    columns = 1 if count <= 3 else 2
    rows = -(-count // columns)
    figure.set_size_inches(8.0 if columns == 1 else 11.0, 1.0 + 2.1 * rows)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_visible(False)
    for ax in axes[max(count - columns, 0) : count]:
        ax.set_xlabel("time (s)")
        ax.tick_params(labelbottom=True)
    return axes[:count]


def run_curves(
    axes: Sequence[Axes] | np.ndarray, run: Run, signals: Sequence[str], unit: Mapping[str, str] | None = None
) -> np.ndarray:
    """Draw signals of a run, one axes each.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes
    run : Run
    signals : sequence of str
        Outputs or inputs.
    unit : mapping of str to str, optional
        See `units`.

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes
        The same axes.
    """
    for ax, name in zip(axes, signals, strict=True):
        _curve(ax, run, name, color=FLEXIBLE, linewidth=1.5)
        _label(ax, name, unit)
    return np.asarray(axes)


def comparison_curves(
    axes: Sequence[Axes] | np.ndarray,
    comparison: Comparison,
    signals: Sequence[str],
    unit: Mapping[str, str] | None = None,
) -> np.ndarray:
    """Draw signals of two runs, flexible as a line and rigid dashed, one axes each.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes
    comparison : Comparison
    signals : sequence of str
    unit : mapping of str to str, optional
        See `units`.

    Returns
    -------
    numpy.ndarray of matplotlib.axes.Axes
        The same axes.
    """
    for ax, name in zip(axes, signals, strict=True):
        _curve(ax, comparison.flexible, name, color=FLEXIBLE, linewidth=1.5, label="flexible")
        if name in (*comparison.rigid.outputs, *comparison.rigid.inputs):
            _curve(ax, comparison.rigid, name, color=RIGID, linewidth=1.4, linestyle=(0, (5, 2)), label="rigid")
        _label(ax, name, unit)
    if len(signals):
        axes[0].figure.align_ylabels()
        axes[0].legend(frameon=False, fontsize=9, labelcolor=INK, ncols=2, loc="best")
    return np.asarray(axes)


def _curve(ax: Axes, run: Run, name: str, **style: Any) -> None:
    """Outputs as curves; inputs as they are, held from instant to instant."""
    if name in run.inputs:
        ax.step(run.t, run[name], where="post", **style)
    else:
        ax.plot(run.t, run[name], **style)


def _label(ax: Axes, name: str, unit: Mapping[str, str] | None) -> None:
    tidy(ax)
    ax.set_ylabel(f"{name} ({unit[name]})" if unit and name in unit else name, fontsize=9, color=INK)
    ax.margins(x=0.0)
    ax.ticklabel_format(useOffset=False)


__all__ = ["comparison_curves", "comparison_figure", "panels", "run_curves", "run_figure", "units"]
