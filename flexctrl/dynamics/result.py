"""What a run that has ended leaves behind."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.notes.adding import drifted
from flexctrl.dynamics.notes.commands import unfelt
from flexctrl.dynamics.notes.left_out import left_out, passed_over
from flexctrl.dynamics.notes.many_states import many_states
from flexctrl.dynamics.notes.outputs import by_sums
from flexctrl.dynamics.notes.straying import strayed
from flexctrl.dynamics.notes.unsized import little, unsized
from flexctrl.dynamics.notes.unsure import unsure
from flexctrl.dynamics.records.record import Unwritten
from flexctrl.dynamics.run import EnergyBalance, Report, Run, Status

__all__ = ["result"]


def result(journey: Journey) -> Run:
    """Return the curves and the report of a run.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    Run
    """
    plan, state, supply = journey.plan, journey.point.state, journey.point.supply
    checkpoint = journey.saved
    assert checkpoint is not None
    if abs(state.t - plan.until) <= 1e-9 * plan.until:
        state = state.with_(t=plan.until)
    state = replace(state, freedoms=plan.model.coordinates)
    try:
        rows = journey.rows.finish(state, journey.outputs_here, supply.u)
        journey.rows.recorder.flush()
    except Unwritten as error:
        journey.fail(error)
        rows = journey.rows.recorder.table()
    width = len(plan.model.outputs)
    y = rows[:, 1 : 1 + width]
    try:
        _judged(journey, y)
    except KeyboardInterrupt:  # nothing is lost but what is told of it
        journey.notes += ("Ctrl-C, pressed twice, cut off what is told of errors",)
    return Run(
        rows[:, 0],
        plan.model.outputs,
        plan.model.inputs,
        y,
        rows[:, 1 + width :],
        state,
        journey.rows.frames,
        journey.status,
        _report(journey),
        plan.model.structure.name,
        tuple(sorted(journey.events, key=lambda event: event.t)),  # a step begins just short of the corner behind it
        checkpoint,
        journey.track,
        journey.fault,
    )


def _judged(journey: Journey, y: np.ndarray) -> None:
    """Let a run know what errors of steps add up to, and what is to be said of it."""
    journey.drift = drift = drifted(journey)
    journey.outputs = by_sums(journey, y)
    journey.notes += strayed(journey) + unsized(journey) + little(journey) + unsure(journey, y) + left_out(journey)
    journey.notes += passed_over(journey) + unfelt(journey) + many_states(journey)
    if journey.status is not Status.FAILED:
        journey.notes += (drift.note,) * bool(drift.note) + journey.outputs.notes


def _report(journey: Journey) -> Report:
    plan, mark, counts, sums = journey.plan, journey.mark, journey.stepper.counts, journey.books.sums
    model, drift = plan.model, journey.drift
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
        error=drift.share,
        output_errors=journey.outputs.shares,
        message=journey.message,
        notes=(*model.notes, *journey.notes),
    )
