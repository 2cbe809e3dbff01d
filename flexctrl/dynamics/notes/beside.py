"""How far a run is off, by a coarser one laid beside it: growth of small differences included."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.outputs import by_rows, placed
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.scales import farthest, output_yardsticks, turning, yardsticks
from flexctrl.dynamics.steps import Controlled, Fixed
from flexctrl.model.model import Model
from flexctrl.model.overturned import bent
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["PARTED", "can_be_told", "kept_short", "may_grow", "told_beside"]

_SWUNG, _FAR = 0.25, 0.02
"""What swings by less is nearly linear; what goes as far may snap through, or swing on a far larger machine."""
_OFTEN = 12.0
"""Little grows in half a turn, to and fro: steps of one length, half of which it costs, are not taken again for it."""
_POINTS, _FEW = 4, 1500
_INSTANTS, _GOLDEN = 16, 0.5 * (5.0**0.5 - 1.0)
_TOLD, _AIM = 0.03, 0.01
_LEAST, _ALL = 0.1, 0.995
"""Where fewer steps than that could be longer, both runs are about the same but for what grows."""
PARTED = 0.2
"""Runs that have parted by more may both be wrong: no share of that is sure to be the finer one's."""
_MORE = 1.2
_GROWN = "small differences grow, or steps are too long"
_EARLY = "the {kind} run beside it ended at t = {t:.3g} s: how far small differences have grown since is not told"


def can_be_told(journey: Journey) -> bool:
    """Tell whether a coarser run may be made, and would say something.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
        False in small motion, and where the run ended early.
    """
    model, ended = journey.plan.model, journey.status in (Status.FINISHED, Status.STOPPED)
    return ended and isinstance(model, Model) and model.large and journey.mark.steps > 0


def kept_short(journey: Journey) -> bool:
    """Tell whether samples keep nearly all steps short: a coarser run would be the same.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
    """
    sample = journey.plan.feed.sample_time
    return sample > 0.0 and journey.mark.steps < _MORE * journey.point.state.t / sample


def may_grow(journey: Journey) -> bool:
    """Tell whether small differences may have grown of themselves.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
        Whether something has swung by more than a quarter of a radian, gone farther than a fiftieth of the machine's
        size, met corners, or followed a continuous law, which may have corners of its own; in steps of one length, if
        it has gone twelve times that way to and fro. Where samples keep steps short the other run is a finer one,
        which costs twice as much as the run itself: only for what turns so far and often, or goes a quarter of the
        machine's size so often, and corners.
    """
    plan, sums, watch, short = journey.plan, journey.books.sums, journey.watch, kept_short(journey)
    feed, model = plan.feed, plan.model
    own = {*watch.corner_names, *(() if short else watch.names)}
    least = np.where(turning(model) | short, _SWUNG, _FAR) * yardsticks(model)
    swung = sums.moved > least
    if short or isinstance(plan.method.pace, Fixed):
        swung &= sums.path > _OFTEN * least
    return bool(swung.any()) or feed.reacting or any(event.name in own for event in journey.events)


@dataclass(frozen=True)
class _Gap:
    """How far two runs are apart.

    Attributes
    ----------
    t : numpy.ndarray, shape (instants,)
    size : numpy.ndarray, shape (instants,)
        The most so far, over the largest motion of the run.
    where : str
        The output, the node or the motor's angle at which that is most.
    outputs : numpy.ndarray, shape (outputs,)
        The most in each output that is a place or an angle, in its own unit; 0 in others.
    bent : str
        What is to be said of elements bent far, at the instants looked at.
    """

    t: np.ndarray
    size: np.ndarray
    where: str
    outputs: np.ndarray
    bent: str = ""


