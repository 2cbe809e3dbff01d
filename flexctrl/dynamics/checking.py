"""Runs made again, coarser, to tell how far the first is off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from flexctrl.dynamics.agreed import agreed
from flexctrl.dynamics.journey import Journey
from flexctrl.dynamics.methods.checked import Beside, Checked
from flexctrl.dynamics.notes.answers import jumps
from flexctrl.dynamics.notes.apart import LOST
from flexctrl.dynamics.notes.beside import PARTED, TOLD, elsewhere, rattles, told_beside
from flexctrl.dynamics.notes.commanded import commanded
from flexctrl.dynamics.notes.fading import radius
from flexctrl.dynamics.notes.lengths import as_many, usual
from flexctrl.dynamics.notes.orders import least_order, orders_seen
from flexctrl.dynamics.notes.peaks import peaked
from flexctrl.dynamics.notes.rates import may_be_lost, rated
from flexctrl.dynamics.others import UNCHECKED, Beginning, Other, made, noted, standing
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.steps import Controlled, Fixed

__all__ = ["laid_beside", "news"]

_NEARER, _LITTLE = 0.5, 0.01
_FARTHER = 5.0 / 3.0
"""How far the last one is, in powers: 243 times the tolerance."""
_ASTRAY, _FASTER = 0.1, 1.3
"""It goes elsewhere where it is a tenth of the motion away, and so much farther than by its order."""
_CHANCE = 2.0 / 3.0
"""What is nearer than that, of what it would be by its order, is so by chance."""
_ALIKE, _SAMPLED, _KNOTTED = 0.7, 0.5, 0.4
"""A coarser run with more of the steps, or so many between samples or between knots that are more than a coarser run
would take steps by itself, is much the same, and makes the same errors."""
_DAMPING = 0.5
"""Spectral radius of steps below which what vibrates fast is gone from coarser runs as from the first."""
_CUT = 0.8
"""A run nearby with more of the steps is much the same where stops cut them."""
_OFF, _NEARLY = 0.01, 0.001
"""What rates are apart by that counts, as all of it may be the first run's; and a thirtieth of what is noted: coarser
runs have told of rattling too little by seven times."""


def laid_beside(run: Run, journey: Journey, method: Checked, beginning: Beginning, shorter: float) -> Run:
    """Return the run with what a coarser one tells of it; where that is much, a second one has the last word.

    Where it takes nearly as many steps, as something else keeps them short, a finer one has the last word. Where
    they tell little, one far coarser shows how errors grow with the tolerance, and a note says whether it goes
    elsewhere; of steps of one length the others know enough. Where rates may have lost their phase one nearer by is
    asked, and of steps of one length a finer one: by which power of theirs errors go a single one does not tell.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    method : Checked
    beginning : Beginning
    shorter : float
        By how much steps of the run beside are shorter; 1 where they are longer.

    Returns
    -------
    Run
    """
    told, others = _by_all(run, journey, method, beginning, shorter)
    cut = any(other.run.status is Status.INTERRUPTED for other in others)
    if others and not cut and _may_be_lost(run, journey, method, others):
        tolerance, steady = journey.plan.tolerance, isinstance(method.pace, Fixed)
        nearby = method.finer(tolerance, usual(journey), 0.5) if steady else method.coarser(tolerance, _NEARER)
        told, nearer = made(told, journey, nearby, beginning)
        others = (*others, nearer) if nearer else others
    known = [(other.run, other.beside.longer) for other in others]
    return commanded(rated(told, known, journey), known, journey)


def _may_be_lost(run: Run, journey: Journey, method: Checked, others: tuple[Other, ...]) -> bool:
    """Tell whether rates may have lost their phase in all coarser runs, where none is nearer by than the first."""
    nearest = min(others, key=lambda other: other.beside.longer)
    first = method.coarser(journey.plan.tolerance).longer
    much = _OFF if isinstance(method.pace, Fixed) else LOST
    return nearest.beside.longer == first and may_be_lost(run, nearest.run, journey, much)


_Known = tuple[Run, tuple[Other, ...]]
"""A run with what is told of it, and by which others."""


def _by_all(run: Run, journey: Journey, method: Checked, beginning: Beginning, shorter: float) -> _Known:
    tolerance = journey.plan.tolerance
    if shorter < 1.0:
        told, others = _told(run, journey, method.finer(tolerance, usual(journey), shorter), beginning)
        if news(told, run) or not (others and isinstance(method.pace, Fixed) and rattles(journey)):
            return told, others
        return _confirmed(run, told, others, journey, method, beginning, 0.5 * shorter)
    told, first = _told(run, journey, method.coarser(tolerance), beginning)
    if not first or first[0].run.status is Status.INTERRUPTED:
        return told, first
    if _much_the_same(run, first[0], journey):
        return _halved(run, told, first[0], journey, method, beginning)
    return _by_coarser(run, told, first[0], journey, method, beginning)


def _much_the_same(run: Run, other: Other, journey: Journey) -> bool:
    """Tell whether a coarser run has taken nearly as many steps, of those that are chosen."""
    longer = other.beside.longer
    knotted = as_many(journey, longer) * longer > 1.0
    alike = _SAMPLED if journey.plan.feed.sample_time else _KNOTTED if knotted else _ALIKE
    return isinstance(journey.plan.method.pace, Controlled) and other.run.report.steps > alike * run.report.steps


def _by_coarser(run: Run, told: Run, other: Other, journey: Journey, method: Checked, beginning: Beginning) -> _Known:
    """The run with what is told of it beside a coarser one: by one nearer where that is much, by one farther else."""
    nearby = method.coarser(journey.plan.tolerance, _NEARER)
    if told.report.error < _LITTLE and not news(told, run):
        if isinstance(method.pace, Fixed):
            return told, (other,)
        return _by_farther(run, told, other, (), True, journey, method, beginning)
    if as_many(journey, nearby.longer) > _CUT:
        return _halved(run, told, other, journey, method, beginning)
    parted = told.report.error > PARTED
    told, nearer = _nearer(run, told, other, journey, nearby, beginning)
    if told.report.error > TOLD:
        return _rattled(run, told, (other, *nearer), journey, method, beginning)
    if parted:
        run, told = (elsewhere(each, other.gap, journey, other.beside.said) for each in (run, told))
        return _confirmed(run, told, (other, *nearer), journey, method, beginning)
    if isinstance(method.pace, Fixed):
        return told, (other, *nearer)
    return _by_farther(run, told, other, nearer, False, journey, method, beginning)


def _by_farther(
    run: Run,
    told: Run,
    other: Other,
    nearer: tuple[Other, ...],
    quiet: bool,
    journey: Journey,
    method: Checked,
    beginning: Beginning,
) -> _Known:
    """The run with what one far coarser adds: how errors grow, if nobody nearer has been asked, and where it goes."""
    farther = method.coarser(journey.plan.tolerance, _FARTHER)
    kept, third = made(told, journey, farther, beginning)
    if third is None:
        return told, (other, *nearer)
    if quiet:
        nearby = method.coarser(journey.plan.tolerance, _NEARER)
        kept, nearer = _grown(run, kept, other, third, journey, nearby, beginning)
    others = (other, third, *nearer)
    if kept.report.error > TOLD:
        return _rattled(run, kept, others, journey, method, beginning)
    longer = farther.longer, other.beside.longer
    grown = (longer[0] ** run.report.order - 1.0) / (longer[1] ** run.report.order - 1.0)
    if third.gap.most > max(_ASTRAY, _FASTER * grown * other.gap.most):
        run, kept = (elsewhere(each, third.gap, journey, farther.said) for each in (run, kept))
        return _confirmed(run, kept, others, journey, method, beginning)
    by_chance = any(_by_chance(near, other, run.report.order) for near in nearer)
    if not news(kept, run) and (by_chance or jumps(run, journey, beginning.again)):
        least = 0.0 if by_chance else _NEARLY
        return _confirmed(run, kept, others, journey, method, beginning, least=least)
    return _rattled(run, kept, others, journey, method, beginning)


def _rattled(
    run: Run, told: Run, others: tuple[Other, ...], journey: Journey, method: Checked, beginning: Beginning
) -> _Known:
    """The run with what is known, and with what a finer one tells where coarser ones may be off alike.

    So they are where corners come one after another, and of vibrations that steps damp away at once.
    """
    alike = rattles(journey) or radius(journey.plan.method) < _DAMPING
    return _confirmed(run, told, others, journey, method, beginning) if alike else (told, others)


def _confirmed(
    run: Run,
    told: Run,
    others: tuple[Other, ...],
    journey: Journey,
    method: Checked,
    beginning: Beginning,
    shorter: float = 0.5,
    least: float = _NEARLY,
) -> _Known:
    """The run with what a finer one tells of it, if that is more.

    Where corners come one after another errors go by no power of the steps: what others make of them may well be too
    little, if it is not far less than what would be noted. What is near by chance is not asked how near: forces and
    rates are not counted yet.
    """
    if max(told.report.error, *told.report.output_errors.values(), 0.0) < least:
        return told, others
    again, plan = replace(run, checkpoint=told.checkpoint), journey.plan
    length = usual(journey) if isinstance(method.pace, Fixed) else 0.0  # no step of one length goes beyond it
    finer, finest = _told(again, journey, method.finer(plan.tolerance, length, shorter), beginning, others)
    if finer.report.error > told.report.error:
        return _as_much(finer, told), (*others, *finest)
    notes = (*told.report.notes, *(note for note in finer.report.notes if note not in run.report.notes))
    known = replace(told, checkpoint=finer.checkpoint, report=replace(told.report, notes=notes))
    return _as_much(known, finer), (*others, *finest)


def _halved(run: Run, told: Run, other: Other, journey: Journey, method: Checked, beginning: Beginning) -> _Known:
    """The run with what one in half the steps tells, also of those that are kept short; it has the last word."""
    mean = run.final.t / max(run.report.steps, 1)
    length = usual(journey) or math.inf
    if isinstance(method.pace, Controlled) and not journey.plan.feed.sample_time:
        length = min(length, 2.0 ** round(math.log2(mean)))  # the same when the run goes on
    beside = method.finer(journey.plan.tolerance, length, 0.5)
    halved, finer = _told(replace(run, checkpoint=told.checkpoint), journey, beside, beginning, (other,))
    return (halved, (other, *finer)) if finer else (told, (other,))


def _order(near: Other, far: Other, most: float) -> float:
    """The order of errors as two runs beside show it: of what they are apart no more than all is the finer one's."""
    if not near.gap.most or _reached(near.run) != _reached(far.run):
        return most
    longer = near.beside.longer, far.beside.longer
    least = np.array([least_order(longer[0], most)])
    return float(orders_seen(np.array([near.gap.most]), np.array([far.gap.most]), longer, (least, most))[0])


