"""Which freedom of a loop goes round: the way of a loop of rigid parts that can move in one way is followed to its end.

Where a freedom stands still on that way the others cannot follow from it: it is at a dead point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.linkages.open_linkage import span_of
from flexctrl.model.motion import Motion
from flexctrl.model.state import State

__all__ = ["going_round"]

_STEP, _LONGEST = 0.25, 40.0
_STILL = 0.01
"""Share of the fastest freedom's rate below which a freedom is no good coordinate."""

Opens = Callable[[State], np.ndarray]
"""State → how fast each loop opens with each freedom, in shares of the machine or radians, per unit."""


@frozen(eq=False)
class _Way:
    """The one way in which some of the freedoms can move."""

    motion: Motion
    opens: Opens
    unit: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    def start(self) -> np.ndarray:
        """The direction at rest."""
        return np.asarray(np.linalg.svd(self._slopes(self.motion.rest))[2][-1])

    def onwards(self, state: State, before: np.ndarray) -> np.ndarray:
        """The direction at a state, from one nearby."""
        direction = np.linalg.solve(np.vstack([self._slopes(state), before]), np.eye(len(before))[-1])
        return np.asarray(direction / np.linalg.norm(direction))

    def step(self, state: State, first: np.ndarray) -> State:
        """The state a step on, by the classical method of Runge and Kutta."""
        second = self.onwards(self._moved(state, 0.5 * first), first)
        third = self.onwards(self._moved(state, 0.5 * second), second)
        last = self.onwards(self._moved(state, third), third)
        return self._moved(state, (first + 2.0 * second + 2.0 * third + last) / 6.0)

    def directions(self) -> Iterator[np.ndarray]:
        """The directions on the way, until it is back, branches or is too long."""
        state, direction, left = self.motion.rest, self.start(), False
        for _ in range(int(_LONGEST / _STEP)):
            yield direction
            try:
                state = self.step(state, direction)
                direction = self.onwards(state, direction)
            except np.linalg.LinAlgError:
                return
            away = self._away(state)
            left = left or away > 2.0 * _STEP
            if left and away < _STEP:
                return

    def _slopes(self, state: State) -> np.ndarray:
        return self.opens(state)[np.ix_(self.rows, self.columns)]

    def _moved(self, state: State, direction: np.ndarray) -> State:
        step = np.zeros(self.motion.n)
        step[self.columns] = _STEP * self.unit[self.columns] * direction
        return self.motion.advance(state, step, state.v, 0.0)

    def _away(self, state: State) -> float:
        rest = self.motion.rest
        moved = np.abs(state.x - rest.x).max() / span_of(rest.x)
        return float(max(moved, np.abs(state.R - rest.R).max()))


def going_round(motion: Motion, opens: Opens, unit: np.ndarray, felt: np.ndarray, dependent: list[int]) -> list[int]:
    """Return which freedoms shall follow from others, so that these go on all the way where there are such.

    Parameters
    ----------
    motion : Motion
        With loops left open.
    opens : callable
        State → how fast independent loops open with each freedom.
    unit : numpy.ndarray, shape (n,)
        Of each freedom.
    felt : numpy.ndarray of bool, shape (loops, n)
        Which loops open with which freedom anywhere.
    dependent : list of int
        A choice that is good at rest. It is kept where it is good all the way, and for loops that can move in several
        ways.

    Returns
    -------
    list of int
    """
    from scipy.sparse.csgraph import connected_components

    chosen = set(dependent)
    _, group = connected_components(felt.T.astype(int) @ felt.astype(int))
    for number in range(group.max(initial=-1) + 1):
        columns = np.flatnonzero((group == number) & felt.any(axis=0))
        free = [int(i) for i in columns if i not in chosen]
        if len(free) == 1 and len(columns) > 1:
            way = _Way(motion, opens, unit, np.asarray(felt[:, columns].any(axis=1)), columns)
            best = _lasting(way, int(np.flatnonzero(columns == free[0])[0]))
            chosen = (chosen | set(free)) - {int(columns[best])}
    return sorted(chosen)


def _lasting(way: _Way, own: int) -> int:
    """Return the freedom that is never near a dead point: the given one, or else the one that stays farthest."""
    start = np.sign(way.start())
    least = np.ones(len(start))
    for direction in way.directions():
        least = np.minimum(least, start * direction / np.abs(direction).max())
        if not (least > _STILL).any():
            return own
    return own if least[own] > _STILL else int(np.argmax(least))
