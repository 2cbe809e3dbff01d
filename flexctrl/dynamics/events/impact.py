"""Impacts that an error of places does not see: ropes that catch, gaps and ends of rails that close at speed.

What a step may err by is told in places. An impact of a stiff rope is over within micrometres: steps that leave these
to chance lose, or make, the speed it comes back with. Where it is damped, that is wrong by up to (ωh)²/4 however deep
it is; without damping of the machine or the method, only late.
"""

from __future__ import annotations

import math

import numpy as np

from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["DAMPED", "LASTING", "NO_IMPACT", "SEEN", "SMALL", "STEPS", "finer", "followed", "lasts"]

SEEN = 300.0
SMALL = 1e-4
STEPS = 12.0
LASTING = 56
"""Steps an impact is followed for: it takes π/ω, 38 of them, or stays."""
DAMPED = 0.01
"""Twice the damping ratio of an impact that is followed whether or not it is seen."""
NO_IMPACT = 0, 0.0
_USUAL, _FEWEST = 1e-4, 0.2


def finer(share: float) -> float:
    """Return how many times more steps follow a damped impact, where errors are to be less than a share of the way.

    Of second order, as steps chosen by errors are: those go with the cube root of the tolerance. Under a far larger
    tolerance fewer do, or runs that are laid beside others to tell their errors would be off alike.
    """
    times = math.pow(_USUAL / share, 1.0 / 3.0)
    return max(1.0 if share < 2.0 * _USUAL else _FEWEST, times)


def lasts(
    model: Plant, before: State, beyond: State, u: np.ndarray, how: tuple[Tolerance, np.ndarray, float]
) -> tuple[int, float]:
    """Return how many steps follow an impact at a corner, and how long: 1/(12 ω); none where nothing hits.

    ω² = v·ΔK v / v·M v with the stiffness ΔK that the corner has brought about: Rayleigh's quotient of the speeds that
    run into it. One that is not damped and as deep as 300 errors allowed is seen by the control of steps, and one with
    next to no energy may go as it likes.

    Parameters
    ----------
    model : Plant
    before, beyond : State
        On both sides of the corner.
    u : numpy.ndarray
    how : tuple of Tolerance, numpy.ndarray and float
        What is allowed, how far each degree of freedom has been, the largest energy turned over [J].

    Returns
    -------
    int
    float
        [s]
    """
    turnover = how[2]
    still, v = np.zeros(model.n), beyond.v
    pushes = [model.slope(state, v, still, (1.0, 0.0, 0.0), u) @ v for state in (beyond, before)]
    momentum = -(model.slope(beyond, v, still, (0.0, 0.0, 1.0), u) @ v)
    stiffness, mass = -float(v @ (pushes[0] - pushes[1])), float(v @ momentum)
    if not (stiffness > 0.0 and mass > 2.0 * SMALL * turnover):
        return NO_IMPACT
    drag = float(v @ (model.balance(before, v, still) - model.balance(beyond, v, still)))
    return followed(model, v, (stiffness / mass, drag / mass), how[:2])


def followed(
    model: Plant, v: np.ndarray, brought: tuple[float, float], how: tuple[Tolerance, np.ndarray]
) -> tuple[int, float]:
    """Return how many steps follow an impact, and how long; none where the control of steps sees it.

    Parameters
    ----------
    model : Plant
    v : numpy.ndarray
        The speeds that run into it.
    brought : tuple of 2 floats
        ω² and twice the rate at which damping ends them [1/s²], [1/s].
    how : tuple of Tolerance and numpy.ndarray
        What is allowed, how far each degree of freedom has been.

    Returns
    -------
    int
    float
        [s]
    """
    (square, rate), (tolerance, moved) = brought, how
    period, far = math.sqrt(1.0 / square), farthest(model, moved)
    if rate * period > DAMPED:
        times = finer(tolerance.relative + tolerance.absolute / max(float(far.max()), tolerance.absolute))
        return int(LASTING * times), period / (STEPS * times)
    deep = np.abs(v) * period / yardsticks(model) >= SEEN * tolerance.of(far)
    return NO_IMPACT if deep.any() else (LASTING, period / STEPS)
