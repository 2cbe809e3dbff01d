"""Coordinates of a machine's shapes from the shape at the start of a step: where methods on the group work."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import logarithm
from flexctrl.model.linkages.chart import Chart
from flexctrl.model.linkages.charting import chart_of
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Local"]


@frozen(eq=False)
class Local:
    """Displacements, rotation vectors and turns since a start, and their rates from quasi-velocities.

    As in `flexctrl.model.linkages.chart.Chart`, whose reference moves on from step to step: rotations are the
    exponential of their coordinates, and a rotation that wanders about a held axis has a coordinate more.

    Attributes
    ----------
    model : Plant
    """

    model: Plant

    @cached_property
    def _chart(self) -> Chart | None:
        return chart_of(self.model, self.model.rest) if isinstance(self.model, Model) and self.model.large else None

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return len(self._chart.names) if self._chart is not None else self.model.n

    @cached_property
    def swirls(self) -> bool:
        """Whether the coordinates' own turning adds to accelerations."""
        return self._chart is not None and bool(self._chart.lines)

    def place(self, start: State, xi: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state at some coordinates from a start.

        Parameters
        ----------
        start : State
        xi : numpy.ndarray, shape (coordinates,)
        v : numpy.ndarray, shape (n,)
            Rates of the degrees of freedom.
        t : float
        """
        if self._chart is None or self.count == self.model.n:
            return self.model.advance(start, xi, v, t)
        moved = self._chart.motion.advance(self._widened(start), xi, xi, t)
        return replace(moved, q=start.q + xi[: self.model.n], v=v)

    def rates(self, start: State, xi: np.ndarray, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return how fast the coordinates change, and what their own turning adds to the accelerations."""
        if self._chart is None:
            return state.v, np.zeros(self.model.n)
        return self._from(start, self._chart).rate(xi, state)

    def between(self, start: State, end: State) -> np.ndarray:
        """Return the coordinates of the end of a step from its start."""
        xi = np.append(end.q - start.q, np.zeros(self.count - self.model.n))
        for turning in self._chart.rotations if self._chart is not None else ():
            if min(turning.coordinates) >= 0 and max(turning.coordinates) >= self.model.n:
                xi[list(turning.coordinates)] = logarithm((end.R[turning.node] @ start.R[turning.node].T)[None])[0]
        return xi

    def _from(self, start: State, chart: Chart) -> Chart:
        """The chart about a start: asked for at every stage of a step."""
        if self.__dict__.get("_last", (None,))[0] is not start:
            self.__dict__["_last"] = start, replace(chart, reference=self._widened(start))
        return self.__dict__["_last"][1]

    def _widened(self, state: State) -> State:
        return replace(state, q=np.append(state.q, np.zeros(self.count - self.model.n)), v=np.zeros(self.count))
