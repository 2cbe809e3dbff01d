"""Local errors of steps that all go one way: what they may have added up to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.dynamics.notes.lengths import in_words, usual
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.notes.unsized import faint, is_faint
from flexctrl.dynamics.records.absurd import LOOKED_AT, missed
from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.dynamics.steps import Controlled, Fixed

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Drift", "drifted", "remedy"]

_TOLD, _AIM = 0.03, 0.01
_REST = 10.0
_ASTRAY = 0.5
"""What has gone as far astray no extrapolation mends."""
_MOST = 10.0
"""Nearer to where it stands on its head a pendulum's period grows by more than its energy tells."""


class Drift(NamedTuple):
    """What the errors of steps may have added up to.

    Attributes
    ----------
    share : float
        Of the largest motion in that part of the machine, at most of a radian or the machine's size; 0 where a linear
        model is integrated exactly.
    freedom : str
        The worst degree of freedom.
    note : str
        What is to be said of it; empty if it is little.
    late : numpy.ndarray, shape (n,)
        By how much each degree of freedom may run ahead of itself, or lag; empty where that is not known.
    ran : float
        Of the share, what a wrong speed has led astray.
    """

    share: float = 0.0
    freedom: str = ""
    note: str = ""
    late: np.ndarray = np.zeros(0)
    ran: float = 0.0


def drifted(journey: Journey) -> Drift:
    """Return by how much a motion may run ahead of itself, or lag.

    Of a local error counts what is along the motion: a share κ = Σ e v / Σ h v² of the time that goes by. Over a way
    Σ h |v| to and fro that is up to π/2 κ Σ h |v|. What is across, or turns round as the motion does, does not add up.
    Of a motion that is little against what each step may err by, all may be wrong. Of others no more is told than how
    far the freedom has moved, to and fro, nor than the width 2 V/ω of what is late, V = 4/π Σ h v² / Σ h |v| and
    ω² = Σ h a² / Σ h v²: fast ripples on a slow motion are only as late as they are wide. That growth makes errors
    larger is not seen. What no law leads runs off with its speed, too, where a method takes or makes energy: see
    `_run_off`.

    Parameters
    ----------
    journey : Journey
        At its end.

    Returns
    -------
    Drift
    """
    plan, sums, model, stepper = journey.plan, journey.books.sums, journey.plan.model, journey.judging
    if stepper is None or not sums.swept.any():
        return Drift()
    went = (sums.swept > 0.0) & np.isfinite(sums.ahead * sums.path / sums.swept)
    late = 0.5 * math.pi * np.abs(sums.ahead[went]) * sums.path[went] / sums.swept[went]
    off, width, to_and_fro = np.zeros(model.n), np.zeros(model.n), 2.0 * sums.moved
    off[went] = np.minimum(late, to_and_fro[went])
    width[went] = _width(sums.swept[went], sums.bent[went], sums.path[went])
    most = np.maximum(farthest(model, sums.moved), _REST * plan.tolerance.negligible) * yardsticks(model)
    lags = np.minimum(stepper.remains(off / most), width / most)
    ran = _run_off(journey) / most
    shares = np.maximum(lags, ran)
    worst = int(np.argmax(shares))
    share, freedom = min(float(shares[worst]), 1.0), model.coordinates[worst]
    parts = faint(journey)
    off = np.where(parts, np.maximum(shares, 1.0), shares) * _judged(most)  # dense output may go beyond steps
    if is_faint(journey, parts):  # a note of its own says so
        return Drift(1.0, freedom, "", off, 1.0)
    note = _note(journey, share, freedom) if share > _TOLD else ""
    return Drift(share, freedom, note, off, float(ran.max()))


def _judged(yard: np.ndarray) -> np.ndarray:
    """Yardsticks, 0 for inner freedoms, which are told by the motion that they bring about."""
    return np.where(np.isfinite(yard), yard, 0.0)


def _width(swept: np.ndarray, bent: np.ndarray, path: np.ndarray) -> np.ndarray:
    """How far what is fast in a motion goes to and fro; of several frequencies that is less than the widest.

    Paths are of all steps, the others of those looked at.
    """
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(8.0 / math.pi * LOOKED_AT * swept**1.5 / (path * np.sqrt(bent)))


def _run_off(journey: Journey) -> np.ndarray:
    """Return by how much a wrong speed may have led motion astray, shape (n,).

    What goes round or away, farther than a radian or the machine's size, is wrong by half the share of energy that
    the books miss at the end. What swings by θ has a period that grows by tan²(θ/2)/8 of that share, as pendulums do.
    Energies that steps of one length keep come back, and so do speeds.
    """
    books, sums, method = journey.books, journey.books.sums, journey.plan.method
    yard = yardsticks(journey.plan.model)
    way = sums.moved / yard
    kept = method.symmetric and isinstance(method.pace, Fixed)
    if kept or not (books.lawful and sums.turnover) or journey.plan.feed.controller is not None:
        return np.zeros_like(way)
    rounds = np.where(way > 1.0, 0.5 * way, 0.0)
    swings = np.where(way < 2.0 * math.pi, np.minimum(np.tan(0.25 * way) ** 2 / 8.0, _MOST) * sums.path / yard, 0.0)
    share = missed(sums.made, sums.unseen) / sums.turnover
    return np.asarray(_judged(yard) * np.minimum(share * np.maximum(rounds, swings), way))


def _note(journey: Journey, share: float, freedom: str) -> str:
    """What is to be said, with the tolerance or the step that would leave little."""
    most = percent(share) if share < 1.0 else "all (or a radian, or the machine's size)"
    said = f"the errors of {journey.mark.steps} steps may have added up to {most} of the motion of {freedom}"
    return f"{said}: {remedy(journey, share)}"


def remedy(journey: Journey, share: float) -> str:
    """Return which tolerance, or step, would leave a hundredth of motion whose errors of steps add up to a share.

    Parameters
    ----------
    journey : Journey
        At its end; its method tells errors of steps.
    share : float

    Returns
    -------
    str
    """
    plan, mark, stepper = journey.plan, journey.mark, journey.judging
    assert stepper is not None
    pace, power = plan.method.pace, float(np.diff(np.log2(stepper.remains(np.array([1.0, 2.0]))))[0])
    if isinstance(pace, Controlled):
        less, asked = (_AIM / share) ** (1.0 / (power * (1.0 - 1.0 / pace.steepness))), plan.tolerance
        less *= min(1.0, journey.point.state.t / (mark.steps * mark.size)) ** pace.steepness  # samples keep them short
        said = f"give Tolerance({less * asked.relative:.1g}, {less * asked.absolute:.1g})"
    else:
        step = usual(journey)
        finer = step * (_AIM / share) ** (1.0 / max(2.0 * power, plan.method.order))
        said = f"take steps of {in_words(finer, step)} s"
    return said + ", or take Richardson of the method" * (plan.method.order == 2 and share < _ASTRAY)
