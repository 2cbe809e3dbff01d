"""How far two runs of a machine are apart, instant by instant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.outputs import placed
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import farthest, output_yardsticks, yardsticks
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.model.overturned import bent
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Gap", "between", "gap_at", "interpolated", "is_short"]

_POINTS, _FEW = 4, 1500
_DUST = 1e-9
_INSTANTS, _FEWER, _GOLDEN = 16, 8, 0.5 * (5.0**0.5 - 1.0)


@frozen
class Gap:
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

    @staticmethod
    def unseen(run: Run) -> Gap:
        """Return that of a run which cannot be laid beside another."""
        return Gap(np.array([run.final.t]), np.zeros(1), "", np.zeros(run.y.shape[1]))

    @property
    def most(self) -> float:
        """At the end."""
        return float(self.size[-1])


def between(run: Run, other: Run, journey: Journey, taken: int) -> Gap:
    """Return how far a run is from another one.

    Parameters
    ----------
    run : Run
    other : Run
        The same in other steps.
    journey : Journey
        How the first went.
    taken : int
        Its steps since it went on.

    Returns
    -------
    Gap
    """
    model = journey.plan.model
    if not isinstance(model, Model):
        return _of_outputs(run, other, journey)
    instants = _INSTANTS if taken <= _FEW else 0 if placed(model) else _FEWER  # rows of rates tell nothing of places
    if instants and _kept(run, other, journey):
        return _of_tracks(run, other, journey, instants)
    return _of_rows(run, other, journey)


def _kept(run: Run, other: Run, journey: Journey) -> bool:
    """Tell whether steps of both are kept, not from sample to sample as what they set out from."""
    return bool(run.track.stretches and other.track.stretches) and not journey.plan.feed.sample_time


def is_short(run: Run, other: Run, journey: Journey) -> bool:
    """Tell whether two runs can be looked at anywhere: their steps are kept, and few.

    Parameters
    ----------
    run, other : Run
    journey : Journey
        How the run went that they are beside.

    Returns
    -------
    bool
    """
    return _kept(run, other, journey) and max(run.report.steps, other.report.steps) <= _FEW


def gap_at(run: Run, other: Run, journey: Journey, t: float) -> float:
    """Return how far places and turns of nodes and angles of motors are apart at an instant, over the largest motion.

    Parameters
    ----------
    run, other : Run
        With their steps, as far as that instant.
    journey : Journey
        How the first went.
    t : float
        [s]

    Returns
    -------
    float
    """
    model = journey.plan.model
    assert isinstance(model, Model)
    apart = _apart(model, run.track.state(t)[0], other.track.state(t)[0])
    return float(apart.max(initial=0.0)) / _most(journey)


def _of_tracks(run: Run, other: Run, journey: Journey, instants: int) -> Gap:
    """Places and turns of nodes and angles of motors, in yardsticks, at instants of no rhythm and where rows differ."""
    model, begin = journey.plan.model, max(run.track.starts[0], other.track.starts[0])
    end = min(run.final.t, other.final.t)
    assert isinstance(model, Model)
    k = np.arange(1, instants)
    t = np.append(begin + (end - begin) * (k + (_GOLDEN * k) % 1.0) / instants, [begin, end] if begin else end)
    t = np.unique(np.append(t, _farthest(run, other, model, (begin, end))))
    pairs = [(run.track.state(s)[0], other.track.state(s)[0]) for s in t]
    apart = np.array([_apart(model, one, other) for one, other in pairs])
    worst = _names(model)[int(np.argmax(apart.max(axis=0)))]
    read, judged = np.zeros(len(model.outputs)), placed(model)
    read[judged] = np.max([abs(model.measure(one) - model.measure(other)) for one, other in pairs], axis=0)[judged]
    size = np.maximum.accumulate(apart.max(axis=1)) / _most(journey)
    return Gap(t, size, worst, read, bent(model, [one for one, _ in pairs]))


def _farthest(run: Run, other: Run, model: Model, within: tuple[float, float]) -> np.ndarray:
    """Instants at which places and angles among the outputs are farthest apart as rows have it, those that are most;
    and those since when they are by half of all, a quarter, and so on: growth shows there.
    """
    rows, judged = np.flatnonzero((other.t > within[0]) & (other.t < within[1])), placed(model)
    if len(run.t) < _POINTS or not len(rows) or not judged:
        return np.zeros(0)
    yards = output_yardsticks(model, 1.0)[judged]
    apart = np.abs(other.y[rows][:, judged] - interpolated(run.t, run.y[:, judged], other.t[rows]))
    apart = np.nan_to_num(apart / np.where(yards > 0.0, yards, np.inf), posinf=0.0)
    far = np.argmax(apart, axis=0)[np.argsort(-apart.max(axis=0))[:_FEWER]]
    so_far = np.maximum.accumulate(apart.max(axis=1))
    halves = np.searchsorted(so_far, so_far[-1] * 0.5 ** np.arange(1, _FEWER + 1))
    return other.t[rows[np.append(far, halves)]]


def _of_rows(run: Run, other: Run, journey: Journey) -> Gap:
    """Places and angles among the outputs, row by row, and all nodes and motors at the end; in yardsticks.

    For many steps, and those from sample to sample: these are kept as what they set out from, and would all have to be
    taken again.
    """
    model, near = journey.plan.model, 1e-9 * run.final.t
    assert isinstance(model, Model)
    judged, read = placed(model), np.zeros(len(model.outputs))
    within = (other.t >= run.t[0] - near) & (other.t <= run.final.t + near) if len(run.t) >= _POINTS else []
    t = other.t[within] if judged and len(within) else np.zeros(0)
    yards = output_yardsticks(model, 1.0)[judged]
    rows = np.zeros((0, len(judged)))
    if t.size:
        rows = other.y[within][:, judged] - interpolated(run.t, run.y[:, judged], t)
    read[judged] = np.abs(rows).max(axis=0, initial=0.0)
    apart, names = np.abs(rows) / np.where(yards > 0.0, yards, np.inf), [model.outputs[i] for i in judged]
    if abs(other.final.t - run.final.t) <= near:
        names += _names(model)
        last = _apart(model, run.final, other.final)
        wide = np.hstack([apart, np.zeros((len(apart), last.size))])
        apart, t = np.vstack([wide, np.append(np.zeros(len(judged)), last)]), np.append(t, run.final.t)
    if not apart.size:
        return Gap.unseen(run)
    worst = names[int(np.argmax(apart.max(axis=0)))]
    return Gap(t, np.maximum.accumulate(apart.max(axis=1)) / _most(journey), worst, read)


def _of_outputs(run: Run, other: Run, journey: Journey) -> Gap:
    """All outputs of a linear model, row by row, over how far each goes, and its coordinates at the end."""
    model, near, way = journey.plan.model, 1e-9 * run.final.t, np.ptp(run.y, axis=0) if len(run.y) else np.zeros(0)
    within = (other.t >= run.t[0] - near) & (other.t <= run.final.t + near) if len(run.t) >= _POINTS else []
    rows = np.zeros((0, way.size))
    t = other.t[within] if way.size and len(within) else np.zeros(0)
    if t.size:
        rows = np.abs(other.y[within] - interpolated(run.t, run.y, t))
    yards = output_yardsticks(model, journey.mark.size) * _most(journey)
    apart = rows / np.where(way > _DUST * yards, way, np.inf)
    last = np.abs(other.final.q - run.final.q) / _most(journey)
    names, ends = [*run.outputs, *model.coordinates], np.append(np.zeros(way.size), last)
    apart = np.vstack([np.hstack([apart, np.zeros((len(apart), last.size))]), ends])
    worst = names[int(np.argmax(apart.max(axis=0)))]
    size = np.maximum.accumulate(apart.max(axis=1))
    return Gap(np.append(t, run.final.t), size, worst, rows.max(axis=0, initial=0.0))


def interpolated(times: np.ndarray, values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return values at times between rows: those of the cubic through the four rows around each.

    Parameters
    ----------
    times : numpy.ndarray, shape (rows,)
        Four at least.
    values : numpy.ndarray, shape (rows, count)
    t : numpy.ndarray, shape (n,)

    Returns
    -------
    numpy.ndarray, shape (n, count)
    """
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
    return max(float(moved.max(initial=0.0)), 1e3 * journey.plan.tolerance.negligible)


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
