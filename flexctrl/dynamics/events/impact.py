"""Impacts that an error of places does not see: ropes that catch, gaps and ends of rails that close at speed.

What a step may err by is told in places. An impact of a stiff rope is over within micrometres: steps that leave these
to chance lose, or make, the speed it comes back with.
"""

from __future__ import annotations

import math

import numpy as np

from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import farthest, yardsticks
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["LASTING", "SEEN", "SMALL", "STEPS", "lasts"]

SEEN = 300.0
SMALL = 1e-4
STEPS = 12.0
LASTING = 56
"""Steps an impact is followed for: it takes π/ω, 38 of them, or stays."""


def lasts(model: Plant, before: State, beyond: State, u: np.ndarray, how: tuple[Tolerance, np.ndarray, float]) -> float:
    """Return steps that follow an impact at a corner, 1/(12 ω); infinity where steps of their own do, or nothing hits.

    ω² = v·ΔK v / v·M v with the stiffness ΔK that the corner has brought about: Rayleigh's quotient of the speeds that
    run into it. An impact as deep as a hundred errors allowed is seen by the control of steps, and one with next to no
    energy may go as it likes.

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
    float
        [s]
    """
    tolerance, moved, turnover = how
    still, v = np.zeros(model.n), beyond.v
    pushes = [model.slope(state, v, still, (1.0, 0.0, 0.0), u) @ v for state in (beyond, before)]
    momentum = -(model.slope(beyond, v, still, (0.0, 0.0, 1.0), u) @ v)
    stiffness, mass = -float(v @ (pushes[0] - pushes[1])), float(v @ momentum)
    if not (stiffness > 0.0 and mass > 2.0 * SMALL * turnover):
        return math.inf
    period = math.sqrt(mass / stiffness)
    deep = np.abs(v) * period / yardsticks(model) >= SEEN * tolerance.of(farthest(model, moved))
    return math.inf if deep.any() else period / STEPS
