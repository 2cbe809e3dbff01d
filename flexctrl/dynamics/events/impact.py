"""Impacts that an error of places does not see: ropes that catch, gaps and ends of rails that close at speed.

What a step may err by is told in places. An impact of a stiff rope is over within micrometres: steps that leave these
to chance lose, or make, the speed it comes back with. Where it is damped, that is wrong by up to (ωh)²/4 however deep
it is; without damping it comes back late, and all that follows is so much later.
"""

from __future__ import annotations

import math

import numpy as np

from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["LASTING", "NO_IMPACT", "SMALL", "STEPS", "finer", "followed", "lasts"]

SMALL = 1e-4
STEPS = 12.0
LASTING = 56
"""Steps an impact is followed for: it takes π/ω, 38 of them, or stays."""
NO_IMPACT = 0, 0.0
_USUAL, _FEWEST = 1e-4, 0.2


def finer(share: float) -> float:
    """Return how many times more steps follow an impact, where errors are to be less than a share of the way.

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
    run into it. One with next to no energy may go as it likes.

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
    return followed(model, stiffness / mass, how[:2])


def followed(model: Plant, square: float, how: tuple[Tolerance, np.ndarray]) -> tuple[int, float]:
    """Return how many steps follow an impact, and how long.

    Parameters
    ----------
    model : Plant
    square : float
        The ω² that it brings [1/s²].
    how : tuple of Tolerance and numpy.ndarray
        What is allowed, how far each degree of freedom has been.

    Returns
    -------
    int
    float
        [s]
    """
    tolerance, moved = how
    far = float(farthest(model, moved).max())
    times = finer(tolerance.relative + tolerance.absolute / max(far, tolerance.absolute))
    return int(LASTING * times), math.sqrt(1.0 / square) / (STEPS * times)
