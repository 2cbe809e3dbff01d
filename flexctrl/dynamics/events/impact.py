"""Impacts that an error of places does not see: ropes that catch, gaps and ends of rails that close at speed.

What a step may err by is told in places. An impact of a stiff rope is over within micrometres: steps that leave these
to chance lose, or make, the speed it comes back with. Where it is damped, that is wrong by up to (ωh)²/4 however deep
it is; without damping it comes back late, and all that follows is so much later.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["LASTING", "NO_IMPACT", "SMALL", "STEPS", "Wanted", "finer", "followed", "lasts"]

SMALL = 1e-4
STEPS = 12.0
LASTING = 56
"""Steps an impact is followed for: it takes π/ω, 38 of them, or stays."""
NO_IMPACT = 0, 0.0
_USUAL, _FEWEST = 1e-4, 0.2


class Wanted(NamedTuple):
    """What is to be seen of an impact.

    Attributes
    ----------
    tolerance : Tolerance
    moved : numpy.ndarray, shape (n,)
        How far each degree of freedom has been.
    steepness : float
        Power of the step with which the method's error grows.
    """

    tolerance: Tolerance
    moved: np.ndarray
    steepness: float


def finer(share: float, steepness: float) -> float:
    """Return how many times more steps follow an impact, where errors are to be less than a share of the way.

    As many as other steps, which are chosen by errors: of second order these go with the cube root of the tolerance.
    Under a far larger tolerance fewer do, or runs that are laid beside others to tell their errors would be off alike.
    """
    times = math.pow(_USUAL / share, 1.0 / steepness)
    return max(1.0 if share < 2.0 * _USUAL else _FEWEST, times)


def lasts(
    model: Plant, before: State, beyond: State, u: np.ndarray, wanted: Wanted, turnover: float
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
    wanted : Wanted
    turnover : float
        The largest energy turned over [J].

    Returns
    -------
    int
    float
        [s]
    """
    still, v = np.zeros(model.n), beyond.v
    pushes = [model.slope(state, v, still, (1.0, 0.0, 0.0), u) @ v for state in (beyond, before)]
    momentum = -(model.slope(beyond, v, still, (0.0, 0.0, 1.0), u) @ v)
    stiffness, mass = -float(v @ (pushes[0] - pushes[1])), float(v @ momentum)
    if not (stiffness > 0.0 and mass > 2.0 * SMALL * turnover):
        return NO_IMPACT
    return followed(model, stiffness / mass, wanted)


def followed(model: Plant, square: float, wanted: Wanted) -> tuple[int, float]:
    """Return how many steps follow an impact, and how long.

    Parameters
    ----------
    model : Plant
    square : float
        The ω² that it brings [1/s²].
    wanted : Wanted

    Returns
    -------
    int
    float
        [s]
    """
    tolerance, far = wanted.tolerance, float(farthest(model, wanted.moved).max())
    times = finer(tolerance.relative + tolerance.absolute / max(far, tolerance.absolute), wanted.steepness)
    return int(LASTING * times), math.sqrt(1.0 / square) / (STEPS * times)
