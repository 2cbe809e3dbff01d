"""How a law answers to what it has read: in proportion or not, with limits, or by jumps that a hair decides."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import FlexctrlError

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.run import Run

__all__ = ["Manner", "answers", "jumps"]

_PLACES, _HALVINGS = 17, 16
_JUMP = 5e-3
"""Encoders of an arm or a crane step by 1e-5 of their way; what moves a run by percents steps by a hundredth."""
_BENT, _AT_ONCE = 0.05, 0.4
"""How much slopes change along the line, of the largest, and which share of it at one place where that is a limit."""
_LEVEL, _OFTEN = 0.1, 8
"""How much less steep a law is where it is saturated, and how many times an input turns where a loop hunts."""

Answer = Callable[[float], np.ndarray]


class Manner(Enum):
    """What a law's answers look like along a line of measurements."""

    SMOOTH = "smooth"
    HUNTING = "level in most places and steep in few, to and fro"
    LIMITED = "with a corner"
    ABRUPT = "with a jump"


def answers(run: Run, journey: Journey, feed: Feed | None) -> Manner:
    """Tell how a sampled law answers along the line from the least to the most of all that it has read.

    Where the largest change between two places does not become small as they come nearer, it is a jump.

    Parameters
    ----------
    run : Run
    journey : Journey
        At its end.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    Manner
        Jumps count from half a percent of all that a command, or a state of the law, changes by along that line.
    """
    if feed is None or not feed.sample_time:
        return Manner.SMOOTH
    t, x = journey.point.state.t, journey.point.supply.x
    return _along(run, feed, lambda y: feed.told(t, x, y))


def jumps(run: Run, journey: Journey, feed: Feed | None) -> bool:
    """Tell whether a continuous law jumps along the line from the least to the most of all that it has read.

    Parameters
    ----------
    run : Run
    journey : Journey
        At its end.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    bool
    """
    if feed is None or not feed.reacting:
        return False
    t, x = journey.point.state.t, journey.point.supply.x
    return _along(run, feed, lambda y: feed.answer(t, y, x)) is Manner.ABRUPT


def _along(run: Run, feed: Feed, told: Callable[[np.ndarray], tuple[list[float], np.ndarray]]) -> Manner:
    """How a law answers along that line."""
    if not feed.reads.size or not len(run.y):
        return Manner.SMOOTH
    read = run.y[:, feed.reads]
    low, high = read.min(axis=0), read.max(axis=0)
    try:
        return _kind(lambda share: np.concatenate(told(low + share * (high - low))), _hunts(run.u))
    except (FlexctrlError, ArithmeticError, ValueError):  # beside where it was, a law may say nothing
        return Manner.SMOOTH


def _hunts(u: np.ndarray) -> bool:
    """Whether some input goes from one side of what it goes through to the other again and again."""
    middle = 0.5 * (u.max(axis=0) + u.min(axis=0))
    return bool((np.diff(u > middle, axis=0).sum(axis=0) > _OFTEN).any())


def _kind(answer: Answer, hunts: bool = False) -> Manner:
    places = np.linspace(0.0, 1.0, _PLACES)
    said = np.array([answer(share) for share in places])
    changes, whole = np.diff(said, axis=0), np.ptp(said, axis=0)
    moving, steepest = np.flatnonzero(whole > 0.0).tolist(), np.argmax(np.abs(changes), axis=0)
    if any(_jump(answer, part, places, int(steepest[part])) > _JUMP * whole[part] for part in moving):
        return Manner.ABRUPT
    if hunts and any(_saturates(changes[:, part]) for part in moving):
        return Manner.HUNTING
    return Manner.LIMITED if any(_cornered(changes[:, part]) for part in moving) else Manner.SMOOTH


def _jump(answer: Answer, part: int, places: np.ndarray, at: int) -> float:
    """What is left of a change as the places it is between come nearer."""
    low, high = places[at], places[at + 1]
    below, above = answer(low)[part], answer(high)[part]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        said = answer(middle)[part]
        if abs(said - below) > abs(above - said):
            high, above = middle, said
        else:
            low, below = middle, said
    return float(abs(above - below))


def _saturates(changes: np.ndarray) -> bool:
    """Whether a law is saturated in most places."""
    return bool(np.median(np.abs(changes)) < _LEVEL * np.abs(changes).max())


def _cornered(changes: np.ndarray) -> bool:
    """Whether slopes change, and at few places: a corner lies between two of them, or at one."""
    bends = np.abs(np.diff(changes))
    near = bends[:-1] + bends[1:]
    return bool(near.max() > max(_BENT * np.abs(changes).max(), _AT_ONCE * bends.sum()))
