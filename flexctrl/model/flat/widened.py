"""Flat models in coordinates of charts: rotations that wander about held axes have one of their own more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexctrl.kernels.kernel import Run
from flexctrl.mechanics.rotation import turn_kernel
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.flattening import layout_of
from flexctrl.model.flat.layout import Layout
from flexctrl.model.flat.tiles import NO_TILES
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.linkages.chart import Chart
from flexctrl.model.linkages.levers import Levers
from flexctrl.model.model import Model

__all__ = ["widened"]


def widened(model: Model, chart: Chart | None) -> tuple[Flattened, np.ndarray, np.ndarray]:
    """Return a model on flat vectors whose nodes are placed by the coordinates of a chart.

    Parameters
    ----------
    model : Model
        One that can be flat.
    chart : Chart or None
        Its own; None for one in small motion.

    Returns
    -------
    flattened : Flattened
        Its steps are steps of the coordinates.
    spare : numpy.ndarray
        Coordinates beyond the degrees of freedom, a part of the workspace.
    places : numpy.ndarray of int, shape (coordinates,)
        Where each coordinate stands: in the order of elimination, and from its padded length on.
    """
    layout, beyond = layout_of(model), 0 if chart is None else len(chart.names) - model.n
    found = layout.made(beyond)
    places = np.append(layout.position[: model.n], layout.padded + np.arange(beyond))
    if chart is not None and beyond:
        turn, placing = _runs(layout, chart, found.flat)
        found = replace(found, flat=replace(found.flat, turn=turn, placing=placing, tiles=NO_TILES))
    return found, found.flat.z[layout.length :], places


def _runs(layout: Layout, chart: Chart, flat: Flat) -> tuple[Sequence[Run], Sequence[Run]]:
    """Kernels that turn nodes and place the linkage by further coordinates too."""
    starts, wide, own = layout.starts, chart.motion, layout.motion
    bind, none = layout.model.backend.bind, starts["step"] + own.n
    beyond = layout.length + np.arange(wide.n - own.n)
    steps = np.concatenate([starts["step"] + layout.position[: own.n], beyond, [none]])
    turn, placing = flat.turn, flat.placing
    if (turned := layout.turned).size:
        old, new = (start[:, None] + 3 + np.arange(9) for start in (starts["pose"] + 12 * turned, NODE_SLOT * turned))
        theta = steps[wide.owned[: wide.source_base].reshape(-1, 6)[turned, 3:]]
        turn = (bind(turn_kernel(), np.hstack([old, theta]), np.zeros((len(turned), 0)), new),) * 2
    if isinstance(wide.linkage, Levers):
        at = replace(layout.lever_places, step=np.append(steps[wide.linked], none))
        beside = np.full(len(at.step) - len(at.v), at.v[-1])  # only places are asked for
        at = replace(at, v=np.append(at.v, beside), a=np.append(at.a, beside), goal=np.append(at.goal, beside))
        placing = wide.linkage.bound(layout.model.backend, at).placing
    elif not own.plain:
        poses = starts["pose"] + 12 * own.nodes, NODE_SLOT * own.nodes
        old, new = ((start[:, None] + np.arange(12)).ravel() for start in poses)
        gather = np.concatenate([old, steps[wide.linked]])
        placing = (bind(wide.linkage.kernels[0], gather[None], np.zeros((1, 0)), new[None]),)
    return turn, placing
