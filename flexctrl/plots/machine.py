"""The machine drawn: parts, node numbers, joints and drives, as drawn or deformed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import offset_copy

from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.plots.pose import Drawn, Pose, axis_curve, posed, seen
from flexctrl.plots.style import DRIVE, GROUND, INK, PALE, ROPE
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.drives import RotaryDrive, Winch
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import TRANSLATIONS
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import Hinge, InPlane, Joint, Pin, Slide, Support, Weld, main_axis
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.structure import Structure

_NAMES = "xyz"
_MOST_LABELS = 40
_SYMBOLS: dict[type, tuple[str, str, float, str]] = {
    Support: ("support", "^", 9.0, GROUND),
    Weld: ("weld", "s", 5.0, INK),
    Pin: ("pin", "o", 7.0, "white"),
    Hinge: ("hinge", "o", 8.0, "#fde68a"),
    Slide: ("slide", "D", 6.0, "#bfdbfe"),
}


def best_plane(structure: Structure, poses: Sequence[Pose] = ()) -> tuple[int, int] | None:
    """Return the two axes of the plane a machine lies and moves in, or None if it needs space.

    Parameters
    ----------
    structure : Structure
    poses : sequence of State
        Deformed ones that are to be seen, too.

    Returns
    -------
    (int, int) or None
        Numbers of the horizontal and the vertical axis of the picture.
    """
    points = np.vstack([Drawn.of(structure).x, *(seen(structure, p).x for p in poses)])
    extent = np.ptp(points, axis=0)
    flat = [i for i in range(3) if extent[i] <= 0.01 * extent.max()]
    if not flat:
        return None
    across = _held_axis(structure), _turning_axis(structure)
    normal = next((axis for axis in across if axis in flat), min(flat, key=lambda i: (extent[i], i != 1)))
    right, up = (i for i in range(3) if i != normal)
    return right, up


def _held_axis(structure: Structure) -> int:
    """The axis across the plane that a machine is held in; -1 without one."""
    joints = () if isinstance(structure.joints, JoinTable) else structure.joints
    held = [joint.held & TRANSLATIONS for joint in joints if isinstance(joint, InPlane)]
    return min(held[0]) if held else -1


def _turning_axis(structure: Structure) -> int:
    """The main axis of the first rotary drive: a machine that turns is looked at along its axis; -1 without one."""
    turning = [d.direction for d in structure.drives if isinstance(d, RotaryDrive)]
    return main_axis(turning[0]) if turning else -1


def add_machine_axes(
    figure: Figure, structure: Structure, poses: Sequence[Pose] = (), position: tuple[int, int, int] = (1, 1, 1)
) -> Axes:
    """Add axes in which a machine and its deformed poses can be drawn: plane if they lie in one, else 3-D.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    structure : Structure
    poses : sequence of State
    position : tuple of 3 ints
        Rows, columns and place, as for ``Figure.add_subplot``.

    Returns
    -------
    matplotlib.axes.Axes
    """
    plane = best_plane(structure, poses)
    ax: Any = figure.add_subplot(*position, projection="3d" if plane is None else None)
    if plane is None:
        _space(ax)
    return ax


def _space(ax: Any) -> None:
    ax.view_init(elev=20, azim=-58)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.pane.set_alpha(0.0)
        axis._axinfo["grid"].update(color="#e5e7eb", linewidth=0.6)
    ax.tick_params(labelsize=8, colors=INK)


@frozen
class Pen:
    """Draws points of space on plane or 3-D axes."""

    ax: Any
    plane: tuple[int, int] | None

    def _project(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        axes = range(3) if self.plane is None else self.plane
        return tuple(np.atleast_2d(points)[:, i] for i in axes)

    def line(self, points: np.ndarray, **style: Any) -> None:
        """Draw a curve through points, shape (m, 3)."""
        self.ax.plot(*self._project(points), clip_on=False, **style)

    def mark(self, points: np.ndarray, drop: float = 0.0, **style: Any) -> None:
        """Draw markers at points, ``drop`` points of type below them."""
        lower = offset_copy(self.ax.transData, self.ax.figure, y=-drop, units="points")
        self.ax.plot(*self._project(points), linestyle="none", transform=lower, clip_on=False, **style)

    def write(self, point: np.ndarray, text: str, shift: tuple[float, float], **style: Any) -> None:
        """Write beside a point, shifted by points of type."""
        at = tuple(float(c[0]) for c in self._project(point))
        if self.plane is None:
            moved = offset_copy(self.ax.transData, self.ax.figure, *shift, units="points")
            self.ax.text(*at, text, transform=moved, **style)
        else:
            self.ax.annotate(text, at, shift, textcoords="offset points", **style)


def draw_machine(
    ax: Axes,
    machine: Structure | Model,
    pose: Pose | None = None,
    *,
    numbers: bool = True,
    symbols: bool = True,
    color: str | Callable[[Part], str] = INK,
    width: float = 2.4,
    plane: tuple[int, int] | None = None,
    length: str = "m",
) -> Axes:
    """Draw a machine.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Plane or 3-D, see `add_machine_axes`; a plane picture shows the plane the machine lies in.
    machine : Structure or Model
    pose : State, optional
        Deformed; default: as drawn. How component modes bend beams is shown if ``machine`` is the model of that state:
        a structure does not know which numbers of a state are theirs.
    numbers : bool
        Whether to write the join table's node numbers (of a large machine: where parts are joined).
    symbols : bool
        Whether to draw joints and drives, with a legend.
    color : str or callable
        Of parts, or part ↦ colour.
    width : float
        Of beams [points].
    plane : (int, int), optional
        Axes shown in a plane picture; default: see `best_plane`.
    length : str
        Unit of its places, for the axes.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    structure, shown = posed(machine, pose)
    plane = None if ax.name == "3d" else plane or best_plane(structure) or (0, 2)
    pen = Pen(ax, plane)
    fixed = ROPE if symbols and not callable(color) else None
    for part in structure.elements:
        tint = color(part) if callable(color) else color
        _draw_part(pen, part, structure, shown, tint, width, fixed)
    for drive in structure.drives:
        if isinstance(drive, Winch):
            ends = [structure.number(n) for n in (drive.against, drive.node)]
            pen.line(shown.x[ends], color=fixed or INK, linewidth=0.55 * width)
    if symbols:
        _draw_symbols(pen, structure, shown)
    if numbers:
        _draw_numbers(pen, structure, shown)
    _frame(ax, structure, plane, length)
    return ax


