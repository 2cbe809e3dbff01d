"""The legs of a ride: steps under the same inputs, done again for the states on the way when these are asked for."""

from __future__ import annotations

import weakref
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.stepper import MarchingStepper, Memory
from flexctrl.dynamics.records.books import Sums
from flexctrl.dynamics.records.frames import Later
from flexctrl.dynamics.steps import Mark, Point
from flexctrl.frozen import frozen
from flexctrl.model.state import State

__all__ = ["Leg", "Legs", "Span", "Told", "same"]


def same(u: np.ndarray, v: np.ndarray) -> bool:
    """Tell whether inputs are the same."""
    return bool(u.tolist() == v.tolist())


class Leg(NamedTuple):
    """Steps under the same inputs.

    Attributes
    ----------
    supply : Supply
    t : float
        Where they start [s].
    pacing : float or Pacing
        Their length, or how it is controlled.
    steps : int
    """

    supply: Supply
    t: float
    pacing: float | Pacing
    steps: int


_KEPT = 4
_asked: list[weakref.ref[Legs]] = []
"""Rides whose states are known, the one asked for last at the end: states take ten times the room of what made them."""


class Held(NamedTuple):
    """Legs from sample to sample, written down as they come.

    Attributes
    ----------
    rate : numpy.ndarray
        See `Supply`.
    samples : list
        Where each starts, the length of its steps, their number, its inputs and the controller's state.
    """

    rate: np.ndarray
    samples: list[tuple[float, float, int, list[float], np.ndarray]]

    def legs(self) -> list[Leg]:
        """The legs."""
        return [Leg(Supply(np.array(u), x, self.rate), t, h, steps) for t, h, steps, u, x in self.samples]

    @property
    def steps(self) -> int:
        """How many there are."""
        return sum(steps for _, _, steps, _, _ in self.samples)

    def commands(self, after: np.ndarray) -> np.ndarray:
        """Return the inputs in force from each step's end on; after the last sample others may be."""
        told = np.array([*(u for _, _, _, u, _ in self.samples), after.tolist()])
        steps = np.array([n for _, _, n, _, _ in self.samples])
        found = np.repeat(told[:-1], steps, axis=0)
        found[np.cumsum(steps) - 1] = told[1:]
        return found


class Told(NamedTuple):
    """Legs from sample to sample, written down by compiled loops.

    Attributes
    ----------
    rate : numpy.ndarray
        See `Supply`.
    table : numpy.ndarray, shape (legs, 3 + inputs + states)
        Where each starts, the length of its steps, their number, its inputs and the controller's state.
    inputs : int
    period : float
        Between samples [s].
    pacing : Pacing or None
        How steps are controlled; None: they are of one length.
    """

    rate: np.ndarray
    table: np.ndarray
    inputs: int
    period: float
    pacing: Pacing | None

    @property
    def samples(self) -> np.ndarray:
        """One a leg."""
        return self.table

    def legs(self) -> list[Leg]:
        """The legs."""
        return [self._leg(row) for row in self.table]

    @property
    def steps(self) -> int:
        """How many there are."""
        return int(self.table[:, 2].sum())

    def _leg(self, row: np.ndarray) -> Leg:
        t, size, steps = row[:3].tolist()
        supply = Supply(row[3 : 3 + self.inputs].copy(), row[3 + self.inputs :].copy(), self.rate)
        if self.pacing is None:
            return Leg(supply, t, size, int(steps))
        near = round(t / self.period)
        stop = (near if near * self.period > t else near + 1) * self.period  # a corner may be just before a sample
        return Leg(supply, t, self.pacing._replace(size=size, stop=stop), int(steps))


class Again(NamedTuple):
    """A leg done again.

    Attributes
    ----------
    states : Later
    supplies : list of Supply
        After each step.
    stands : State
        Where the next leg starts: beyond the corner, where the last step ended just before one.
    """

    states: Later
    supplies: list[Supply]
    stands: State


class Opened(NamedTuple):
    """Books and watch as a ride opens them.

    Attributes
    ----------
    first : numpy.ndarray, shape (n,)
        Where the degrees of freedom were at first.
    sums : Sums
    losing : bool
        Whether power is dissipated.
    sides : numpy.ndarray
        The sides that corners of laws of force were on.
    """

    first: np.ndarray
    sums: Sums
    losing: bool
    sides: np.ndarray


