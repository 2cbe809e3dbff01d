"""How far a run is off, by a coarser one laid beside it: growth of small differences included."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.answers import Manner
from flexctrl.dynamics.notes.gap import Gap
from flexctrl.dynamics.notes.heard import heard
from flexctrl.dynamics.notes.lengths import as_many, in_words, usual
from flexctrl.dynamics.notes.orders import MARGIN
from flexctrl.dynamics.notes.outputs import by_rows
from flexctrl.dynamics.notes.peaks import unresolved
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.notes.right import right_until, said_until
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.scales import turning, yardsticks
from flexctrl.dynamics.steps import Controlled, Fixed
from flexctrl.effects.lugre_friction import LuGreFriction
from flexctrl.model.model import Model

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = [
    "PARTED",
    "TOLD",
    "agreeing",
    "can_be_told",
    "elsewhere",
    "is_cut",
    "kept_short",
    "may_grow",
    "rattles",
    "shorter",
    "told_beside",
]

_SWUNG, _FAR = 0.25, 0.02
"""What swings by less is nearly linear; what goes as far may snap through, or swing on a far larger machine."""
_OFTEN = 12.0
"""Little grows in half a turn, to and fro: steps of one length, half of which it costs, are not taken again for it."""
TOLD, _AIM = 0.03, 0.01
"""What is noted, and what a remedy would leave."""
_LEAST, _ALL = 0.1, 0.995
"""Where fewer steps than that could be longer, both runs are about the same but for what grows."""
_ASTRAY, PARTED = 0.1, 0.2
"""Runs that have parted by more may both be wrong: no share of that is sure to be the finer one's."""
_MORE = 1.2
_CUT = 0.6
"""Where a run in twice the step takes more of the steps, it makes some errors alike."""
_AGAIN = 4
"""Corners at so many instants: what follows the last hangs on all before."""
_GROWN = "small differences grow, or steps are too long"
_ELSEWHERE = (
    "{where} goes elsewhere in a run {how} ({far:.2g} of the motion away, from t = {t:.3g} s): {grown}, and what is "
    "told of errors here may be too little: see whether {remedy} agrees"
)
_EARLY = (
    "the {kind} run beside it ended at t = {t:.3g} s: how far small differences have grown since is not told, nor what "
    "outputs are off by: see whether {remedy} agrees"
)


def can_be_told(journey: Journey) -> bool:
    """Tell whether a coarser run may be made, and would say something.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
        False for linear models and `Exact`, of which `interpolated` tells, and where the run ended early.
    """
    return journey.status in (Status.FINISHED, Status.STOPPED) and _has_steps_to_judge(journey)


def is_cut(journey: Journey) -> bool:
    """Tell whether a coarser run would say something of one that is interrupted.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    bool
    """
    return journey.status is Status.INTERRUPTED and _has_steps_to_judge(journey)


def _has_steps_to_judge(journey: Journey) -> bool:
    return isinstance(journey.plan.model, Model) and journey.judging is not None and journey.mark.steps > 0


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


def shorter(run: Run, journey: Journey, law: Manner) -> float:
    """Return by how much steps of the run beside are to be shorter; 1 where they are to be longer.

    Parameters
    ----------
    journey : Journey
        At its end.
    law : Manner
        How a sampled law answers.

    Returns
    -------
    float
        A half where samples, breaks of commands or the end keep steps short (most of them, or those between the short
        ones that bristles and lags take after samples), in steps of one length past corners, which a law of one's own
        may have, too, and in those that do not see a line vibrate whose tension is asked for: whether a contact with
        little to spare breaks loose is decided by a finer run, where two coarse ones may be wrong alike. A quarter for
        what jumps at every sample: of what half the steps round as the run itself does, they round a quarter otherwise.
        So it is under a law that hunts between its limits, as it does in another phase in runs that are not far finer.
    """
    if law in (Manner.ABRUPT, Manner.HUNTING):
        return 0.25
    fixed = isinstance(journey.plan.method.pace, Fixed)
    cornered = fixed and (journey.plan.feed.reacting or _cornered(journey, {*journey.watch.corner_names}))
    if as_many(journey, 2.0) > _CUT or kept_short(journey) or _flows(journey) or cornered or unresolved(journey):
        return 0.5
    return 0.5 if law is Manner.LIMITED and heard(run, journey) else 1.0


