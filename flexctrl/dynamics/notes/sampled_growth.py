"""Sampled loops that grow as steps do not see: what a law excites from sample to sample, long steps may damp away."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.notes.fading import radius
from flexctrl.dynamics.notes.sampled_loop import Answers, SampledLoop
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.steps import Controlled
from flexctrl.errors import FlexctrlError
from flexctrl.model.model import Model
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["grows", "of_sampled_loop"]

_MOST = 400
_GROWN, _LOST, _BOUNDED, _TURNED = 1.0, 3.0, 20.0, 0.5
"""Powers of e over the run: what steps may miss, beyond which nothing is right, and what of growth that steps see is
held by limits that a loop about one place does not have; poles that turn together [rad]."""
_SMALL, _WIDER, _ALIKE = 1e-7, 8.0, 1e-2
_HALVINGS, _ENDS = 10, 2
_UNEVEN = 0.5
"""Chosen steps are longer where little moves: what grows from there is seen by those."""
_SAID = (
    "the sampled loop is unstable, with a pole at z = {pole}: it grows by e^{whole:.3g} over the run, of which "
    "steps of {step:.2g} s see e^{seen:.2g}; look at the gains and the sample time, or take steps of {finer:.1g} s "
    "at most"
)


class Missed(NamedTuple):
    """What is to be said of growth that steps do not see, and whether nothing of the run is right then."""

    said: str
    lost: bool


def of_sampled_loop(run: Run, journey: Journey, feed: Feed | None) -> Run:
    """Return a run with what is to be said of a sampled loop that grows as its steps do not see.

    Linear about the start and about the end: where that is so at both, the run has failed; at one, or where limits must
    have held what steps do see grow by far, a note says so.

    Parameters
    ----------
    run : Run
    journey : Journey
        At its end.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    Run
    """
    rho, model, steps = radius(journey.plan.method), journey.plan.model, run.report.steps
    ended = run.status in (Status.FINISHED, Status.STOPPED) and steps > 0
    if feed is None or not feed.sample_time or math.isnan(rho) or not (ended and isinstance(model, Model)):
        return run
    try:
        found = [_missed(loop, journey, rho) for loop in _loops(journey, feed)]
    except (FlexctrlError, ArithmeticError, ValueError) as error:  # beside where it was, a law may say nothing
        return _noted(run, f"whether the sampled loop grows could not be told: {error}")
    missed = [one for one in found if one]
    if not missed:
        return run
    if len(missed) == _ENDS and all(one.lost for one in missed):
        return replace(run, status=Status.FAILED, report=replace(run.report, message=missed[-1].said))
    return _noted(run, missed[0].said)


def grows(journey: Journey, feed: Feed | None) -> bool:
    """Tell whether a sampled loop grows by e over a run, linear about the start or the end.

    Parameters
    ----------
    journey : Journey
        At its end.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    bool
    """
    span = journey.point.state.t - journey.origin.state.t
    if feed is None or not (feed.sample_time and isinstance(journey.plan.model, Model) and span > 0.0):
        return False
    growth = math.exp(_GROWN * feed.sample_time / max(span, feed.sample_time))
    try:
        return any(loop.poles(growth).size for loop in _loops(journey, feed))
    except (FlexctrlError, ArithmeticError, ValueError):  # `of_sampled_loop` has said so
        return False


def _noted(run: Run, note: str) -> Run:
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))


def _loops(journey: Journey, feed: Feed) -> Iterator[SampledLoop]:
    """The loop about the start and about the end, but where contacts stick and where a law has no slope."""
    law, end = feed.controller, journey.point
    assert law is not None
    for state, x in ((journey.origin.state, np.asarray(law.initial(), dtype=float)), (end.state, end.supply.x)):
        model = journey.plan.model
        if not feed.reads.size or 2 * model.n + x.size > _MOST or model.switches.sticks(state):
            continue
        answers = _answers(feed, state, x)
        if answers is not None:
            yield _loop(feed, state, end.supply.u, answers)


def _loop(feed: Feed, state: State, u: np.ndarray, law: Answers) -> SampledLoop:
    model, still = feed.model, np.zeros(feed.model.n)
    kinds = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    M, C, K = (-model.slope(state, state.v, still, seeds, u).toarray() for seeds in kinds)
    on_place, on_rate = model.signals.slopes(state, model.rates(state), model.motion.raw)
    T = model.motion.jacobian(state)[: model.motion.raw]
    reads, reads_rate = ((part[feed.reads] @ T).toarray() for part in (on_place, on_rate))
    push = (T.T @ model.reach(state, u)).toarray()
    return SampledLoop(M, C, K, push, reads, reads_rate, law, feed.sample_time, M.diagonal() > model.dust)


def _answers(feed: Feed, state: State, x: np.ndarray) -> Answers | None:
    """How a law answers, by central differences; None where it answers by jumps."""
    y = feed.measured(state)

    def said(d: np.ndarray) -> np.ndarray:
        u, after = feed.told(state.t, x + d[y.size :], y + d[: y.size])
        return np.concatenate([u, after])

    at = np.concatenate([y, x])
    slopes = [
        np.array([(said(d) - said(-d)) / (2.0 * d.max()) for d in np.diag(size * np.maximum(1.0, abs(at)))]).T
        for size in (_SMALL, _WIDER * _SMALL)
    ]
    near, wide = slopes
    if not np.allclose(near, wide, rtol=_ALIKE, atol=_ALIKE * float(abs(near).max(initial=0.0))):
        return None
    m, k = len(feed.base), y.size
    return Answers(near[:m, :k], near[:m, k:], near[m:, :k], near[m:, k:])


def _missed(loop: SampledLoop, journey: Journey, rho: float) -> Missed | None:
    """What is to be said of the pole whose growth over the run its steps miss most; None if they see it."""
    span = journey.point.state.t - journey.origin.state.t
    samples = span / loop.sample
    growing = loop.poles(math.exp(_GROWN / max(samples, 1.0)))
    if not growing.size:
        return None
    fewer = _UNEVEN if isinstance(journey.plan.method.pace, Controlled) else 1.0
    count = max(1, math.floor(fewer * loop.sample * journey.mark.steps / span * (1.0 + 1e-6)))
    stepped = loop.stepped(rho, count, 1.0)
    worst = max(growing, key=lambda z: math.log(abs(z)) - _grows(stepped, z))
    whole, seen = (samples * pace for pace in (math.log(abs(worst)), _grows(stepped, worst)))
    if whole - seen <= _GROWN:
        return None
    fine = next(
        (k for k in range(1, _HALVINGS) if _near(loop.stepped(rho, count << k, 1.0), worst, samples)), _HALVINGS
    )
    pole = f"{worst.real:.4g}" + (f" ± {abs(worst.imag):.4g}i" if abs(worst.imag) > 1e-9 else "")
    said = _SAID.format(
        pole=pole, whole=whole, step=loop.sample / count, seen=max(seen, 0.0), finer=loop.sample / (count << fine)
    )
    return Missed(said, whole - seen > _LOST and seen < _BOUNDED)


def _grows(stepped: np.ndarray, pole: complex) -> float:
    """By what power of e steps have that pole grow in a sample: the nearest of theirs, if any turns with it."""
    turns = abs(np.angle(stepped * np.conj(pole)))
    return max((math.log(abs(z)) for z in stepped[turns < _TURNED]), default=0.0)


def _near(stepped: np.ndarray, pole: complex, samples: float) -> bool:
    return samples * (math.log(abs(pole)) - _grows(stepped, pole)) < 0.5 * _GROWN
