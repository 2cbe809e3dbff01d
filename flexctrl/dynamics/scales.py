"""What counts as an error of size 1 in each degree of freedom."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from flexctrl.model import units
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

__all__ = ["components", "farthest", "largest", "output_yardsticks", "turning", "yardsticks"]


def turning(model: Plant) -> np.ndarray:
    """Return which degrees of freedom are rotations, shape (n,)."""
    return once(model, units.turning)


def yardsticks(model: Plant) -> np.ndarray:
    """Return what an error of 1 is in each degree of freedom, shape (n,): a radian, or the size of the machine.

    A source angle counts as the motion it drives, or a motor's many turns would excuse any error of the machine;
    inner freedoms of effects have scales of their own.
    """
    return once(model, _yardsticks)


def _yardsticks(model: Plant) -> np.ndarray:
    return units.yardsticks(model, model.structure.size)


def output_yardsticks(model: Plant, time: float) -> np.ndarray:
    """Return how large each output is where every node and motor moves by a yardstick, within a time.

    Coordinates of a linear model move by 1.

    Parameters
    ----------
    model : Plant
    time : float
        What rates are of [s].

    Returns
    -------
    numpy.ndarray, shape (outputs,)
    """
    raw = _raw_yardsticks(model) if isinstance(model, Model) else np.ones(model.motion.raw)
    on_place, on_rates = model.signals.slopes(model.rest, np.zeros(raw.size), raw.size)
    return abs(on_place) @ raw + abs(on_rates) @ raw / time


def _raw_yardsticks(model: Model) -> np.ndarray:
    size, motion = model.structure.size, model.motion
    raw = np.ones(motion.raw)
    raw[: motion.source_base].reshape(-1, 6)[:, :3] = size
    gears = units.geared(model, size)
    raw[motion.source_base : motion.source_base + gears.size] = gears
    return raw


def components(model: Plant) -> np.ndarray:
    """Return to which part of a machine each degree of freedom belongs, counted from 0, shape (n,).

    What elements, joints, ropes and drives connect is one part; what stands beside it, uncoupled, is another one.
    """
    return once(model, _components)


def _components(model: Plant) -> np.ndarray:
    if not isinstance(model, Model):  # coordinates of a linear model may be modes of one machine
        return np.zeros(model.n, dtype=int)
    motion, n = model.motion, model.n
    T, viscous, raw = sp.coo_matrix(motion.jacobian(model.rest)), model.viscous.tocoo(), np.arange(motion.raw)
    of_node = np.where(raw < motion.source_base, raw - raw % 6, raw)
    ends = [(T.col, n + T.row), (n + raw, n + of_node), (viscous.row, viscous.col)]
    for rows in (family.scatter(motion.source_base) for family in model.forces.families):
        ends.append((n + rows.ravel(), n + np.repeat(rows[:, 0], rows.shape[1])))
    first, last = (np.concatenate(side) for side in zip(*ends, strict=True))
    return np.unique(_joined(first, last, n + motion.raw)[:n], return_inverse=True)[1]


def _joined(one: np.ndarray, other: np.ndarray, n: int) -> np.ndarray:
    """The first of all that links join each with. As scipy.sparse.csgraph does it, whose import takes longer."""
    lead = np.arange(n)
    while ((a := lead[one]) != (b := lead[other])).any():
        np.minimum.at(lead, np.maximum(a, b), np.minimum(a, b))
        while ((further := lead[lead]) != lead).any():
            lead = further
    return lead


def farthest(model: Plant, moved: np.ndarray) -> np.ndarray:
    """Return how far the freedom has moved that has moved most: what relative tolerances are relative to.

    In each part of a machine that is not coupled to others, that of the part; and a radian, or the size of the
    machine, at most: or what spins or travels would excuse errors of all else.

    Parameters
    ----------
    model : Plant
    moved : numpy.ndarray, shape (n,)
        Largest distance of each degree of freedom from where it began.

    Returns
    -------
    numpy.ndarray, shape (n,)
        In yardsticks.
    """
    way, part = moved * (1.0 / yardsticks(model)), components(model)
    most = np.zeros(part.max(initial=0) + 1)
    # no more than 1, without round-off: the compiled loops, which take it up step by step, find the same to the bit
    np.maximum.at(most, part, np.minimum(way, 1.0))
    return most[part]


def largest(correction: np.ndarray) -> tuple[float, int]:
    """Return the largest of some corrections in yardsticks, shape (n,), and where it is; what is no number goes first.

    Parameters
    ----------
    correction : numpy.ndarray, shape (n,)

    Returns
    -------
    float, int
    """
    if not correction.size:
        return 0.0, 0
    sizes = np.abs(correction)
    worst = int(np.argmax(sizes)) if np.isfinite(sizes).all() else int(np.argmax(~np.isfinite(sizes)))
    return float(sizes[worst]), worst


def once(model: Plant, found: Callable[[Plant], np.ndarray]) -> np.ndarray:
    """Return what is found of a model, kept with it."""
    kept = model.__dict__.setdefault("_scales", {})
    if found not in kept:
        kept[found] = found(model)
        kept[found].flags.writeable = False
    return kept[found]
