"""Sampled loops that grow as steps do not see: what a law excites from sample to sample, long steps may damp away."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.design.wrapping import in_turn_of
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.notes.fading import radius
from flexctrl.dynamics.notes.law_slopes import law_slopes
from flexctrl.dynamics.notes.limits import limited
from flexctrl.dynamics.notes.moments import FEW, PARTLY, PARTS, moments, step_about
from flexctrl.dynamics.notes.sampled_loop import Answers, SampledLoop
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.steps import Controlled
from flexctrl.errors import FlexctrlError
from flexctrl.model.model import Model
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["grows", "of_sampled_loop", "passed_over"]

_MOST, _MOST_IN_TURN = 400, 50
_GROWN, _LOST, _FAR, _BOUNDED, _TURNED = 1.0, 3.0, 4.0, 20.0, 0.5
"""Powers of e over the run: what steps may miss, beyond which nothing is right, what is said though steps see it, and
what of growth that steps see is held by limits that a loop about one place does not have; poles that turn together
[rad]."""
_HALVINGS, _ENDS = 10, 2
_GROWING = 1.0 + 1e-9
_NUMBERS = math.log(sys.float_info.max)
_UNEVEN = 0.5
"""Chosen steps are longer where little moves: what grows from there is seen by those."""
_UNSTABLE = "the sampled loop is unstable"
_SEEN = (
    "{where} " + _UNSTABLE + ", with a pole at z = {pole}: it grows {whole} over the run, and what "
    "steps err by with it{held}; look at the signs, the gains and the sample time"
)
_SAID = (
    _UNSTABLE + "{when}, with a pole at z = {pole}: it grows {whole} over the run, of which "
    "steps of {step:.2g} s see e^{seen:.2g}; look at the gains and the sample time, or take steps of {finer:.1g} s "
    "at most"
)


class Missed(NamedTuple):
    """Growth over some samples that steps do not see.

    Attributes
    ----------
    pole : complex
    whole, seen, most : float
        Powers of e: of the pole, and of what steps see of it, at the least and at the most.
    step, finer : float
        A step that sees least, and one that sees it [s].
    """

    pole: complex
    whole: float
    seen: float
    most: float
    step: float
    finer: float

    @property
    def lost(self) -> bool:
        """Whether nothing of the run is right, if this is what becomes of it."""
        return self.whole - self.most > _LOST and self.most < _BOUNDED

    def said(self, when: str = "") -> str:
        """What is to be said."""
        told = {"whole": self._power, "seen": max(self.seen, 0.0), "step": self.step, "finer": self.finer}
        return _SAID.format(pole=self._pole, when=when, **told)

    def told(self, where: str, held: str) -> str:
        """What is to be said of growth that steps see."""
        return _SEEN.format(where=where, pole=self._pole, whole=self._power, held=held)

    @property
    def _power(self) -> str:
        return f"by e^{self.whole:.3g}" if self.whole < _NUMBERS else "beyond all numbers"

    @property
    def _pole(self) -> str:
        z = self.pole
        return f"{z.real:.4g}" + (f" ± {abs(z.imag):.4g}i" if abs(z.imag) > 1e-9 else "")


class Counts(NamedTuple):
    """How many steps there are in a sample: where fewest are, and in most."""

    fewest: int
    mostly: int
    others: tuple[int, ...] = ()

    @classmethod
    def of(cls, mean: float, fewer: float = 1.0) -> Counts:
        """Return those about a mean, which has others on both sides."""
        few, mostly, *others = (
            max(1, k) for k in (math.floor(fewer * mean), round(mean), math.floor(mean), math.ceil(mean))
        )
        return cls(few, mostly, tuple(others))


def of_sampled_loop(run: Run, journey: Journey, feed: Feed | None) -> Run:
    """Return a run with what is to be said of a sampled loop that grows as its steps do not see.

    Linear about the start and about the end: where that is so at both, the run has failed; at one, or where limits must
    have held what steps do see grow by far, or the law answers far less to much, a note says so. Small loops are looked
    at between them, too, as gains may be high there alone. Growth that steps see is right as far as it goes, and noted.

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
    end = journey.point
    ended = run.status in (Status.FINISHED, Status.STOPPED) and steps > 0
    if feed is None or not feed.sample_time or not (ended and isinstance(model, Model)):
        return run
    try:
        found = [_missed(loop, _samples(loop, journey), _counts(loop, journey), rho) for loop in _loops(journey, feed)]
        missed = [one for one in found if one and one.whole - one.seen > _GROWN]
        lost = (
            len(missed) == _ENDS
            and all(one.lost for one in missed)
            and not _limited(run, end.state, end.supply.x, feed)
        )
        between = "" if missed else _between(run, journey, feed, rho) or _unstable(found, run, journey, feed)
    except (FlexctrlError, ArithmeticError, ValueError) as error:  # beside where it was, a law may say nothing
        return _noted(run, f"whether the sampled loop grows could not be told: {error}")
    if lost:
        return replace(run, status=Status.FAILED, report=replace(run.report, message=missed[-1].said()))
    said = missed[0].said() if missed else between
    return _noted(run, said) if said else run


