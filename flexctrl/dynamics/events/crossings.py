"""Where gauges cross zero within a step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from flexctrl.dynamics.events.event import Direction
from flexctrl.dynamics.events.roots import comes_back, nearly, root
from flexctrl.dynamics.events.watch import Crossing, Watch
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.records.dense import Curve, Hermite
from flexctrl.dynamics.records.tensions import Interval
from flexctrl.dynamics.scales import once, turning, yardsticks
from flexctrl.dynamics.steps import Point
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["crossings", "met", "offset"]

_SLOPE = 1e-2
_BENT = 0.25
_TURN = 0.5  # rad between probes
_PARTS, _FINE = 4, 8  # of a step with a cubic for its motion, and with a polynomial of higher degree
_NEAR = 1e-9


def crossings(watch: Watch, curve: Curve, before: Point, after: Point, every: float | None = None) -> list[Crossing]:
    """Return where gauges cross zero over a step, in order; sides stay as they are.

    Events are looked for at the rows that are ``every`` so many seconds too.
    """
    calm = not watch.names and watch.calm(after.state, before.state)
    if calm and not watch.events:
        return []
    t, h = before.state.t, after.state.t - before.state.t
    value = _Along(watch, curve, before, after)
    last = watch.values(before.state, before.supply.u)
    ends = [(t + 0.5 * h, value(t + 0.5 * h)), (t + h, watch.values(after.state, after.supply.u, before.state))]
    watch.sizes = np.maximum(watch.sizes, np.abs([last, *(v for _, v in ends)]).max(axis=0))
    found, number = [], len(watch.events)
    clear = _clear(watch, np.array([last, *(v for _, v in ends)])[:, :number])
    probes = _probes(watch, curve, before, after, every, clear) if number else []
    seen: list[tuple[float, Sequence[float] | np.ndarray]] = [*ends, *((at, value.events(at)) for at in probes)]
    for gauge in range(number if calm else len(last)):  # corners are looked at as where there are no events
        corners = [(t, last[gauge]), *((at, v[gauge]) for at, v in (seen if gauge < number else ends))]
        found += _through(watch, gauge, _with_vertices(sorted(corners), gauge, value), value)
    return sorted(found, key=lambda c: c.t)


def met(
    watch: Watch, curves: Callable[[Point, Point], Curve], before: Point, after: Point, every: float | None = None
) -> list[Crossing]:
    """Return where gauges cross zero over a step, in order: corners where what is gone on from meets them."""
    found = crossings(watch, curves(before, after), before, after, every)
    if after.firm is after or not watch.corner_names:
        return found
    firm = crossings(watch, curves(before.firm, after.firm), before.firm, after.firm)
    corners = len(watch.events) + len(watch.names)
    both = [c for c in found if c.gauge < corners] + [c for c in firm if c.gauge >= corners]
    return sorted(both, key=lambda c: c.t)


def offset(watch: Watch, curve: Curve, before: Point, after: Point, gauge: int) -> float:
    """Return how much later than at the end of a step a gauge is zero, by its slope there: never if it has none."""
    t, h = after.state.t, after.state.t - before.state.t
    now = watch.value(after.state, after.supply.u, before.state, gauge)
    if abs(now) <= watch.dust_of(watch.sizes[gauge]):
        return 0.0
    slope = (now - _Along(watch, curve, before, after).one(gauge, t - _SLOPE * h)) / (_SLOPE * h)
    return float(-now / slope) if slope != 0.0 else math.inf


def _clear(watch: Watch, values: np.ndarray) -> bool:
    """Tell whether events stay on their sides by more than twice what they bend over a step."""
    ahead = watch.sides[: values.shape[1]] * values
    bend = np.abs(values[0] - 2.0 * values[1] + values[2])
    return bool((ahead.min(axis=0) > _BENT * bend).all() and (ahead > 0.0).all())


def _probes(watch: Watch, curve: Curve, before: Point, after: Point, every: float | None, clear: bool) -> list[float]:
    """Return where within a step, beside its middle, events are looked for."""
    t, h = before.state.t, after.state.t - before.state.t
    fastest = np.maximum(np.abs(before.state.v), np.abs(after.state.v))
    turned = h * float((fastest * once(watch.feed.model, _turns)).max(initial=0.0))
    if clear and turned <= _TURN and isinstance(curve, Hermite):
        return []
    parts = 2 * math.ceil(0.5 * max(_PARTS if isinstance(curve, Hermite) else _FINE, turned / _TURN))
    found = t + h / parts * np.arange(1, parts)
    if every is not None:
        found = np.append(found, every * np.arange(math.ceil(t / every), math.floor((t + h) / every) + 1))
    taken = np.sort(np.append(found, (t, t + h)))
    apart = taken[1:][np.diff(taken) > _NEAR * h]
    return apart[(np.abs(apart - t - 0.5 * h) > _NEAR * h) & (apart < t + (1.0 - _NEAR) * h)].tolist()


def _with_vertices(points: list[tuple[float, float]], gauge: int, value: _Along) -> list[tuple[float, float]]:
    """Add the vertices of parabolas through three points where they may lie across zero and these do not."""
    found, asked = list(points), gauge < len(value.watch.events)  # corners are let go of at zero again and again
    for (a, fa), (b, fb), (c, fc) in zip(points, points[1:], points[2:], strict=False):
        if not ((fa * fb > 0.0 or (asked and fa == 0.0)) and fb * fc > 0.0 and a < b < c):
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


def _through(watch: Watch, gauge: int, corners: Sequence[tuple[float, float]], value: _Along) -> list[Crossing]:
    side, found = watch.sides[gauge], []
    dust = watch.dusts[gauge]
    direction = watch.directions[gauge]
    for i, ((a, fa), (b, fb)) in enumerate(pairwise(corners)):
        if abs(fb) <= dust or np.sign(fb) == side:
            continue
        rising = fb > 0.0
        if side != 0.0 and direction is not (Direction.FALLING if rising else Direction.RISING):
            own = partial(value.one, gauge)
            if fa * fb > 0.0 and abs(fa) > _NEAR * watch.sizes[gauge]:  # beyond it from the start
                at = a
            elif not fa * fb < 0.0:
                at = comes_back(own, a, b, fb, dust)
            elif watch.stops(gauge):  # where exactly, is found by steps
                at = nearly(corners, a)
            else:
                at = root(own, (a, fa), (b, fb))
            low, high = corners[max(i - 1, 0)][0], corners[min(i + 2, len(corners) - 1)][0]
            found.append(Crossing(at, gauge, rising, low, high))
        side = np.sign(fb)
    return found


@frozen
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
        values = self.watch.values(state, self.supply(state).u, self.before.state)
        if self.watch.events:
            values[: len(self.watch.events)] = self._asked(state)
        return values

    def events(self, t: float) -> list[float]:
        """Those of the events asked for."""
        return self._asked(self.curve.at(t))

    def _asked(self, state: State) -> list[float]:
        outputs = self.watch.tensions.within(state, Interval(self.before.state, self.after.state, self.curve.seen))
        signals = self.watch.named_signals(outputs, self.supply(state).u)
        return [event.value(signals) for event in self.watch.events]

    def one(self, gauge: int, t: float) -> float:
        """One of them."""
        state = self.curve.at(t)
        if gauge < len(self.watch.events):
            return self._asked(state)[gauge]
        return self.watch.value(state, self.supply(state).u, self.before.state, gauge)


def _turns(model: Plant) -> np.ndarray:
    """Return how far a unit of each degree of freedom turns what it turns [rad]; nothing turns in a linear model."""
    return turning(model) / yardsticks(model) if isinstance(model, Model) else np.zeros(model.n)
