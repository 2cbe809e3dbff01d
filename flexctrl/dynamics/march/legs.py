"""The legs of a ride: steps under the same inputs, done again for the states on the way when these are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.alpha import AlphaPoint
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.march.marching import Pacing
from flexctrl.dynamics.march.stepper import MarchingStepper, Memory
from flexctrl.dynamics.steps import Point
from flexctrl.model.motion import State

__all__ = ["Leg", "Legs", "Span", "same"]


def same(u: np.ndarray, v: np.ndarray) -> bool:
    """Tell whether inputs are the same to the last bit."""
    return u.tobytes() == v.tobytes()


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


@dataclass(eq=False)
class Legs:
    """What a ride has done.

    Attributes
    ----------
    stepper : MarchingStepper
    start, end : AlphaPoint
    memory : Memory
    first, moved : numpy.ndarray, shape (n,)
        Where the degrees of freedom were at first, and how far they had been from there.
    legs : list of Leg
    """

    stepper: MarchingStepper
    start: AlphaPoint
    memory: Memory
    first: np.ndarray
    moved: np.ndarray
    legs: list[Leg] = field(default_factory=list)
    end: AlphaPoint = field(init=False)

    def __post_init__(self) -> None:
        self.end = self.start

    @property
    def bytes(self) -> float:
        """What it takes to remember the ride."""
        march, size = self.memory.march, self.start.state.q.size
        return 500.0 * (1 + len(self.legs)) + march.tangent.nbytes + march.mass.nbytes + 8.0 * (9 * size)

    @property
    def starts(self) -> list[float]:
        """When the legs start."""
        return [leg.t for leg in self.legs]

    def stretches(self) -> list[Span]:
        """The legs, as the track knows stretches of steps."""
        return [Span(self, i) for i in range(len(self.legs))]

    @cached_property
    def states(self) -> list[list[State]]:
        """The states after the steps of each leg."""
        again = MarchingStepper(self.stepper.plain)
        again.marcher.recall(self.memory.march)
        again.enter(self.start)
        marcher = again.marcher
        marcher.open(self.first, self.moved, False)
        marcher.keep(all_states=True)
        u, found = self.start.supply.u, []
        for leg in self.legs:
            marcher.march.t = leg.t
            if not same(leg.supply.u, u):
                u = leg.supply.u
                marcher.jump(u)
            found.append(marcher.travelled(leg.pacing, leg.steps))
        return found


@dataclass(frozen=True, eq=False)
class Span:
    """One leg of a ride, as the track knows stretches of steps."""

    ride: Legs
    number: int

    @property
    def states(self) -> Sequence[State]:
        """After each step."""
        return self.ride.states[self.number]

    @cached_property
    def before(self) -> Point:
        """Where the leg starts."""
        leg = self.ride.legs[self.number]
        state = self.ride.states[self.number - 1][-1] if self.number else self.ride.start.state
        return Point(state.with_(t=leg.t), np.zeros(0), leg.supply)

    @cached_property
    def after(self) -> Point:
        """Where it ends."""
        last = self.number == len(self.ride.legs) - 1
        state = self.ride.end.state if last else self.states[-1]
        return Point(state, np.zeros(0), self.ride.legs[self.number].supply)
