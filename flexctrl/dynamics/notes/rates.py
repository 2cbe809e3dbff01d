"""Forces and rates among the outputs: how far each may be off at an instant, by all runs laid beside one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.beside import agreeing
from flexctrl.dynamics.notes.gap import interpolated
from flexctrl.dynamics.notes.orders import least_order, orders_seen
from flexctrl.dynamics.notes.outputs import fast, told_from, ways
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.notes.striking import at_events, in_both, struck
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Fixed
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.structure.outputs import AngularVelocity, Velocity

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["LOST", "Apart", "are_asked", "is_named", "may_be_lost", "rated", "said_of_rates"]

_POINTS, _NEAR = 4, 1e-9
_STEEP, _MOST, _JUMP, _SHARED = 0.1, 8, 0.01, 0.3
_NOTED, _BESIDE, _NAMED = 0.1, 2.0, 3
_ROUND = np.pi
"""How far goes what does not only swing, in radians or sizes of the machine."""
_LITTLE, _DUST, _FAINT = 1e-3, 1e-6, 1e-2
"""What is told, of its largest value; of what is noted a larger share. What is told is fainter than what is noted."""
_ALIKE = 0.97
"""A coarser run in more of the steps is the same run: samples may round steps of any length to one."""
_LEAST = 0.5
"""Of a gap to a finer run no more than twice as much is this one's, where samples keep both short."""
LOST, _SURE = 0.1, 0.25
"""From which share of an output's range a gap is no longer one of small lags (all of it from twice that), and by how
much the order seen may be lower."""
_SAID = "by another run, {name} may be off by {far} of its range at an instant: see whether {finer} agrees"
_STRUCK = (
    "{name} may jump by {far} of its range at events: rows at their very instants, or as near as these may be "
    "off, are of one side of that"
)
_LINEAR = (
    "what errors of steps do to single outputs is not told of a linear model: the method Exact makes none, and is its "
    "default"
)
_ABOUT = " {name} rings by", " largest {name} is", " peaks of {name} may"


@frozen
class Apart:
    """How far the outputs of another run are from those of a run.

    Attributes
    ----------
    longer : float
        By how much its steps are longer; below 1 it is a finer one.
    free : float
        The share of steps that are.
    most : numpy.ndarray, shape (outputs,)
        In rows, in units of the outputs.
    struck : numpy.ndarray, shape (outputs,)
        In rows at the very instants of events, where forces may jump, or of the other side of one.
    """

    longer: float
    free: float
    most: np.ndarray
    struck: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, run: Run, other: Run, longer: float) -> Apart:
        """Return it of two runs, where both have rows.

        Between its rows the first is somewhere between what it is there and a smooth curve through them. Rows of a run
        that has failed need be no numbers: they tell nothing.
        """
        fewer, near = other.report.steps / max(run.report.steps, 1), _NEAR * run.final.t
        free, (most, jumped) = (1.0 - fewer) / (1.0 - 1.0 / longer), np.zeros((2, run.y.shape[1]))
        if len(run.t) >= _POINTS:
            within = (other.t >= run.t[0] - near) & (other.t <= run.t[-1] + near) & np.isfinite(other.y).all(axis=1)
            low, high = _between(run, other.t[within], near)
            y = other.y[within]
            most = np.maximum(np.maximum(low - y, y - high), 0.0).max(axis=0, initial=0.0)
            if run.track.stretches and other.track.stretches and len(other.t):
                jumped = struck(run, other)
                most = most if run.track.feed.sample_time else np.maximum(most, _where_steep(run, other, near))
        return cls(longer, min(max(free, _LEAST), 1.0), most, jumped)

    def left(self, order: np.ndarray) -> np.ndarray:
        """What of a gap is the first run's own, if errors go by powers of the steps."""
        least = _LEAST if self.longer < 1.0 else 1.0
        return self.most / np.maximum(self.free * np.abs(self.longer**order - 1.0), least)


