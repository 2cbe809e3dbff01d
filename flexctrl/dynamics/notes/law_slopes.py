"""How a sampled law answers near a state: in proportion, by counts, or by jumps."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.notes.sampled_loop import Answers
from flexctrl.errors import FlexctrlError
from flexctrl.model.state import State

__all__ = ["law_slopes"]

_SMALL, _WIDER, _WIDTHS = 1e-7, 8.0, 10
_ALIKE, _ABOUT_ALIKE = 1e-2, 0.1


class Sides(NamedTuple):
    """Slopes to either side."""

    up: np.ndarray
    down: np.ndarray

    @property
    def slopes(self) -> np.ndarray:
        """Central ones."""
        return 0.5 * (self.up + self.down)

    @property
    def answered(self) -> np.ndarray:
        """What changes on both sides."""
        return (self.up != 0.0) & (self.down != 0.0)


def law_slopes(feed: Feed, state: State, x: np.ndarray) -> Answers | None:
    """Return how a law answers to what it reads and to its state, by central differences.

    One that rounds says nothing within a count: its slopes are those over so many that these do not decide.

    Parameters
    ----------
    feed : Feed
        With a law that may be asked anew.
    state : State
    x : numpy.ndarray
        The law's state.

    Returns
    -------
    Answers or None
        None where it answers by jumps, or by counts too coarse for slopes.
    """
    y = feed.measured(state)

    def said(d: np.ndarray) -> np.ndarray:
        u, after = feed.told(state.t, x + d[y.size :], y + d[: y.size])
        return np.concatenate([u, after])

    at = np.concatenate([y, x])
    here = said(0.0 * at)

    def sides(size: float) -> Sides:
        steps = np.diag(size * np.maximum(1.0, abs(at)))
        both = (np.array([side * (said(side * d) - here) / d.max() for d in steps]).T for side in (1.0, -1.0))
        return Sides(*both)

    near, wide = sides(_SMALL).slopes, sides(_WIDER * _SMALL).slopes
    if not np.allclose(near, wide, rtol=_ALIKE, atol=_ALIKE * float(abs(near).max(initial=0.0))):
        return None
    found = _over_counts(near, sides)
    if found is None:
        return None
    m, k = len(feed.base), y.size
    return Answers(found[:m, :k], found[:m, k:], found[m:, :k], found[m:, k:])


def _over_counts(near: np.ndarray, sides: Callable[[float], Sides]) -> np.ndarray | None:
    """Slopes wide enough that rounding does not decide: two in turn are about alike; the near ones if none rounds.

    What rounds answers on both sides, farther out; what is at a limit does so on one.
    """
    silent, widths = _silent(near), list[Sides]()
    if not silent.any():
        return near
    with suppress(FlexctrlError, ArithmeticError, ValueError):  # so far out a law may say nothing
        widths.extend(sides(_SMALL * _WIDER**k) for k in range(2, _WIDTHS))
    rounded = silent & np.any([wide.answered for wide in widths], axis=0)
    if not rounded.any():
        return near
    for one, other in pairwise(wide.slopes for wide in widths):
        if not (_silent(one) & rounded).any() and _about_alike(one, other):
            return other
    return None


def _silent(slopes: np.ndarray) -> np.ndarray:
    """Answers that nothing changes, and what changes no answer."""
    moves = slopes != 0.0
    return ~(moves.any(axis=1, keepdims=True) & moves.any(axis=0, keepdims=True))


def _about_alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Tell whether slopes are, for what each reading and state does."""
    return bool((abs(other - one) <= _ABOUT_ALIKE * abs(other).max(axis=0, initial=0.0)).all())
