"""How far runs of linear equations are off under laws that are not linear: by one in half the steps.

`Exact` interpolates a continuous law over its steps, to within a tolerance for each. What these leave may add up, and
grows where the law makes small differences grow; no estimate of single steps tells of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.linear_motion.exact import ExactStepper
from flexctrl.dynamics.march.stepper import plain_of
from flexctrl.dynamics.methods.checked import Beside, Checked
from flexctrl.dynamics.notes.apart import Apart
from flexctrl.dynamics.notes.beside import agreeing, told_beside
from flexctrl.dynamics.notes.lengths import usual
from flexctrl.dynamics.notes.outputs import ways
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.others import UNCHECKED, Beginning, made, noted
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.scales import farthest, output_yardsticks
from flexctrl.dynamics.steps import Controlled
from flexctrl.model.model import Model

__all__ = ["halved", "interpolates"]

_HALF = 0.5
_DUST = 1e-9
"""Of what an output would be if all moved as far as what has moved farthest: less is last digits."""
_NOTED, _BESIDE = 0.05, 2.0
_ROWS = 4
"""Of fewer nothing is known between them: their errors are those of the coordinates at the end."""
_SAID = "by a finer run, {name} may be off by {far} of its range: see whether {finer} agrees"


def interpolates(journey: Journey) -> bool:
    """Tell whether a run of linear equations has errors that nothing tells of but another run.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
        Where `Exact` interpolates a law, and under a continuous law on a linear model by any other method.
    """
    feed, stepper = journey.plan.feed, plain_of(journey.stepper)
    if isinstance(stepper, ExactStepper):
        return feed.continuous and not stepper.closed
    return feed.reacting and not isinstance(journey.plan.model, Model)


def halved(run: Run, journey: Journey, method: Checked, beginning: Beginning) -> Run:
    """Return the run with what one in half the steps tells of places and of each output.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    method : Checked
    beginning : Beginning

    Returns
    -------
    Run
    """
    if run.status is Status.INTERRUPTED:
        return noted(run, f"{UNCHECKED} (interrupted)")
    run, other = made(run, journey, _finer(journey, method), beginning)
    if other is None:
        return run
    told = told_beside(run, other.run, other.gap, journey, _HALF, run.report.order)
    shares, known = _shares(run, other.run, journey), told.report.output_errors
    errors = {name: max(share, known.get(name, 0.0)) for name, share in shares.items()}
    report = replace(told.report, output_errors={**known, **errors})
    return replace(told, report=replace(report, notes=(*report.notes, *_said(errors, report.error, journey))))


def _finer(journey: Journey, method: Checked) -> Beside:
    """Half the steps; those that go by a tolerance though they are of one length are refused by a lower one."""
    tolerance = journey.plan.tolerance
    finer = method.finer(tolerance, usual(journey), _HALF)
    if isinstance(method.pace, Controlled):
        return finer
    tight = _HALF**method.order
    return replace(finer, tolerance=Tolerance(tight * tolerance.relative, tight * tolerance.absolute))


def _shares(run: Run, other: Run, journey: Journey) -> dict[str, float]:
    """By how much each output is off, over its range, where that is more than last digits."""
    if not run.y.size or len(run.t) < _ROWS:
        return {}
    model = journey.plan.model
    way, most = ways(journey, run.y), Apart.of(run, other, _HALF).most
    far = float(farthest(model, journey.books.sums.moved).max(initial=0.0))
    least = _DUST * far * output_yardsticks(model, journey.mark.size)
    seen = np.flatnonzero(way > least)
    return {run.outputs[i]: min(float(most[i] / way[i]), 1.0) for i in seen.tolist()}


def _said(errors: dict[str, float], error: float, journey: Journey) -> tuple[str, ...]:
    """What is to be said of the output that is farthest off, where the run as a whole is less so."""
    worst = max(errors, key=errors.__getitem__, default="")
    if not worst or errors[worst] <= max(_NOTED, _BESIDE * error):
        return ()
    return (_SAID.format(name=worst, far=percent(errors[worst]), finer=agreeing(journey)),)
