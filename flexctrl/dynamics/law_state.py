"""The state of a continuous law over a step: by the trapezoidal rule, with its error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.said import state_of

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Supply

__all__ = ["CLEAR", "HALVINGS", "LOOSE", "MANY", "NEARER", "YOUNG", "error", "slope_of", "softened", "trapezoidal"]

NEARER, HALVINGS = 10, 24
"""Steps of Newton's method towards the state; halvings between the rates on both sides of a jump."""
LOOSE, YOUNG = 3.0, 0.01
"""By how much errors of a law's state count less than those of places: it may do little. A share of the time so far."""
MANY = 50
"""States of a law whose slope, by differences, takes longer than all else of a step."""
CLEAR = 1e-2
"""Errors over what is allowed that nothing needs to be known of."""
_SMALL, _LEFT = 1e-7, 1e-12
_Map = Callable[[np.ndarray], np.ndarray]


def trapezoidal(
    c: Controller, t: float, y: np.ndarray, start: tuple[np.ndarray, np.ndarray], h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state x = x₀ + h/2 (ẋ₀ + f(t, x, y)) and its rate at the end of a step, by Newton's method.

    Where the rate jumps with the state and turns it back from both sides, there is no such x: the state stays where
    it jumps, under the rate between the two that keeps it there (Filippov).

    Parameters
    ----------
    c : Controller
    t : float
        At the end of the step [s].
    y : numpy.ndarray
        What it reads there.
    start : tuple of 2 numpy.ndarray
        State and rate at the start.
    h : float
        [s]

    Returns
    -------
    numpy.ndarray, numpy.ndarray
    """
    x0, rate0 = start

    def rate(x: np.ndarray) -> np.ndarray:
        return state_of(c, c.rate(t, x, y), "rate", x0.size)

    x, f = x0 + h * rate0, rate0
    for _ in range(NEARER):
        before, f = f, rate(x)
        slope = np.eye(x.size) - 0.5 * h * slope_of(rate, x, f)
        step = np.linalg.solve(slope, x - x0 - 0.5 * h * (rate0 + f))
        x = x - step
        if np.abs(step).max() <= _LEFT * (1.0 + np.abs(x).max()):
            return x, rate(x)
    return _between(lambda f: x0 + 0.5 * h * (rate0 + f), rate, (before, f))


def _between(led: _Map, rate: _Map, sides: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The rate between two others that leads to where it jumps from one to the other, and the state there."""
    one, d = sides[0], sides[1] - sides[0]
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        f = one + share * d
        if float((rate(led(f)) - f) @ d) > 0.0:
            low = share
        else:
            high = share
    return led(f), f


def error(one: Supply, other: Supply, span: tuple[float, float], tolerance: Tolerance, soften: _Map) -> float:
    """Return the local error of the trapezoidal rule over what is allowed: h³/12 of the second derivative of the rate.

    It is relative to how large a state has been, or to what its rate makes of it in a hundredth of the time so far:
    what leaves zero has no size yet. What counts is what the rule leaves of it: a state that
    follows at once what it reads forgets it.

    Parameters
    ----------
    one, other : Supply
        Before and after the step.
    span : tuple of 2 floats
        When it ends, and its length [s].
    tolerance : Tolerance
    soften : callable
        What the rule makes of a change of the state at the start of the step.

    Returns
    -------
    float
        0 for the first step.
    """
    if not one.trend.size:
        return 0.0
    t, h = span
    off = h * h / 12.0 * (other.trend - one.trend)
    size = np.maximum(other.most, YOUNG * t * np.maximum(np.abs(one.rate), np.abs(other.rate)))
    allowed = LOOSE * (tolerance.relative + tolerance.absolute) * size
    found = _largest(off, allowed)
    return found if found <= CLEAR else _largest(np.minimum(np.abs(off), np.abs(soften(off))), allowed)


def _largest(off: np.ndarray, allowed: np.ndarray) -> float:
    return float(np.divide(np.abs(off), allowed, out=np.zeros(off.size), where=allowed > 0.0).max())


def softened(c: Controller, t: float, y: np.ndarray, ends: tuple[np.ndarray, float], off: np.ndarray) -> np.ndarray:
    """Return what the rule makes of a change of the state at the start of a step: (1 − h/2 ∂f/∂x)⁻¹ of it.

    Parameters
    ----------
    c : Controller
    t : float
        At the end of the step [s].
    y : numpy.ndarray
        What it reads there.
    ends : tuple of numpy.ndarray and float
        The state there, and the length of the step [s].
    off : numpy.ndarray
        The change.

    Returns
    -------
    numpy.ndarray
    """
    x, h = ends

    def rate(x: np.ndarray) -> np.ndarray:
        return state_of(c, c.rate(t, x, y), "rate", x.size)

    return np.asarray(np.linalg.solve(np.eye(x.size) - 0.5 * h * slope_of(rate, x, rate(x)), off))


def slope_of(rate: Callable[[np.ndarray], np.ndarray], x: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return ∂f/∂x by differences, to the side on which less changes: a rate may jump right beside.

    Parameters
    ----------
    rate : callable
        x ↦ f
    x, f : numpy.ndarray, shape (states,)

    Returns
    -------
    numpy.ndarray, shape (states, states)
    """
    J = np.empty((x.size, x.size))
    for i in range(x.size):
        d = np.zeros(x.size)
        d[i] = _SMALL * max(1.0, abs(x[i]))
        ahead, back = (rate(x + d) - f) / d[i], (f - rate(x - d)) / d[i]
        J[:, i] = min(ahead, back, key=lambda column: float(np.abs(column).max()))
    return J
