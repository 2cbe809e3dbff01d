"""Continuous laws that only Python can be asked for, from within compiled loops.

Nothing is known of such a law but what it says. So steps that compiled loops have taken under it are looked at before
they count: where what it says leaves the straight line between the ends of a step, along the way between what it reads
there, it may jump, or a corner of it be met, and that step is left to a plain one, which knows what to do.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from flexctrl.design.piecewise import PiecewisePolynomial
from flexctrl.dynamics.law_state import slope_of
from flexctrl.dynamics.lookahead import OF_RUN, without_rhythm
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.march.guarding import Begun
    from flexctrl.dynamics.march.ride import Ride

__all__ = ["Spoken", "straight_steps"]

_BENT, _ROUND_OFF = 0.02, 1e-9
"""What it may leave the line by, of what it changes by within a step or the one before."""
_MORE, _SEEN = 4.0, 1e-3
"""So many times as much as before it changes where something is hit; of its largest change, what counts."""
_FEWEST, _CLEARLY = 4, 2.0
"""Places within a step at which it is asked; how much further it must be off where it is asked at more."""
_TIME = PiecewisePolynomial((0.0,), ((0.0, 1.0),))
_CALL = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)


@frozen(eq=False)
class _Asking:
    """A function of Python as loops call a kernel."""

    ask: Callable[[], None]
    arguments: ClassVar[int] = 0

    def __post_init__(self) -> None:
        call = _CALL(lambda tables, z, r: self.ask())
        object.__setattr__(self, "call", call)  # alive as long as this is
        object.__setattr__(self, "address", ctypes.cast(call, ctypes.c_void_p).value)


class Spoken:
    """A continuous law as loops ask for it; as `flexctrl.design.answers.Answering` is.

    Parameters
    ----------
    feed : Feed

    Attributes
    ----------
    states, commands : int
    clocks : tuple
        What depends on time alone: time itself.
    places, slopes : numpy.ndarray, shape (states²,)
        All of ∂f/∂x may change.
    faults : list of BaseException
        Ctrl-C while it was asked.
    """

    clocks: ClassVar[tuple[PiecewisePolynomial, ...]] = (_TIME,)

    def __init__(self, feed: Feed) -> None:
        self.feed, self.states = feed, len(feed.beginning)
        self.commands = len(feed.writes)
        self.places, self.slopes = np.arange(self.states**2), np.zeros(self.states**2)
        self.faults: list[BaseException] = []

    def runs(self, work: np.ndarray, answer: np.ndarray, slopes: np.ndarray) -> tuple[Any, Any]:
        """Return what is called for answers and for ∂f/∂x, from what loops have written down for it to read.

        Parameters
        ----------
        work, answer, slopes : numpy.ndarray
            See `flexctrl.dynamics.march.answer.Answer`.
        """
        feed, n, s = self.feed, len(self.feed.model.outputs), self.states
        reads, writes = feed.reads, feed.writes

        def read() -> tuple[float, np.ndarray, np.ndarray]:
            return feed.short_of_break(float(work[-1])), work.take(reads), work[n : n + s].copy()

        def say() -> None:
            u, rate = feed.answer(*read())
            answer[: len(writes)] = [u[i] for i in writes]
            answer[len(writes) :] = rate

        def bend() -> None:
            t, y, x = read()
            slopes[:] = slope_of(lambda x: feed.law_rate(t, y, x), x, answer[len(writes) :]).T.ravel()

        return (_Asking(self._heard(say)),), (_Asking(self._heard(bend)),)

    def _heard(self, ask: Callable[[], None]) -> Callable[[], None]:
        """As asked from loops: what it raises leaves no answer, and steps of Python's own raise it again."""

        def heard() -> None:
            try:
                ask()
            except ControllerError:
                pass
            except BaseException as fault:  # Ctrl-C, and what is none of a run's business
                self.faults.append(fault)

        return heard


def _allowed(u: np.ndarray, swings: tuple[float, ...]) -> np.ndarray:
    """By how much answers may leave the line between the ends of each step; by less than nothing where one is hit.

    There they change by far more than in both steps before; in one of these alone they may just have turned.
    """
    changes = np.abs(np.diff(u, axis=0))
    first, second = (np.vstack([np.zeros_like(changes[:k]), changes])[: len(changes)] for k in (1, 2))
    before = np.maximum(first, second)
    most = _SEEN * np.maximum.accumulate(np.maximum(changes, swings or 0.0), axis=0)
    hit = (changes > _MORE * before) & (changes > most)
    hit[:1] = False
    size = np.maximum(np.maximum(changes, first), most)
    round_off = _ROUND_OFF * np.maximum.accumulate(np.abs(u), axis=0)[1:]  # of no steps to come: a run may end there
    return np.asarray(np.where(hit, -math.inf, _BENT * size + round_off))


class _Course(NamedTuple):
    """Ends of steps under a law: time, what it reads, its state, its answers; by how much these may leave the line."""

    t: np.ndarray
    read: np.ndarray
    state: np.ndarray
    line: np.ndarray
    allowed: np.ndarray

    def straight(self, feed: Feed, counts: np.ndarray, clearly: float = 1.0) -> int:
        """Over how many steps it goes straight on, asked at so many places in each."""
        k = np.repeat(np.arange(len(counts)), counts)
        i = np.arange(k.size) - np.repeat(np.cumsum(counts) - counts, counts)
        shares = without_rhythm(i, counts[k])[:, None]
        at, read, state, line = (a[k] + shares * np.diff(a, axis=0)[k] for a in (self.t[:, None], *self[1:4]))
        said: list[list[float]] = []
        with suppress(ControllerError):
            for each in zip(at.ravel().tolist(), read, state, strict=True):
                told, rate = feed.answer(*each)
                said.append([*told, *rate])
        heard = len(said)
        off = np.abs(np.array(said).reshape(heard, line.shape[1]) - line[:heard])
        bent = np.append(np.flatnonzero((off > clearly * self.allowed[k[:heard]]).any(axis=1)), heard)[0]
        return int(k[bent]) if bent < k.size else len(counts)


def straight_steps(ride: Ride, begun: Begun, done: int) -> int:
    """Return over how many of the steps just taken a law goes straight on, in time and in what it reads.

    Parameters
    ----------
    ride : Ride
    begun : Begun
        Where they began.
    done : int

    Returns
    -------
    int
        All of them, where it can be taken for its values at their ends.
    """
    feed, marcher, until = ride.journey.plan.feed, ride.marcher, ride.journey.plan.until
    t0, swings = begun.point.state.t, ride.journey.mark.swings
    t = np.concatenate([[t0], marcher.rows[:done, 0]])
    y = np.vstack([feed.measured(begun.point.state), marcher.rows[:done, 1:][:, feed.reads]])
    supplies = [ride.supply, *marcher.supplies(ride.supply, done)]
    u, x = np.array([[*s.u, *s.rate] for s in supplies]), np.array([s.x for s in supplies])
    course = _Course(t, y, x, u, _allowed(u, swings))
    straight = course.straight(feed, np.full(done, _FEWEST))
    closely = np.ceil(OF_RUN * np.diff(t[: straight + 1]) / until).astype(int)
    # how long the run is has no say but where more places show a pulse that few have passed over
    return course.straight(feed, np.where(closely > _FEWEST, closely, 0), _CLEARLY)
