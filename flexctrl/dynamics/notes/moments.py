"""Some moments of a run: where the machine was, what its law held in mind, and how long steps were there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.records.dense import Track
from flexctrl.model.state import State

__all__ = ["FEW", "PARTLY", "PARTS", "Moment", "moments", "step_about"]

PARTS, FEW, PARTLY = 8, 60, 0.5
"""In how many parts of a run loops are looked at, of up to how many states; powers of e that steps may miss in them."""
_AROUND = 5


class Moment(NamedTuple):
    """Where a run was.

    Attributes
    ----------
    state : State
    supply : Supply
        In force then.
    part : float
        How long a time this one stands for [s].
    """

    state: State
    supply: Supply
    part: float


def moments(track: Track, end: float, count: int) -> Iterator[Moment]:
    """Yield the middles of so many equal parts of a run, as far as its steps have been kept.

    Parameters
    ----------
    track : Track
    end : float
        Of the run [s].
    count : int

    Yields
    ------
    Moment
    """
    if track.stretches and end > track.starts[0]:
        part = (end - track.starts[0]) / count
        for i in range(count):
            yield Moment(*track.point(track.starts[0] + (i + 0.5) * part), part)


def step_about(track: Track, moment: Moment) -> float:
    """Return the mean length of steps about a moment [s].

    Parameters
    ----------
    track : Track
    moment : Moment

    Returns
    -------
    float
    """
    shares = (np.arange(_AROUND) + 0.5) / _AROUND - 0.5
    return float(np.mean([track.step(t) for t in (moment.state.t + moment.part * shares).tolist()]))