def passed_over(run: Run) -> bool:
    """Tell whether a run has a note of growth that its steps do not see: others in steps as long go as it does.

    Parameters
    ----------
    run : Run

    Returns
    -------
    bool
    """
    return any(note.startswith(_UNSTABLE) for note in run.report.notes)


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


def _unstable(found: list[Missed | None], run: Run, journey: Journey, feed: Feed) -> str:
    """What is to be said of a loop whose growth steps see: all along, or at the start, until a law's limits hold it."""
    growing = [one for one in found if one and one.whole > _FAR]
    if len(growing) == _ENDS:
        return growing[0].told("about its start and its end", "")
    about_start = len(found) == _ENDS and growing[:1] == found[:1]  # one that sticks there has no loop
    if about_start and _limited(run, *_outset(journey, feed), feed):
        return growing[0].told("about its start", ", as long as limits do not hold it")
    return ""


def _outset(journey: Journey, feed: Feed) -> tuple[State, np.ndarray]:
    law = feed.controller
    assert law is not None
    return journey.origin.state, np.asarray(law.initial(), dtype=float)


def _limited(run: Run, state: State, x: np.ndarray, feed: Feed) -> bool:
    """Tell whether a law holds growth by answering less to much."""
    return limited(
        lambda read: np.array(feed.told(state.t, x, read)[0]),
        feed.measured(state),
        np.ptp(run.y[:, feed.reads], axis=0),
    )


def _noted(run: Run, note: str) -> Run:
    return replace(run, report=replace(run.report, notes=(*run.report.notes, note)))


def _loops(journey: Journey, feed: Feed) -> Iterator[SampledLoop]:
    """The loop about the start and about the end, but where contacts stick and where a law has no slope."""
    end = journey.point
    for state, x in (_outset(journey, feed), (end.state, end.supply.x)):
        yield from _loop_at(feed, state, x, end.supply.u)


def _loop_at(feed: Feed, state: State, x: np.ndarray, u: np.ndarray, most: int = _MOST) -> Iterator[SampledLoop]:
    """The loop about a state, if it is no larger than that, and neither sticks nor answers by jumps."""
    model = feed.model
    if not feed.reads.size or 2 * model.n + x.size > most or model.switches.sticks(state):
        return
    answers = [law_slopes(feed, state, own) for own in _in_turn(feed, state, x)]
    known = [one for one in answers if one is not None]
    if known and len(known) == len(answers):
        yield _loop(feed, state, u, *known)


def _in_turn(feed: Feed, state: State, x: np.ndarray) -> list[np.ndarray]:
    """The states of a law from a sample on, until it does the same again; none if that takes too long."""
    states, count = [x], in_turn_of(feed.controller)
    while len(states) < min(count, _MOST_IN_TURN):
        states.append(np.asarray(feed.told(state.t, states[-1], feed.measured(state))[1]))
    return states if len(states) == count else []