def told_beside(run: Run, coarse: Run, journey: Journey, longer: float, taken: int, feared: float = 0.0) -> Run:
    """Return a run with what a coarser one tells of its error.

    Where nothing else keeps them short, steps of the coarser run are longer by a factor r and its errors by rᵖ. Samples
    and impacts do keep steps short: a share φ of steps that could be longer makes n/m = 1 − φ (1 − 1/r) of the n steps,
    and is taken to have made that share of the errors. Of what the runs are apart, 1/(rᵖ − 1) φ is left. Where another
    one, farther off, has parted and this one has not, it may be near by accident: what is told is the geometric mean of
    what the two would leave, if that is more.

    Parameters
    ----------
    run : Run
    coarse : Run
        The same to a larger tolerance, or in longer steps.
    journey : Journey
        How the finer one went.
    longer : float
        By how much steps of the coarser one are longer; below 1 it is a finer one.
    taken : int
        Steps of the run since it went on.
    feared : float
        What one that has parted would leave if errors grew as powers of steps do; 0 if none has.

    Returns
    -------
    Run
        As it is where the coarser one tells nothing: it took no step, nearly all its steps are the same, or it has
        parted from the finer one so far that sums of local errors tell more. Of one that ended before the run did it
        keeps what these sums tell, and says so; one that reached its end and was called unresolved there is as good
        as others.
    """
    if not coarse.report.steps:
        return run
    fewer, report = coarse.report.steps / max(run.report.steps, 1), run.report
    free = (1.0 - fewer) / (1.0 - 1.0 / longer)
    kept = not journey.plan.feed.sample_time and taken <= _FEW and run.track.stretches and coarse.track.stretches
    gap = (_gap if kept else _gap_of_rows)(run, coarse, journey)
    left = min(max(free, _LEAST), 1.0) * abs(longer**report.order - 1.0)
    told, parted = float(gap.size[-1]) / left, gap.size[-1] > PARTED
    origin = journey.origin
    if max(told, origin.error) < report.drift and (free < _LEAST or parted):
        return run
    left = 1.0 if parted else left / max(1.0, math.sqrt(feared / max(told, 1e-300)))
    told = float(gap.size[-1]) / left
    early = coarse.status not in (Status.FINISHED, Status.STOPPED) and coarse.final.t < (1.0 - 1e-9) * run.final.t
    error = max(told, origin.error, report.drift if early else journey.drift.ran)
    right = min(origin.right, _right(run, gap, left))
    kind = "coarser" if longer > 1.0 else "finer"
    outputs = by_rows(journey, run.y, gap.outputs / left, error, kind)
    said = (journey.drift.note, journey.bent, *journey.outputs.notes)
    notes = tuple(note for note in report.notes if note not in said)
    notes += tuple({gap.bent or journey.bent} - {""})
    if max(told, origin.error) >= error > _TOLD:
        notes += (_note(journey, gap, error, right, kind),)
    elif journey.drift.note and error > told:  # a wrong speed, which both runs have alike; or nobody knows better
        notes += (journey.drift.note,)
    if early:
        notes += (_EARLY.format(kind=kind, t=coarse.final.t),)
    known = replace(report, error=error, output_errors=outputs.shares, notes=notes + outputs.notes)
    so_far = replace(run.checkpoint.origin, error=max(told, origin.error), right=right)
    return replace(run, report=known, checkpoint=replace(run.checkpoint, origin=so_far))


def _gap(run: Run, coarse: Run, journey: Journey) -> _Gap:
    """Places and turns of nodes and angles of motors, in yardsticks, at instants of no rhythm."""
    model, begin = journey.plan.model, max(run.track.starts[0], coarse.track.starts[0])
    end = min(run.final.t, coarse.final.t)
    assert isinstance(model, Model)
    k = np.arange(1, _INSTANTS)
    t = np.append(begin + (end - begin) * (k + (_GOLDEN * k) % 1.0) / _INSTANTS, end)
    pairs = [(run.track.state(s)[0], coarse.track.state(s)[0]) for s in t]
    apart = np.array([_apart(model, one, other) for one, other in pairs])
    worst = _names(model)[int(np.argmax(apart.max(axis=0)))]
    read, judged = np.zeros(len(model.outputs)), placed(model)
    read[judged] = np.max([abs(model.measure(one) - model.measure(other)) for one, other in pairs], axis=0)[judged]
    size = np.maximum.accumulate(apart.max(axis=1)) / _most(journey)
    return _Gap(t, size, worst, read, bent(model, [one for one, _ in pairs]))


