"""A model through time, open or closed loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.first_step import first_step
from flexctrl.dynamics.alpha.method import AdaptiveAlpha
from flexctrl.dynamics.asked import check_arguments, check_rows, check_times, events_of
from flexctrl.dynamics.checkpoint import Autosave, Checkpoint, check_same, machine_of
from flexctrl.dynamics.events.event import Event
from flexctrl.dynamics.events.nearing import SMALLEST
from flexctrl.dynamics.events.watch import Watch
from flexctrl.dynamics.feed import Supply, feed_of
from flexctrl.dynamics.journey import Journey, Plan
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.dynamics.methods.checked import Checked, checked
from flexctrl.dynamics.notes.beside import can_be_told, may_grow, told_beside
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track, curves_of
from flexctrl.dynamics.records.record import InMemory, Record
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.result import result
from flexctrl.dynamics.run import Run, Tolerance
from flexctrl.dynamics.steps import Controlled, Fixed, Integrator, Mark, Reusable, Stepper
from flexctrl.dynamics.stops import Stops
from flexctrl.dynamics.swift.layers import beyond_layers
from flexctrl.dynamics.swift.settling import quasistatic
from flexctrl.dynamics.unbegun import UNASKED, unbegun
from flexctrl.errors import FlexctrlError, MechanismError, SingularMatrixError, StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.model.consistent import check_state
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State
from flexctrl.structure.freedoms import HUGE

_ROWS = 1000
_LONGER, _SECONDS = 2.0, 0.2


def simulate(
    model: Model | LinearModel,
    controller: Any = None,
    *,
    until: float,
    start: State | Rest | Checkpoint | None = None,
    inputs: Mapping[str, float] | None = None,
    method: Integrator | None = None,
    tolerance: Tolerance | None = None,
    every: float | None = None,
    events: Sequence[Event] = (),
    record: Record | None = None,
    autosave: Autosave | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run a model through time.

    Parameters
    ----------
    model : Model or LinearModel
        A linear model's state at rest is q = 0; its signals are deviations where it was made by `linearize`.
    controller : Controller, control.StateSpace or control.TransferFunction, optional
        Connected by signal names; sampled ones are held between their instants.
    until : float
        End [s].
    start : State, Rest or Checkpoint, optional
        Where to begin; default: the shape as drawn, at rest. A `Rest` brings its constant inputs along. The clock of
        a run from these begins at 0, whatever the ``t`` of the state; only a `Checkpoint` brings its time along. From a
        `Checkpoint` the run goes on as if it had not been stopped, bit for bit; model, controller, method,
        tolerance, events and ``every`` must be those of the run it was taken from. Beyond an event that ended that run
        it goes on until one happens again.
    inputs : mapping of str to float, optional
        Constant inputs, applied as a step at the start; a controller's commands add to them. A `Checkpoint` brings its
        own along, and takes no others.
    method : Integrator, optional
        Default: `AdaptiveAlpha`, steps chosen to meet ``tolerance``, with a coarser run laid beside where small
        differences may grow (`Checked`); for a linear model `Exact`, with a state at every row, or at the steps of the
        run that it goes on from.
    tolerance : Tolerance, optional
        For error-controlled methods.
    every : float, optional
        Spacing of the output [s], interpolated between steps; default: every step.
    events : sequence of Event, optional
        What to look for; what was found is in ``run.events``.
    record : InMemory or CsvStream, optional
        Where the curves go; default: into memory.
    autosave : Autosave, optional
        Checkpoints written while the run goes on.
    progress : callable, optional
        Called now and then with the fraction done.

    Returns
    -------
    Run
        Whatever happens once it has begun: a step that fails, an exception in the controller, a full disk and Ctrl-C
        end the run with their status, and all that was computed until then. So does Ctrl-C while the controller is
        asked for the first time: the run stands at its start.

    Raises
    ------
    StructureError
        For an argument of another kind, an end that is not positive or before the checkpoint, an unknown input, a
        start that the machine cannot be in (see `project`), or a checkpoint of another run.
    ControllerError
        If the controller's names are not the model's, or if it fails when it is first asked, before there is a run: it
        raises an exception (the cause of this one), or commands what is no column of finite numbers.
    MechanismError
        If a freedom has neither mass nor stiffness.
    """
    given = {"start": start, "method": method, "tolerance": tolerance, "record": record, "autosave": autosave}
    check_arguments({"model": model, "progress": progress, **given})
    check_times(until, every, start)
    if until < 1.0 / HUGE:
        raise StructureError(f"simulate: until = {until} s; expected {1.0 / HUGE:g} s at least: give a longer time")
    record = record or InMemory()
    spacing = every if record.every is None else record.every
    check_rows(until, spacing, len(model.inputs) + len(model.outputs))
    plant: Plant
    if isinstance(model, LinearModel):
        plant, method = _plant(model, method, _spacing(start, every, until))
    else:
        plant = model
        if isinstance(start, State) and model.__dict__.get("_begun") is not start:
            check_state(model, start, "simulate: start")
            model.__dict__["_begun"] = start
    feed = feed_of(plant, controller, _base(plant, start, inputs))
    asked = isinstance(method, Checked)
    method, check = checked(method or AdaptiveAlpha())
    plan = Plan(
        plant,
        feed,
        method,
        tolerance or Tolerance(),
        until,
        progress or _untold,
        autosave,
        time.perf_counter(),
    )
    with np.errstate(all="ignore"):  # what is beyond all numbers is told by the status
        journey, run = _travelled(plan, start, events_of(events), record, spacing)
        if check is None or isinstance(start, Checkpoint) or not can_be_told(journey):
            return run
        if asked or may_grow(journey):
            return _laid_beside(run, journey, check, start, spacing)
    return run


