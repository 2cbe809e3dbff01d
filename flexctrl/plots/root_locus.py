"""Root loci of several models in the same axes, and zeros."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from flexctrl.errors import check_kind
from flexctrl.plots.style import CYCLE, INK, axes_of, by_label, new_figure, tidy
from flexctrl.structure.freedoms import check_finite, listed
from flexctrl.study.branches import on_edge
from flexctrl.study.root_locus import CriticalGain, RootLocus
from flexctrl.study.zeros import Zeros

__all__ = ["close_up", "draw_root_locus", "locus_figure", "plot_root_locus", "zeros_figure"]

_CANCELLED = 0.02
_NARROW = 0.01
"""Half the least width of a picture over its height: without damping, real parts are round-off."""

_BLOT = 0.1
"""Share of a picture's width and height in which what there is cannot be told apart."""

_VIEWS = 3


def plot_root_locus(
    loci: Mapping[str, RootLocus] | RootLocus,
    ax: Axes | None = None,
    *,
    critical: Sequence[CriticalGain] = (),
    top: float | None = None,
) -> Axes:
    """Draw root loci of several models: open-loop poles ×, zeros ○, branches between.

    Loci of sampled loops are drawn as s = ln(z)/dt; a negative real z is drawn at both ±iπ/dt.

    Parameters
    ----------
    loci : RootLocus, or mapping of str to RootLocus
        Label → locus, e.g. of the rigid twin and of the flexible machine.
    ax : matplotlib.axes.Axes, optional
        Drawn into; a new figure if left out.
    critical : sequence of CriticalGain, optional
        Marked on the imaginary axis; those that end stability with their gains.
    top : float, optional
        Largest imaginary part shown, rad/s; default: as high as there are poles that move, and stability ends.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax, 7.0, 5.6)
    for crossing in listed(critical, "plot_root_locus: critical"):
        check_kind(crossing, CriticalGain, "plot_root_locus: critical", "what critical_gains(loop) gives")
    if top is not None:
        check_finite(top, "top", "plot_root_locus", above=0.0)
    several = by_label(loci, "locus", RootLocus)
    shown = {label: locus.in_s() for label, locus in several.items()}
    for number, (label, locus) in enumerate(shown.items()):
        color = CYCLE[number % len(CYCLE)]
        ax.plot(locus.loci.real, locus.loci.imag, color=color, linewidth=1.3, zorder=2 + 0.1 * number)
        ax.plot([], [], color=color, linewidth=1.3, label=label)
        other = _other_side(locus.loci, locus.dt)
        ax.plot(other.real, other.imag, color=color, linewidth=1.3, zorder=2 + 0.1 * number)
        poles, zeros = (np.append(p, _other_side(p[None], locus.dt)) for p in (locus.poles, locus.zeros))
        ax.plot(poles.real, poles.imag, "x", color=color, markersize=7, markeredgewidth=1.6, zorder=4)
        ax.plot(zeros.real, zeros.imag, "o", color=color, markerfacecolor="white", markersize=6, zorder=3)
    end = _end(critical)
    width, height = _window(shown, max(_top(shown), end) if top is None else top, end)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    plane = ", of s = ln(z)/T" if any(locus.dt for locus in several.values()) else ""
    tidy(ax).set(xlabel=f"real part{plane} (1/s)", ylabel=f"imaginary part{plane} (rad/s)")
    ax.set(xlim=width, ylim=(-height, height))
    for crossing in [c for c in critical if c.omega <= height]:
        ax.plot(0.0, crossing.omega, "s", color=INK, markersize=5, zorder=5)
        if crossing.unstable_above:
            note = f"k = {crossing.gain:.3g}"
            room = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
            ax.annotate(note, (0.0, crossing.omega), (9, 7), textcoords="offset points", fontsize=9, bbox=room)
    if len(several) > 1:
        ax.legend(frameon=False, loc="upper left")
    return ax


def draw_root_locus(
    figure: Figure, loci: Mapping[str, RootLocus], title: str, critical: Sequence[CriticalGain] = ()
) -> None:
    """Draw root loci in a figure, and beside them what is slow, where that would be a blot at the origin.

    The first view reaches to where stability ends; there are three views at most.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    loci : mapping of str to RootLocus
    title : str
    critical : sequence of CriticalGain
        See :func:`plot_root_locus`.
    """
    figure.set_layout_engine("constrained")
    tops = _views(loci, _end(critical))
    axes = np.ravel(figure.subplots(1, len(tops), squeeze=False))
    figure.set_size_inches(*(figure.get_size_inches() * (0.3 + 0.7 * len(tops), 1.0)))
    figure.suptitle(title, fontsize=11)
    for ax, top in zip(axes, tops, strict=True):
        plot_root_locus(loci, ax, critical=critical, top=top)
    for ax, close in pairwise(axes):
        close.set_title("near the origin" if ax is axes[0] else "nearer", fontsize=10)
        (left, right), (low, high) = close.get_xlim(), close.get_ylim()
        ax.add_patch(Rectangle((left, low), right - left, high - low, fill=False, color=INK, linewidth=0.8, zorder=6))


def _views(loci: Mapping[str, RootLocus], end: float) -> list[float | None]:
    """How high to look: over everything, near the origin, nearer."""
    views: list[float | None] = [None]
    near = close_up(loci, end=end)
    while near is not None and len(views) < _VIEWS:
        views.append(near)
        near = close_up(loci, near)
    return views


def close_up(loci: Mapping[str, RootLocus], top: float | None = None, end: float = 0.0) -> float | None:
    """Return how high to look for what is a blot at the origin of a picture; None if nothing is.

    Parameters
    ----------
    loci : mapping of str to RootLocus
    top : float, optional
        Largest imaginary part of the picture, rad/s; default: the whole.
    end : float
        Imaginary part that the whole must reach, rad/s.

    Returns
    -------
    float or None
        Largest imaginary part to show [rad/s].
    """
    shown = {label: locus.in_s() for label, locus in loci.items()}
    width, height = _window(shown, max(_top(shown), end) if top is None else top, end)
    points = np.concatenate([np.concatenate(_uncancelled(locus)) for locus in shown.values()])
    rest = max(locus.loop.rest_radius / (locus.loop.dt or 1.0) for locus in loci.values())
    share = np.maximum(abs(points.real) / (width[1] - width[0]), abs(points.imag) / (2.0 * height))
    inside = abs(points[(share < _BLOT) & (abs(points) > rest)])
    return 1.4 * float(inside.max()) if inside.size > 1 else None


def locus_figure(locus: RootLocus, top: float | None = None) -> Figure:
    """Draw one root locus in a new figure, with the gains at which stability ends.

    Parameters
    ----------
    locus : RootLocus
    top : float, optional
        See :func:`plot_root_locus`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(7.0, 5.6)
    ending = [c.omega for c in locus.critical if c.unstable_above and c.omega > 0.0]
    near = 2.5 * ending[0] if top is None and ending else top
    ax = plot_root_locus({locus.loop.name: locus}, figure.subplots(), critical=locus.critical, top=near)
    ax.set_title(locus.loop.name, fontsize=10, color=INK)
    return figure


