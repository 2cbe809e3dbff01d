"""Mode shapes as data that a page can move."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexctrl.linear.modes import Modes
from flexctrl.plots.modes import mode_label, mode_pose
from flexctrl.plots.pose import Drawn, Pose, axis_curve, bent_of, seen
from flexctrl.structure.beams import Beam
from flexctrl.structure.structure import Structure

__all__ = ["animation"]

_ALONG = 9


def animation(modes: Modes) -> dict[str, Any]:
    """Return a machine's lines at rest and at full swing in each mode.

    It is the machine as it was assembled: effects may give it nodes that it was not drawn with, along a heavy rope.

    Parameters
    ----------
    modes : Modes
        With their place.

    Returns
    -------
    dict
        ``rest``: points of every node and along the axes of beams; ``lines``: numbers of points, a list a part;
        ``modes``: label and displacements.
    """
    place = modes.place
    assert place is not None
    structure = place.model.structure
    still = bent_of(structure, place.model.coordinates, place.state.q)
    rest = _points(structure, Drawn(place.state.x, place.state.R, still))
    poses = [_points(structure, mode_pose(place, modes.shapes[:, k])) for k in range(len(modes))]
    shapes = [{"label": mode_label(modes, k), "moved": _rounded(pose - rest)} for k, pose in enumerate(poses)]
    return {"rest": _rounded(rest), "lines": _lines(structure), "modes": shapes}


def _points(structure: Structure, pose: Pose) -> np.ndarray:
    """The nodes, then the axes of the beams as they bend."""
    drawn = seen(structure, pose)
    curves = [axis_curve(b, drawn, [structure.number(n) for n in b.nodes], _ALONG) for b in _beams(structure)]
    return np.vstack([drawn.x, *curves])


def _lines(structure: Structure) -> list[list[int]]:
    """Numbers of points, part by part."""
    first, found = len(structure.nodes), []
    for part in structure.elements:
        if isinstance(part, Beam):
            count = part.elements * _ALONG
            found.append(list(range(first, first + count)))
            first += count
        else:
            found.append([structure.number(node) for node in part.nodes])
    return found


def _beams(structure: Structure) -> list[Beam]:
    return [e for e in structure.elements if isinstance(e, Beam)]


def _rounded(values: np.ndarray) -> list[list[float]]:
    return [[float(f"{v:.6g}") for v in row] for row in values.tolist()]
