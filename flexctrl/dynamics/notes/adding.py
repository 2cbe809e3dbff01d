"""Local errors of steps of controlled error that all go one way: what they may have added up to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.dynamics.steps import Controlled, Judging

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Drift", "drifted"]

_TOLD, _AIM = 0.03, 0.01
_REST = 10.0


class Drift(NamedTuple):
    """What the errors of steps may have added up to.

    Attributes
    ----------
    share : float
        Of the largest motion in that part of the machine, at most of a radian or the machine's size; 0 where steps are
        not of controlled error.
    freedom : str
        The worst degree of freedom.
    note : str
        What is to be said of it; empty if it is little.
    """

    share: float = 0.0
    freedom: str = ""
    note: str = ""


def drifted(journey: Journey) -> Drift:
    """Return by how much a motion may run ahead of itself, or lag.

    Of a local error counts what is along the motion: a share κ = Σ e v / Σ h v² of the time that goes by. Over a way
    Σ h |v| to and fro that is up to π/2 κ Σ h |v|. What is across, or turns round as the motion does, does not add up.
    No more is told than how far the freedom has moved; that growth makes errors larger is not seen. What goes round or
    away, farther than a radian or the machine's size, and is led by no law, runs off with its speed, too: that is wrong
    by half the share of energy that the books miss.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    Drift
    """
    plan, sums, model = journey.plan, journey.books.sums, journey.plan.model
    if not (isinstance(plan.method.pace, Controlled) and sums.swept.any()):
        return Drift()
    stepper = cast("Judging[Any]", journey.stepper)
    went = (sums.swept > 0.0) & np.isfinite(sums.ahead * sums.path / sums.swept)
    late = 0.5 * math.pi * np.abs(sums.ahead[went]) * sums.path[went] / sums.swept[went]
    off = np.zeros(model.n)
    off[went] = np.minimum(late, sums.moved[went])
    off = off / yardsticks(model) / np.maximum(farthest(model, sums.moved), _REST * plan.tolerance.absolute)
    shares = np.maximum([stepper.remains(lag) for lag in off.tolist()], _run_off(journey))
    worst = int(np.argmax(shares))
    share, freedom = float(shares[worst]), model.coordinates[worst]
    if share <= _TOLD:
        return Drift(share, freedom)
    power = math.log2(stepper.remains(2.0) / stepper.remains(1.0))
    less = (_AIM / share) ** (1.0 / (power * (1.0 - 1.0 / plan.method.pace.steepness)))
    return Drift(share, freedom, _note(journey, share, freedom, less))


def _run_off(journey: Journey) -> np.ndarray:
    """Return by how much a wrong speed may have led astray what goes far, in yardsticks, shape (n,)."""
    books, way = journey.books, journey.books.sums.moved / yardsticks(journey.plan.model)
    free = books.lawful and journey.plan.feed.controller is None
    return np.where(way > 1.0, 0.5 * books.residual * way, 0.0) if free else np.zeros_like(way)


def _note(journey: Journey, share: float, freedom: str, less: float) -> str:
    """What is to be said, with the share of the tolerance that would leave little."""
    plan, asked = journey.plan, journey.plan.tolerance
    most = f"{100.0 * share:.2g} %" if share < 1.0 else "all (or a radian, or the machine's size)"
    remedy = f"give Tolerance({less * asked.relative:.1g}, {less * asked.absolute:.1g})"
    if plan.method.order == 2:
        remedy += ", or take Richardson of the method"
    steps = journey.mark.steps
    return f"the errors of {steps} steps may have added up to {most} of the motion of {freedom}: {remedy}"
