"""Events: instants at which a function of the signals crosses zero, found between the steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from flexctrl.dynamics.dense import Curve, Hermite
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.scales import turning, yardsticks
from flexctrl.dynamics.steps import Point
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite

__all__ = ["Direction", "Event", "EventError", "Occurrence", "Watch"]

_DUST = 1e-13
_SLOPE = 1e-2
_HALVINGS = 20
_BENT = 0.25
_TURN = 0.5  # rad between probes
_PARTS, _FINE = 4, 8  # of a step with a cubic for its motion, and with a polynomial of higher degree
_NEAR = 1e-9


class EventError(StructureError):
    """The function of an event raises, or gives what is no finite number."""


class Direction(Enum):
    """Which way a value must go through zero to count."""

    RISING = 1
    FALLING = -1
    EITHER = 0


@dataclass(frozen=True)
class Event:
    """Something to look for during a run: a signal, or a function of signals, reaches a value.

    Parameters
    ----------
    name : str
        What to call it in ``run.events``.
    of : str or callable
        An output or input of the model, or a function of a mapping of all of them (name → value) to a number that is
        continuous in time.
    at : float
        The value to be reached.
    direction : Direction
        Which way.
    terminal : bool
        Whether the run ends there, with `Status.STOPPED`.

    Raises
    ------
    StructureError
        For a value that is no finite number, and what is no direction, signal or function.

    Notes
    -----
    Within a step the motion is known at all times (the method's own polynomial, or a cubic). It is looked at closely
    wherever something may happen: in four places of a step at least (eight for `ExplicitRungeKutta` and `Exact`), so
    densely that no node turns by more than half a radian between two, at all rows that ``every`` asks for, and where
    the parabola through three such values bends to zero. What a run's rows show to have crossed is found so, and what
    crosses and comes back where it shows in such a parabola. Steps in which signals stay clear of their values, by
    twice what they bend, are not looked at closely. What crosses twice between two places and bends otherwise goes
    unseen (a function with a kink or a narrow peak); take shorter steps for that. What only touches the value counts
    where it does so just as an input jumps (a speed that comes to zero at the end of a braking torque).
    """

    name: str
    of: str | Callable[[Mapping[str, float]], float]
    at: float = 0.0
    direction: Direction = Direction.EITHER
    terminal: bool = False

    def __post_init__(self) -> None:
        owner = f"event {self.name!r}"
        if not isinstance(self.name, str):
            raise StructureError(f"{owner}: its name is no text")
        if not isinstance(self.of, str) and not callable(self.of):
            raise StructureError(f"{owner}: of = {self.of!r}; expected the name of a signal or a function of signals")
        check_finite(self.at, "at", owner)
        if not isinstance(self.direction, Direction):
            choices = ", ".join(f"Direction.{d.name}" for d in Direction)
            raise StructureError(f"{owner}: direction = {self.direction!r}; expected one of {choices}")

    def value(self, signals: Mapping[str, float]) -> float:
        """Return how far it is from happening.

        Parameters
        ----------
        signals : mapping of str to float
            All outputs and inputs.

        Returns
        -------
        float

        Raises
        ------
        EventError
            If its function raises, or gives no finite number.
        """
        if isinstance(self.of, str):
            return signals[self.of] - self.at
        try:
            found = float(self.of(signals))
        except Exception as error:
            raise EventError(f"event {self.name!r}: its function raised {type(error).__name__}: {error}") from error
        if not math.isfinite(found):
            raise EventError(f"event {self.name!r}: its function gives {found}; expected a finite number at all times")
        return found - self.at


@dataclass(frozen=True)
class Occurrence:
    """An event that happened.

    Attributes
    ----------
    name : str
    t : float
        When [s].
    rising : bool
        Which way the value went. Of dry friction: True where a contact slides from then on (it breaks loose, or its
        slip turns back at once), False where it sticks.
    signals : mapping of str to float
        Outputs and inputs at that instant.
    """

    name: str
    t: float
    rising: bool
    signals: Mapping[str, float]


@dataclass(frozen=True)
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
                hint = did_you_mean(event.of, known)
                raise StructureError(f"event {event.name!r}: the model has no signal {event.of!r}{hint}")

    @property
    def count(self) -> int:
        """Number of gauges."""
        return len(self.events) + len(self.names) + len(self.corner_names)

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

    def _calm(self, state: State, before: State) -> bool:
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
        return self._signals(self.feed.model.measure(state), u)

    def _signals(self, outputs: np.ndarray, u: np.ndarray) -> dict[str, float]:
        model = self.feed.model
        values = [*outputs.tolist(), *np.asarray(u).tolist()]
        return dict(zip((*model.outputs, *model.inputs), values, strict=True))

    def values(self, state: State, u: np.ndarray, before: State | None = None) -> np.ndarray:
        """Return the gauges' values, of a state that came from one before."""
        found = []
        if self.events:
            signals = self.signals(state, u)
            found = [event.value(signals) for event in self.events]
        switches = self.switches(state, u) if self.names else np.zeros(0)
        return np.concatenate([found, switches, self.corners(state, before or state)])

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
        dust = _DUST * self.sizes
        if self.corner_names:
            dust[-len(self.dust) :] = self.dust
        return dust

    def dusts_of(self, sizes: np.ndarray) -> np.ndarray:
        """What counts as zero of events of some sizes."""
        return _DUST * sizes

    def dust_of(self, size: float) -> float:
        """What counts as zero of an event of a size."""
        return _DUST * size

    def switched(self) -> None:
        """Note that every switching law of force holds."""
        first = len(self.events)
        self.sides[first : first + len(self.names)] = 1.0

    def withheld(self, switch: int) -> None:
        """Note that a switching law of force is kept from switching over the next step."""
        self.sides[len(self.events) + switch] = 0.0

    def crossings(self, curve: Curve, before: Point, after: Point, every: float | None = None) -> list[Crossing]:
        """Return where gauges cross zero over a step, in order; sides stay as they are.

        Events are looked for at the rows that are ``every`` so many seconds too.
        """
        if self.quiet and self._calm(after.state, before.state):
            return []
        t, h = before.state.t, after.state.t - before.state.t
        value = _Along(self, curve, before, after)
        last = self.values(before.state, before.supply.u)
        ends = [(t + 0.5 * h, value(t + 0.5 * h)), (t + h, self.values(after.state, after.supply.u, before.state))]
        self.sizes = np.maximum(self.sizes, np.abs([last, *(v for _, v in ends)]).max(axis=0))
        found, number = [], len(self.events)
        clear = self._clear(np.array([last, *(v for _, v in ends)])[:, :number])
        probes = self._probes(curve, before, after, every, clear) if number else []
        seen: list[tuple[float, Sequence[float] | np.ndarray]] = [*ends, *((at, value.events(at)) for at in probes)]
        for gauge in range(len(last)):
            corners = [(t, last[gauge]), *((at, v[gauge]) for at, v in (seen if gauge < number else ends))]
            found += self._through(gauge, self._with_vertices(sorted(corners), gauge, value), value)
        return sorted(found, key=lambda c: c.t)

    def _clear(self, values: np.ndarray) -> bool:
        """Tell whether events stay on their sides by more than twice what they bend over a step."""
        ahead = self.sides[: values.shape[1]] * values
        bend = np.abs(values[0] - 2.0 * values[1] + values[2])
        return bool((ahead.min(axis=0) > _BENT * bend).all() and (ahead > 0.0).all())

    def _probes(self, curve: Curve, before: Point, after: Point, every: float | None, clear: bool) -> list[float]:
        """Return where within a step, beside its middle, events are looked for."""
        t, h = before.state.t, after.state.t - before.state.t
        fastest = np.maximum(np.abs(before.state.v), np.abs(after.state.v))
        turned = h * float((fastest * self._turns).max(initial=0.0))
        if clear and turned <= _TURN and isinstance(curve, Hermite):
            return []
        parts = 2 * math.ceil(0.5 * max(_PARTS if isinstance(curve, Hermite) else _FINE, turned / _TURN))
        found = t + h / parts * np.arange(1, parts)
        if every is not None:
            found = np.append(found, every * np.arange(math.ceil(t / every), math.floor((t + h) / every) + 1))
        taken = np.sort(np.append(found, (t, t + h)))
        apart = taken[1:][np.diff(taken) > _NEAR * h]
        return apart[(np.abs(apart - t - 0.5 * h) > _NEAR * h) & (apart < t + (1.0 - _NEAR) * h)].tolist()

    @cached_property
    def _turns(self) -> np.ndarray:
        return _turns(self.feed.model)

    def _with_vertices(self, points: list[tuple[float, float]], gauge: int, value: _Along) -> list[tuple[float, float]]:
        """Add the vertices of parabolas through three points where they may lie across zero and these do not."""
        found = list(points)
        for (a, fa), (b, fb), (c, fc) in zip(points, points[1:], points[2:], strict=False):
            if not (fa * fb > 0.0 and fb * fc > 0.0 and a < b < c):
                continue
            before, after = (fb - fa) / (b - a), (fc - fb) / (c - b)
            bend = (after - before) / (c - a)
            if not bend * fb > 0.0:
                continue
            slope = before + bend * (b - a)
            at = b - 0.5 * slope / bend
            if a < at < c and (fb - 0.25 * slope * slope / bend) * fb < 0.1 * fb * fb:
                found.append((at, value(at)[gauge]))
        return sorted(found)

    def _through(self, gauge: int, corners: Sequence[tuple[float, float]], value: _Along) -> list[Crossing]:
        side, found = self.sides[gauge], []
        dust = self.dusts[gauge]
        direction = self._directions[gauge]
        for i, ((a, fa), (b, fb)) in enumerate(pairwise(corners)):
            if abs(fb) <= dust or np.sign(fb) == side:
                continue
            rising = fb > 0.0
            if side != 0.0 and direction is not (Direction.FALLING if rising else Direction.RISING):
                own = partial(value.one, gauge)
                if not fa * fb < 0.0:
                    at = _return(own, a, b, fb, dust)
                elif self.stops(gauge):  # where exactly, is found by steps
                    at = _nearly(corners, a)
                else:
                    at = _root(own, (a, fa), (b, fb))
                low, high = corners[max(i - 1, 0)][0], corners[min(i + 2, len(corners) - 1)][0]
                found.append(Crossing(at, gauge, rising, low, high))
            side = np.sign(fb)
        return found

    @cached_property
    def _directions(self) -> tuple[Direction, ...]:
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

    def offset(self, curve: Curve, before: Point, after: Point, gauge: int) -> float:
        """Return how much later than at the end of a step a gauge is zero, by its slope there."""
        t, h = after.state.t, after.state.t - before.state.t
        now = self.value(after.state, after.supply.u, before.state, gauge)
        slope = (now - _Along(self, curve, before, after).one(gauge, t - _SLOPE * h)) / (_SLOPE * h)
        return float(-now / slope) if abs(now) > _DUST * self.sizes[gauge] and slope != 0.0 else 0.0

    def settle(self, after: Point) -> None:
        """Note the sides after a step."""
        values = self.values(after.state, after.supply.u)
        clear = np.abs(values) > self.dusts
        self.sides = np.where(clear, np.sign(values), self.sides)
        self.switched()

    def cross(self, crossing: Crossing) -> None:
        """Note that a gauge has crossed, though its value may still be on either side of zero by round-off."""
        self.sides[crossing.gauge] = 1.0 if crossing.rising else -1.0

    def occurrence(self, crossing: Crossing, state: State, u: np.ndarray) -> Occurrence:
        """Return what is told of a crossing."""
        return self.named(crossing, self.feed.model.measure(state), u)

    def named(self, crossing: Crossing, outputs: np.ndarray, u: np.ndarray) -> Occurrence:
        """Return what is told of a crossing, where outputs are known."""
        named = (*(e.name for e in self.events), *self.names, *self.corner_names)
        return Occurrence(named[crossing.gauge], crossing.t, crossing.rising, self._signals(outputs, u))

    def corner(self, which: int, t: float, rising: bool) -> Crossing:
        """Return that a corner is met."""
        return Crossing(t, len(self.events) + len(self.names) + which, rising)


@dataclass(frozen=True)
class _Along:
    """The gauges over a step."""

    watch: Watch
    curve: Curve
    before: Point
    after: Point

    def supply(self, state: State) -> Supply:
        return self.watch.feed.between(self.before.supply, self.after.supply, self._share(state.t), state)

    def _share(self, t: float) -> tuple[float, float]:
        h = self.after.state.t - self.before.state.t
        return (t - self.before.state.t) / h, h

    def __call__(self, t: float) -> np.ndarray:
        state = self.curve.at(t)
        return self.watch.values(state, self.supply(state).u, self.before.state)

    def events(self, t: float) -> list[float]:
        """Those of the events asked for."""
        state = self.curve.at(t)
        signals = self.watch.signals(state, self.supply(state).u)
        return [event.value(signals) for event in self.watch.events]

    def one(self, gauge: int, t: float) -> float:
        """One of them."""
        state = self.curve.at(t)
        return self.watch.value(state, self.supply(state).u, self.before.state, gauge)


def _turns(model: Model) -> np.ndarray:
    """Return how far a unit of each degree of freedom turns what it turns [rad]; nothing turns in a linear model."""
    return turning(model) / yardsticks(model) if isinstance(model, Model) else np.zeros(model.n)


def _nearly(points: Sequence[tuple[float, float]], first: float) -> float:
    """Return where the parabola through three points is zero: two between which values change sign, and one beside."""
    i = [t for t, _ in points].index(first)
    (a, fa), (b, fb) = points[i : i + 2]
    c, fc = points[i + 2] if i + 2 < len(points) else points[i - 1]
    s = (c - a) / (b - a)
    bend = (fc - fa - (fb - fa) * s) / (s * (s - 1.0))
    slope = fb - fa - bend
    q = -0.5 * (slope + math.copysign(math.sqrt(max(slope * slope - 4.0 * bend * fa, 0.0)), slope))
    roots = [root for root in (fa / q if q else 0.5, q / bend if bend else 0.5) if 0.0 <= root <= 1.0]
    return a + (b - a) * (roots[0] if roots else 0.5)


def _return(f: Callable[[float], float], a: float, b: float, fb: float, dust: float) -> float:
    """Return when what starts at zero comes back through it, having gone the other way than at b; a if it never does.

    A contact that has just broken loose may stick again within the step.
    """
    low = a
    for _ in range(_HALVINGS):
        t = 0.5 * (low + b)
        if (ft := f(t)) * fb < 0.0 and abs(ft) > dust:
            return _root(f, (t, ft), (b, fb))
        if ft * fb > 0.0:
            b, fb = t, ft
        else:
            low = t
    return a


def _root(f: Callable[[float], float], first: tuple[float, float], last: tuple[float, float]) -> float:
    """Return a root between two times to round-off; the values there hold: a curve meets them but for round-off."""
    from scipy.optimize import brentq

    known, (a, _), (b, _) = dict((first, last)), first, last
    smallest = 4e-16 * max(abs(a), abs(b)) + 1e-300
    return float(brentq(lambda t: known[t] if t in known else f(t), a, b, xtol=smallest, rtol=1e-15))