def _flows(journey: Journey) -> bool:
    """Tell whether bristles or lags take short steps after samples, which keep the others: these are then alike.

    So are coarser runs in when bristles let go, with or without samples: what creeps first is over within a step.
    """
    model = journey.plan.model
    if not isinstance(model, Model):
        return False
    bristles = any(isinstance(effect, LuGreFriction) for effect in model.effects)
    return bristles or (journey.plan.feed.sample_time > 0.0 and model.motion.flows.size > 0)


def rattles(journey: Journey) -> bool:
    """Tell whether a run has met corners again and again: what two coarser ones tell is a guess there.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    bool
    """
    names = {*journey.watch.corner_names}
    return len({event.t for event in journey.events if event.name in names}) >= _AGAIN


def _cornered(journey: Journey, names: set[str]) -> bool:
    return any(event.name in names for event in journey.events)


def may_grow(journey: Journey, law: Manner) -> bool:
    """Tell whether small differences may have grown of themselves.

    Parameters
    ----------
    journey : Journey
        At its end.
    law : Manner
        How a sampled law answers.

    Returns
    -------
    bool
        Whether something has swung by more than a quarter of a radian, gone farther than a fiftieth of the machine's
        size, met corners, or followed a law that has corners or jumps, or is continuous, which may have some; or the
        tension of a line is asked for whose vibration steps do not see. In steps of one length, if it has gone twelve
        times that way to and fro. Where samples keep steps short the other run is a finer one, which costs twice as
        much as the run itself: only for what turns so far and often, or goes a quarter of the machine's size so often,
        and for corners and jumps.
    """
    plan, sums, watch, short = journey.plan, journey.books.sums, journey.watch, kept_short(journey)
    feed, model = plan.feed, plan.model
    own = {*watch.corner_names, *(() if short else watch.names)}
    least = np.where(turning(model) | short, _SWUNG, _FAR) * yardsticks(model)
    swung = sums.moved > least
    if short or isinstance(plan.method.pace, Fixed):
        swung &= sums.path > _OFTEN * least
    bounds = feed.reacting or law is not Manner.SMOOTH or _cornered(journey, own)
    return bool(swung.any()) or bounds or unresolved(journey)


