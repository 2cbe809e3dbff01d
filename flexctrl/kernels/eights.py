"""Eight floats at once: what compiled loops keep in a register, and numpy arrays where they run uncompiled."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

__all__ = ["Eight", "eight", "larger", "largest", "put", "total"]

Eight: TypeAlias = np.ndarray


def eight(x: np.ndarray) -> Eight:
    """Return the first eight entries of a vector."""
    return np.array(x[:8])


def put(x: np.ndarray, value: Eight) -> None:
    """Write the first eight entries of a vector."""
    x[:8] = value


def larger(a: Eight, b: Eight) -> Eight:
    """Return the larger of two, entry by entry; NaN counts as less."""
    return np.fmax(a, b)


def largest(a: Eight) -> float:
    """Return the largest entry."""
    return float(np.fmax.reduce(a))


def total(a: Eight) -> float:
    """Return the sum of the entries."""
    return float(np.sum(a))
