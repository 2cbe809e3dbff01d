"""The step that the end of a run cuts short: what happens in it is told as if the run went on.

A run that goes on from its checkpoint takes that step as a whole. Here it is tried as a whole first: where it ends at
a switch or corner before the end it is no last one, and events in it are told at the instants at which the run that
goes on would find them.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.dynamics.checkpoint import Checkpoint
from flexctrl.dynamics.records.dense import Track
from flexctrl.dynamics.records.record import InMemory
from flexctrl.dynamics.records.rows import Rows

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ends_before"]


def ends_before(journey: Journey, stop: float) -> bool:
    """Keep where a run stands before the step that its end cuts short.

    Parameters
    ----------
    journey : Journey
    stop : float
        The next sample instant or break [s].

    Returns
    -------
    bool
        Whether that step, as a whole, ends at a switch or corner before the end: it has been taken then.
    """
    if journey.saved is not None:
        return False
    here = journey.snapshot()
    found = None if journey.watch.idle else _tried(journey, stop, here)
    if found is not None and found.point.state.t <= journey.plan.until:
        journey.go(stop, _beyond(journey), 1)
        return True
    if found is not None:
        journey.events += [event for event in found.events if event.t <= journey.plan.until]
        journey.told = journey.plan.until
    journey.saved = replace(here, told=journey.told)
    return False


def _tried(journey: Journey, stop: float, here: Checkpoint) -> Journey | None:
    """Return the run after the step as a whole, with the stepper as it was; None if the step fails."""
    other = _double(journey)
    try:
        other.go(stop, _beyond(journey), 1)
    except (ArithmeticError, ValueError):
        return None
    finally:
        journey.stepper.recall(here.memory)
        journey.stepper.counts.take(here.counts)
    return other


def _beyond(journey: Journey) -> float:
    return journey.plan.until + 2.0 * journey.mark.size


def _double(journey: Journey) -> Journey:
    """The run as it stands, with nothing written down."""
    rows, books, model = journey.rows, copy.copy(journey.books), journey.plan.model
    unread = InMemory().start((*model.outputs, *model.inputs))
    books.sums = replace(books.sums, moved=books.sums.moved.copy())
    watch = replace(journey.watch, sides=journey.watch.sides.copy(), sizes=journey.watch.sizes.copy())
    return replace(
        journey,
        books=books,
        watch=watch,
        rows=Rows(rows.feed, rows.every, rows.until, unread, rows.curve, rows.count),
        track=Track(rows.feed, -1.0, rows.curve),
        mark=replace(journey.mark),
        events=[],
    )
