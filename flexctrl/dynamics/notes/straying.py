"""Parts that have gone farther from where they began than any machine reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.scales import once, turning, yardsticks
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["lost", "spun", "strayed", "thrown"]

_FAR = 1e6
_LOST = 1e15 / _FAR
"""So far out, two ends of a machine are one double number."""
_SPUN = 1e3
"""Radians from sample to sample: no machine is governed so, and no dentist's drill turns by a tenth of that."""
_TIMES, _PUSHED = 10.0, 0.2
"""What grows as e^λt has λt > ln 10⁶ and x a/v² of 1: in samples, which end in a push, 1/4 at least. A power tⁿ has
n and (n − 1)/n, what flies freely 1 and 0."""


def strayed(journey: Journey) -> tuple[str, ...]:
    """Return what is to be said of a machine that has left: its loop may not be stable, or nothing holds it.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    tuple of str
        Empty while no freedom that travels has gone a million times the size of the machine; and for a machine
        without any, but under a loop that grows.
    """
    model, times = journey.plan.model, _times(journey)
    worst, grows = int(np.argmax(times)) if times.size else 0, thrown(journey) is not None
    sized = model.structure.sized
    if not (times > 1.0).any() or not (grows or sized):
        return ()
    doubted = "" if journey.plan.feed.controller is None else ", or the loop is not stable"
    blame = "the loop is not stable" if grows else f"nothing holds it{doubted}"
    size = "the size of the machine" if sized else "a unit of length"
    return (f"{model.coordinates[worst]} has gone {_FAR * times[worst]:.1g} times {size}, as if {blame}",)


def thrown(journey: Journey) -> int | None:
    """Return the freedom that a loop has thrown farthest, None if all it has done is to go far.

    What flies away, or is pushed away by forces that do not grow, has a speed of no more than a few times its distance
    over the time; a loop that is not stable has it grow by orders, and goes on to push.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    int or None
    """
    return _ever_faster(journey, _times(journey)) if journey.plan.feed.controller is not None else None


def spun(journey: Journey) -> int | None:
    """Return the freedom that a sampled loop has turn fastest, a thousand radians a sample at least; None if none.

    What only turns goes nowhere. As `thrown`, it has its rate grow by orders, and is pushed on.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    int or None
    """
    sample = journey.plan.feed.sample_time
    if journey.plan.feed.controller is None or not sample:
        return None
    turned = np.where(turning(journey.plan.model), np.abs(journey.point.state.v), 0.0) * sample
    return _ever_faster(journey, turned / _SPUN)


def _ever_faster(journey: Journey, times: np.ndarray) -> int | None:
    """The freedom with the most of these, more than one, whose speed grows by orders and that is pushed on."""
    if not (far := times > 1.0).any():
        return None
    moved, state, push = journey.books.sums.moved, journey.point.state, np.abs(journey.point.rate)
    speed = np.abs(state.v)
    grown = far & (speed * state.t > _TIMES * moved) & (push * moved > _PUSHED * speed**2)
    return int(np.argmax(np.where(grown, times, 0.0))) if grown.any() else None


def lost(journey: Journey) -> bool:
    """Tell whether a loop has thrown a part so far that no number tells the shape of the machine any more.

    Nor does a law that reads where it is. Where nothing is read, what flies there is right; numbers of a linear model
    tell its shape however large they are.

    Parameters
    ----------
    journey : Journey

    Returns
    -------
    bool
    """
    plan = journey.plan
    looped = plan.feed.controller is not None and isinstance(plan.model, Model)
    return looped and bool((_times(journey) > _LOST).any())


def _times(journey: Journey) -> np.ndarray:
    """How far each freedom that travels has gone, in millions of sizes of the machine."""
    return np.asarray(journey.books.sums.moved / once(journey.plan.model, _far))


def _far(model: Plant) -> np.ndarray:
    """A million times the size of the machine in each freedom that travels."""
    return np.where(turning(model), np.inf, _FAR * yardsticks(model))
