"""A run that Ctrl-C ends before its first step: it stands where it was to begin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexctrl.dynamics.checkpoint import Checkpoint
from flexctrl.dynamics.events.watch import Watch
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.journey import Journey, Plan
from flexctrl.dynamics.origin import Origin
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.run import Status
from flexctrl.dynamics.steps import Mark, Point, Stepper
from flexctrl.dynamics.stops import Stops
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["UNASKED", "unbegun"]

UNASKED = -1
"""Stops that a checkpoint has passed whose controller has not been asked: from there a run begins."""


def unbegun(
    plan: Plan,
    stepper: Stepper[Any],
    start: State | Rest | Checkpoint | None,
    watch: Watch,
    rows: Rows,
    track: Track,
) -> Journey:
    """Return a run that is over where it was to begin, or to go on.

    Parameters
    ----------
    plan : Plan
    stepper : Stepper
    start : State, Rest, Checkpoint or None
    watch : Watch
    rows : Rows
    track : Track

    Returns
    -------
    Journey
    """
    model, none = plan.model, np.zeros(0)
    if isinstance(start, Checkpoint):
        point, origin = start.point, start.origin
    else:
        state = start.state if isinstance(start, Rest) else start or model.rest
        point = Point(model.motion.counted(state.with_(t=0.0)), np.zeros(model.n), Supply(plan.feed.base, none, none))
        origin = Origin(point.state, none)
    books = Books(plan.feed, point.state, plan.method, plan.tolerance)
    mark = replace(start.mark) if isinstance(start, Checkpoint) else Mark(0.0)
    journey = Journey(plan, stepper, point, Stops(0.0, ()), books, watch, rows, track, mark, origin)
    journey.status = Status.INTERRUPTED
    journey.message = f"interrupted at t = {point.state.t:.6g} s, before the first step"
    if isinstance(start, Checkpoint):
        books.sums, books.first, journey.saved = replace(start.sums), start.first, start
    else:
        journey.saved = replace(journey.snapshot(), passed=UNASKED, rows=0)
    return journey