def _draw_part(
    pen: Pen, part: Part, structure: Structure, pose: Drawn, color: str, width: float, rope: str | None
) -> None:
    """One part in its colour; ropes and springs in that of ropes if there is one."""
    nodes = [structure.number(n) for n in part.nodes]
    if isinstance(part, Beam):
        pen.line(axis_curve(part, pose, nodes), color=color, linewidth=width, solid_capstyle="round", zorder=2)
        pen.mark(pose.x[nodes], marker="o", color=color, markersize=2.2 + 0.4 * width, zorder=3)
    elif isinstance(part, Rope | Spring):
        curve = pose.x[nodes] if isinstance(part, Rope) else _zigzag(pose.x[nodes], structure.size)
        pen.line(curve, color=rope or color, linewidth=0.55 * width, zorder=2)
    else:
        _draw_body(pen, part, pose.x[nodes], _heaviest(structure), color)


def _zigzag(ends: np.ndarray, size: float, turns: int = 6) -> np.ndarray:
    a, b = ends
    along = (b - a) / np.linalg.norm(b - a)
    aside = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    s = np.concatenate([[0.0], np.linspace(0.2, 0.8, 2 * turns), [1.0]])
    swing = np.concatenate([[0.0, 0.0], np.resize([1.0, -1.0], 2 * turns - 2), [0.0, 0.0]])
    return a + s[:, None] * (b - a) + 0.015 * size * swing[:, None] * aside / np.linalg.norm(aside)


def _heaviest(structure: Structure) -> float:
    masses = [p.mass for p in structure.elements if isinstance(p, PointMass | RigidBody)]
    return max(masses, default=0.0) or 1.0


def _draw_body(pen: Pen, part: PointMass | RigidBody, points: np.ndarray, heaviest: float, color: str) -> None:
    for point in points[1:]:
        pen.line(np.array([points[0], point]), color=color, linewidth=4.0, alpha=0.35, zorder=1)
    size = 5.0 + 9.0 * (part.mass / heaviest) ** (1 / 3)
    pen.mark(points[:1], marker="o", color=color, alpha=0.85, markersize=size, markeredgewidth=0.0, zorder=3)


