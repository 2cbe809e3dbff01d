"""Until when a run has been right, as far as others laid beside it tell, and what of it none has been laid beside."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.notes.gap import Gap, gap_at
from flexctrl.dynamics.run import Run
from flexctrl.model.model import Model

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.origin import Origin

__all__ = ["is_after_a_cut", "right_until", "said_until", "unseen"]

_ROUNDS, _PARTS, _LONG = 3, 4, 0.01
"""How often the time between two instants is parted, into how many parts, while it is more than that of the way."""
_UNSEEN = (
    "what was run {when}, cut off or unchecked, has not been laid beside another run: what is told of errors is of "
    "what came after"
)


def right_until(
    run: Run, other: Run, journey: Journey, gap: Gap, least: float, agreed: Callable[[float], float] = float
) -> float:
    """Return until when two runs are apart by no more than so much, and were in the parts before.

    Parameters
    ----------
    run, other : Run
    journey : Journey
        How the first went.
    gap : Gap
        How far they are apart.
    least : float
        Of the motion.
    agreed : callable, optional
        Until when runs beside agree, of which this one is one: no later than a time.

    Returns
    -------
    float
        Infinity if they are at the end. Where they were farther apart as the run went on already, until when runs
        beside agreed before; if that tells nothing, until when it was seen that they were not [s].
    """
    wrong, origin = gap.size > least, journey.origin
    if not wrong.any():
        return origin.right
    first = int(np.argmax(wrong))
    low, high = ([journey.begin, *gap.t.tolist()][k] for k in (first, first + 1))
    right = _narrowed(run, other, journey, (low, high), least)
    sooner = agreed(right)
    if sooner == right <= journey.begin and is_after_a_cut(journey):
        sooner = origin.unseen[0]
    return min(origin.right, sooner)


def is_after_a_cut(journey: Journey) -> bool:
    """Tell whether a run goes on from a part that others have not been laid beside.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    bool
    """
    return journey.begin == journey.origin.unseen[1] > 0.0


def _narrowed(run: Run, other: Run, journey: Journey, within: tuple[float, float], least: float) -> float:
    """Until when it is so between two instants: as far as steps are kept that need not all be taken again."""
    low, high = within
    kept = run.track.stretches and other.track.stretches and isinstance(journey.plan.model, Model)
    if not kept or journey.plan.feed.sample_time:
        return low
    if low <= (begin := max(run.track.starts[0], other.track.starts[0])):
        if journey.begin and gap_at(run, other, journey, begin) > least:
            return low
        low = begin
    for _ in range(_ROUNDS):
        if high - low < _LONG * (run.final.t - journey.begin):
            break
        t = np.linspace(low, high, _PARTS + 1).tolist()
        wrong = next((k for k in range(1, _PARTS) if gap_at(run, other, journey, t[k]) > least), _PARTS)
        low, high = t[wrong - 1], t[wrong]
    return low


def said_until(origin: Origin, right: float, share: str) -> str:
    """Return until when places are right, in words.

    Parameters
    ----------
    origin : Origin
        Of the run, with what of it has not been seen.
    right : float
        [s]
    share : str
        To what share of the motion.

    Returns
    -------
    str
    """
    begin, end = origin.unseen
    if right >= end:
        since = f"from t = {end:.3g} s " if end else ""
        return f"places are right to {share} {since}until t = {right:.3g} s"
    if right < begin:
        return f"places are right to {share} until t = {right:.3g} s"
    went_on = f"places may have been off by more than {share} as it went on at t = {end:.3g} s"
    if right == begin:
        return f"{went_on}, and nothing tells since when"
    return f"{went_on}, as runs beside it are apart by so much since t = {right:.3g} s"


def unseen(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of parts that others have not been laid beside.

    Parameters
    ----------
    journey : Journey
        At its end, with others beside it.

    Returns
    -------
    tuple of str
    """
    begin, end = journey.origin.unseen
    when = f"between t = {begin:.3g} and {end:.3g} s" if begin else f"before t = {end:.3g} s"
    return (_UNSEEN.format(when=when),) if end else ()