def told_beside(
    run: Run,
    coarse: Run,
    gap: Gap,
    journey: Journey,
    longer: float,
    order: float,
    feared: float = 0.0,
    agreed: Callable[[float], float] = float,
) -> Run:
    """Return a run with what a coarser one tells of its error.

    Where nothing else keeps them short, steps of the coarser run are longer by a factor r and its errors by rᵖ. Samples
    and impacts do keep steps short: a share φ of steps that could be longer makes n/m = 1 − φ (1 − 1/r) of the n steps,
    and is taken to have made that share of the errors. Of what the runs are apart, 1/(rᵖ − 1) φ is left, and told with
    a factor of safety. Where another one, farther off, has parted and this one has not, it may be near by accident:
    what is told is the geometric mean of what the two would leave, if that is more.

    Parameters
    ----------
    run : Run
    coarse : Run
        The same to a larger tolerance, or in longer steps.
    gap : Gap
        How far the two are apart.
    journey : Journey
        How the finer one went.
    longer : float
        By how much steps of the coarser one are longer; below 1 it is a finer one.
    order : float
        p: that of the method, or less, as two runs beside have shown it.
    feared : float
        What one that has parted would leave if errors grew as powers of steps do; 0 if none has.
    agreed : callable, optional
        Until when this one and those before it agree with each other: no later than a time [s].

    Returns
    -------
    Run
        As it is where the coarser one took no step. Where nearly all its steps are the same, or it has parted from
        the finer one so far that sums of local errors tell more, it tells of outputs alone. Of one that ended before
        the run did it keeps what these sums tell, and says so; one that reached its end and was called unresolved
        there is as good as others.
    """
    if not coarse.report.steps:
        return run
    fewer, report = coarse.report.steps / max(run.report.steps, 1), run.report
    free = (1.0 - fewer) / (1.0 - 1.0 / longer)
    left = min(max(free, _LEAST), 1.0) * abs(longer**order - 1.0) / MARGIN
    told, parted = gap.most / left, gap.most > PARTED
    origin = journey.origin
    summed = max(told, origin.error) < report.drift and (free < _LEAST or parted)
    left = 1.0 if parted else left / max(1.0, math.sqrt(feared / max(told, 1e-300)))
    told = gap.most / left
    early = coarse.status not in (Status.FINISHED, Status.STOPPED) and coarse.final.t < (1.0 - 1e-9) * run.final.t
    error = max(told, origin.error, report.drift if early else journey.drift.ran)
    kind = "coarser" if longer > 1.0 else "finer"
    ended = (_EARLY.format(kind=kind, t=coarse.final.t, remedy=agreeing(journey)),) if early else ()
    if summed:  # nobody knows which share of what the two are apart is this one's
        outputs = by_rows(journey, run.y, gap.outputs, report.drift, kind)
        notes = tuple(note for note in report.notes if note not in journey.outputs.notes) + outputs.notes + ended
        return replace(run, report=replace(report, output_errors=outputs.shares, notes=notes))
    outputs = by_rows(journey, run.y, gap.outputs / left, error, kind)
    right = right_until(run, coarse, journey, gap, TOLD * left, agreed)
    said = (journey.drift.note, journey.bent, *journey.outputs.notes)
    notes = tuple(note for note in report.notes if note not in said)
    notes += tuple({gap.bent or journey.bent} - {""})
    if max(told, origin.error) >= error > TOLD:
        notes += (_note(journey, gap, error, right, kind),)
    elif journey.drift.note and error > told:  # a wrong speed, which both runs have alike; or nobody knows better
        notes += (journey.drift.note,)
    known = replace(report, error=error, output_errors=outputs.shares, notes=notes + ended + outputs.notes)
    so_far = replace(run.checkpoint.origin, error=max(told, origin.error), right=right)
    return replace(run, report=known, checkpoint=replace(run.checkpoint, origin=so_far))


def elsewhere(run: Run, gap: Gap, journey: Journey, how: str) -> Run:
    """Return a run with a note that a far coarser one goes elsewhere: two nearer ones may be off alike.

    Parameters
    ----------
    run : Run
        With what nearer ones have told.
    gap : Gap
        How far it is from that one.
    journey : Journey
        How it went.
    how : str
        In which steps the other one went.

    Returns
    -------
    Run
    """
    since, remedy = float(gap.t[int(np.argmax(gap.size > _ASTRAY))]), agreeing(journey)
    note = _ELSEWHERE.format(where=gap.where, how=how, far=gap.most, t=since, grown=_GROWN, remedy=remedy)
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))


def agreeing(journey: Journey) -> str:
    """Return what is to agree with a run that may be wrong: one far finer.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    str
        Its tolerance, or its step.
    """
    asked, pace = journey.plan.tolerance, journey.plan.method.pace
    if isinstance(pace, Controlled):
        return f"Tolerance({0.01 * asked.relative:.1g}, {0.01 * asked.absolute:.1g})"
    return f"a step of {0.25 * usual(journey):.1g} s"


def _note(journey: Journey, gap: Gap, error: float, right: float, kind: str) -> str:
    """What is to be said: how far off, until when all is well, and what would leave little."""
    plan, pace = journey.plan, journey.plan.method.pace
    far = f"{percent(error)} of the motion" if error < _ALL else "all of the motion"
    parted = max(gap.most, journey.origin.error) > PARTED
    is_off = f"may be off by {far}, as {_GROWN}" if parted else f"is off by {far}"
    said = f"by a {kind} run, {gap.where} {is_off}"
    finer = (_AIM / error) ** (1.0 / plan.method.order)
    if isinstance(pace, Controlled):
        less, asked = finer**pace.steepness, plan.tolerance
        remedy = f"give Tolerance({less * asked.relative:.1g}, {less * asked.absolute:.1g})"
    else:
        step = usual(journey)
        remedy = f"take steps of {in_words(finer * step, step)} s"
    return f"{said}; {said_until(journey.origin, right, f'{TOLD:.0%}')}: {remedy}"
