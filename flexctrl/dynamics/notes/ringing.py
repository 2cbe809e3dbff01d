"""What loads put on at once set ringing so fast that steps see little of it: lines and shafts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.notes.fading import fading, radius
from flexctrl.dynamics.notes.outputs import Fast, placed
from flexctrl.dynamics.notes.rates import is_named
from flexctrl.dynamics.notes.shocks import Shock, Swing, shocks
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import output_yardsticks
from flexctrl.dynamics.steps import Integrator
from flexctrl.dynamics.swift.stiff_lines import SURE
from flexctrl.model.model import Model
from flexctrl.structure.outputs import Tension

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ringing"]

_SEEN, _SEEN_BY_MANY, _LITTLE, _STEADY, _RESOLVED = 1.0, 2.0, 0.05, 0.01, 0.2
"""Radians in a step, and in one of many stages; what counts, of what an output goes through and of its largest; a step
that sees all."""
_TELLING = 0.01
"""Of what an output goes through, is told without a note: no other run sees it either."""
_LAG = 0.3
"""Radians by which two runs part in phase from where on an extrapolation of them is larger than either."""
_TOLD, _DUST = 1e-3, 1e-9
_LOOKED_AT = 0.02, 0.2, 0.5, 0.9
_MOMENTS = (np.arange(16) + 0.5) / 16.0
"""Of what meets corners, as a rope is slack for a while, and steps are long then."""
_PART = 10.0
"""Of a swing that steps see, at least a tenth is in what its output goes through."""
_FADED, _MORE, _AIM = 0.1, 3.0, 0.05
"""What is noted of what an output goes through, where that is more than three times what is told; and what is not."""
_SAID = (
    "{name} rings by up to {swing:.2g} from {since} on, by {turned:.2g} rad in a step, which sees little of that: "
    "its peaks may be missed; bring loads up more slowly, or take steps of {finer:.1g} s"
)
_PARTED = (
    "{name} rings by up to {swing:.2g} from {since} on, and the two runs that are extrapolated part by {lag:.2g} rad "
    "of that: its peaks may be too large; bring loads up more slowly, or take steps of {finer:.1g} s"
)
_FADING = (
    "{name} rings by up to {swing:.2g} from {since} on, of which steps of {step:.2g} s damp {lost:.0%} away and have "
    "the rest lag by {lag:.2g} rad at the end: take steps of {finer:.1g} s if that counts"
)


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and rates that ring in ways that its steps do not resolve.

    What is out of balance at the start accelerates a line's ends, or a motor, by a: they swing about where forces
    balance by a/ω², and a motor's speed by a/ω. So do they where an input jumps, by what it adds to a. Where that is
    5 % of what the output gets to, and steps turn it by more than a radian while it rings, its peaks are a matter of
    chance, but for the first, which short first steps may see; where the two runs of `Richardson` part by a third of a
    radian in it, they are too large. What turns by less than a radian, steps may damp away or have lag, if nothing else
    ends it before. What sticks is held, and rubs where it slides to and fro.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.

    Returns
    -------
    Run
    """
    model = journey.plan.model
    if not (isinstance(model, Model) and len(run.y)) or journey.judging is None:  # or it is solved exactly
        return run
    asked = [o for o in model.structure.outputs if isinstance(o, Fast) and not is_named(o.name, run.report.notes)]
    judged = list(_judged(run, journey, model, asked)) if asked else []
    notes = tuple(each.note for each in judged if each.note)
    known = run.report.output_errors
    found = (each for each in judged if each.share > _TOLD and (each.counts or each.name not in known))
    shares = {each.name: max(each.share, known.get(each.name, 0.0)) for each in found}
    report = replace(run.report, output_errors={**known, **shares}, notes=(*run.report.notes, *notes))
    return replace(run, report=report) if judged else run


class _Judged(NamedTuple):
    """An output, what it may be off by over its range, and what is to be said of it.

    Attributes
    ----------
    name : str
    share : float
    note : str
    counts : bool
        Whether that is more than other runs know, which may be off alike.
    """

    name: str
    share: float
    note: str
    counts: bool