def _by_chance(near: Other, far: Other, order: float) -> bool:
    """Tell whether one is nearer than errors of an order are, as one may be that met a corner at the same moment."""
    least, most = (abs(other.beside.longer**order - 1.0) for other in (near, far))
    return near.gap.most * most < _CHANCE * far.gap.most * least


def _grown(
    run: Run, told: Run, other: Other, far: Other, journey: Journey, nearby: Beside, beginning: Beginning
) -> _Known:
    """The run with what is told of it where errors grow as they do from the one to the other run beside."""
    order = _order(other, far, run.report.order)
    if order == run.report.order:
        return told, ()
    known = _said(replace(run, checkpoint=told.checkpoint), other, journey, beginning, order)
    much = known.report.error > TOLD or news(known, run)
    return _nearer(run, known, other, journey, nearby, beginning) if much else (known, ())


def news(told: Run, run: Run) -> bool:
    """Tell whether a run beside has notes of its own.

    Parameters
    ----------
    told : Run
        With what others tell.
    run : Run
        Without.

    Returns
    -------
    bool
    """
    return not set(told.report.notes) <= set(run.report.notes)


def _nearer(run: Run, told: Run, other: Other, journey: Journey, nearby: Beside, beginning: Beginning) -> _Known:
    """What a second one tells, unless it ended before the first."""
    kept, second = made(replace(run, checkpoint=told.checkpoint), journey, nearby, beginning)
    if second is None:
        return told, ()
    if _reached(second.run) < _reached(other.run):
        return standing(told, second.run.checkpoint), ()
    order, parted = run.report.order, told.report.error > PARTED
    feared = told.report.error / (other.beside.longer**order - 1.0) if parted else 0.0
    seen = order if parted else _order(second, other, order)
    nearer = _said(kept, second, journey, beginning, seen, feared, (other,))
    alike = nearer.report.error == told.report.error == run.report.drift
    return _as_much(nearer, told) if alike else nearer, (second,)


