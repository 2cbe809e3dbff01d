"""A model through time, open or closed loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.method import AdaptiveAlpha
from flexctrl.dynamics.asked import check_arguments, check_rows, check_times, events_of
from flexctrl.dynamics.bouncing import bounced
from flexctrl.dynamics.breakaway import loosened
from flexctrl.dynamics.checking import laid_beside
from flexctrl.dynamics.checkpoint import Autosave, Checkpoint, check_same
from flexctrl.dynamics.events.event import Event
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.interpolated import halved, interpolates
from flexctrl.dynamics.interrupt import Interruption
from flexctrl.dynamics.journey import Journey, Plan
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.dynamics.methods.checked import Checked, checked
from flexctrl.dynamics.misreading import misread
from flexctrl.dynamics.notes.answers import Manner, answers
from flexctrl.dynamics.notes.beside import can_be_told, is_cut, may_grow, shorter
from flexctrl.dynamics.notes.commands import twice
from flexctrl.dynamics.notes.heeded import heeded
from flexctrl.dynamics.notes.leaving import leaves
from flexctrl.dynamics.notes.rates import are_asked, said_of_rates
from flexctrl.dynamics.notes.right import unseen
from flexctrl.dynamics.notes.ringing import ringing
from flexctrl.dynamics.notes.turned_over import turned_over
from flexctrl.dynamics.others import UNCHECKED, Beginning, noted, seen_until
from flexctrl.dynamics.records.digest import Watched
from flexctrl.dynamics.records.record import InMemory, Record, Recorder
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.setting_out import travelled
from flexctrl.dynamics.steps import Fixed, Integrator
from flexctrl.dynamics.swift.light_motors import giving_way
from flexctrl.errors import StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.model.consistent import admitted
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
        Where to begin; default: the shape as drawn, at rest. A `Rest` brings its constant inputs along, to which the
        controller's commands add: those of a law of deviations belong there, a law that bears the load by itself begins
        in ``rest.state`` (a note tells where a load seems to be borne twice). The clock of
        a run from these begins at 0, whatever the ``t`` of the state; only a `Checkpoint` brings its time along. From a
        `Checkpoint` the run goes on as if it had not been stopped, bit for bit; model, controller, method,
        tolerance, events and ``every`` must be those of the run it was taken from; an event may become ``terminal``, or
        be so no more. Beyond an event that ended that run it goes on until one happens again.
    inputs : mapping of str to float, optional
        Constant inputs, applied as a step at the start; a controller's commands add to them. A `Checkpoint` brings its
        own along, and takes no others. Functions of time are a controller: ``OpenLoop({"push": lambda t: …})``.
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
        Whatever happens once it has begun: a step that fails, an exception in the controller (`sys.exit` there, too: it
        ends the run, not the program, until ``raise run.fault``), a full disk and Ctrl-C end the run with their status,
        and all that was computed until then. So does Ctrl-C while the controller is asked for the first time: the run
        stands at its start.

    Raises
    ------
    StructureError
        For an argument of another kind, an end that is not positive or before the checkpoint, an unknown input, a
        start that the machine cannot be in (see `project`), or a checkpoint of another run.
    ControllerError
        If the controller's names are not the model's, or if it fails when it is first asked, before there is a run: it
        raises an exception (the cause of this one), or commands what is no column of finite numbers.
    EventError
        If the function of an event fails where the run begins.
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
    chosen, check = checked(method or _default(model, _spacing(start, every, until)))
    if isinstance(model, LinearModel):
        plant = _plant(model, chosen)
    else:
        plant = giving_way(model)
        start = _admitted(model, start)
    feed = feed_of(plant, controller, _base(plant, start, inputs))
    beginning = Beginning.of(start, spacing, feed) if check else None
    plan = Plan(
        plant,
        feed,
        chosen,
        tolerance or Tolerance(),
        until,
        progress or _untold,
        autosave,
        time.perf_counter(),
    )
    with Interruption() as kept, np.errstate(all="ignore"):  # what is beyond all numbers is told by the status
        began = time.thread_time()
        journey, run = travelled(plan, start, events_of(events), record, spacing)
        beginning = replace(beginning, cost=time.thread_time() - began) if beginning else None
        looked = run = noted(run, *twice(journey, start, inputs, beginning))
        cut = False
        try:
            looked = _growing(run, journey, beginning)
            if check and looked.status is not Status.FAILED:
                looked = _compared(looked, journey, check, beginning, isinstance(method, Checked))
        except KeyboardInterrupt:  # the second one: whatever is known by now
            cut = True
        except Exception:  # what is in other hands may fail by it otherwise
            if not kept.asked:
                raise
        return _held(_cut(looked) if cut or kept.asked else looked, journey.rows.recorder)


def _held(run: Run, recorder: Recorder) -> Run:
    """The run with the rows that it is to hold, of which a stream keeps the first and the last."""
    if not isinstance(recorder, Watched):
        return run
    rows, width = recorder.recorder.table(), 1 + len(run.outputs)
    return replace(run, t=rows[:, 0], y=rows[:, 1:width], u=rows[:, width:])


def _growing(run: Run, journey: Journey, beginning: Beginning | None) -> Run:
    """The run with what is told of growth under a sampled law that its steps do not see."""
    if not (beginning and journey.plan.feed.sample_time):
        return run
    from flexctrl.dynamics.notes.sampled_growth import of_sampled_loop  # brings all that modes need

    return of_sampled_loop(run, journey, beginning.again)


def _admitted(model: Model, start: State | Rest | Checkpoint | None) -> State | Rest | Checkpoint | None:
    """A start that a machine can be in, with the dry contacts that it has; one that it has begun in is not checked."""
    if isinstance(start, Rest):
        return replace(start, state=admitted(model, start.state, "simulate: start"))
    if isinstance(start, State) and model.__dict__.get("_begun") is not start:
        start = model.__dict__["_begun"] = admitted(model, start, "simulate: start")
    return start


def _compared(run: Run, journey: Journey, check: Checked, beginning: Beginning | None, always: bool) -> Run:
    """The run with what others beside it tell; nothing of one that stands where it was to begin."""
    if not journey.mark.steps:
        return run
    if beginning and can_be_told(journey):
        law = _manner(run, journey, beginning)
        asked = always or may_grow(journey, law) or are_asked(run, journey)
        if asked or leaves(run, journey, beginning.again):
            told = laid_beside(run, journey, check, beginning, shorter(run, journey, law))
            told = loosened(misread(told, run, journey, beginning, law), run, journey, beginning)
            run = noted(bounced(told, run, journey, beginning), *unseen(journey))
        else:
            run = seen_until(run, run.final.t)
    elif beginning and interpolates(journey):
        run = halved(run, journey, check, beginning)
    elif beginning and is_cut(journey):
        run = noted(run, f"{UNCHECKED} (interrupted)")
    told = turned_over(said_of_rates(ringing(run, journey), journey), journey)
    return heeded(told, journey, beginning.again) if beginning else told


def _manner(run: Run, journey: Journey, beginning: Beginning) -> Manner:
    """How a sampled law answers; one that holds what would run away goes to and fro between its limits."""
    if journey.plan.feed.sample_time:
        from flexctrl.dynamics.notes.sampled_growth import passed_over

        if passed_over(run):
            return Manner.HUNTING
    return answers(run, journey, beginning.again)


def _cut(run: Run) -> Run:
    """The run, interrupted at its end, as others were laid beside it."""
    if run.status is Status.FAILED or run.status is Status.INTERRUPTED:
        return run
    ended = f"{run.report.message}; " if run.report.message else ""
    message = f"{ended}interrupted at t = {run.final.t:.6g} s, as others were laid beside: not all is told of errors"
    return replace(run, status=Status.INTERRUPTED, report=replace(run.report, message=message))


def _default(model: Model | LinearModel, step: float) -> Integrator:
    """The method where none is given: exact for linear models."""
    if not isinstance(model, LinearModel):
        return AdaptiveAlpha()
    from flexctrl.dynamics.linear_motion.exact import Exact

    return Exact(step)


def _plant(linear: LinearModel, method: Integrator) -> LinearPlant:
    """A linear model as a machine; outputs that feel inputs at once are known to the exact method only."""
    from flexctrl.dynamics.linear_motion.exact import Exact

    if linear.D.any() and not isinstance(method, Exact):
        raise StructureError(f"simulate: an output of {linear.name} feels inputs at once (D ≠ 0); use the method Exact")
    return LinearPlant(linear)


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


__all__ = ["simulate"]