def _where_steep(run: Run, other: Run, near: float) -> np.ndarray:
    """How far outputs of another run are from a run's own where these change most from row to row, there and between,
    and in the rows that are farthest from it.

    What a run does between two rows may be anything, as far as rows tell: all that another one is off by may lie
    between them. It does not where both have many rows at the same times, as samples make them.
    """
    way = np.ptp(run.y, axis=0)
    steep = (np.abs(np.diff(run.y, axis=0)) / np.where(way > 0.0, way, np.inf)).max(axis=1)
    most = np.argsort(-steep)[:_MOST]
    shared = np.abs(other.t[np.clip(np.searchsorted(other.t, run.t - near), 0, len(other.t) - 1)] - run.t) <= near
    rows = np.unique(np.concatenate([most, most + 1, _where_far(run, other, way)]))
    rows = rows[~shared[rows] & ~np.isin(rows, at_events(run))] if shared.mean() < _SHARED else rows[:0]
    between = 0.5 * (run.t[most] + run.t[most + 1])[steep[most] > _STEEP]
    own = [(run.t[k], run.y[k]) for k in rows if in_both(run, other, run.t[k])]
    own += [(t, run.track.moment(t)[1]) for t in between if in_both(run, other, t)]
    apart = (np.abs(other.track.moment(t)[1] - y) for t, y in own)
    return reduce(np.fmax, apart, np.zeros(run.y.shape[1]))


def _where_far(run: Run, other: Run, way: np.ndarray) -> np.ndarray:
    """The rows in which outputs are farthest from smooth curves through another run's, of those that are so most."""
    rows = np.flatnonzero((run.t > other.t[0]) & (run.t < other.t[-1]))
    if len(other.t) < _POINTS:
        return rows[:0]
    apart = np.abs(interpolated(other.t, other.y, run.t[rows]) - run.y[rows]) / np.where(way > 0.0, way, np.inf)
    apart[~np.isfinite(apart)] = 0.0
    far = np.argsort(-apart, axis=0)[:2]
    order = np.argsort(-np.take_along_axis(apart, far, axis=0), axis=None)
    return rows[far.ravel()[order[: 2 * _MOST]]]


def are_asked(run: Run, journey: Journey) -> bool:
    """Tell whether a run shows forces or rates that count, of which sums of local errors tell nothing.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.

    Returns
    -------
    bool
    """
    return bool(_judged(run, journey, _LITTLE))


def may_be_lost(run: Run, other: Run, journey: Journey, share: float) -> bool:
    """Tell whether some force or rate of another run is so far away that it may have lost its phase.

    Parameters
    ----------
    run : Run
    other : Run
        In other steps.
    journey : Journey
        How the first went.
    share : float
        Of what the output goes through.

    Returns
    -------
    bool
    """
    way = _judged(run, journey, _LITTLE)
    most = Apart.of(run, other, 2.0).most if way else np.zeros(0)
    return any(most[i] > share * far for i, far in way.items())


def rated(run: Run, others: Sequence[tuple[Run, float]], journey: Journey) -> Run:
    """Return a run with what others tell of its forces and rates, instant by instant.

    Of two coarser runs the gaps tell by which power of the steps errors go; what no step resolves goes by none, and all
    of a gap may be this run's. Of a single one nobody knows, but in steps of one length, as these are made finer where
    corners are met, and what rings is told by itself. The gap of a finer one is most of what this one is off, whatever
    coarser ones say. One that ended early tells nothing if others did not.

    Parameters
    ----------
    run : Run
        With what they tell of places.
    others : sequence of (Run, float)
        By how much their steps are longer.
    journey : Journey
        How the run went.

    Returns
    -------
    Run
    """
    way = _judged(run, journey, _DUST)
    apart = _apart(run, others) if way else []
    if not apart:
        return run
    steady = isinstance(journey.plan.method.pace, Fixed)
    off, known = _off(apart, ways(journey, run.y), run.report.order, steady), run.report.output_errors
    found = {run.outputs[i]: min(float(off[i] / way[i]), 1.0) for i in way}
    late = _late(run, journey, way)
    shares = {name: max(share, known.get(name, 0.0), late.get(name, 0.0)) for name, share in found.items()}
    notes = (*run.report.notes, *_jumps(run, way, shares, min(apart, key=lambda a: a.longer).struck))
    return replace(run, report=replace(run.report, output_errors={**known, **shares}, notes=notes))