def _travelled(
    plan: Plan,
    start: State | Rest | Checkpoint | None,
    events: tuple[Event, ...],
    record: Record,
    spacing: float | None,
) -> tuple[Journey, Run]:
    """A run from its start to where it ends, and what it leaves."""
    model, feed = plan.model, plan.feed
    watch = _watch(plan, events)
    if isinstance(start, Checkpoint):
        _check_going_on(plan, start, watch, spacing)
    stepper = plan.method.stepper(model, feed, plan.tolerance)
    curve = curves_of(model, stepper)
    recorder = record.start((*model.outputs, *model.inputs), start.rows if isinstance(start, Checkpoint) else 0)
    try:
        rows = Rows(feed, spacing, plan.until, recorder, curve)
        track = Track(feed, record.states, curve)
        journey = _run(plan, stepper, start, watch, rows, track)
        return journey, result(journey)
    finally:
        recorder.close()
        if isinstance(stepper, Reusable):
            stepper.done()


def _laid_beside(run: Run, journey: Journey, method: Checked, start: State | Rest | None, spacing: float | None) -> Run:
    """The run with what a coarser one tells of it; that is ended where it takes far longer."""
    plan, end = journey.plan, run.final.t
    coarser, tolerance = method.coarser(plan.tolerance)
    latest = time.perf_counter() + _LONGER * run.report.wall_s + _SECONDS

    def ended(share: float) -> None:
        if time.perf_counter() > latest:
            raise KeyboardInterrupt

    beside = replace(plan, method=coarser, tolerance=tolerance, until=end, tell=ended, autosave=None)
    try:
        # a run that keeps no rows, as a stream does not, is compared where it ends
        _, coarse = _travelled(beside, start, (), InMemory(), spacing if len(run.t) > 1 else end)
    except (FlexctrlError, KeyboardInterrupt):
        return run
    return told_beside(run, coarse, journey, method.longer)


def _plant(linear: LinearModel, method: Integrator | None, step: float) -> tuple[LinearPlant, Integrator]:
    """A linear model as a machine, and its method; outputs that feel inputs at once are known to the exact one only."""
    from flexctrl.dynamics.linear_motion.exact import Exact

    method = method or Exact(step)
    if linear.D.any() and not isinstance(method, Exact):
        raise StructureError(f"simulate: an output of {linear.name} feels inputs at once (D ≠ 0); use the method Exact")
    return LinearPlant(linear), method


