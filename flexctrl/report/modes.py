"""Mode shapes as data that a page can move."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexctrl.linear.modes import Modes
from flexctrl.plots.machine import seen
from flexctrl.plots.modes import mode_label, mode_pose
from flexctrl.structure.structure import Structure

__all__ = ["animation"]


def animation(structure: Structure, modes: Modes) -> dict[str, Any]:
    """Return a machine's lines at rest and at full swing in each mode.

    Parameters
    ----------
    structure : Structure
    modes : Modes
        With their place.

    Returns
    -------
    dict
        ``rest``: points of every node; ``lines``: node numbers, a list a part; ``modes``: label and displacements.
    """
    place = modes.place
    assert place is not None
    rest = seen(structure, place.state).x
    lines = [[structure.number(node) for node in part.nodes] for part in structure.elements]
    poses = [seen(structure, mode_pose(place, modes.shapes[:, k])) for k in range(len(modes))]
    shapes = [{"label": mode_label(modes, k), "moved": _rounded(pose.x - rest)} for k, pose in enumerate(poses)]
    return {"rest": _rounded(rest), "lines": lines, "modes": shapes}


def _rounded(values: np.ndarray) -> list[list[float]]:
    return [[float(f"{v:.6g}") for v in row] for row in values.tolist()]
