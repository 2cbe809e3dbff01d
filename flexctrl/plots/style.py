"""Colours and habits that all pictures share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import NoneType
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexctrl.errors import StructureError, check_kind, shortened

T = TypeVar("T")

INK = "#1f2937"
PALE = "#b6bec9"
FLEXIBLE = "#1d4ed8"
RIGID = "#d9480f"
DRIVE = "#b45309"
ROPE = "#7c6f64"
GROUND = "#3f7d58"

CYCLE = ("#1d4ed8", "#d9480f", "#3f7d58", "#7048a8", "#d4a106", "#22a7a0", "#d6336c", "#8d6e63")
"""Line colours in order."""


def by_label(given: Mapping[str, T] | T, kind: str, of: type | tuple[type, ...] = object) -> Mapping[str, T]:
    """Return what is to be drawn by label; one alone bears its own name, or that of its kind.

    Parameters
    ----------
    given : mapping of str to object, or object
    kind : str
    of : type or tuple of types
        What each of them is to be.

    Returns
    -------
    mapping of str to object

    Raises
    ------
    StructureError
        For a list, nothing at all, or something of another type.
    """
    if isinstance(given, Mapping) and given:
        for label, one in given.items():
            if not isinstance(one, of):
                raise StructureError(f"{label!r} is drawn as a {kind}, and is {one!r}; expected a {kind}")
        return given
    if isinstance(given, Mapping | list | tuple) or given is None or not isinstance(given, of):
        raise StructureError(
            f"nothing to draw by label in {given!r}; expected one {kind}, or a mapping of label to {kind}"
        )
    return {getattr(given, "name", "") or kind: given}


def axes_of(ax: Axes | None, width: float, height: float) -> Axes:
    """Return axes to draw into: those given, or of a new figure.

    Parameters
    ----------
    ax : matplotlib.axes.Axes or None
    width, height : float
        Of the new figure, inches.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    StructureError
        For what is no axes.
    """
    check_kind(ax, (Axes, NoneType), "plot: ax", "axes, as pyplot.subplots()[1]")
    return new_figure(width, height).subplots() if ax is None else ax


def two_axes(axes: Sequence[Axes]) -> tuple[Axes, Axes]:
    """Return the two axes of a Bode plot.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes

    Returns
    -------
    tuple of matplotlib.axes.Axes

    Raises
    ------
    StructureError
        For what is no pair of axes.
    """
    given = list(axes) if isinstance(axes, Sequence | np.ndarray) else []
    if len(given) != 2 or not all(isinstance(ax, Axes) for ax in given):
        raise StructureError(f"plot: axes = {shortened(axes)}; expected two axes, as pyplot.subplots(2)[1]")
    return given[0], given[1]


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of pyplot, so that ``plt.show()`` shows it.

    Parameters
    ----------
    width, height : float
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import matplotlib.pyplot as plt

    return plt.figure(figsize=(width, height), layout="constrained")


def tidy(ax: Axes) -> Axes:
    """Take away the frame's upper right and lay a fine grid.

    Parameters
    ----------
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(PALE)
    ax.grid(True, color="#e5e7eb", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.tick_params(colors=INK, labelsize=9, length=3)
    return ax


__all__ = ["CYCLE", "DRIVE", "FLEXIBLE", "GROUND", "INK", "PALE", "RIGID", "ROPE", "by_label", "new_figure", "tidy"]
