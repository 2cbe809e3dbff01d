"""Between the steps: states at any time of a step, and of a whole run."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.methods.local import Local
from flexctrl.dynamics.records.frames import times
from flexctrl.dynamics.records.tensions import Interval, Tensions
from flexctrl.dynamics.steps import Point, Stepper
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Booked", "Curve", "Dense", "Hermite", "LeftBehind", "Track", "curves_of"]


class Curve(Protocol):
    """The motion over one step."""

    @property
    def seen(self) -> float:
        """Radians of a vibration in the step up to which it is followed."""

    def at(self, t: float) -> State:
        """Return the state at a time of the step."""


@runtime_checkable
class Dense(Protocol):
    """A stepper that knows its motion within a step better than `Hermite` does."""

    def curve(self, before: Any, after: Any) -> Curve:
        """Return the motion over a step it has taken."""


@frozen(eq=False)
class Hermite:
    """The cubic through places and rates at both ends, in the coordinates from the start of the step.

    Its error over a step of length h is O(h⁴) in places and O(h³) in rates: in places no more than that of a method of
    up to the fourth order, in rates of up to the third.

    Attributes
    ----------
    local : Local
    start, end : State
    """

    local: Local
    start: State
    end: State
    seen: ClassVar[float] = 1.0

    @cached_property
    def _ends(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates at the end, rates at both ends, and what rates have beside those of the coordinates."""
        h = self.end.t - self.start.t
        xi = self.local.between(self.start, self.end)
        first = np.append(self.start.v, np.zeros(len(xi) - len(self.start.v)))
        last = self.local.rates(self.start, xi, self.end)[0]
        return xi, h * first, h * last, self.end.v - last[: len(self.end.v)]

    def at(self, t: float) -> State:
        """Return the state at a time of the step."""
        place, rate, turning = self.course(t)
        return self.local.place(self.start, place, rate[: len(turning)] + turning, t)

    def course(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the coordinates at a time of the step, their rates, and about what is to be added to those."""
        h = self.end.t - self.start.t
        s = (t - self.start.t) / h
        xi, first, last, turning = self._ends
        bend, twist = 3.0 * xi - 2.0 * first - last, first + last - 2.0 * xi
        place = s * (first + s * (bend + s * twist))
        return place, (first + s * (2.0 * bend + s * 3.0 * twist)) / h, s * s * turning

    def secant(self) -> State:
        """Return the middle of the step with its mean rates, which noise in the rates at its ends does not touch."""
        h = self.end.t - self.start.t
        middle = self.at(self.start.t + 0.5 * h)
        return middle.with_(v=self._ends[0][: len(middle.v)] / h)


@runtime_checkable
class Booked(Protocol):
    """A curve that knows what was turned over on it."""

    def turned_over(self) -> tuple[float, float]:
        """Return the work of the inputs and what was dissipated [J]."""


def curves_of(model: Plant, stepper: Stepper[Any]) -> Callable[[Point, Point], Curve]:
    """Return how the motion over a step of a stepper is found: its own way, or `Hermite`."""
    if isinstance(stepper, Dense):
        return stepper.curve
    local = Local(model)
    return lambda before, after: Hermite(local, before.state, after.state)


class Stretched(Protocol):
    """Steps between two points; ``states`` and ``supplies`` are those after each of them.

    ``supply`` is what they set out under, ``even`` how long each is [s], or 0 where they are unlike.
    """

    @property
    def even(self) -> float: ...

    @property
    def supply(self) -> Supply: ...

    @property
    def states(self) -> Sequence[State]: ...

    @property
    def supplies(self) -> Sequence[Supply]: ...

    @property
    def before(self) -> Point: ...

    @property
    def after(self) -> Point: ...


class Parted(Protocol):
    """Steps in parts: the one at a time, and where the last one ends."""

    def part(self, t: float) -> Stretched: ...

    @property
    def after(self) -> Point: ...


class Repeatable(Parted, Protocol):
    """Many steps that can be done again: where they start, and the bytes it takes to remember."""

    @property
    def bytes(self) -> float: ...

    @property
    def start(self) -> Point: ...


@frozen(eq=False)
class Stretch:
    """Steps between two points; ``states`` has those after each of them."""

    states: Sequence[State]
    before: Point
    after: Point
    even: ClassVar[float] = 0.0

    @property
    def supply(self) -> Supply:
        return self.before.supply

    @property
    def supplies(self) -> Sequence[Supply]:
        return (self.before.supply,) * (len(self.states) - 1) + (self.after.supply,)

    def part(self, t: float) -> Stretch:
        """The only part."""
        return self


@dataclass
class Track:
    """The steps of a run, as far as there is room to keep them.

    Attributes
    ----------
    feed : Feed
    room : float
        Bytes; a run that needs more keeps nothing.
    curve : callable
        (point before, point after) → the motion over that step.
    """

    feed: Feed
    room: float
    curve: Callable[[Point, Point], Curve]
    used: float = 0.0
    starts: list[float] = field(default_factory=list)
    stretches: list[Parted] = field(default_factory=list)

    @property
    def empty(self) -> bool:
        """Whether there were no steps to keep."""
        return not self.stretches and self.used <= self.room

    @property
    def missing(self) -> str:
        """Why there are no steps though some were taken, and what to do about it."""
        return "the steps of this run were not kept, they need more room; give record=InMemory(states=bytes)"

    def __deepcopy__(self, memo: object) -> Track:
        return self  # of a run that has ended

    def __reduce__(self) -> tuple[type[LeftBehind], tuple[bool]]:
        return LeftBehind, (self.empty,)

    def keep(self, states: Sequence[State], before: Point, after: Point) -> None:
        """Keep one step or many."""
        if self.used > self.room:
            return
        self.used += 500.0 + len(states) * (1500.0 + 8.0 * (12 * len(after.state.x) + 5 * after.state.q.size))
        if self.used > self.room:
            self.starts, self.stretches = [], []
            return
        self.starts.append(before.state.t)
        self.stretches.append(Stretch(states, before, after))

    def remember(self, ride: Repeatable) -> None:
        """Keep many steps that can be done again."""
        if self.used <= self.room:
            self.used += ride.bytes
            self.starts.append(ride.start.state.t)
            self.stretches.append(ride)
        if self.used > self.room:
            self.starts, self.stretches = [], []

    def state(self, t: float) -> tuple[State, np.ndarray]:
        """Return the state and the inputs at a time."""
        state, u, _ = self._found(t)
        return state, u

    @cached_property
    def tensions(self) -> Tensions:
        """The tensions among the outputs."""
        return Tensions(self.feed.model)

    def point(self, t: float) -> tuple[State, Supply]:
        """Return the state at a time, and the inputs that the step there set out under."""
        return self.state(t)[0], self._ends(t)[0].supply

    def moment(self, t: float) -> tuple[State, np.ndarray, np.ndarray]:
        """Return the state, the outputs and the inputs at a time."""
        state, u, interval = self._found(t)
        outputs = self.tensions.within(state, interval) if interval else self.feed.model.measure(state)
        return state, outputs, u

    def _found(self, t: float) -> tuple[State, np.ndarray, Interval | None]:
        """The state and the inputs, and the step that it is within."""
        before, after = self._ends(t)
        for end in (after, before):
            if t == end.state.t:
                return end.state, end.supply.u, None
        h = after.state.t - before.state.t
        curve = self.curve(before, after)
        state = curve.at(t)
        share = ((t - before.state.t) / h, h)
        u = self.feed.between(before.supply, after.supply, share, state).u
        return state, u, Interval(before.state, after.state, curve.seen)

    def step(self, t: float) -> float:
        """Return how long the step at a time is [s]."""
        if even := self._part(t).even:
            return even
        before, after = self._ends(t)
        return float(after.state.t - before.state.t)

    def held(self, t: float) -> np.ndarray:
        """Return the inputs at a time, where none change within steps."""
        return self._part(t).supply.u

    def _part(self, t: float) -> Stretched:
        return self.stretches[max(0, bisect_right(self.starts, t) - 1)].part(t)

    def _ends(self, t: float) -> tuple[Point, Point]:
        s = self._part(t)
        if len(s.states) == 1:
            return s.before, s.after
        i = min(bisect_right(times(s.states), t), len(s.states) - 1)
        after = replace(s.after, state=s.states[i], supply=s.supplies[i])
        if i == 0:
            return s.before, after
        return replace(s.before, state=s.states[i - 1], supply=s.supplies[i - 1]), after


class LeftBehind(Track):
    """Stands in a run that was pickled for its steps: they are done again by compiled loops, which stay where they are.

    Parameters
    ----------
    empty : bool
        Whether there were no steps to leave.
    """

    def __init__(self, empty: bool) -> None:
        self.room, self.used, self.starts, self.stretches = 0.0, 0.0 if empty else 1.0, [], []

    @property
    def missing(self) -> str:
        """Why there are no steps, and what to do about it."""
        return "a run that comes from another process or a file has its rows, not its steps; ask it where it was made"