def _draw_symbols(pen: Pen, structure: Structure, pose: Pose) -> None:
    seen: dict[str, Line2D] = {}
    joints = () if isinstance(structure.joints, JoinTable) else structure.joints
    for joint in joints:
        if isinstance(joint, InPlane):  # of every node; the picture is plane itself
            continue
        label, style = _symbol(joint)
        drop = 7.0 if isinstance(joint, Support) else 0.0
        pen.mark(pose.x[structure.number(joint.nodes[-1])], drop, **style, zorder=4 - bool(drop))
        seen[label] = Line2D([], [], linestyle="none", **style)
    ring: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": DRIVE, "markeredgewidth": 2.0}
    for drive in structure.drives:
        at = pose.x[structure.number(drive.node)]
        pen.mark(at, markersize=15.0, **ring, zorder=5)
        pen.write(at, drive.name, (0.0, 13.0), color=DRIVE, fontsize=9, ha="center")
        seen["drive"] = Line2D([], [], linestyle="none", markersize=9.0, **ring)
    if seen:
        look = {"frameon": False, "fontsize": 9, "labelcolor": INK, "handletextpad": 0.4}
        place = {"loc": "upper right"} if pen.plane is None else {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}
        pen.ax.legend(list(seen.values()), list(seen), **place, **look)


def _symbol(joint: Joint) -> tuple[str, dict[str, Any]]:
    label, marker, size, face = next(look for kind, look in _SYMBOLS.items() if isinstance(joint, kind))
    return label, {"marker": marker, "markersize": size, "markerfacecolor": face, "markeredgecolor": INK}


def _draw_numbers(pen: Pen, structure: Structure, pose: Pose) -> None:
    """Node numbers of the join table; nodes at one place share a label."""
    joined = {structure.number(n) for p in structure.elements for n in (p.nodes[0], p.nodes[-1])}
    shown = range(len(structure.nodes)) if len(structure.nodes) <= _MOST_LABELS else sorted(joined)
    places: dict[tuple[float, ...], list[int]] = {}
    for i in shown:
        places.setdefault(tuple(np.round(pose.x[i] / structure.size, 4)), []).append(i)
    for group in places.values():
        label = ", ".join(str(i + 1) for i in group)
        pen.write(pose.x[group[0]], label, (-7.0, -5.0), color="#6b7280", fontsize=8, ha="right", va="top")


def _frame(ax: Any, structure: Structure, plane: tuple[int, int] | None, length: str) -> None:
    if plane is not None:
        ax.set_xlabel(f"{_NAMES[plane[0]]} ({length})")
        ax.set_ylabel(f"{_NAMES[plane[1]]} ({length})")
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.12)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
        return
    ax.set(xlabel=f"x ({length})", ylabel=f"y ({length})", zlabel=f"z ({length})")
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    narrow = np.diff(limits, axis=1)[:, 0] < 0.3 * structure.size
    middle = limits.mean(axis=1)
    limits[narrow] = middle[narrow, None] + 0.15 * structure.size * np.array([-1.0, 1.0])
    ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    sides = np.diff([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()], axis=1)[:, 0]
    for axis, side in zip((ax.xaxis, ax.yaxis, ax.zaxis), sides, strict=True):
        axis.set_major_locator(MaxNLocator(2 if side < 0.5 * sides.max() else 5))
    ax.set_box_aspect(sides, zoom=1.15)


def draw_moved(
    ax: Axes,
    machine: Structure | Model,
    pose: Pose,
    color: str,
    *,
    label: str = "",
    plane: tuple[int, int] | None = None,
    length: str = "m",
) -> Axes:
    """Draw a machine as it is drawn, pale, and where it is over it.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    machine : Structure or Model
        The model of that state, if component modes are to be seen; see `draw_machine`.
    pose : State
    color : str
    label : str
        Title of the axes.
    plane : (int, int), optional
        Axes shown in a plane picture; default: see `best_plane`.
    length : str
        Unit of its places, for the axes.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    bare = partial(draw_machine, ax, machine, numbers=False, symbols=False, plane=plane, length=length)
    bare(color=PALE, width=1.4)
    bare(pose, color=color)
    if label:
        ax.set_title(label, fontsize=10, color=INK, pad=2.0)
    return ax


def draw_deformed(
    ax: Axes,
    machine: Structure | Model,
    pose: Pose,
    color: str,
    *,
    label: str = "",
    plane: tuple[int, int] | None = None,
) -> Axes:
    """Draw a machine and a shape of it, on axes without numbers: how far a mode goes is nobody's to say.

    Parameters
    ----------
    ax, machine, pose, color, label, plane
        As for `draw_moved`.

    Returns
    -------
    matplotlib.axes.Axes
        The same axes.
    """
    draw_moved(ax, machine, pose, color, label=label, plane=plane)
    for axis in (getattr(ax, f"{name}axis") for name in _NAMES[: 3 if ax.name == "3d" else 2]):
        axis.set_ticklabels([])
        axis.set_label_text(axis.get_label_text().split()[0])
        axis.labelpad = -12.0 if ax.name == "3d" else 2.0
    return ax


__all__ = ["add_machine_axes", "best_plane", "draw_deformed", "draw_machine", "draw_moved"]
