"""Steps that end where a continuous law jumps with what it reads, and pushes back from both sides.

A relay, a sliding mode or an ideal switch has no value there with which a step could end: with either it would be on
the other side. The motion slides along where the law jumps, under the value between the two that keeps it there (A. F.
Filippov (1988): Differential Equations with Discontinuous Righthand Sides). As an implicit step knows where it ends, it
finds that value itself, without chatter (V. Acary, B. Brogliato (2010): Implicit Euler numerical scheme and
chattering-free implementation of sliding mode systems).
"""

from __future__ import annotations

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

__all__ = ["jumps", "slide"]

_FINE = 2.0**-16
"""Share of a jump to which the value between is found."""
_JUMPS, _NOTICED = 1e-6, 1e-2
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
    return bool((np.abs(said - used - foretold) > _NOTICED * size).any())


def slide(stepper: Stepper, point: AlphaPoint, h: float) -> AlphaPoint:
    """Return the point a step later, under inputs between those that the law has on both sides of a jump.

    Of each input the value is sought at which the law, asked at the step's end, turns from more to less. Where it says
    at the end what it was held at, it does not jump there.

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

    def end(u: np.ndarray) -> _End:
        held.feed = cast("Feed", _Held(stepper.feed, u))
        after = held.exactly(point, h)
        return _End(after, stepper.feed.at(after.state, point.supply, h))

    one = end(point.supply.u).said.u
    found = end(one)
    u, other = one, found.said.u
    apart = _JUMPS * np.maximum(np.abs(one), np.abs(other))
    for _ in range(_SWEEPS):
        turning = np.flatnonzero(np.abs(other - one) > apart)
        before, turns = u, np.zeros(u.size, dtype=bool)
        for i in turning:
            u, turns[i] = _between(end, u, int(i), (float(one[i]), float(other[i])))
        found = end(u) if turning.size else found
        agrees = np.abs(found.said.u - u) <= apart
        settled = np.abs(u - before) <= _SETTLED * np.abs(other - one)
        if agrees.all():
            return replace(found.after, supply=found.said)
        if (agrees | turns).all() and (turning.size == 1 or settled[turning].all()):
            return replace(found.after, supply=replace(found.said, u=u, slid=True))
        one, other = np.where(agrees | turns, one, u), np.where(agrees | turns, other, found.said.u)
    why = f"no inputs agree with a law that jumps at t = {point.state.t + h:.6g} s"
    raise StepError(stepper.counts.worst, f"{why} with a step of {h:.3g} s")


class _End(NamedTuple):
    """Where a step under held inputs ends, and what the law says there."""

    after: AlphaPoint
    said: Supply


def _between(
    end: Callable[[np.ndarray], _End], u: np.ndarray, i: int, span: tuple[float, float]
) -> tuple[np.ndarray, bool]:
    """Inputs of which one is where the law turns from more to less, or what it says; and whether it turns."""
    from scipy.optimize import brentq

    def having(value: float) -> np.ndarray:
        return np.concatenate([u[:i], [value], u[i + 1 :]])

    def more(value: float) -> float:
        return float(end(having(value)).said.u[i]) - value

    first, last = (more(value) for value in span)
    if first * last >= 0.0:
        return having(span[0] + first), False
    return having(brentq(more, *span, xtol=_FINE * abs(span[1] - span[0]))), True