def _judged(run: Run, journey: Journey, model: Model, asked: list[Fast]) -> Iterator[_Judged]:
    """What is to be told of each output, by the vibrations that it may ring with, largest first."""
    known, found = run.report.output_errors, list(shocks(run, journey))
    told = max(run.report.error, *(known.get(model.outputs[i], 0.0) for i in placed(model)), 0.0)
    yards = output_yardsticks(model, 1.0)
    for output in asked:
        values = run[output.name]
        way, most = float(np.ptp(values)), float(np.abs(values).max())
        slack = isinstance(output, Tension) and not values.all()
        swings = [(swing, shock) for shock in found for swing in shock.swings(output)]
        share, note, counts = 0.0, "", False
        much = max(_LITTLE * way, _STEADY * most)
        dust = (SURE if isinstance(output, Tension) else _DUST) * yards[model.outputs.index(output.name)]
        for swing, shock in sorted(swings, key=lambda each: -each[0].size):
            if not swing.size > max(_TELLING * way, dust):
                continue
            lasts = _lasting(shock.decay(swing), journey.point.state.t - shock.state.t)
            step = _step(run, journey, shock, swing, lasts, slack)
            beside = known.get(output.name, np.inf)
            ringing = _Ringing(output.name, shock.since, lasts, step, way, told, beside)
            off, said = _told(journey.plan.method, swing, ringing)
            share = max(share, min(off / way, 1.0) if way else float(off > 0.0))
            note, counts = note or (said if swing.size > much else ""), counts or swing.gain > 1.0 or off == swing.size
        yield _Judged(output.name, share, note, bool(note) or counts)


def _lasting(decay: float, left: float) -> float:
    """How long it rings, if damping of its own does not end it before [s]."""
    return left if left * decay < 1.0 else 1.0 / decay


def _step(run: Run, journey: Journey, shock: Shock, swing: Swing, lasts: float, slack: bool) -> float:
    """How long steps are while something rings, on average [s]; 0 where it does not ring at all, as a slack rope."""
    since, track, corners = shock.state.t, run.track, {*journey.watch.corner_names}
    end = min(since + lasts, journey.point.state.t)
    known = bool(track.stretches) and track.starts[0] <= since < end
    if known and (slack or any(event.name in corners and since < event.t < end for event in journey.events)):
        moments = since + (end - since) * _MOMENTS
        steps = [track.step(t) for t in moments.tolist() if shock.stands(swing, *track.state(t))]
        return float(np.mean(steps)) if steps else 0.0
    if journey.rows.every is None and len(run.t) and run.t[0] <= since < end:
        return (end - since) / max(int(np.count_nonzero(np.diff(run.t[(run.t >= since) & (run.t <= end)]))), 1)
    if known:
        return float(np.mean([track.step(since + share * (end - since)) for share in _LOOKED_AT]))
    return journey.point.state.t / max(journey.mark.steps, 1)


class _Ringing(NamedTuple):
    """An output that rings.

    Attributes
    ----------
    name, since : str
        Since when, in words.
    lasts, step : float
        For how long, and in what steps [s].
    way, told, beside : float
        What it goes through, the largest share that is told of others, and what runs beside tell of it; infinite if
        there are none.
    """

    name: str
    since: str
    lasts: float
    step: float
    way: float
    told: float
    beside: float


def _told(method: Integrator, swing: Swing, of: _Ringing) -> tuple[float, str]:
    """How far off a vibration may have an output, and what is to be said of it; nothing where that is little."""
    turned, angle = of.step * swing.frequency, of.lasts * swing.frequency
    said = {"name": of.name, "swing": swing.size, "since": of.since}
    if turned > (_SEEN_BY_MANY if math.isnan(radius(method)) else _SEEN):
        return swing.size, _SAID.format(**said, turned=turned, finer=_RESOLVED / swing.frequency)
    if swing.handed_on or swing.size > _PART * of.way:  # steps that see it show it, if it is there
        return 0.0, ""
    if isinstance(method, Richardson):
        lag = 0.75 * angle * turned**2 / 12.0
        note = _PARTED.format(**said, lag=lag, finer=of.step * np.sqrt(0.1 * _LAG / lag)) if lag > _LAG else ""
        return min(lag**2, 1.0) * swing.size, note
    faded, lag = fading(method, turned, angle)
    missed = abs(1.0 - np.exp(complex(-faded, min(lag, np.pi)))) * swing.size
    if missed > _MORE * of.beside * of.way:  # something else ends it, or runs that lag unlike would be apart
        return 0.0, ""
    if missed > max(_FADED, _MORE * of.told) * of.way:
        finer = of.step * np.sqrt(_AIM * min(1.0 / (faded + lag), of.way / missed))  # a swing may be seen in part
        return missed, _FADING.format(**said, step=of.step, lost=-np.expm1(-faded), lag=lag, finer=finer)
    return missed, ""