def _late(run: Run, journey: Journey, way: dict[int, float]) -> dict[str, float]:
    """By what share speeds may be off of what goes round by itself, at a wrong speed: as late as places are."""
    model, sums, drift = journey.plan.model, journey.books.sums, journey.drift
    span = journey.point.state.t - journey.origin.state.t
    if not (drift.ran > 0.0 and drift.late.size and isinstance(model, Model) and span > 0.0):
        return {}
    state, raw = journey.point.state, model.motion.raw
    rows, steps = np.diff(run.t), np.abs(np.diff(run.y, axis=0))
    steep = (steps[rows > 0.0] / rows[rows > 0.0, None]).max(axis=0, initial=0.0)
    speed = np.sqrt(sums.swept / span)
    rounds = (speed > 0.0) & (sums.moved > _ROUND * yardsticks(model))
    delay = np.divide(drift.late, speed, out=np.zeros_like(speed), where=rounds)
    sight = model.signals.slopes(state, model.rates(state), raw)[1] @ model.motion.jacobian(state)[:raw]
    shown = {i: sight[[i]].indices for i in way if isinstance(model.structure.outputs[i], Velocity | AngularVelocity)}
    return {
        model.outputs[i]: min(float(delay[own].max(initial=0.0) * steep[i] / way[i]), 1.0) for i, own in shown.items()
    }


def _jumps(run: Run, way: dict[int, float], shares: Mapping[str, float], struck: np.ndarray) -> tuple[str, ...]:
    """What is to be said of outputs that jump at events by more than all that is told of them."""
    jumps = {run.outputs[i]: float(struck[i] / far) for i, far in way.items()}
    much = {name: jump for name, jump in jumps.items() if jump > max(_JUMP, _BESIDE * shares[name])}
    if not much:
        return ()
    worst, *others = sorted(much, key=lambda name: -much[name])
    note = _STRUCK.format(name=worst, far=percent(min(much[worst], 1.0)))
    return (note + (f"; so may {', '.join(others[:_NAMED])}" if others else ""),)


def _judged(run: Run, journey: Journey, little: float) -> dict[int, float]:
    """The forces and rates that go through more than a share of their largest value, and what each goes through.

    That has to be more than absolute tolerances; or the value itself, where it may go through next to nothing.
    """
    model = journey.plan.model
    if not isinstance(model, Model) or len(run.y) < _POINTS:
        return {}
    way, most = ways(journey, run.y), np.abs(run.y).max(axis=0)
    counts = most > told_from(journey, _FAINT) if little < _LITTLE else way > told_from(journey)
    return {i: float(way[i]) for i in fast(model) if counts[i] and np.inf > way[i] > little * most[i]}


def _apart(run: Run, others: Sequence[tuple[Run, float]]) -> list[Apart]:
    """How far others are from a run: those that ended as late, if any did, in other steps than its own."""
    ended = [each for each in others if each[0].final.t >= run.final.t * (1.0 - _NEAR)] or others
    unlike = [each for each in ended if each[1] < 1.0 or each[0].report.steps < _ALIKE * run.report.steps]
    return [Apart.of(run, other, longer) for other, longer in unlike if len(other.t)]


