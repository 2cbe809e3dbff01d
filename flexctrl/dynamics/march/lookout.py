"""Events among marched steps from sample to sample: steps are looked at one by one, in their middles and at their ends.

What is found of a step depends on that step alone, so that it does not matter how many are looked at at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexctrl.dynamics.events.event import Event, EventError
from flexctrl.dynamics.events.watch import Watch
from flexctrl.dynamics.march.weaving import Weaver
from flexctrl.model.state import State

__all__ = ["FAR", "Lookout"]

FAR = 1.5
"""What turns farther within a step [rad] is left to a plain one, which looks at it in many places."""

_DOUBT = 0.25  # twice what the parabola through both ends and the middle may lie below the least of them


class Lookout:
    """Looks for events behind a march.

    Parameters
    ----------
    watch : Watch
    weaver : Weaver
        Knows the states after the steps.
    state : State
        Where they start.
    turns : numpy.ndarray
        How far a unit of each degree of freedom, in the order of elimination, turns what it turns [rad].
    """

    def __init__(self, watch: Watch, weaver: Weaver, state: State, turns: np.ndarray) -> None:
        self.turns = turns
        self.watch, self.weaver = watch, weaver
        model = watch.feed.model
        self.last = model.measure(state).tolist()
        self.names = (*model.outputs, *model.inputs)
        self.sides_of(watch)
        self.steady = [isinstance(e.of, str) and e.of in model.outputs for e in watch.events]
        self.places = [self.names.index(e.of) if isinstance(e.of, str) else -1 for e in watch.events]

    def sides_of(self, watch: Watch) -> None:
        """Take up the side that each event is on."""
        self.sides = watch.sides[: len(watch.events)].tolist()

    def calm(self, table: np.ndarray, inputs: np.ndarray) -> tuple[int, int]:
        """Return how many steps nothing happens in, and after how many an event may be brought about by a jump.

        Parameters
        ----------
        table : numpy.ndarray, shape (steps, 1 + outputs)
            Time and outputs after each step.
        inputs : numpy.ndarray, shape (steps + 1, inputs)
            In force over each step, and after the last one.
        """
        watch, count = self.watch, len(table)
        if not count:
            return 0, 1
        y = np.vstack([self.last, table[:, 1:]])
        times = np.append(self.weaver.t, table[:, 0])
        middle = 0.5 * (times[:-1] + times[1:])
        steps, within = np.arange(count), np.zeros(count, dtype=bool)
        between = self.weaver.rows(steps, middle, within, np.inf, np.inf)[0][:, 1:]
        parts = (y[:-1], between, y[1:])
        found = np.array([self._values(part, inputs[:-1]) for part in parts])
        after = found[2] if all(self.steady) else self._values(y[1:], inputs[1:])
        number = len(watch.events)
        sides = watch.sides[:number]
        sizes = np.fmax.accumulate(np.fmax(np.abs(found).max(axis=0), watch.sizes[:number]))
        clear = self._clear(found, sides, watch.dust_of(sizes))
        held = (sides * after > watch.dust_of(sizes)) | (sides == 0.0)
        turned = np.diff(times) * (np.abs(self.weaver.rates(count)) * self.turns).max(axis=1, initial=0.0)
        doubtful, jumpy = ~clear.all(axis=1) | (turned > FAR), ~held.all(axis=1)
        quiet = int(np.argmax(doubtful)) if doubtful.any() else count
        jumps = int(np.argmax(jumpy)) + 1 if jumpy.any() else count + 1
        return quiet, jumps

    def _clear(self, found: np.ndarray, sides: np.ndarray, dusts: np.ndarray) -> np.ndarray:
        """Where values stay on their side, or where they have not left zero."""
        ahead = sides * found
        bend = np.abs(found[0] - 2.0 * found[1] + found[2])
        away = (ahead > dusts).all(axis=0) & (ahead.min(axis=0) > _DOUBT * bend)
        return away | ((sides == 0.0) & (np.abs(found) <= dusts).all(axis=0))

    def pass_by(self, table: np.ndarray, inputs: np.ndarray) -> None:
        """Note steps in which nothing happened, and how large values have been after them."""
        if len(table):
            sizes, most = self.watch.sizes, np.abs(self._values(table[:, 1:], inputs[:-1])).max(axis=0)
            sizes[: len(most)] = np.maximum(sizes[: len(most)], most)
            self.last = table[-1, 1:].tolist()

    def passes(self, first: int, last: int, begun: float, rows: np.ndarray, u: list[float]) -> bool:
        """Tell whether nothing happens in some steps under the same inputs that start at a time; note them then."""
        before, sizes, grown = self.last, self.watch.sizes.tolist(), False
        for step in range(first, last):
            t, *now = rows[step].tolist()
            middle = self.weaver.reading(step, 0.5 * (begun + t))
            for i, event in enumerate(self.watch.events):
                place = self.places[i]
                if self.steady[i]:
                    three = [before[place] - event.at, middle[place] - event.at, now[place] - event.at]
                else:
                    three = [self._value(event, place, (*y, *u)) for y in (before, middle, now)]
                size = max(abs(three[0]), abs(three[2]))
                if size > sizes[i]:
                    sizes[i], grown = size, True
                if not _is_clear(three, self.sides[i], self.watch.dust_of(sizes[i])):
                    return False
            before, begun = now, t
        self.last = before
        if grown:
            self.watch.sizes[:] = sizes
        return True

    def leaps(self, row: np.ndarray, u: list[float], stands: bool) -> bool:
        """Tell whether inputs that have jumped may bring about an event; ``stands``: one may be at zero already."""
        signals = (*row[1:].tolist(), *u)
        for i, event in enumerate(self.watch.events):
            if (stands or not self.steady[i]) and self.sides[i] != 0.0:
                ahead = self.sides[i] * self._value(event, self.places[i], signals)
                if not ahead > self.watch.dust_of(self.watch.sizes[i]):
                    return True
        return False

    def _value(self, event: Event, place: int, signals: Sequence[float]) -> float:
        if place >= 0:
            return signals[place] - event.at
        return self._worked_out(event, [signals]).item()

    def _values(self, outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Values of events, NaN where their functions give none; shape (steps, events)."""
        signals = np.hstack([outputs, inputs])
        columns = [
            signals[:, place] - event.at if place >= 0 else self._worked_out(event, signals.tolist())
            for event, place in zip(self.watch.events, self.places, strict=True)
        ]
        return np.column_stack(columns)

    def _worked_out(self, event: Event, rows: Sequence[Sequence[float]]) -> np.ndarray:
        column: list[float] = []
        try:
            for row in rows:
                column.append(event.value(dict(zip(self.names, row, strict=True))))
        except EventError:
            column += [np.nan] * (len(rows) - len(column))
        return np.array(column)


def _is_clear(three: Sequence[float], side: float, dust: float) -> bool:
    """Tell whether values at both ends and in the middle of a step say that it does not leave its side."""
    a, b, c = three
    if side == 0.0:
        return abs(a) <= dust and abs(b) <= dust and abs(c) <= dust
    least = min(side * a, side * b, side * c)
    return least > dust and least > _DOUBT * abs(a - 2.0 * b + c)