def _gap_of_rows(run: Run, coarse: Run, journey: Journey) -> _Gap:
    """Places and angles among the outputs, row by row, and all nodes and motors at the end; in yardsticks.

    For many steps, and those from sample to sample: these are kept as what they set out from, and would all have to be
    taken again.
    """
    model, near = journey.plan.model, 1e-9 * run.final.t
    assert isinstance(model, Model)
    judged, read = placed(model), np.zeros(len(model.outputs))
    within = (coarse.t >= run.t[0] - near) & (coarse.t <= run.final.t + near) if len(run.t) >= _POINTS else []
    t = coarse.t[within] if judged and len(within) else np.zeros(0)
    yards = output_yardsticks(model, 1.0)[judged]
    rows = coarse.y[within][:, judged] - _between(run.t, run.y[:, judged], t) if t.size else np.zeros((0, len(judged)))
    read[judged] = np.abs(rows).max(axis=0, initial=0.0)
    apart, names = np.abs(rows) / np.where(yards > 0.0, yards, np.inf), [model.outputs[i] for i in judged]
    if abs(coarse.final.t - run.final.t) <= near:
        names += _names(model)
        last = _apart(model, run.final, coarse.final)
        wide = np.hstack([apart, np.zeros((len(apart), last.size))])
        apart, t = np.vstack([wide, np.append(np.zeros(len(judged)), last)]), np.append(t, run.final.t)
    if not apart.size:
        return _Gap(np.array([run.final.t]), np.zeros(1), "", read)
    worst = names[int(np.argmax(apart.max(axis=0)))]
    return _Gap(t, np.maximum.accumulate(apart.max(axis=1)) / _most(journey), worst, read)


def _between(times: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values at times between rows: the cubic through the four rows around each."""
    first = np.clip(np.searchsorted(times, t) - 2, 0, len(times) - _POINTS)
    at = first[:, None] + np.arange(_POINTS)
    x = times[at]
    off = t[:, None] - x
    found = np.zeros((len(t), values.shape[1]))
    for i in range(_POINTS):
        others = [j for j in range(_POINTS) if j != i]
        span = np.prod(x[:, [i]] - x[:, others], axis=1)
        weight = np.divide(np.prod(off[:, others], axis=1), span, out=np.zeros(len(t)), where=span != 0.0)
        found += weight[:, None] * values[at[:, i]]
    return found


def _most(journey: Journey) -> float:
    """How far the machine has moved, in yardsticks: what shares are of."""
    moved = farthest(journey.plan.model, journey.books.sums.moved)
    return max(float(moved.max(initial=0.0)), 1e3 * journey.plan.tolerance.absolute)


def _apart(model: Model, one: State, other: State) -> np.ndarray:
    """How far each node and motor is from where it is in another run; without the ground, that comes last of nodes."""
    way = np.linalg.norm(one.x - other.x, axis=1) / model.structure.size
    chord = np.linalg.norm(one.R - other.R, axis=(1, 2)) / np.sqrt(8.0)
    nodes = np.maximum(way, 2.0 * np.arcsin(np.minimum(chord, 1.0)))[:-1]
    sources = _sources(model)
    return np.append(nodes, np.abs(one.q - other.q)[sources] / yardsticks(model)[sources])


def _names(model: Model) -> list[str]:
    return [*map(str, model.structure.nodes), *(model.coordinates[i] for i in _sources(model))]


def _sources(model: Model) -> np.ndarray:
    """Which degrees of freedom are angles of motors."""
    return np.unique(model.motion.sources[model.motion.sources < model.n])


def _right(run: Run, gap: _Gap, left: float) -> float:
    """Until when two runs have told that all is well; infinity if they do at the end."""
    wrong = gap.size > _TOLD * left
    begin = run.track.starts[:1] or run.t[:1].tolist() or [0.0]
    return float([*begin, *gap.t.tolist()][int(np.argmax(wrong))]) if wrong.any() else math.inf


def _note(journey: Journey, gap: _Gap, error: float, right: float, kind: str) -> str:
    """What is to be said: how far off, until when all is well, and what would leave little."""
    plan, pace = journey.plan, journey.plan.method.pace
    far = f"{100.0 * error:.2g} % of the motion" if error < _ALL else "all of the motion"
    parted = max(gap.size[-1], journey.origin.error) > PARTED
    is_off = f"may be off by {far}, as {_GROWN}" if parted else f"is off by {far}"
    said = f"by a {kind} run, {gap.where} {is_off}"
    finer = (_AIM / error) ** (1.0 / plan.method.order)
    if isinstance(pace, Controlled):
        less, asked = finer**pace.steepness, plan.tolerance
        remedy = f"give Tolerance({less * asked.relative:.1g}, {less * asked.absolute:.1g})"
    else:
        remedy = f"take steps of {finer * pace.step:.1g} s"
    return f"{said}; right to {_TOLD:.0%} until t = {right:.3g} s: {remedy}"