def _off(apart: list[Apart], ways: np.ndarray, order: float, steady: bool) -> np.ndarray:
    """By how much each output may be off: by a finer run if there is one, else by the nearest coarser one.

    What rings in a coarser run may have lost its phase there: gaps that are a fifth of all that there is go by no power
    of the steps, if no farther run shows that they do; nor does a farther one whose gap is that large.
    Where the order seen is less than the method's, part of what is off goes by none, and is in all runs alike: no less
    is told than the geometric mean of what the order leaves and all of the gap.
    A finer one may be near by chance, where each impact adds its own: no less is told than the geometric mean of what
    it tells and what coarser ones do.
    """
    near, *farther = sorted(apart, key=lambda a: a.longer)
    single = not farther or near.longer == farther[-1].longer
    known = near.longer < 1.0 or (steady and single)
    least = np.full(near.most.shape, order if known else least_order(near.longer, order))
    if near.longer < 1.0:
        own, coarser = near.left(least), [a for a in farther if a.longer > 1.0]
        return np.maximum(own, np.sqrt(own * _off(coarser, ways, order, steady))) if coarser else own
    seen = (
        least if single else orders_seen(near.most, farther[-1].most, (near.longer, farther[-1].longer), (least, order))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        if not single and (farther[-1].most > 2.0 * LOST * ways)[ways > 0.0].any():
            seen = least  # nor does one that has lost its phase show any power
        off = near.left(seen)
        lost = np.where(ways > 0.0, np.clip(near.most / ways / LOST - 1.0, 0.0, 1.0), 0.0)
    sure = ~np.full(off.shape, single) & (seen > order - _SURE)
    mean = np.sqrt(off * near.most) if not known else off
    return np.where(sure, off, np.maximum(off + lost * (near.most - off), mean))


def _between(run: Run, t: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """The least and the most that outputs of a run may be at some times."""
    after = np.clip(np.searchsorted(run.t, t), 1, len(run.t) - 1)
    curve = interpolated(run.t, run.y, t)
    low, high = np.minimum(curve, run.y[after]), np.maximum(curve, run.y[after])
    low, high = np.minimum(low, run.y[after - 1]), np.maximum(high, run.y[after - 1])
    for row in (after - 1, after):
        there = np.abs(run.t[row] - t)[:, None] <= near
        low, high = np.where(there, run.y[row], low), np.where(there, run.y[row], high)
    return low, high


def said_of_rates(run: Run, journey: Journey) -> Run:
    """Return a run with a note on the forces and rates that are farther off than places are, unless others name them.

    Parameters
    ----------
    run : Run
        With all that is told of it.
    journey : Journey
        How it went.

    Returns
    -------
    Run
    """
    model, report = journey.plan.model, run.report
    if not isinstance(model, Model):  # linear equations; `judging` is None where they are solved exactly
        known = journey.judging is None or report.output_errors
        return run if known else replace(run, report=replace(report, notes=(*report.notes, _LINEAR)))
    names = [model.outputs[i] for i in _judged(run, journey, _LITTLE)]
    shares = {name: report.output_errors.get(name, 0.0) for name in names if not is_named(name, report.notes)}
    far = [name for name in shares if shares[name] > max(_NOTED, _BESIDE * report.error)]
    if not far:
        return run
    worst, *others = sorted(far, key=lambda name: -shares[name])
    note = _SAID.format(name=worst, far=percent(shares[worst]), finer=agreeing(journey))
    named = ", ".join(f"{name} {percent(shares[name])}" for name in others[:_NAMED])
    more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    note += f"; beside it {named}{more}" if others else ""
    return replace(run, report=replace(report, notes=(*report.notes, note)))


def is_named(name: str, notes: Sequence[str]) -> bool:
    """Tell whether some note is about the peaks or the ringing of an output.

    Parameters
    ----------
    name : str
    notes : sequence of str

    Returns
    -------
    bool
    """
    return any(words.format(name=name) in f" {note}" for words in _ABOUT for note in notes)
