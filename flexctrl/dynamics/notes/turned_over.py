"""Angles whose whole turns hang on the last digits: rotations whose axis comes near its opposite, and sway past ±π."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.model.model import Model
from flexctrl.structure.outputs import Rotation, SwayAngle

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

_OVER = (
    "{name} goes over the top at t = {t:.4g} s, where it jumps from π to −π: a row stands within {near:.1g} rad of "
    "that, less than steps may err by, and may be on the other side; compare such rows up to whole turns"
)


def turned_over(run: Run, journey: Journey) -> Run:
    """Return a run with a note on the angles whose whole turns hang on the errors of steps.

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
    if not (isinstance(model, Model) and run.track.stretches and len(run.t) > 1):
        return run
    notes = (*_opposite(run, model, journey.plan.tolerance.relative), *_over(run, model))
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes)))


def _opposite(run: Run, model: Model, least: float) -> Iterator[str]:
    """Of rotations; they are told apart by what turns, of which a model of small motion has none."""
    angles = [i for i, output in enumerate(model.structure.outputs) if isinstance(output, Rotation)]
    for number, i in enumerate(angles if len(model.motion.twists) else ()):
        passed = [_nearest(run, model, number, k) for k in _leaps(run.y[:, i])]
        near, t = min(passed, default=(np.inf, 0.0))
        if near < min(_NEAR * max(run.report.error, least), _AT_MOST):
            yield _SAID.format(name=run.outputs[i], t=t, near=near)


def _over(run: Run, model: Model) -> Iterator[str]:
    """Of sway."""
    for i, output in enumerate(model.structure.outputs):
        sway = run.y[:, i]
        jumps = np.flatnonzero(np.abs(np.diff(sway)) > np.pi)
        if isinstance(output, SwayAngle) and jumps.size:
            rows = np.unique([jumps, jumps + 1])
            near = np.pi - np.abs(sway[rows])
            errs = max(run.report.output_errors.get(output.name, 0.0), run.report.error) * np.ptp(sway)
            if near.min() < min(_NEAR * errs, _AT_MOST):
                yield _OVER.format(name=output.name, t=run.t[rows[near.argmin()]], near=near.min())


def _leaps(angle: np.ndarray) -> list[int]:
    """After which rows it goes farthest, if that is far."""
    went = np.abs(np.diff(angle))
    return [int(k) for k in np.argsort(-went)[:_MOST] if went[k] > _LEAP]


def _nearest(run: Run, model: Model, number: int, row: int) -> tuple[float, float]:
    """How near an axis comes to its opposite between two rows, and when."""
    begin = max(run.t[row], run.track.starts[0])
    times = np.linspace(begin, run.t[row + 1], _WITHIN + 1).tolist()
    return min((model.motion.twists.short_of_opposite(number, run.track.state(t)[0].R), t) for t in times)
