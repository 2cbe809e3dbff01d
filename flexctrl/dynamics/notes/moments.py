"""Some moments of a run: where the machine was, what its law held in mind, and how long steps were there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.run import Run
from flexctrl.model.state import State

__all__ = ["Moment", "moments"]

_AROUND = 5


class Moment(NamedTuple):
    """Where a run was.

    Attributes
    ----------
    t : float
        [s]
    step : float
        Mean length of the steps about it [s].
    state : State
    supply : Supply
        In force then.
    """

    t: float
    step: float
    state: State
    supply: Supply


def moments(run: Run, count: int) -> Iterator[Moment]:
    """Yield the middles of so many equal parts of a run, as far as its steps have been kept.

    Parameters
    ----------
    run : Run
    count : int

    Yields
    ------
    Moment
    """
    track, end = run.track, run.final.t
    if not track.stretches or not end > track.starts[0]:
        return
    part = (end - track.starts[0]) / count
    for i in range(count):
        first = track.starts[0] + i * part
        around = first + part * (np.arange(_AROUND) + 0.5) / _AROUND
        middle = float(around[_AROUND // 2])
        yield Moment(middle, float(np.mean([track.step(t) for t in around.tolist()])), *track.point(middle))
