"""Forces and rates among the outputs: whether a finer run has other peaks."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.outputs import fast
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import output_yardsticks
from flexctrl.dynamics.steps import Fixed
from flexctrl.dynamics.swift.stiff_lines import frequency_of
from flexctrl.model.model import Model
from flexctrl.structure.outputs import Output, Tension

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["peaked", "unresolved"]

_TOLD, _SEEN, _AIM, _RESOLVED = 0.05, 10.0, 0.01, 0.2
_UNSEEN, _BLIND = 0.5, 2.0
"""Radians of its vibration in a step beyond which a line's peaks may be missed, beyond which by half steps too."""
_SAID = (
    "by a finer run, the largest {name} is {other:.3g}, here it is {own:.3g}, and may be off by {far}: "
    "take steps of {finer:.1g} s"
)
_MISSED = (
    "{line} is caught in steps that see little of how it vibrates ({turned:.2g} rad in each), and the peaks of {name} "
    "may be missed: take steps of {finer:.1g} s"
)


def unresolved(journey: Journey) -> bool:
    """Tell whether the tension of a line is asked for in steps of one length that do not see how it vibrates.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    bool
    """
    model, pace = journey.plan.model, journey.plan.method.pace
    if not (isinstance(pace, Fixed) and isinstance(model, Model)):
        return False
    return any(pace.step * _frequency(model, output) > _UNSEEN for output in model.structure.outputs)


def peaked(run: Run, other: Run, journey: Journey, longer: float) -> Run:
    """Return a run with what a finer one tells of the peaks of forces and rates.

    At one instant two runs may differ by all of a shock that is late in one of them; how large it is does not hang on
    that. Errors of peaks are taken to go as steps do, as those of impacts within a step do. Where rows are apart, peaks
    are not compared.

    Parameters
    ----------
    run, other : Run
    journey : Journey
        How the first went.
    longer : float
        By how much steps of the other are longer: less than 1.

    Returns
    -------
    Run
    """
    if not isinstance(journey.plan.model, Model):
        return run
    shares, notes = _compared(run, other, journey, longer) if journey.rows.every is None else ({}, ())
    report, missed = run.report, tuple(_missed(journey, shares))
    known = {**report.output_errors, **shares}
    return replace(run, report=replace(report, output_errors=known, notes=(*report.notes, *notes, *missed)))


def _compared(run: Run, other: Run, journey: Journey, longer: float) -> tuple[dict[str, float], tuple[str, ...]]:
    """By how much the largest values may be off, of those that may be far off, and what is to be said of them."""
    model, end = journey.plan.model, min(run.final.t, other.final.t) * (1.0 + 1e-9)
    assert isinstance(model, Model)
    peaks, others = (np.abs(r.y[r.t <= end]).max(axis=0, initial=0.0) for r in (run, other))
    most, off = np.maximum(peaks, others), np.abs(others - peaks) / (1.0 - longer)
    least = _SEEN * journey.plan.tolerance.negligible * output_yardsticks(model, journey.mark.size)
    far = [i for i in fast(model) if most[i] > least[i] and off[i] > _TOLD * most[i]]
    shares = {model.outputs[i]: min(float(off[i] / most[i]), 1.0) for i in far}
    return shares, tuple(_note(journey, i, peaks, others, shares[model.outputs[i]]) for i in far)


def _missed(journey: Journey, told: Collection[str]) -> Iterator[str]:
    """What is to be said of lines that are caught within steps that no run in half of them sees better."""
    model, pace = journey.plan.model, journey.plan.method.pace
    assert isinstance(model, Model)
    met = {event.name for event in journey.events}
    for output in model.structure.outputs:
        turned = pace.step * _frequency(model, output) if isinstance(pace, Fixed) else 0.0
        if turned > _BLIND and isinstance(output, Tension) and output.line in met and output.name not in told:
            finer = _RESOLVED / turned * journey.mark.size
            yield _MISSED.format(line=output.line, turned=turned, name=output.name, finer=finer)


def _frequency(model: Model, output: Output) -> float:
    """Of the line whose tension an output is [rad/s]; 0 for other outputs."""
    return frequency_of(model, output.line) if isinstance(output, Tension) else 0.0


def _note(journey: Journey, output: int, peaks: np.ndarray, others: np.ndarray, share: float) -> str:
    name, step = journey.plan.model.outputs[output], journey.mark.size
    finer = (_AIM / share) ** (1.0 / journey.plan.method.order) * step
    return _SAID.format(name=name, other=others[output], own=peaks[output], far=percent(share), finer=finer)
