"""Eight floats at once: what compiled loops keep in a register, and numpy arrays where they run uncompiled."""

from __future__ import annotations

from typing import Any, TypeAlias, overload

import numpy as np

__all__ = ["Eight", "add_six", "ahead", "eight", "larger", "largest", "lost", "put", "put_six", "rounded", "total"]

SPLIT = 2.0**27 + 1.0

Eight: TypeAlias = np.ndarray


def eight(x: np.ndarray) -> Eight:
    """Return the first eight entries of a vector, of single precision or not."""
    return x[:8].astype(float) if x.dtype == np.float32 else np.array(x[:8])


def put(x: np.ndarray, value: Eight | float) -> None:
    """Write the first eight entries of a vector."""
    x[:8] = value


def put_six(y: np.ndarray, x: np.ndarray | Eight) -> None:
    """Copy the first six entries of one vector, or of eight, into another, in two moves."""
    y[:6] = x[:6]


def add_six(y: np.ndarray, x: np.ndarray | Eight) -> None:
    """Add the first six entries of one vector, or of eight, to those of another, in two moves."""
    y[:6] += x[:6]


def ahead(x: np.ndarray) -> None:
    """Have the first entries of a vector brought near, as they will be read; they need not be there.

    Uncompiled there is nothing to be gained.
    """
    assert x.ndim == 1


def larger(a: Eight, b: Eight) -> Eight:
    """Return the larger of two, entry by entry; NaN in the second counts as less, and symbols as beyond all."""
    return np.where(b > a, b, a) if a.dtype != object else np.full(a.shape, np.inf, dtype=object)


def largest(a: Eight) -> float:
    """Return the largest entry; infinity of symbols, which may be anything."""
    return float(np.fmax.reduce(a)) if a.dtype != object else np.inf


def total(a: Eight) -> float:
    """Return the sum of the entries."""
    return float(np.sum(a))


@overload
def rounded(a: Eight | float, b: Eight) -> Eight: ...


@overload
def rounded(a: float, b: float) -> float: ...


def rounded(a: Any, b: Any) -> Any:
    """Return a · b rounded to a double, whatever it is added to afterwards."""
    return a * b


def lost(a: Eight | float, b: Eight) -> Eight:
    """Return what `rounded` has lost, exactly (T. J. Dekker, Numer. Math. 18 (1971) 224–242)."""
    (a_high, a_low), (b_high, b_low) = _halves(a), _halves(b)
    return ((a_high * b_high - a * b) + a_high * b_low + a_low * b_high) + a_low * b_low


def _halves(a: Eight | float) -> tuple[Eight | float, Eight | float]:
    high = SPLIT * a - (SPLIT * a - a)
    return high, a - high
