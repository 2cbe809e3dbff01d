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
from flexctrl.dynamics.notes.adding import Drift, drifted
from flexctrl.dynamics.notes.straying import strayed
from flexctrl.dynamics.notes.unsized import unsized
from flexctrl.dynamics.notes.unsure import unsure
from flexctrl.dynamics.records.books import Books
from flexctrl.dynamics.records.dense import Track, curves_of
from flexctrl.dynamics.records.record import InMemory, Record, Unwritten
from flexctrl.dynamics.records.rows import Rows
from flexctrl.dynamics.run import EnergyBalance, Report, Run, Status, Tolerance
from flexctrl.dynamics.steps import Controlled, Fixed, Integrator, Mark, Reusable, Stepper
from flexctrl.dynamics.stops import Stops
from flexctrl.dynamics.swift.layers import beyond_layers
from flexctrl.dynamics.swift.settling import quasistatic
from flexctrl.dynamics.unbegun import UNASKED, unbegun
from flexctrl.errors import MechanismError, SingularMatrixError, StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.model.consistent import check_state
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State
from flexctrl.structure.freedoms import HUGE

_ROWS = 1000


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
        Constant inputs, applied as a step at the start; a controller's commands add to them.
    method : Integrator, optional
        Default: `AdaptiveAlpha`, steps chosen to meet ``tolerance``; for a linear model `Exact`, with a state at
        every row, or at the steps of the run that it goes on from.
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
    tell = progress or _untold
    plan = Plan(
        plant, feed, method or AdaptiveAlpha(), tolerance or Tolerance(), until, tell, autosave, time.perf_counter()
    )
    watch = _watch(plan, events_of(events))
    if isinstance(start, Checkpoint):
        _check_going_on(plan, start, watch, spacing)
    stepper = plan.method.stepper(plant, feed, plan.tolerance)
    curve = curves_of(plant, stepper)
    recorder = record.start((*plant.outputs, *plant.inputs), start.rows if isinstance(start, Checkpoint) else 0)
    try:
        rows = Rows(feed, spacing, until, recorder, curve)
        track = Track(feed, record.states, curve)
        return _run(plan, stepper, start, watch, rows, track)
    finally:
        recorder.close()
        if isinstance(stepper, Reusable):
            stepper.done()


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
    if inputs is not None:
        return model.input_vector(inputs)
    if isinstance(start, Checkpoint):
        return start.base
    return start.inputs if isinstance(start, Rest) else model.input_vector({})


def _run(
    plan: Plan,
    stepper: Stepper[Any],
    start: State | Rest | Checkpoint | None,
    watch: Watch,
    rows: Rows,
    track: Track,
) -> Run:
    try:
        if isinstance(start, Checkpoint):
            journey = _resumed(plan, stepper, start, watch, rows, track)
        else:
            journey = _begun(plan, stepper, start, watch, rows, track)
    except KeyboardInterrupt:
        return _result(unbegun(plan, stepper, start, watch, rows, track))
    with np.errstate(all="ignore"):  # what is beyond all numbers is told by the status
        journey.travel()
        return _result(journey)


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
    stops = Stops(plan.feed.sample_time, plan.feed.breaks, start.passed)
    rows.count = start.rows
    journey = Journey(plan, stepper, start.point, stops, books, watch, rows, track, replace(start.mark))
    journey.told, journey.balked = start.told, start.balked
    return journey


def _result(journey: Journey) -> Run:
    plan, state, supply = journey.plan, journey.point.state, journey.point.supply
    checkpoint = journey.saved
    assert checkpoint is not None
    if abs(state.t - plan.until) <= 1e-9 * plan.until:
        state = state.with_(t=plan.until)
    try:
        rows = journey.rows.finish(state, supply.u)
        journey.rows.recorder.flush()
    except Unwritten as error:
        journey.fail(error)
        rows = journey.rows.recorder.table()
    width = len(plan.model.outputs)
    drift = drifted(journey)
    journey.notes += strayed(journey) + unsized(journey) + unsure(journey, rows[:, 1 : 1 + width])
    if drift.note and journey.status is not Status.FAILED:
        journey.notes += (drift.note,)
    return Run(
        rows[:, 0],
        plan.model.outputs,
        plan.model.inputs,
        rows[:, 1 : 1 + width],
        rows[:, 1 + width :],
        state,
        journey.rows.frames,
        journey.status,
        _report(journey, drift),
        plan.model.structure.name,
        tuple(journey.events),
        checkpoint,
        journey.track,
        journey.fault,
    )


def _report(journey: Journey, drift: Drift) -> Report:
    plan, mark, counts, sums = journey.plan, journey.mark, journey.stepper.counts, journey.books.sums
    model = plan.model
    return Report(
        method=repr(plan.method),
        order=plan.method.order,
        damping=plan.method.damping,
        steps=mark.steps,
        rejected_steps=mark.rejected,
        newton_iterations=counts.newton,
        factorisations=counts.factorisations,
        wall_s=time.perf_counter() - plan.began,
        dofs=model.n,
        energy=EnergyBalance(sums.start, sums.work, sums.lost, sums.kinetic, sums.stored),
        energy_residual=journey.books.residual,
        worst=model.coordinates[counts.worst] if model.n else "",
        closure_error=sums.closure,
        drift=drift.share,
        drifted=drift.freedom,
        message=journey.message,
        notes=(*model.notes, *journey.notes),
    )


__all__ = ["simulate"]
