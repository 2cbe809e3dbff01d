"""What a displacement of one is in each degree of freedom: a radian, the size of the machine, what a motor turns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flexctrl.model.plant import Plant

__all__ = ["TURNS", "force_unit", "geared", "turning", "units", "yardsticks"]

TURNS = ("_rx", "_ry", "_rz", "_turn")
_SHIFTS = ("_u", "_v", "_w", "_slide", "_source")


def turning(model: Plant) -> np.ndarray:
    """Return which degrees of freedom are rotations, shape (n,).

    Parameters
    ----------
    model : Plant

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
    """
    other = (*_SHIFTS, *model.motion.scales)
    return np.array([not name.endswith(other) for name in model.coordinates], dtype=bool)


def yardsticks(model: Plant, size: float) -> np.ndarray:
    """Return what an error of one is in each degree of freedom: a radian, or a size.

    A source angle counts as the motion it drives: its unit is what the motor turns by then. Inner freedoms of effects
    have scales of their own, infinite where the motion that they bring about is judged instead.

    Parameters
    ----------
    model : Plant
    size : float
        [m].

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    gears = {f"{d.name}_source": gear for d, gear in zip(model.structure.drives, geared(model, size), strict=True)}
    known = gears | dict(model.motion.scales)
    pairs = zip(model.coordinates, turning(model), strict=True)
    return np.array([known.get(name, 1.0 if turns else size) for name, turns in pairs])


def units(model: Plant, size: float) -> np.ndarray:
    """Return what a displacement of one is in each degree of freedom; a size in those that have no yardstick.

    Parameters
    ----------
    model : Plant
    size : float
        [m].

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    found = yardsticks(model, size)
    return np.where(np.isfinite(found), found, size)


def force_unit(name: str) -> str:
    """Return what forces on a degree of freedom are measured in, with a space before; empty for an inner one.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
    """
    if name.endswith((*TURNS, "_source")):
        return " N m"
    return " N" if name.endswith(_SHIFTS) else ""


def geared(model: Plant, size: float) -> np.ndarray:
    """Return by how much each motor turns as what it drives turns by a radian or travels a size, shape (drives,).

    Parameters
    ----------
    model : Plant
    size : float
        [m].

    Returns
    -------
    numpy.ndarray, shape (drives,)
    """
    return np.array([abs(d.effective_ratio) * (1.0, size)[d.column == 0] for d in model.structure.drives])