def zeros_figure(zeros: Zeros) -> Figure:
    """Draw zeros in the complex plane; in the open right half plane in another colour.

    Parameters
    ----------
    zeros : Zeros

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(6.0, 5.2)
    ax = tidy(figure.subplots())
    right = np.isin(zeros.finite, zeros.nonminimum_phase)
    for chosen, color, label in ((~right, CYCLE[0], "minimum phase"), (right, CYCLE[1], "right half plane")):
        s, doubt = zeros.finite[chosen], (zeros.uncertainty * abs(zeros.finite))[chosen]
        ax.errorbar(s.real, s.imag, doubt, doubt, "o", color=color, markerfacecolor="white", label=label)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    ax.set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)")
    ax.set_title(f"{len(zeros.finite)} finite zeros, {zeros.infinite} at infinity", fontsize=10, color=INK)
    if right.any():
        ax.legend(frameon=False, fontsize="small")
    return figure


def _top(loci: Mapping[str, RootLocus]) -> float:
    """As high as there are poles that move: those on a zero of their own are not worth the room."""
    moving = [float(abs(pole.imag)) for locus in loci.values() for pole in _uncancelled(locus)[0]]
    return 1.4 * max(moving, default=0.0) or np.inf


def _uncancelled(locus: RootLocus) -> tuple[np.ndarray, np.ndarray]:
    """Poles without those that a zero keeps where they are, and zeros without those on a pole."""
    poles, zeros = np.asarray(locus.poles), np.asarray(locus.zeros)
    gaps = np.abs(poles[:, None] - zeros)
    moving = gaps.min(axis=1, initial=np.inf) > _CANCELLED * np.abs(poles)
    return poles[moving], zeros[gaps.min(axis=0, initial=np.inf) > _CANCELLED * np.abs(zeros)]


def _end(critical: Sequence[CriticalGain]) -> float:
    """As high as the first end of stability is well inside."""
    return 1.2 * next((c.omega for c in sorted(critical, key=lambda c: c.gain) if c.unstable_above), 0.0)


def _other_side(points: np.ndarray, dt: float) -> np.ndarray:
    """Mirror images of branches that are somewhere at ±iπ/dt, where each of them is on one side only.

    Parameters
    ----------
    points : numpy.ndarray of complex, shape (N, n)
        In s; each column a branch.
    dt : float

    Returns
    -------
    numpy.ndarray of complex, shape (N, m)
    """
    return np.asarray(points[:, on_edge(points, dt).any(axis=0)].conj())


def _window(loci: Mapping[str, RootLocus], top: float, end: float = 0.0) -> tuple[tuple[float, float], float]:
    """Limits that show the poles and zeros and most of the branches between them."""
    fixed = np.concatenate([np.concatenate([locus.poles, locus.zeros]) for locus in loci.values()])
    moving = np.concatenate([locus.loci.ravel() for locus in loci.values()])
    moving = moving[np.isfinite(moving)]
    height = min(top, max(1.12 * float(abs(fixed.imag).max(initial=0.0)), end))
    height = height or 1.2 * float(np.quantile(abs(moving.imag), 0.9)) or 1.0
    near = moving[(abs(moving.imag) <= height) & (abs(moving.real) <= 3 * height)].real
    anchors = fixed.real[(abs(fixed.imag) <= height) & (abs(fixed.real) <= height)]
    ends = np.concatenate([np.quantile(near, [0.03, 0.97]) if near.size else np.zeros(1), anchors, [0.0]])
    pad = max(0.12 * float(np.ptp(ends)), _NARROW * height)
    return (float(ends.min()) - pad, float(ends.max()) + pad), height
