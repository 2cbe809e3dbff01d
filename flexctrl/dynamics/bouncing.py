"""Drives that bounce in their play faster than steps see: what becomes of a run that damps what it does not see.

A shaft that lands on a flank rings against it, and a damped one soon bears. Steps that turn that vibration by radians
keep it for as long as the method's own damping lets them: the drive bounces on, and so it does in finer runs that do
not see it either. A run in such steps whose method damps within each what it does not see has it bear at once. Where
the two part, nothing but steps that see the vibration knows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.dynamics.methods.checked import Beside
from flexctrl.dynamics.notes.apart import Apart
from flexctrl.dynamics.notes.outputs import fast, seen, ways
from flexctrl.dynamics.others import Beginning, made, noted
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.steps import Integrator
from flexctrl.dynamics.swift.stiff_lines import firmest_shaft
from flexctrl.effects.backlash import Backlash
from flexctrl.model.model import Model

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["bounced"]

_OFTEN, _UNSEEN, _SEES = 8, 1.0, 0.3
"""How many times a drive meets its play; radians of its shaft's vibration in a step that does not see it, and in one
that does."""
_LEAST, _TWICE = 0.03, 2.0
"""What is noted of an output's range, where it is more than twice what is told."""
_BOUNCES = (
    "{drive} meets its play {count} times and bounces there by vibrations that a step turns by {turned:.2g} rad: where "
    "steps damp them, {where} is {far:.2g} of its range elsewhere; steps of {sees:.1g} s see them"
)


def bounced(told: Run, run: Run, journey: Journey, beginning: Beginning) -> Run:
    """Return a run with what one tells that damps what its steps do not see, if a drive bounces in its play.

    Parameters
    ----------
    told : Run
        With what others tell.
    run : Run
        Without.
    journey : Journey
        How it went.
    beginning : Beginning

    Returns
    -------
    Run
        With the larger of both as the errors of outputs.
    """
    model, damped = journey.plan.model, _damped(journey.plan.method)
    assert isinstance(model, Model)
    drive, count = _bouncing(run, model)
    turned = firmest_shaft(model) * run.final.t / max(journey.mark.steps, 1)
    if damped is None or count < _OFTEN or turned < _UNSEEN:
        return told
    beside = Beside(damped, journey.plan.tolerance, 1.0, "with what steps do not see damped")
    standing, other = made(told, journey, beside, beginning)
    if other is None:
        return standing
    way = ways(journey, run.y)
    judged = [i for i in {*seen(journey, run.y)[1], *fast(model)} if 0.0 < way[i] < np.inf]
    apart = Apart.of(run, other.run, 0.5).most
    far = {run.outputs[i]: min(float(apart[i] / way[i]), 1.0) for i in judged}
    known = standing.report.output_errors
    more = {name: share for name, share in far.items() if share > max(_LEAST, _TWICE * known.get(name, 0.0))}
    if not more:
        return standing
    worst = max(more, key=lambda name: more[name])
    sees = _SEES / firmest_shaft(model)
    said = {"drive": drive, "count": count, "turned": turned, "where": worst, "far": more[worst], "sees": sees}
    errors = {**known, **{name: max(share, known.get(name, 0.0)) for name, share in far.items()}}
    return noted(replace(standing, report=replace(standing.report, output_errors=errors)), _BOUNCES.format(**said))


def _bouncing(run: Run, model: Model) -> tuple[str, int]:
    """The drive that meets its play most often, and how many times it does."""
    loose = [name for effect in model.effects if isinstance(effect, Backlash) for name, _ in effect.gaps]
    times = {name: sum(event.name == name for event in run.events) for name in loose}
    most = max(times, key=lambda name: times[name], default="")
    return most, times.get(most, 0)


def _damped(method: Any) -> Integrator | None:
    """The method with all damping that it may have of what steps do not see; None where it has none to choose."""
    if hasattr(method, "method"):
        inner = _damped(method.method)
        return None if inner is None else replace(method, method=inner)
    return replace(method, rho=0.0) if getattr(method, "rho", 0.0) > 0.0 else None
