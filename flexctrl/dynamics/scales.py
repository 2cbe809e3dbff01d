"""What counts as an error of size 1 in each degree of freedom."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexctrl.model.model import Model

__all__ = ["farthest", "turning", "yardsticks"]

_POINT = 1e-12
_SHIFTS = ("_u", "_v", "_w", "_slide", "_source")


def turning(model: Model) -> np.ndarray:
    """Return which degrees of freedom are rotations, shape (n,)."""
    return once(model, _turning)


def _turning(model: Model) -> np.ndarray:
    other = (*_SHIFTS, *model.motion.scales)
    return np.array([not name.endswith(other) for name in model.coordinates], dtype=bool)


def yardsticks(model: Model) -> np.ndarray:
    """Return what an error of 1 is in each degree of freedom, shape (n,): a radian, or the size of the machine.

    A machine that is but a point counts as a metre.

    A source angle counts as the motion it drives, or a motor's many turns would excuse any error of the machine;
    inner freedoms of effects have scales of their own.
    """
    return once(model, _yardsticks)


def _yardsticks(model: Model) -> np.ndarray:
    size = model.structure.size if model.structure.size > _POINT else 1.0
    gears = {f"{d.name}_source": abs(d.effective_ratio) * (1.0, size)[d.column == 0] for d in model.structure.drives}
    known = gears | model.motion.scales
    pairs = zip(model.coordinates, turning(model), strict=True)
    return np.array([known.get(name, 1.0 if turns else size) for name, turns in pairs])


def farthest(model: Model, moved: np.ndarray) -> float:
    """Return how far the freedom has moved that has moved most: what relative tolerances are relative to.

    A radian, or the size of the machine, at most: or what spins or travels would excuse errors of all else.

    Parameters
    ----------
    model : Model
    moved : numpy.ndarray, shape (n,)
        Largest distance of each degree of freedom from where it began.

    Returns
    -------
    float
        In yardsticks.
    """
    way = moved * (1.0 / yardsticks(model))
    # no more than 1; the compiled loops work it out in the same order, to the bit
    return float((way + 1.0 - np.maximum(way, 1.0)).max(initial=0.0))


def once(model: Model, found: Callable[[Model], np.ndarray]) -> np.ndarray:
    """Return what is found of a model, kept with it."""
    kept = model.__dict__.setdefault("_scales", {})
    if found not in kept:
        kept[found] = found(model)
        kept[found].flags.writeable = False
    return kept[found]