def _spacing(start: State | Rest | Checkpoint | None, every: float | None, until: float) -> float:
    """The step of the default method of linear models: a run that goes on keeps its own."""
    if isinstance(start, Checkpoint) and isinstance(start.pace, Fixed):
        return start.pace.step
    return every or until / _ROWS


def _untold(share: float) -> None:
    """Progress nobody asked for."""
    return


def _base(model: Plant, start: State | Rest | Checkpoint | None, inputs: Mapping[str, float] | None) -> np.ndarray:
    if isinstance(start, Checkpoint):
        if inputs:
            check_same("set of inputs", model.input_vector(inputs).tolist(), start.base.tolist())
        return start.base
    if inputs is not None:
        return model.input_vector(inputs)
    return start.inputs if isinstance(start, Rest) else model.input_vector({})


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
    state = model.motion.counted(state)
    supply = plan.feed.first(state)
    state = model.switches.begin(state, supply.u)
    stops = Stops(plan.feed.sample_time, plan.feed.breaks)
    stops.skip(0.0)
    state, supply, notes = beyond_layers(plan.feed, state, supply, pace, plan.tolerance)
    size = pace.step if isinstance(pace, Fixed) else _first(plan, pace, state, supply, min(stops.next, plan.until))
    try:
        point = stepper.start(state, supply, size)
    except SingularMatrixError as error:
        name = model.coordinates[error.where]
        raise MechanismError(
            f"simulate: {name} has neither mass nor stiffness; hold it with a Support, or give the part "
            "rotary inertia (rhoJ, rhoI) or mass"
        ) from None
    watch.begin(point)
    books = Books(plan.feed, point.state, plan.method, plan.tolerance)
    books.turn(point, size)
    journey = Journey(plan, stepper, point, stops, books, watch, rows, track, Mark(size), notes=notes)
    if moved := [model.coordinates[i] for i in quasistatic(model) if point.state.q[i] != state.q[i]]:
        journey.notes += (f"{', '.join(moved)}: moved by the start's inputs to where forces balance, as without mass",)
    rows.here(point, 0.0)
    return journey


def _first(plan: Plan, pace: Controlled, state: State, supply: Supply, span: float) -> float:
    """The first step, as asked for or from how the machine sets out."""
    if pace.first is None:
        first = first_step(plan.feed, state, supply, pace, plan.tolerance, span)
        return max(first, SMALLEST * plan.until)
    return min(pace.first, pace.largest)


def _check_going_on(plan: Plan, start: Checkpoint, watch: Watch, every: float | None) -> None:
    """Raise unless a run goes on as it was; its controller is asked later, on a model that is its own."""
    check_same("model", machine_of(plan.model), start.machine)
    check_same("method", repr(plan.method), start.method)
    check_same("tolerance", plan.tolerance, start.tolerance)
    check_same("number of events", watch.count if start.passed != UNASKED else 0, len(start.sides))
    check_same("spacing of rows (every)", every, start.every)
    check_same("controller", plan.feed.told_law, start.law)


def _resumed(plan: Plan, stepper: Stepper[Any], start: Checkpoint, watch: Watch, rows: Rows, track: Track) -> Journey:
    """A run that goes on."""
    if start.passed == UNASKED:
        return _begun(plan, stepper, start.point.state, watch, rows, track)
    check_same("controller", len(plan.feed.first(start.point.state).x), len(start.point.supply.x))
    stepper.recall(start.memory)
    stepper.counts.take(start.counts)
    watch.sides, watch.sizes, watch.span = start.sides.copy(), start.sizes.copy(), start.span
    books = Books(plan.feed, start.point.state, plan.method, plan.tolerance)
    books.sums, books.first = replace(start.sums), start.first
    stops = Stops(plan.feed.sample_time, plan.feed.breaks, start.passed, start.found)
    plan.feed.met[:] = [start.found]
    rows.count = start.rows
    journey = Journey(plan, stepper, start.point, stops, books, watch, rows, track, replace(start.mark))
    journey.told, journey.balked = start.told, start.balked
    return journey


__all__ = ["simulate"]
