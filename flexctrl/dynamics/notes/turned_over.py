"""Rotations whose axis comes close to its opposite: on which side it passes decides of whole turns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.model.model import Model
from flexctrl.structure.outputs import Rotation

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["turned_over"]

_LEAP, _MOST, _WITHIN = 1.0, 40, 8
"""How far an angle goes from row to row where its axis may pass, how many such rows are looked at, and how closely."""
_NEAR, _AT_MOST = 5.0, 0.5
"""So many times what the run errs by; and so many radians, whatever that is: others stand far from it."""
_SAID = (
    "whole turns of {name} hang on less than steps err by: at t = {t:.4g} s its axis passes within {near:.1g} rad of "
    "its opposite, where what is left of a rotation is not defined; ask for a rotation about another axis, or against "
    "a node that turns along (minus)"
)


def turned_over(run: Run, journey: Journey) -> Run:
    """Return a run with a note on the rotations whose whole turns hang on the errors of steps.

    Parameters
    ----------
    run : Run
        With all that is told of its errors.
    journey : Journey
        How it went.

    Returns
    -------
    Run
    """
    model = journey.plan.model
    if not (isinstance(model, Model) and len(model.motion.twists) and run.track.stretches and len(run.t) > 1):
        return run
    angles = [i for i, output in enumerate(model.structure.outputs) if isinstance(output, Rotation)]
    error, notes = max(run.report.error, journey.plan.tolerance.relative), []
    for number, i in enumerate(angles):
        passed = [_nearest(run, model, number, k) for k in _leaps(run.y[:, i])]
        near, t = min(passed, default=(np.inf, 0.0))
        if near < min(_NEAR * error, _AT_MOST):
            notes.append(_SAID.format(name=run.outputs[i], t=t, near=near))
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes)))


def _leaps(angle: np.ndarray) -> list[int]:
    """After which rows it goes farthest, if that is far."""
    went = np.abs(np.diff(angle))
    return [int(k) for k in np.argsort(-went)[:_MOST] if went[k] > _LEAP]


def _nearest(run: Run, model: Model, number: int, row: int) -> tuple[float, float]:
    """How near an axis comes to its opposite between two rows, and when."""
    begin = max(run.t[row], run.track.starts[0])
    times = np.linspace(begin, run.t[row + 1], _WITHIN + 1).tolist()
    return min((model.motion.twists.short_of_opposite(number, run.track.state(t)[0].R), t) for t in times)
