"""How long steps of one length are, where samples, breaks of commands or the end of a run cut them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.steps import Controlled

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["as_many", "in_words", "usual"]

_SHORTER = 0.25
"""Of the time, steps may be shorter than those that are usual."""
_HALVED = 1.3
"""So many more steps than were planned."""


def in_words(length: float, step: float) -> str:
    """Return a length of steps in words: in one digit, or in two where one would make it as long as a step.

    Parameters
    ----------
    length, step : float
        [s]

    Returns
    -------
    str
    """
    short = f"{length:.1g}"
    return short if float(short) < 0.9 * step else f"{length:.2g}"


def usual(journey: Journey) -> float:
    """Return how long steps are that something may keep short.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    float
        In most of the time; of steps that are chosen, how long stops let them be, 0 where there are none [s].
    """
    pace, spans, feed = journey.plan.method.pace, _spans(journey), journey.plan.feed
    if isinstance(pace, Controlled):
        return _most(spans, spans) if feed.sample_time or feed.breaks else 0.0
    known = _most(spans / _counts(spans, pace.step), spans)
    return journey.point.state.t / journey.mark.steps if _halved(journey, spans, pace.step) else known


def as_many(journey: Journey, longer: float) -> float:
    """Return the share of its steps that a run in longer ones takes at least: all of them, where stops cut all.

    Parameters
    ----------
    journey : Journey
        At its end.
    longer : float
        By how much they are longer, where nothing keeps them short.

    Returns
    -------
    float
    """
    pace, spans, feed = journey.plan.method.pace, _spans(journey), journey.plan.feed
    if isinstance(pace, Controlled):  # samples are looked at by themselves
        stops = 0 if feed.sample_time else len(spans)
        return max(1.0 / longer, stops / max(journey.mark.steps, 1))
    if _halved(journey, spans, pace.step):
        return 1.0
    return float(_counts(spans, longer * pace.step).sum() / _counts(spans, pace.step).sum())


def _spans(journey: Journey) -> np.ndarray:
    """Times between stops, each made a whole number of steps [s]."""
    feed = journey.plan.feed
    if feed.sample_time:
        return np.array([feed.sample_time])
    end = journey.point.state.t
    breaks = np.unique(np.array([b for b in feed.breaks if b > 0.0]))
    last = np.searchsorted(breaks, end)
    return np.diff(np.concatenate([[0.0], breaks[: last + 1], [end] if last == len(breaks) else []]))


def _halved(journey: Journey, spans: np.ndarray, step: float) -> bool:
    """Tell whether many steps have been taken in halves, as they did not converge: so would longer ones."""
    planned = _counts(spans, step).sum() * journey.point.state.t / spans.sum()
    return bool(journey.mark.steps > _HALVED * planned)


def _counts(spans: np.ndarray, step: float) -> np.ndarray:
    """How many steps each of the spans takes."""
    return np.maximum(np.ceil(spans / step - 1e-6), 1.0)


def _most(lengths: np.ndarray, spans: np.ndarray) -> float:
    """The length that is not gone below for most of the time."""
    order = np.argsort(lengths)
    return float(lengths[order][np.searchsorted(np.cumsum(spans[order]), _SHORTER * spans.sum())])
