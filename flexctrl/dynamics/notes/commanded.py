"""What a law commands: how far each input may be off at an instant, by all runs laid beside one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.apart import Apart, off_by, telling
from flexctrl.dynamics.notes.orders import MARGIN
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.steps import Fixed

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["commanded"]


def commanded(run: Run, others: Sequence[tuple[Run, float]], journey: Journey) -> Run:
    """Return a run with what others tell of the commands of its law, instant by instant, as of forces and rates.

    Parameters
    ----------
    run : Run
    others : sequence of (Run, float)
        By how much their steps are longer.
    journey : Journey
        How the run went.

    Returns
    -------
    Run
        As it is, where there is no law, or one that reads nothing.
    """
    feed = journey.plan.feed
    if feed.controller is None or not feed.reads.size or not len(run.u):
        return run
    way = np.ptp(run.u, axis=0)
    apart = [Apart.of_commands(run, other, longer) for other, longer in telling(run, others)]
    told = [i for i in feed.writes if way[i] > 0.0] if apart else []
    if not told:
        return run
    off = MARGIN * off_by(apart, way, run.report.order, isinstance(journey.plan.method.pace, Fixed))
    shares = {run.inputs[i]: min(float(off[i] / way[i]), 1.0) for i in told}
    return replace(run, report=replace(run.report, command_errors=shares))
