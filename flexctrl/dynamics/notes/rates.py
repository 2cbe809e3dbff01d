"""Forces and rates among the outputs: how far each may be off at an instant, by all runs laid beside one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.apart import Apart, off_by, telling
from flexctrl.dynamics.notes.beside import agreeing
from flexctrl.dynamics.notes.orders import MARGIN
from flexctrl.dynamics.notes.outputs import fast, told_from, ways
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Fixed
from flexctrl.model.model import Model
from flexctrl.structure.outputs import AngularVelocity, Velocity

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["are_asked", "is_named", "may_be_lost", "rated", "said_of_rates"]

_POINTS, _JUMP = 4, 0.01
_NOTED, _BESIDE, _NAMED = 0.1, 2.0, 3
_ROUND = np.pi
"""How far goes what does not only swing, in radians or sizes of the machine."""
_LITTLE, _DUST, _FAINT = 1e-3, 1e-6, 1e-2
"""What is told, of its largest value; of what is noted a larger share. What is told is fainter than what is noted."""
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
    apart = [Apart.of(run, other, longer) for other, longer in telling(run, others)] if way else []
    if not apart:
        return run
    steady = isinstance(journey.plan.method.pace, Fixed)
    off, known = off_by(apart, ways(journey, run.y), run.report.order, steady), run.report.output_errors
    found = {run.outputs[i]: min(MARGIN * float(off[i] / way[i]), 1.0) for i in way}
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
