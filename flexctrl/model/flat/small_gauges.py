"""The outputs of a flat model that moves little: sums of how far and how fast nodes and motors have moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.model.gauges import Gauges
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT

if TYPE_CHECKING:
    from flexctrl.model.flat.layout import Layout

__all__ = ["small_gauges"]

_RATE = 12


def small_gauges(layout: Layout) -> Gauges:
    """Return the gauges of a model in small motion.

    Parameters
    ----------
    layout : Layout
        Of its workspace, whose ``shift`` holds how far raw coordinates have moved from rest.

    Returns
    -------
    Gauges
        One sum for each output, in their order.
    """
    model, rest, still = layout.model, layout.model.rest, np.zeros(layout.motion.raw)
    measures, rates = model.signals.measures, _rates(layout)
    cells, weights, moving = [], [], False
    for measure in measures:
        places, on_place, rated, on_rate = measure.slope(rest, still)
        rated, on_rate = rated[on_rate != 0.0], on_rate[on_rate != 0.0]
        cells.append(np.concatenate([layout.starts["shift"] + places, rates[rated]]))
        weights.append(np.concatenate([on_place, on_rate]))
        moving |= bool(rated.size)
    count, empty, none = len(measures), np.zeros(0), np.zeros(0, dtype=int)
    return Gauges(
        outputs=count,
        rows=count,
        plains=count,
        angled=0,
        turning=0,
        tense=0,
        moving=int(moving),
        starts=np.cumsum([0, *map(len, cells)]),
        cells=np.concatenate([empty, *cells]).astype(int),
        weights=np.concatenate([empty, *weights]),
        levels=np.array([measure.value(rest, still) for measure in measures]),
        sums=np.zeros(count),
        plain=np.repeat(np.arange(count), 2),
        angles=none,
        turns=none,
        axes=empty,
        shown=empty,
        summed=empty,
        faced=empty,
        facing=empty,
        tensions=(),
    )


def _rates(layout: Layout) -> np.ndarray:
    """Where the workspace holds the rates of nodes and motors."""
    nodes = NODE_SLOT * np.arange(len(layout.motion.place))[:, None] + _RATE + np.arange(6)
    drives = layout.forces.drive_base + DRIVE_SLOT * np.arange(len(layout.motion.drives)) + 1
    return np.concatenate([nodes.ravel(), drives])
