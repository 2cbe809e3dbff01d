"""What a run looks for, and on which side of zero each of that is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from flexctrl.dynamics.events.event import CLOCK, NO_CLOCK, Direction, Event, Occurrence
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.records.tensions import Interval, Tensions
from flexctrl.dynamics.steps import Point
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.model.state import State

__all__ = ["TOGETHER", "Crossing", "Watch"]

TOGETHER = 1e-7
"""Share of a step within which what happens does so at once."""
_DUST = 1e-13
_Size = TypeVar("_Size", float, np.ndarray)


@frozen
class Crossing:
    """A gauge goes through zero; nothing else does so with it between ``low`` and ``high`` [s]."""

    t: float
    gauge: int
    rising: bool
    low: float = -math.inf
    high: float = math.inf


@dataclass
class Watch:
    """All gauges of a run: the events asked for, then laws of force that switch, then laws that have corners.

    Attributes
    ----------
    feed : Feed
    events : tuple of Event
    switches : callable
        (state, inputs) → how far each switching law of force is from its end, positive while it lasts; a run stops
        and starts anew where one falls to zero.
    names : tuple of str
        Of the switches.
    corners : callable
        (state, state before) → values whose signs tell the sides of corners in laws of force; steps end where one
        changes.
    corner_names, ends : tuple of str
        Of the corners; what to say where a run cannot go on beyond one, empty where it can.
    dust : numpy.ndarray
        Values of corners below these are zero but for round-off.
    sides : numpy.ndarray
        The side each gauge is on: ±1; 0 while it has not left zero.
    span : int
        How many steps are taken at once before it is looked at whether an event has happened.
    """

    feed: Feed
    events: tuple[Event, ...]
    switches: Callable[[State, np.ndarray], np.ndarray]
    names: tuple[str, ...]
    corners: Callable[[State, State], np.ndarray]
    corner_names: tuple[str, ...]
    ends: tuple[str, ...]
    dust: np.ndarray
    sides: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    span: int = 64

    def __post_init__(self) -> None:
        model = self.feed.model
        known = (*model.outputs, *model.inputs)
        for event in self.events:
            if isinstance(event.of, str) and event.of not in known:
                hint = NO_CLOCK if event.of in CLOCK else did_you_mean(event.of, known)
                raise StructureError(f"event {event.name!r}: the model has no signal {event.of!r}{hint}")

    @property
    def idle(self) -> bool:
        """Whether there is nothing to look for."""
        return self.quiet and not self.corner_names

    @property
    def quiet(self) -> bool:
        """Whether there is nothing to look for but corners."""
        return not self.events and not self.names

    @property
    def corner_sides(self) -> np.ndarray:
        """The sides that corners are on."""
        return self.sides[len(self.sides) - len(self.corner_names) :]

    def passed(self, state: State, t: float) -> list[Crossing]:
        """Return which corners a state is beyond, and did not stand on before, other than those that end a run."""
        values, sides = self.corners(state, state), self.corner_sides
        there = (sides * values < 0.0) & (np.abs(values) > self.dust)
        return [self.corner(int(k), t, bool(values[k] > 0.0)) for k in np.flatnonzero(there) if not self.ends[k]]

    def calm(self, state: State, before: State) -> bool:
        """Tell whether a state is on the same side of all corners."""
        values = self.corners(state, before)
        return bool(((np.sign(values) == self.corner_sides) | (np.abs(values) <= self.dust)).all())

    def stops(self, gauge: int) -> bool:
        """Tell whether a step has to end at a gauge's zero."""
        return gauge >= len(self.events) or self.events[gauge].terminal

    def last_word(self, gauge: int) -> str:
        """Return what is said where a run ends at a gauge's zero; empty where it goes on."""
        if gauge < len(self.events):
            return self.events[gauge].name
        corner = gauge - len(self.events) - len(self.names)
        return self.ends[corner] if corner >= 0 else ""

    def signals(self, state: State, u: np.ndarray) -> dict[str, float]:
        """Return all signals by name."""
        return self.named_signals(self.feed.model.measure(state), u)

    @cached_property
    def told(self) -> tuple[str, ...]:
        """The events asked for, in words."""
        return tuple(event.told for event in self.events)

    @cached_property
    def tensions(self) -> Tensions:
        """The tensions among the outputs."""
        return Tensions(self.feed.model)

    def named_signals(self, outputs: np.ndarray, u: np.ndarray) -> dict[str, float]:
        """Return all signals by name, where outputs are known."""
        model = self.feed.model
        values = [*outputs.tolist(), *np.asarray(u).tolist()]
        return dict(zip((*model.outputs, *model.inputs), values, strict=True))

    def values(self, state: State, u: np.ndarray, before: State | None = None) -> np.ndarray:
        """Return the gauges' values, of a state that came from one before."""
        found = self.asked(state, u)
        switches = self.switches(state, u) if self.names else np.zeros(0)
        return np.concatenate([found, switches, self.corners(state, before or state)])

    def asked(self, state: State, u: np.ndarray) -> list[float]:
        """Return the values of the events asked for."""
        if not self.events:
            return []
        signals = self.signals(state, u)
        return [event.value(signals) for event in self.events]

    @property
    def onlooking(self) -> Watch:
        """A watch for the events asked for alone: what these tell is nothing that switches and corners go by."""
        count, none = len(self.events), np.zeros(0)
        sides, sizes = self.sides[:count].copy(), self.sizes[:count].copy()
        return Watch(self.feed, self.events, _nothing, (), _nothing, (), (), none, sides, sizes)

    def left(self, after: Point, before: Point, crossing: Crossing) -> float:
        """Return how far a gauge is from zero after a step, on the side it comes from: below zero it has passed it."""
        gauge = crossing.gauge
        return (-1.0 if crossing.rising else 1.0) * self.value(after.state, after.supply.u, before.state, gauge)

    def value(self, state: State, u: np.ndarray, before: State, gauge: int) -> float:
        """Return one gauge's value, of a state that came from one before."""
        switch = gauge - len(self.events)
        if 0 <= switch < len(self.names):
            return self.feed.model.switches.gap(state, u, switch)
        return float(self.values(state, u, before)[gauge])

    def begin(self, point: Point) -> None:
        """Note the side that each gauge is on at the start."""
        values = self.values(point.state, point.supply.u)
        self.sides, self.sizes = np.sign(values), np.abs(values)
        self.sides[np.abs(values) <= self.dusts] = 0.0
        self.switched()

    @property
    def dusts(self) -> np.ndarray:
        """What counts as zero of each gauge."""
        dust = self.dust_of(self.sizes)
        if self.corner_names:
            dust[-len(self.dust) :] = self.dust
        return dust

    def dust_of(self, size: _Size) -> _Size:
        """What counts as zero of events of some size."""
        return _DUST * size

    def switched(self) -> None:
        """Note that every switching law of force holds."""
        first = len(self.events)
        self.sides[first : first + len(self.names)] = 1.0

    def withheld(self, switch: int) -> None:
        """Note that a switching law of force is kept from switching over the next step."""
        self.sides[len(self.events) + switch] = 0.0

    @cached_property
    def directions(self) -> tuple[Direction, ...]:
        switches, corners = [Direction.FALLING] * len(self.names), [Direction.EITHER] * len(self.corner_names)
        return (*(event.direction for event in self.events), *switches, *corners)

    def leaps(self, point: Point) -> list[Crossing]:
        """Return the events that a jump of the inputs to those of a point has brought about; sides stay as they are.

        What comes to zero just where inputs jump has reached it, though they may turn it back.
        """
        values, dusts, found = self.values(point.state, point.supply.u), self.dusts, []
        for gauge, event in enumerate(self.events):
            value, side = values[gauge], self.sides[gauge]
            missed = Direction.FALLING if side < 0.0 else Direction.RISING
            there = abs(value) <= dusts[gauge] or np.sign(value) == -side
            if side != 0.0 and there and event.direction is not missed:
                found.append(Crossing(point.state.t, gauge, bool(side < 0.0)))
        return found

    def reach(self, crossing: Crossing) -> None:
        """Note that a gauge has come to zero: what leaves it from there does not cross it again."""
        self.sides[crossing.gauge] = 0.0

    def settle_laws(self, after: Point) -> None:
        """Note that switches hold, and the sides of corners that have left zero: none has been passed unnoted."""
        first = len(self.events) + len(self.names)
        values = self.corners(after.firm.state, after.firm.state)
        left = (self.sides[first:] == 0.0) & (np.abs(values) > self.dust)
        self.sides[first:][left] = np.sign(values[left])
        self.switched()

    def settle(self, after: Point) -> None:
        """Note the sides after a step."""
        values = self.values(after.state, after.supply.u)
        if self.corner_names:
            values[-len(self.corner_names) :] = self.corners(after.firm.state, after.firm.state)
        clear = np.abs(values) > self.dusts
        self.sides = np.where(clear, np.sign(values), self.sides)
        self.switched()

    def cross(self, crossing: Crossing) -> None:
        """Note that a gauge has crossed, though its value may still be on either side of zero by round-off."""
        self.sides[crossing.gauge] = 1.0 if crossing.rising else -1.0

    def occurrence(
        self, crossing: Crossing, state: State, u: np.ndarray, interval: Interval | None = None
    ) -> Occurrence:
        """Return what is told of a crossing, by a state that may be within a step."""
        outputs = self.tensions.within(state, interval) if interval else self.feed.model.measure(state)
        return self.named(crossing, outputs, u)

    def named(self, crossing: Crossing, outputs: np.ndarray, u: np.ndarray) -> Occurrence:
        """Return what is told of a crossing, where outputs are known."""
        named = (*(e.name for e in self.events), *self.names, *self.corner_names)
        signals = self.named_signals(outputs, u)
        return Occurrence(named[crossing.gauge], float(crossing.t), bool(crossing.rising), signals)

    def corner(self, which: int, t: float, rising: bool) -> Crossing:
        """Return that a corner is met."""
        return Crossing(t, len(self.events) + len(self.names) + which, rising)


def _nothing(*_: object) -> np.ndarray:
    """Values of gauges that are not there."""
    return np.zeros(0)
