"""Tensions between the ends of steps: where places are interpolated, a stiff line is as long as it may be by chance."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flexctrl.dynamics.swift.stiff_lines import frequency_of
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State
from flexctrl.structure.outputs import Tension

__all__ = ["Interval", "Tensions"]


@frozen(eq=False)
class Interval:
    """The step that a state is within.

    Attributes
    ----------
    before, after : State
        At its start and at its end.
    seen : float
        Radians of a line's vibration in it from which on interpolated places tell nothing of its length.
    """

    before: State
    after: State
    seen: float


@frozen
class Tensions:
    """The tensions among the outputs of a machine whose lines turn: straight between the ends of long steps.

    Interpolated places are right to O(h⁴); a load that swings on a stiff rope leaves its circle by as much, and the
    rope's stiffness makes a force of that. What it bears at the ends of the step is solved for.

    Attributes
    ----------
    model : Plant
    """

    model: Plant

    @cached_property
    def _lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Which outputs are tensions of such lines, and the frequencies of these [rad/s]."""
        model = self.model
        if not (isinstance(model, Model) and model.large):
            return np.zeros(0, dtype=int), np.zeros(0)
        outputs = enumerate(model.structure.outputs)
        found = [(i, frequency_of(model, o.line)) for i, o in outputs if isinstance(o, Tension)]
        found = [(i, frequency) for i, frequency in found if frequency > 0.0]
        return np.array([i for i, _ in found], dtype=int), np.array([frequency for _, frequency in found])

    def stiff(self, h: float, seen: float) -> bool:
        """Tell whether some line turns by more than what is seen [rad] in a step of a length [s]."""
        return bool((h * self._lines[1] > seen).any())

    def within(self, state: State, interval: Interval) -> np.ndarray:
        """Return the outputs of a state that is interpolated within a step, shape (outputs,)."""
        values, before, after = self.model.measure(state), interval.before, interval.after
        h = after.t - before.t
        if not (h > 0.0 and self.stiff(h, interval.seen)):
            return values
        ends = self.model.measure(before)[None], self.model.measure(after)[None]
        return self.straight(values[None], ends, np.array([(state.t - before.t) / h]), np.array([h]), interval.seen)[0]

    def straight(
        self, values: np.ndarray, ends: tuple[np.ndarray, np.ndarray], share: np.ndarray, h: np.ndarray, seen: float
    ) -> np.ndarray:
        """Return outputs within steps with the tensions of stiff lines between those at the ends.

        Parameters
        ----------
        values : numpy.ndarray, shape (rows, outputs)
            Of interpolated states.
        ends : tuple of 2 numpy.ndarray, shape (rows, outputs)
            At the start and at the end of the step that each is in.
        share, h : numpy.ndarray, shape (rows,)
            What of the step is done, and its length [s].
        seen : float
            As in `Interval`.

        Returns
        -------
        numpy.ndarray, shape (rows, outputs)
        """
        columns, frequencies = self._lines
        if not columns.size:
            return values
        first, last = (end[:, columns] for end in ends)
        found = values.copy()
        line = first + share[:, None] * (last - first)
        found[:, columns] = np.where(h[:, None] * frequencies > seen, line, values[:, columns])
        return found
