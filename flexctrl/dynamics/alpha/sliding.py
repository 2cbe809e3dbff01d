"""Steps that end where a continuous law jumps with what it reads, and pushes back from both sides.

A relay, a sliding mode or an ideal switch has no value there with which a step could end: with either it would be on
the other side. The motion slides along where the law jumps, under the value between the two that keeps it there (A. F.
Filippov (1988): Differential Equations with Discontinuous Righthand Sides). As an implicit step knows where it ends, it
finds that value itself, without chatter (V. Acary, B. Brogliato (2010): Implicit Euler numerical scheme and
chattering-free implementation of sliding mode systems).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.steps import StepError
from flexctrl.frozen import frozen
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.alpha.steps import Stepper

__all__ = ["NOTICED", "jumps", "slide"]

_FINE = 2.0**-16
"""Share of a jump to which the value between is found."""
_JUMPS, NOTICED = 1e-6, 1e-2
_SWEEPS, _SETTLED = 8, 1e-3


@frozen
class _Held:
    """A feed whose inputs are held; the controller's state goes on."""

    feed: Feed
    u: np.ndarray
    continuous: bool = False
    reacting: bool = False

    def at(self, state: State, before: Supply, h: float) -> Supply:
        return replace(self.feed.at(state, before, h), u=self.u)


def jumps(before: np.ndarray, used: np.ndarray, said: np.ndarray, foretold: np.ndarray) -> bool:
    """Tell whether a law changes over the last correction as its slope does not foretell.

    A correction by a tangent that feels a jump is small, and says nothing.

    Parameters
    ----------
    before, used, said : numpy.ndarray, shape (inputs,)
        Where the step begins, where it was corrected for the last time, where it ends.
    foretold : numpy.ndarray, shape (inputs,)
        ``said - used`` by the slope of the law.

    Returns
    -------
    bool
    """
    size = np.maximum(np.abs(before), np.maximum(np.abs(used), np.abs(said)))
    return bool((np.abs(said - used - foretold) > NOTICED * size).any())


def slide(stepper: Stepper, point: AlphaPoint, h: float) -> AlphaPoint:
    """Return the point a step later, under inputs between those that the law has on both sides of a jump.

    Of each input the value is sought at which the law, asked at the step's end, turns from more to less; of inputs that
    jump at the same place it is the same share of the way from one side to the other, as Filippov has it: a force and
    its reaction stay opposite. Where a law says at the end what it was held at, it does not jump there.

    Parameters
    ----------
    stepper : Stepper
        Of a continuous law that reads what moves.
    point : AlphaPoint
    h : float
        [s]

    Returns
    -------
    AlphaPoint

    Raises
    ------
    StepError
        Where no inputs are found that the law agrees with, or turns at.
    """
    held = replace(stepper, memory=None, _solve=None)
    ends = dict[bytes, _End]()

    def end(u: np.ndarray) -> _End:
        known = u.tobytes()
        if known not in ends:
            held.feed = cast("Feed", _Held(stepper.feed, u))
            after = held.exactly(point, h)
            ends[known] = _End(after, stepper.feed.at(after.state, point.supply, h))
        return ends[known]

    one = end(point.supply.u).said.u
    found = end(one)
    u, other = one, found.said.u
    apart = _JUMPS * np.maximum(np.abs(one), np.abs(other))
    turning, groups = np.zeros(0, dtype=int), list[np.ndarray]()
    for _ in range(_SWEEPS):
        moving = np.flatnonzero(np.abs(other - one) > apart)
        if moving.tolist() != turning.tolist():
            turning, groups = moving, _together(end, u, moving, (one, other))
        before, turns = u, np.zeros(u.size, dtype=bool)
        for group in groups:
            u, turns[group] = _between(end, u, group, (one, other))
        found = end(u) if turning.size else found
        agrees = np.abs(found.said.u - u) <= apart
        settled = np.abs(u - before) <= _SETTLED * np.abs(other - one)
        if agrees.all():
            return replace(found.after, supply=found.said)
        if (agrees | turns).all() and (len(groups) == 1 or settled[turning].all()):
            return replace(found.after, supply=replace(found.said, u=u, slid=True))
        one, other = np.where(agrees | turns, one, u), np.where(agrees | turns, other, found.said.u)
    why = f"no inputs agree with a law that jumps at t = {point.state.t + h:.6g} s"
    raise StepError(stepper.counts.worst, f"{why} with a step of {h:.3g} s")


class _End(NamedTuple):
    """Where a step under held inputs ends, and what the law says there."""

    after: AlphaPoint
    said: Supply


_Span = tuple[np.ndarray, np.ndarray]
"""Inputs on both sides of where they jump."""


def _between(
    end: Callable[[np.ndarray], _End], u: np.ndarray, group: np.ndarray, span: _Span
) -> tuple[np.ndarray, bool]:
    """Inputs of which some are where the law turns from more to less, or what it says; and whether it turns."""
    share = _share(end, u, group, span)
    if math.isnan(share):
        changed = u.copy()
        changed[group] = end(_having(u, group, span, 0.0)).said.u[group]
        return changed, False
    return _having(u, group, span, share), True


def _having(u: np.ndarray, group: np.ndarray, span: _Span, share: float) -> np.ndarray:
    """Inputs of which some are at a share of the way from one side to the other."""
    changed = u.copy()
    changed[group] = (1.0 - share) * span[0][group] + share * span[1][group]
    return changed


def _share(end: Callable[[np.ndarray], _End], u: np.ndarray, group: np.ndarray, span: _Span) -> float:
    """The share of the way at which what the law says of the first of some inputs turns; NaN where it does not."""
    from scipy.optimize import brentq

    def more(share: float) -> float:
        held = _having(u, group, span, share)
        return float(end(held).said.u[group[0]] - held[group[0]])

    first, last = more(0.0), more(1.0)
    return float(brentq(more, 0.0, 1.0, xtol=_FINE)) if first * last < 0.0 else math.nan


def _together(end: Callable[[np.ndarray], _End], u: np.ndarray, turning: np.ndarray, span: _Span) -> list[np.ndarray]:
    """Inputs that jump at the same place, found where each jumps if all of them change at once."""
    groups, left = list[np.ndarray](), turning
    while left.size:
        groups.append(left[_with_first(end, u, left, turning, span)] if left.size > 1 else left)
        left = np.setdiff1d(left, groups[-1])
    return groups


def _with_first(
    end: Callable[[np.ndarray], _End], u: np.ndarray, left: np.ndarray, turning: np.ndarray, span: _Span
) -> np.ndarray:
    """Which of the inputs that are left jump where the first of them does."""
    first = left == left[0]
    share = _share(end, u, np.append(left, np.setdiff1d(turning, left)), span)
    if math.isnan(share):
        return first
    sides = (end(_having(u, turning, span, share + s * _FINE)).said.u[left] for s in (-2.0, 2.0))
    jumped = np.abs(np.subtract(*sides)) > 0.5 * np.abs(span[1] - span[0])[left]
    return first | jumped
