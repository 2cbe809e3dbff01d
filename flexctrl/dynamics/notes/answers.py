"""How a law answers to what it has read: in proportion or not, with limits, or by jumps that a hair decides."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from flexctrl.dynamics.notes.moments import moments
from flexctrl.errors import FlexctrlError

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.run import Run

__all__ = ["Manner", "answers", "jumps"]

_PLACES, _FEW, _HALVINGS = 17, 9, 16
_JUMP = 5e-3
"""Encoders of an arm or a crane step by 1e-5 of their way; what moves a run by percents steps by a hundredth."""
_BENT, _AT_ONCE = 0.05, 0.4
"""How much slopes change along the line, of the largest, and which share of it at one place where that is a limit."""
_LEVEL, _OFTEN = 0.1, 8
"""How much less steep a law is where it is saturated, and how many times an input turns where a loop hunts."""
_GROUPS, _IN_TURN, _APART = 3, 8, 16
"""Samples on the way at which a law is asked, too: so many in turn, as some count them; fewer where there are few."""

_BEFORE = 1e-6
"""Of a sample: a law's state is the one it came with."""

Answer: TypeAlias = Callable[[float], np.ndarray]
_Told: TypeAlias = Callable[[float, np.ndarray, np.ndarray], tuple[list[float], np.ndarray]]


class Manner(Enum):
    """What a law's answers look like along a line of measurements."""

    SMOOTH = "smooth"
    HUNTING = "level in most places and steep in few, to and fro"
    LIMITED = "with a corner"
    ABRUPT = "with a jump"


def answers(run: Run, journey: Journey, feed: Feed | None) -> Manner:
    """Tell how a sampled law answers along the line from the least to the most of all that it has read.

    Where the largest change between two places does not become small as they come nearer, it is a jump. These are
    looked for at some samples on the way as well, as laws may go by the clock or count, and along one reading alone,
    the others being what they were: what goes by their difference changes little where all go up together.

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
    return _along(run, journey, feed, feed.told, _at_samples(run, feed))


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

    def told(t: float, x: np.ndarray, y: np.ndarray) -> tuple[list[float], np.ndarray]:
        return feed.answer(t, y, x)

    found = (_Asked(m.state.t, m.supply.x, feed.measured(m.state)) for m in moments(run.track, run.final.t, _IN_TURN))
    return _along(run, journey, feed, told, found) is Manner.ABRUPT


class _Asked(NamedTuple):
    """When a law is asked, its state then, and what it reads."""

    t: float
    x: np.ndarray
    y: np.ndarray


def _at_samples(run: Run, feed: Feed) -> Iterator[_Asked]:
    """Samples on the way, as far as steps have been kept."""
    if not run.track.stretches:
        return
    first, last = (math.ceil(t / feed.sample_time) for t in (run.track.starts[0], run.final.t))
    count = min(_GROUPS * _IN_TURN, (last - first) // _APART)
    for k in range(count):
        group, turn = divmod(k, _IN_TURN)
        t = (first + 1 + turn + (2 * group + 1) * (last - first) // (2 * _GROUPS)) * feed.sample_time
        if t < run.final.t:
            yield _Asked(t, run.track.point(t - _BEFORE * feed.sample_time)[1].x, feed.measured(run.track.state(t)[0]))


def _along(run: Run, journey: Journey, feed: Feed, told: _Told, asked: Iterator[_Asked]) -> Manner:
    """How a law answers along that line at the end, and whether it jumps at other times."""
    if not feed.reads.size or not len(run.y):
        return Manner.SMOOTH
    read, end = run.y[:, feed.reads], journey.point
    low, high = read.min(axis=0), read.max(axis=0)

    def line(at: _Asked, start: np.ndarray, stop: np.ndarray) -> Answer:
        return lambda share: np.concatenate(told(at.t, at.x, start + share * (stop - start)))

    found = Manner.SMOOTH
    with suppress(FlexctrlError, ArithmeticError, ValueError):  # beside where it was, a law may say nothing
        last = line(_Asked(end.state.t, end.supply.x, read[-1]), low, high)
        found = _kind(last, _hunts(run.u))
        if found is Manner.ABRUPT:
            return found
        least = _JUMP * np.ptp([last(share) for share in np.linspace(0.0, 1.0, _FEW)], axis=0)
        for k, at in enumerate(asked):
            one = np.arange(len(low)) == k % len(low)
            alone = line(at, np.where(one, low, at.y), np.where(one, high, at.y))
            if _leaps(line(at, low, high), least) or _leaps(alone, least):
                return Manner.ABRUPT
    return found


def _leaps(answer: Answer, least: np.ndarray) -> bool:
    """Whether there is a jump along a line, of half a percent and more than so much."""
    places = np.linspace(0.0, 1.0, _FEW)
    said = np.array([answer(share) for share in places])
    changes, bound = np.abs(np.diff(said, axis=0)), np.maximum(least, _JUMP * np.ptp(said, axis=0))
    parts = np.flatnonzero(np.ptp(said, axis=0) > least).tolist()
    return any(_jump(answer, i, places, int(np.argmax(changes[:, i])), float(bound[i])) > bound[i] for i in parts)


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


def _jump(answer: Answer, part: int, places: np.ndarray, at: int, least: float = 0.0) -> float:
    """What is left of a change as the places it is between come nearer, or less than the least that counts."""
    low, high = places[at], places[at + 1]
    below, above = answer(low)[part], answer(high)[part]
    for _ in range(_HALVINGS):
        if abs(above - below) < least:
            break
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
