"""Where inputs jump, and what jumps that follow each other by the clock add up to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.errors import ControllerError
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["PART", "PARTS", "Jump", "Train", "input_jumps"]

_ABOUT = 0.98, 0.99, 1.0, 1.01, 1.02
"""Frequencies of vibrations, over what they are found as if all else let go."""
_MOST, _BESIDE, _WATCHED = 16, 1e-9, 1024
"""Breaks of a law that are looked at, and how far on either side, in parts of the run; samples that are."""
_LITTLE = 1e-6
PARTS, PART = 4, 0.1
"""In how many parts of a run samples are looked at for the largest jump, as lines lie otherwise there; what counts of
others beside it."""


class Train(NamedTuple):
    """Shocks that follow each other by the clock.

    Attributes
    ----------
    sizes : tuple of float
        Each over the largest; a single one has none beside it.
    apart : float
        Time from one to the next [s].
    """

    sizes: tuple[float, ...] = ()
    apart: float = 0.0

    def gains(self, frequencies: np.ndarray, decays: np.ndarray) -> np.ndarray:
        """Return how far they make things ring, over what the largest does: A ← A exp((iω − δ) T) + their size.

        Whole turns between samples add all of them up. So that counts of frequencies within a fiftieth.

        Parameters
        ----------
        frequencies, decays : numpy.ndarray, shape (things,)
            ω and δ [1/s].

        Returns
        -------
        numpy.ndarray, shape (things,)
        """
        turn = np.exp((1j * np.multiply.outer(_ABOUT, frequencies) - decays) * self.apart)
        ringing, most = np.zeros(turn.shape, dtype=complex), np.ones(turn.shape)
        for size in self.sizes:
            ringing = ringing * turn + size
            most = np.maximum(most, np.abs(ringing))
        return np.asarray(most.max(axis=0))


class Jump(NamedTuple):
    """Inputs before and after, in a state; at samples also all others that are known, one after the other.

    Attributes
    ----------
    state : State
    before, after : numpy.ndarray, shape (inputs,)
    commands : numpy.ndarray, shape (samples, inputs)
        After samples that follow each other; none at breaks.
    apart : float
        Time from sample to sample [s].
    """

    state: State
    before: np.ndarray
    after: np.ndarray
    commands: np.ndarray = np.zeros((0, 0))
    apart: float = 0.0

    def size(self, i: int) -> float:
        """Return by how much an input jumps."""
        return float(abs(self.after[i] - self.before[i]))

    def train(self, i: int) -> Train:
        """Return all jumps of an input at samples, over this one."""
        sizes = np.diff(self.commands[:, i]) / self.size(i) if self.apart else np.zeros(0)
        return Train(tuple(sizes.tolist()), self.apart)


def input_jumps(run: Run, journey: Journey) -> Iterator[Jump]:
    """Return where inputs jump: at breaks of a continuous law, as far as they are known, and at samples, most by parts.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.

    Returns
    -------
    iterator of Jump
    """
    feed, track = journey.plan.feed, run.track
    if feed.controller is None or not track.stretches:
        return
    if feed.continuous:
        beside = _BESIDE * journey.point.state.t
        inner = [b for b in (*feed.breaks, *feed.met) if track.starts[0] + beside < b < journey.point.state.t - beside]
        with suppress(ControllerError, ArithmeticError, ValueError):  # beside where it was, a law may say nothing
            for b in sorted(set(inner))[:_MOST]:
                state, before = track.state(b - beside)
                yield Jump(state.with_(t=b), before, track.state(b + beside)[1])
        return
    samples, u = _commands(run, journey)
    leaps = np.abs(np.diff(u, axis=0))
    leaps[leaps < PART * leaps.max(axis=0, initial=0.0)] = 0.0
    parts = np.array_split(np.arange(len(leaps)), PARTS)
    rows = [1 + part[np.argmax(leaps[part], axis=0)][leaps[part].any(axis=0)] for part in parts if part.size]
    for row in np.unique(np.concatenate([*rows, []])).astype(int).tolist():
        state = track.state(float(samples[row] * feed.sample_time))[0]
        yield Jump(state, u[row - 1], u[row], u, feed.sample_time)


def _commands(run: Run, journey: Journey) -> tuple[np.ndarray, np.ndarray]:
    """The inputs after samples that follow each other, and the numbers of these: where rows show most of them move."""
    feed, track = journey.plan.feed, run.track
    first = math.ceil(track.starts[0] / feed.sample_time - _LITTLE)
    last = math.ceil(run.final.t / feed.sample_time - _LITTLE)
    leaps = np.abs(np.diff(run.u, axis=0))
    way = np.ptp(run.u, axis=0)
    if last - first > _WATCHED and len(leaps):
        row = int(np.argmax((leaps / np.where(way > 0.0, way, 1.0)).max(axis=1)))
        first = min(max(first, int(run.t[row] / feed.sample_time) - _WATCHED // 4), last - _WATCHED)
    middles = (np.arange(first, min(last, first + _WATCHED)) + 0.5) * feed.sample_time
    middles = middles[middles < run.final.t]
    rows = np.searchsorted(run.t, middles) - 1
    if (rows >= 0).all() and (middles - run.t[rows] < (0.5 + _LITTLE) * feed.sample_time).all():
        held = run.u[rows]
    else:
        held = np.array([track.held(t) for t in middles.tolist()]).reshape(-1, run.u.shape[1])
    return np.rint(middles / feed.sample_time - 0.5).astype(int), held
