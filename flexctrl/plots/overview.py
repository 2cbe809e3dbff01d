"""A structure, a model and an equilibrium, each in one picture."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flexctrl.mechanics.rotation import exponential, logarithm
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.plots.machine import add_machine_axes, best_plane, draw_deformed, draw_machine
from flexctrl.plots.pose import Drawn, bent_of, seen
from flexctrl.plots.style import FLEXIBLE, INK, new_figure
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.elements import Part
from flexctrl.structure.structure import Structure

__all__ = ["model_figure", "rest_figure", "structure_figure"]

_SEEN = 0.03
_ENLARGED = 0.08


def structure_figure(structure: Structure) -> Figure:
    """Draw a machine in a new figure: parts, node numbers, joints and drives.

    Parameters
    ----------
    structure : Structure

    Returns
    -------
    matplotlib.figure.Figure
    """
    ax = _machine_axes(structure)
    draw_machine(ax, structure)
    table = structure.join_table
    ax.set_title(
        f"{structure.name}: {len(structure.nodes)} nodes, {table.free} degrees of freedom", fontsize=10, color=INK
    )
    return _figure_of(ax)


def model_figure(model: Model) -> Figure:
    """Draw a machine in a new figure: what some effect bends in blue, what is rigid in black.

    Parameters
    ----------
    model : Model

    Returns
    -------
    matplotlib.figure.Figure
    """

    def tint(part: Part) -> str:
        return FLEXIBLE if model.bends(part) and not isinstance(part, PointMass | RigidBody) else INK

    ax = _machine_axes(model.structure)
    draw_machine(ax, model.structure, numbers=False, symbols=False, color=tint)
    lines = [Line2D([], [], color=color, linewidth=2.4) for color in (FLEXIBLE, INK)]
    place = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if ax.name != "3d" else {"loc": "upper right"}
    ax.legend(lines, ["flexible", "rigid"], **place, frameon=False, fontsize=9)
    effects = ", ".join(type(effect).__name__ for effect in model.effects) or "no effects"
    title = f"{model.structure.name}: {model.n} degrees of freedom under {effects}"
    ax.set_title(textwrap.fill(title, 90), fontsize=9, color=INK)
    return _figure_of(ax)


def rest_figure(rest: Rest) -> Figure:
    """Draw an equilibrium in a new figure over the machine as drawn; small displacements are enlarged.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    matplotlib.figure.Figure
    """
    structure, count = rest.model.structure, len(rest.model.structure.nodes)
    drawn = Drawn.of(structure)
    moved, turned = seen(structure, rest.state).x - drawn.x, logarithm(rest.state.R[:count])
    largest = max(float(np.abs(moved).max(initial=0.0)) / structure.size, float(np.abs(turned).max(initial=0.0)))
    scale = _round(_ENLARGED / largest) if 0.0 < largest < _SEEN else 1.0
    bent = bent_of(structure, rest.model.coordinates, rest.state.q)
    pose = Drawn(drawn.x + scale * moved, exponential(scale * turned), {name: scale * a for name, a in bent.items()})
    ax = _machine_axes(structure, pose)
    draw_deformed(ax, structure, pose, FLEXIBLE, plane=best_plane(structure, (pose,)))
    enlarged = f", displacements × {scale:g}" if scale != 1.0 else ""
    most = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
    ax.set_title(f"{structure.name} at rest: moved by up to {most:.3g} m{enlarged}", fontsize=10, color=INK)
    return _figure_of(ax)


def _machine_axes(structure: Structure, pose: Drawn | None = None) -> Axes:
    poses = () if pose is None else (pose,)
    plane = best_plane(structure, poses)
    points = np.vstack([Drawn.of(structure).x, *(p.x for p in poses)])
    across, up = np.ptp(points, axis=0)[list(plane)] if plane is not None else (1.0, 0.8)
    shape = float(np.clip(up / max(across, 1e-9 * structure.size), 0.4, 1.3)) if across or up else 1.0
    width = 8.0 if shape < 1.0 else 6.2
    return add_machine_axes(new_figure(width, width * shape + 0.6), structure, poses)


def _figure_of(ax: Axes) -> Figure:
    figure = ax.figure
    assert isinstance(figure, Figure)
    return figure


def _round(scale: float) -> float:
    """One digit, rounded down."""
    power = 10.0 ** np.floor(np.log10(scale))
    return float(max(np.floor(scale / power) * power, 1.0))
