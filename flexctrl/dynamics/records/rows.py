"""The rows of a run: at every step, or at instants evenly spaced whatever the steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.inputs import Inputs
from flexctrl.dynamics.march.weaving import Weaver
from flexctrl.dynamics.records.dense import Curve, Hermite
from flexctrl.dynamics.records.digest import Digested
from flexctrl.dynamics.records.frames import Frames, Later
from flexctrl.dynamics.records.record import Recorder
from flexctrl.dynamics.records.tensions import Interval, Tensions
from flexctrl.dynamics.steps import Fixed, Pace, Point
from flexctrl.model.state import State

__all__ = ["Rows"]

_FRAMES, _FEWEST, _BYTES = 120, 24, 48e6
"""States kept for drawing: about so many, fewer of large machines."""
_NEAR = 1e-9
_ROUND_OFF = 1e-15
_UNREAD = np.zeros(0)


@dataclass
class Rows:
    """What is written of a run.

    Attributes
    ----------
    feed : Feed
    every : float or None
        Spacing [s]; None: every step.
    until : float
        End of the run [s]; some 120 states on the way are kept for drawing, some 24 of large machines.
    recorder : Recorder
    curve : callable
        (point before, point after) → the motion over that step.
    count : int
        Number of the next row.
    """

    feed: Feed
    every: float | None
    until: float
    recorder: Recorder
    curve: Callable[[Point, Point], Curve]
    count: int = 0
    frames: Frames = field(default_factory=Frames)

    def here(self, point: Point, slack: float, read: np.ndarray = _UNREAD) -> None:
        """Write the row of a point, if one is due within some slack; what has been read there is not measured again."""
        if self.every is None or abs(self.count * self.every - point.state.t) <= slack:
            self._write(point.state, read if read.size else self.feed.model.measure(point.state), point.supply.u)

    def within(self, before: Point, after: Point, to_jump: bool) -> None:
        """Write the rows within a step, and the one at its end unless inputs are about to jump there."""
        every, t, h = self.every, after.state.t, after.state.t - before.state.t
        curve, near = None, _near(t, h)
        while every is not None and (row := self.count * every) < t - near:
            curve = curve or self.curve(before, after)
            state = curve.at(row)
            share = ((row - before.state.t) / h, h)
            u = self.feed.between(before.supply, after.supply, share, state).u
            self._write_between(state, Interval(before.state, after.state, curve.seen), u)
        if not to_jump:
            self.here(after, near)

    def _among(self, start: State, times: np.ndarray, states: Sequence[State], supply: Supply, to_jump: bool) -> None:
        """Write the rows within many steps."""
        kept, near = len(times) - to_jump, _near(times[-1], times[0] - start.t)
        assert self.every is not None
        while (row := self.count * self.every) <= times[-1] + near:
            i = int(np.searchsorted(times, row - near))
            state = states[i]
            if abs(times[i] - row) > near:
                before, after = (Point(end, np.zeros(0), supply) for end in (states[i - 1] if i else start, state))
                curve = self.curve(before, after)
                self._write_between(curve.at(row), Interval(before.state, state, curve.seen), supply.u)
                continue
            if i >= kept:
                return
            self._write(state, self.feed.model.measure(state), supply.u)

    def between(self, weaver: Weaver, table: np.ndarray, inputs: Inputs, to_jump: bool) -> None:
        """Write the rows within many steps whose states a weaver knows, and at their ends.

        Parameters
        ----------
        weaver : Weaver
        table : numpy.ndarray, shape (steps, 1 + outputs)
            Time and outputs after each step.
        inputs : Inputs
        to_jump : bool
            Whether inputs are about to jump at the end of the last one.
        """
        times, every = table[:, 0], self.every
        weaver.times(times)
        near = _NEAR * np.diff(times, prepend=weaver.t) + _ROUND_OFF * times
        due = times if every is None else every * np.arange(self.count, int((times[-1] + near[-1]) / every) + 2)
        due = due[due <= times[-1] + near[-1]]
        steps = np.searchsorted(times + near, due)
        ends = np.abs(times[steps] - due) <= near[steps]
        wanted = ~ends | (steps < len(table) - to_jump)
        steps, due, ends = steps[wanted], due[wanted], ends[wanted]
        if len(due):
            rows, drawn = weaver.rows(steps, np.where(ends, times[steps], due), ends, *self.due())
            rows[ends] = table[steps[ends]]
            self._straighten(rows, table, steps, ends, weaver)
            for states in drawn:
                self.frames.take(states)
            self.count += len(due)
            self.recorder.rows(rows, inputs.at(steps, ends, rows))
        weaver.go_on(len(table))

    def _straighten(
        self, rows: np.ndarray, table: np.ndarray, steps: np.ndarray, ends: np.ndarray, weaver: Weaver
    ) -> None:
        """Put tensions of stiff lines right in rows within steps."""
        h = np.diff(table[:, 0], prepend=weaver.t)
        if ends.all() or not self.tensions.stiff(float(h.max()), Hermite.seen):
            return
        start = np.array([weaver.t, *weaver.reading(0, weaver.t)])
        at, t, before = steps[~ends], rows[~ends, 0], np.vstack([start, table[:-1]])
        share = (t - before[at, 0]) / h[at]
        within = before[at, 1:], table[at, 1:]
        rows[~ends, 1:] = self.tensions.straight(rows[~ends, 1:], within, share, h[at], Hermite.seen)

    @cached_property
    def tensions(self) -> Tensions:
        """Those among the outputs."""
        return Tensions(self.feed.model)

    def on_steps(self, pace: Pace, sample: float, t: float) -> bool:
        """Tell whether rows are due at the ends of steps only, as these are from a time on."""
        if self.every is None or (sample > 0.0 and _whole(self.every / sample)):
            return True
        return (
            isinstance(pace, Fixed)
            and not self.feed.breaks
            and all(_whole(s / pace.step) for s in (self.every, sample, t))
        )

    def due(self) -> tuple[float, float]:
        """Return when the next state for drawing is due, and their spacing; runs that are laid beside are not drawn."""
        if isinstance(self.recorder, Digested):
            return math.inf, self.until
        return (self.frames.last + self._spacing if self.frames else 0.0), self._spacing

    @cached_property
    def _spacing(self) -> float:
        rest = self.feed.model.rest
        size = 8.0 * (12 * len(rest.x) + 5 * rest.q.size)
        return self.until / min(_FRAMES, max(_FEWEST, int(_BYTES / size))) * (1 - _NEAR)

    def ridden(
        self,
        start: State,
        table: np.ndarray,
        states: Sequence[State],
        supply: Supply,
        inputs: Inputs,
        to_jump: bool,
    ) -> None:
        """Write the rows of many steps: times and outputs, and all states or those due for drawing."""
        times, kept = table[:, 0], len(table) - to_jump
        if self.every is not None and len(states) == len(table):
            return self._among(start, times, states, supply, to_jump)
        self.frames.take(states)
        chosen = np.arange(kept)
        if self.every is not None:
            near = _near(times[-1], times[0] - start.t)
            ahead = int((times[-1] + near) / self.every) + 1
            wanted = np.searchsorted(times, self.every * np.arange(self.count, ahead) - near)
            chosen = wanted[wanted < kept]
        self.count += len(chosen)
        self.recorder.rows(table[chosen], inputs.at(chosen, np.ones(len(chosen), dtype=bool), table[chosen]))

    def sampled(self, table: np.ndarray, commands: np.ndarray, states: Later, slack: float) -> None:
        """Write the rows of many steps with inputs of their own, and keep the states due for drawing."""
        if self.every is not None:
            times = table[:, 0]
            ahead = int((times[-1] + slack) / self.every) + 1
            found = np.searchsorted(times, self.every * np.arange(self.count, ahead) - slack)
            chosen = found[found < len(times)]
            if len(states) == len(table):
                states = states.picked(chosen)
            table, commands = table[chosen], commands[chosen]
        self.frames.take(states)
        self.count += len(table)
        self.recorder.rows(table, commands)

    def row(self, t: float, y: np.ndarray, u: np.ndarray, slack: float) -> bool:
        """Write the row of an instant whose outputs are known, if one is due within some slack; tell whether it was."""
        due = self.every is None or abs(self.count * self.every - t) <= slack
        if due:
            self.count += 1
            self.recorder.row(t, y, u)
        return due

    def finish(self, state: State, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Write the row of the end, if the last one is before it, and return all rows."""
        rows = self.recorder.table()
        if not len(rows) or rows[-1, 0] < state.t - 1e-12 * self.until:
            self._write(state, y, u)
            rows = self.recorder.table()
        return rows

    def _write(self, state: State, y: np.ndarray, u: np.ndarray) -> None:
        self.count += 1
        self.recorder.row(state.t, y, u)
        self.frame(state)

    def _write_between(self, state: State, interval: Interval, u: np.ndarray) -> None:
        self.count += 1
        self.recorder.row(state.t, self.tensions.within(state, interval), u)
        self.frame(state)

    def frame(self, state: State) -> None:
        """Keep a state for drawing, if one is due."""
        if state.t >= self.due()[0]:
            self.frames.append(state)

    def drawn(self, later: Later) -> None:
        """Keep a state for drawing that is to be made yet, if one is due."""
        if later.last >= self.due()[0]:
            self.frames.take(later)


def _near(t: float, h: float) -> float:
    """Return by how much a row may be off the end of a step of length h at t."""
    return _NEAR * h + _ROUND_OFF * t


def _whole(ratio: float) -> bool:
    """Tell whether a number is whole but for round-off."""
    return abs(ratio - round(ratio)) < _NEAR * max(1.0, 1e-6 * ratio)