@dataclass(eq=False)
class Legs:
    """What a ride has done.

    Attributes
    ----------
    stepper : MarchingStepper
    start, end : AlphaPoint
    memory : Memory
    books : Opened
    mark : Mark
        At the start.
    parts : list of Leg, Held or Told
    """

    stepper: MarchingStepper
    start: AlphaPoint
    memory: Memory
    books: Opened
    mark: Mark
    parts: list[Leg | Held | Told] = field(default_factory=list)
    end: AlphaPoint = field(init=False)

    def __post_init__(self) -> None:
        self.end = self.start

    @property
    def bytes(self) -> float:
        """What it takes to remember the ride."""
        march, size = self.memory.march, self.start.state.q.size
        count = sum(1 if isinstance(part, Leg) else len(part.samples) for part in self.parts)
        return 500.0 * (1 + count) + march.tangent.nbytes + march.mass.nbytes + 8.0 * (9 * size)

    @cached_property
    def legs(self) -> list[Leg]:
        """All legs; once they are, no others are to come."""
        return [leg for part in self.parts for leg in ([part] if isinstance(part, Leg) else part.legs())]

    @cached_property
    def _starts(self) -> list[float]:
        return [leg.t for leg in self.legs]

    def part(self, t: float) -> Span:
        """Return the leg at a time."""
        return Span(self, max(0, bisect_right(self._starts, t) - 1))

    @property
    def after(self) -> Point:
        """Where the last leg ends."""
        return self.end

    @property
    def again(self) -> list[Again]:
        """All legs, done again; what has been found is kept of the rides asked for last."""
        found = self._again
        if not (_asked and _asked[-1]() is self):
            rides = [ride for asked in _asked if (ride := asked()) is not None and ride is not self]
            kept = [*rides, self][-_KEPT:]
            for ride in rides[: 1 - _KEPT]:
                vars(ride).pop("_again", None)
            _asked[:] = map(weakref.ref, kept)
        return found

    @cached_property
    def _again(self) -> list[Again]:
        stepper = self.stepper.again()
        stepper.marcher.recall(self.memory.march)
        stepper.enter(self.start)
        marcher = stepper.marcher
        marcher.open(self.books.first, self.books.sums.moved, self.books.losing)
        marcher.go_on(self.books.sums)
        marcher.about_to(self.mark.size)
        marcher.watch(self.books.sides, self.start.state)
        marcher.follow(self.mark)
        marcher.keep(all_states=True)
        before, found = self.start.supply, list[Again]()
        for leg in self.legs:
            marcher.march.t = leg.t
            marcher.resupply(before, leg.supply, leg.pacing)
            before = leg.supply
            states, supplies = marcher.travelled(leg.supply, leg.pacing, leg.steps)
            found.append(Again(states, supplies, marcher.point(leg.supply).state))
        return found


@frozen(eq=False)
class Span:
    """One leg of a ride, as the track knows stretches of steps."""

    ride: Legs
    number: int

    @property
    def even(self) -> float:
        """How long each step is [s]; 0 where they are unlike."""
        pacing = self.ride.legs[self.number].pacing
        return 0.0 if isinstance(pacing, Pacing) else pacing

    @property
    def supply(self) -> Supply:
        """What they set out under."""
        return self.ride.legs[self.number].supply

    @property
    def states(self) -> Sequence[State]:
        """After each step."""
        return self.ride.again[self.number].states

    @property
    def supplies(self) -> Sequence[Supply]:
        """After each step."""
        return self.ride.again[self.number].supplies

    @cached_property
    def before(self) -> Point:
        """Where the leg starts."""
        leg = self.ride.legs[self.number]
        state = self.ride.again[self.number - 1].stands if self.number else self.ride.start.state
        return Point(state.with_(t=leg.t), np.zeros(0), leg.supply)

    @cached_property
    def after(self) -> Point:
        """Where it ends."""
        last = self.number == len(self.ride.legs) - 1
        state = self.ride.end.state if last else self.states[-1]
        return Point(state, np.zeros(0), self.supplies[-1])
