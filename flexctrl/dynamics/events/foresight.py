"""Where events may happen among many steps, told from what signals are after each of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexctrl.dynamics.events.event import Event, EventError
from flexctrl.dynamics.events.watch import Watch
from flexctrl.dynamics.steps import Point

__all__ = ["calm_steps"]

_DOUBT = 2.0
_SEEN = 1e-3
"""Of the largest value of a signal: vibrations that may count in a function of it."""
_FEWEST = 3


def calm_steps(watch: Watch, before: Point, table: np.ndarray, inputs: np.ndarray, within: np.ndarray) -> int:
    """Return how many steps are over before the first one in which an event may happen; gauges keep their sizes.

    A value may go through zero and back within a step if it bends towards zero by more than what it is from there. How
    it bends is told by the values after the steps before and beyond; doubt is the rule, as a step in doubt is only
    looked at more closely.

    Parameters
    ----------
    watch : Watch
    before : Point
        Where the steps start.
    table : numpy.ndarray, shape (steps, 1 + outputs)
        Time and outputs after each step.
    inputs : numpy.ndarray, shape (steps + 1, inputs)
        Inputs at the start and after each of them.
    within : numpy.ndarray, shape (outputs,)
        How far outputs may go to and fro within steps, which values after them do not show.

    Returns
    -------
    int
        As many as there are, if nothing happens.
    """
    count, events = len(table), watch.events
    if count < _FEWEST:
        return 0
    first = watch.asked(before.state, inputs[0])
    found = _values(watch, events, table[:, 1:], inputs[1:])
    values = np.vstack([first, found])
    t = np.append(before.state.t, table[: len(found), 0])
    ahead = watch.sides[: len(events)] * values
    sizes = np.maximum.accumulate(np.maximum(np.abs(values), watch.sizes[: len(events)]))
    clear = (ahead > watch.dust_of(sizes)) & (ahead > 0.0)
    dips = _dips(t, ahead) + np.multiply(2.0, _unseen(watch, table[:, 1:], within))
    doubtful = ~(clear[:-1] & clear[1:] & (np.minimum(ahead[:-1], ahead[1:]) > dips)).all(axis=1)
    calm = int(np.argmax(doubtful)) if doubtful.any() else len(found)
    watch.sizes[: len(events)] = sizes[calm]
    return calm


def _values(watch: Watch, events: Sequence[Event], outputs: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Values of events after each step; as far as their functions give any."""
    model = watch.feed.model
    columns: list[np.ndarray] = []
    names = (*model.outputs, *model.inputs)
    for event in events:
        if isinstance(event.of, str) and event.of in model.outputs:
            columns.append(outputs[:, model.outputs.index(event.of)] - event.at)
            continue
        column: list[float] = []
        try:
            for row in np.hstack([outputs, inputs]).tolist():
                column.append(event.value(dict(zip(names, row, strict=True))))
        except EventError:
            pass
        columns.append(np.array(column))
    least = min(len(column) for column in columns)
    return np.column_stack([column[:least] for column in columns])


def _unseen(watch: Watch, outputs: np.ndarray, within: np.ndarray) -> list[float]:
    """By how much events may be elsewhere within steps; of functions that is not known, where signals are by much."""
    names = watch.feed.model.outputs
    known = {**dict.fromkeys(watch.feed.model.inputs, 0.0), **dict(zip(names, within.tolist(), strict=True))}
    far = bool((within > _SEEN * np.abs(outputs).max(axis=0)).any())
    unknown = math.inf if far else 0.0
    return [known.get(event.of, unknown) if isinstance(event.of, str) else unknown for event in watch.events]


def _dips(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """By how much values may lie below their smaller end within each step: h²/8 of their bend, and more in doubt."""
    h = np.diff(t)[:, None]
    if len(h) < 2:
        return np.full((len(h), values.shape[1]), np.inf)
    slopes = np.diff(values, axis=0) / h
    bends = 2.0 * np.diff(slopes, axis=0) / (h[:-1] + h[1:])
    padded = np.vstack([bends[:1], bends, bends[-1:]])
    most = np.maximum(padded[:-1], padded[1:])
    change = np.abs(np.diff(padded, axis=0))
    return _DOUBT * np.maximum(most + change, 0.0) * h * h / 8.0
