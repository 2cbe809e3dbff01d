"""A run from where it begins to where it ends: how it sets out, or goes on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from flexctrl.dynamics.alpha.first_step import first_step
from flexctrl.dynamics.checkpoint import Checkpoint, check_same, machine_of
from flexctrl.dynamics.events.event import Event
from flexctrl.dynamics.events.nearing import SMALLEST
from flexctrl.dynamics.events.watch import Watch
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.interrupt import heed
from flexctrl.dynamics.journey import Journey, Plan
from flexctrl.dynamics.origin import Origin
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track, curves_of
from flexctrl.dynamics.records.digest import watched
from flexctrl.dynamics.records.record import Record
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.result import result
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.steps import Controlled, Fixed, Mark, Reusable, Stepper
from flexctrl.dynamics.stops import Stops
from flexctrl.dynamics.swift.layers import beyond_layers
from flexctrl.dynamics.swift.light_motors import seated
from flexctrl.dynamics.swift.settling import quasistatic
from flexctrl.dynamics.unbegun import UNASKED, unbegun
from flexctrl.dynamics.unheld import needed
from flexctrl.errors import MechanismError, SingularMatrixError
from flexctrl.model.equilibrium import Rest
from flexctrl.model.state import State

__all__ = ["travelled"]

_DIGITS = 12


def travelled(
    plan: Plan,
    start: State | Rest | Checkpoint | None,
    events: tuple[Event, ...],
    record: Record,
    spacing: float | None,
) -> tuple[Journey, Run]:
    """Return a run from its start to where it ends, and what it leaves: of what is streamed a digest.

    Parameters
    ----------
    plan : Plan
    start : State, Rest, Checkpoint or None
    events : tuple of Event
    record : Record
    spacing : float or None
        Of rows [s]; None: every step.

    Returns
    -------
    Journey, Run
    """
    model, feed = plan.model, plan.feed
    watch = _watch(plan, events)
    if isinstance(start, Checkpoint):
        _check_going_on(plan, start, watch, spacing)
    stepper = plan.method.stepper(model, feed, plan.tolerance)
    curve = curves_of(model, stepper)
    recorder = watched(record, (*model.outputs, *model.inputs), start.rows if isinstance(start, Checkpoint) else 0)
    try:
        rows = Rows(feed, spacing, plan.until, recorder, curve)
        track = Track(feed, record.states, curve)
        journey = _run(plan, stepper, start, watch, rows, track)
        return journey, result(journey)
    finally:
        recorder.close()
        if isinstance(stepper, Reusable):
            stepper.done()


def _run(
    plan: Plan,
    stepper: Stepper[Any],
    start: State | Rest | Checkpoint | None,
    watch: Watch,
    rows: Rows,
    track: Track,
) -> Journey:
    try:
        if isinstance(start, Checkpoint):
            journey = _resumed(plan, stepper, start, watch, rows, track)
        else:
            journey = _begun(plan, stepper, start, watch, rows, track)
    except KeyboardInterrupt:
        return unbegun(plan, stepper, start, watch, rows, track)
    journey.travel()
    return journey


def _watch(plan: Plan, events: tuple[Event, ...]) -> Watch:
    switches, kinks = plan.model.switches, plan.model.kinks.met
    return Watch(plan.feed, events, switches.gaps, switches.names, kinks.values, kinks.names, kinks.ends, kinks.dust)


def _begun(
    plan: Plan,
    stepper: Stepper[Any],
    start: State | Rest | None,
    watch: Watch,
    rows: Rows,
    track: Track,
) -> Journey:
    """A run from a state."""
    model, pace = plan.model, plan.method.pace
    state = (start.state if isinstance(start, Rest) else start or model.rest).with_(t=0.0)
    drawn = model.motion.counted(state)
    supply = plan.feed.first(drawn)
    state = model.switches.begin(seated(model, drawn, supply.u), supply.u)
    stops = Stops(plan.feed.sample_time, plan.feed.breaks)
    stops.skip(0.0)
    state, supply, notes = beyond_layers(plan.feed, state, supply, pace, plan.tolerance)
    size = pace.step if isinstance(pace, Fixed) else _first(plan, pace, state, supply, stops.next)
    try:
        point = stepper.start(state, supply, size)
    except SingularMatrixError as error:
        name = model.coordinates[error.where]
        raise MechanismError(f"simulate: {name} has neither mass nor stiffness; {needed(model, error.where)}") from None
    heed()
    watch.begin(point)
    books = Books(plan.feed, point.state, plan.method, plan.tolerance)
    books.turn(point, size)
    origin = Origin(drawn, point.supply.u)
    journey = Journey(plan, stepper, point, stops, books, watch, rows, track, Mark(size), origin, notes=notes)
    if moved := [model.coordinates[i] for i in quasistatic(model) if point.state.q[i] != state.q[i]]:
        journey.notes += (f"{', '.join(moved)}: moved by the start's inputs to where forces balance, as without mass",)
    rows.here(point, 0.0)
    return journey


def _first(plan: Plan, pace: Controlled, state: State, supply: Supply, span: float) -> float:
    """The first step, as asked for or from how the machine sets out.

    Where the run ends does not count if inputs jump somewhere: it may go on from there.
    """
    span = span if math.isfinite(span) else plan.until
    if pace.first is None:
        first = first_step(plan.feed, state, supply, pace, plan.tolerance, span)
        return max(first, SMALLEST * plan.until)
    return min(pace.first, pace.largest)


def _check_going_on(plan: Plan, start: Checkpoint, watch: Watch, every: float | None) -> None:
    """Raise unless a run goes on as it was; its controller is asked later, on a model that is its own."""
    digests = (digest[:_DIGITS] for digest in (machine_of(plan.model), start.machine))
    check_same("model, by the digest of its names, effects and numbers", *digests)
    check_same("method", repr(plan.method), start.method)
    check_same("tolerance", plan.tolerance, start.tolerance)
    check_same("number of events", len(watch.events), len(start.events))
    for now, before in zip(watch.told, start.events, strict=True):
        check_same("event", now, before)
    check_same("spacing of rows (every)", every, start.every)
    check_same("controller", plan.feed.told_law, start.law)


def _resumed(plan: Plan, stepper: Stepper[Any], start: Checkpoint, watch: Watch, rows: Rows, track: Track) -> Journey:
    """A run that goes on."""
    if start.passed == UNASKED:
        return _begun(plan, stepper, start.point.state, watch, rows, track)
    states = len(plan.feed.first(start.point.state).x)
    check_same("controller, by how many states it has", states, len(start.point.supply.x))
    stepper.recall(start.memory)
    stepper.counts.take(start.counts)
    watch.sides, watch.sizes, watch.span = start.sides.copy(), start.sizes.copy(), start.span
    books = Books(plan.feed, start.point.state, plan.method, plan.tolerance)
    books.sums, books.first = replace(start.sums), start.first
    rows.count = start.rows
    stops, mark = _stops(plan, start), replace(start.mark)
    origin = start.origin.gone_on(start.t)
    journey = Journey(plan, stepper, start.point, stops, books, watch, rows, track, mark, origin, begin=start.t)
    journey.told, journey.balked = start.told, start.balked
    journey.read = start.point, start.read
    return journey


def _stops(plan: Plan, saved: Checkpoint) -> Stops:
    """What is ahead of a run that goes on."""
    plan.feed.meet(saved.found)
    return Stops(plan.feed.sample_time, plan.feed.breaks, saved.passed, saved.found)