def _as_much(run: Run, other: Run) -> Run:
    """The run with no less told of outputs than another one tells: where sums have the word, both are guesses."""
    shares, others = run.report.output_errors, other.report.output_errors
    most = {name: max(share, others.get(name, 0.0)) for name, share in shares.items()}
    return replace(run, report=replace(run.report, output_errors=most))


def _reached(other: Run) -> float:
    """Until when a run tells of another; one that an end of the machine's own stops is not early."""
    return math.inf if other.status is Status.STOPPED else other.final.t


def _told(run: Run, journey: Journey, beside: Beside, beginning: Beginning, known: tuple[Other, ...] = ()) -> _Known:
    """The run with what one other tells, if there is one, beside others that are known."""
    kept, other = made(run, journey, beside, beginning)
    if other is None:
        return kept, ()
    return _said(kept, other, journey, beginning, run.report.order, known=known), (other,)


def _said(
    run: Run,
    other: Other,
    journey: Journey,
    beginning: Beginning,
    order: float,
    feared: float = 0.0,
    known: tuple[Other, ...] = (),
) -> Run:
    """The run with what one other tells, if errors are of an order; until when it is right others known have a say."""
    if other.run.final.t <= beginning.t:
        return noted(run, f"{UNCHECKED}, which ended at t = {other.run.final.t:.3g} s")
    until = agreed(other, known, journey, run.report.order)
    told = told_beside(run, other.run, other.gap, journey, other.beside.longer, order, feared, until)
    return peaked(told, other.run, journey, other.beside.longer) if other.beside.longer < 1.0 else told