def _loop(feed: Feed, state: State, u: np.ndarray, law: Answers, *later: Answers) -> SampledLoop:
    model, still = feed.model, np.zeros(feed.model.n)
    kinds = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    M, C, K = (-model.slope(state, state.v, still, seeds, u).toarray() for seeds in kinds)
    on_place, on_rate = model.signals.slopes(state, model.rates(state), model.motion.raw)
    T = model.motion.jacobian(state)[: model.motion.raw]
    reads, reads_rate = ((part[feed.reads] @ T).toarray() for part in (on_place, on_rate))
    push = (T.T @ model.reach(state, u)).toarray()
    heavy, first = M.diagonal() > model.dust, (model.motion.flows, model.motion.settling)
    return SampledLoop(M, C, K, push, reads, reads_rate, law, feed.sample_time, heavy, *first, later)


def _samples(loop: SampledLoop, journey: Journey) -> float:
    return float((journey.point.state.t - journey.origin.state.t) / loop.sample)


def _counts(loop: SampledLoop, journey: Journey) -> Counts:
    """How many steps there are in a sample: about as many as on average, and fewer where little moves."""
    mean = journey.mark.steps / _samples(loop, journey)
    if not isinstance(journey.plan.method.pace, Controlled):
        return Counts(*2 * (max(1, round(mean)),))
    return Counts.of(mean, _UNEVEN)


def _between(run: Run, journey: Journey, feed: Feed, rho: float) -> str:
    """What is to be said of growth in the midst of a run, summed up over its parts; empty if steps see it."""
    if math.isnan(rho):
        return ""
    found: list[tuple[float, Missed]] = []
    for moment in moments(run.track, run.final.t, PARTS):
        state, supply = moment.state, moment.supply
        for loop in _loop_at(feed, state, supply.x, supply.u, FEW):
            if loop.poles(_GROWING).size:
                counts = Counts.of(loop.sample / step_about(run.track, moment))
                some = _missed(loop, _samples(loop, journey) / PARTS, counts, rho)
                found += [(state.t, some)] if some else []
    if not found:
        return ""
    whole, seen = (sum(part) for part in zip(*((one.whole, one.seen) for _, one in found), strict=True))
    if whole - seen <= PARTLY:
        return ""
    times = [t for t, _ in found]
    worst = max((one for _, one in found), key=lambda one: one.whole - one.seen)
    return worst._replace(whole=whole, seen=seen).said(f" from about t = {min(times):.3g} s to {max(times):.3g} s")


def _missed(loop: SampledLoop, samples: float, counts: Counts, rho: float) -> Missed | None:
    """The pole whose growth over some samples its steps miss most; None if none grows."""
    growing = loop.poles(_GROWING)
    if not growing.size:
        return None
    if math.isnan(rho):  # explicit steps are as short as what grows
        worst = max(growing, key=abs)
        whole, step = samples * math.log(abs(worst)), loop.sample / counts.mostly
        return Missed(complex(worst), whole, whole, whole, step, step)
    stepped = {count: loop.stepped(rho, count, 1.0) for count in {counts.fewest, counts.mostly, *counts.others}}

    def seen(z: complex) -> dict[int, float]:
        return {count: _grows(poles, z) for count, poles in stepped.items()}

    worst = max(growing, key=lambda z: math.log(abs(z)) - min(seen(z).values()))
    found, few = seen(worst), counts.fewest
    least = min(found, key=found.__getitem__)
    fine = next((k for k in range(1, _HALVINGS) if _near(loop.stepped(rho, few << k, 1.0), worst, samples)), _HALVINGS)
    return Missed(
        pole=complex(worst),
        whole=samples * math.log(abs(worst)),
        seen=samples * found[least],
        most=samples * found[counts.mostly],
        step=loop.sample / least,
        finer=loop.sample / (few << fine),
    )


def _grows(stepped: np.ndarray, pole: complex) -> float:
    """By what power of e steps have that pole grow in a sample: the nearest of theirs, if any turns with it."""
    turns = abs(np.angle(stepped * np.conj(pole)))
    return max((math.log(abs(z)) for z in stepped[turns < _TURNED]), default=0.0)


def _near(stepped: np.ndarray, pole: complex, samples: float) -> bool:
    return samples * (math.log(abs(pole)) - _grows(stepped, pole)) < 0.5 * _GROWN
