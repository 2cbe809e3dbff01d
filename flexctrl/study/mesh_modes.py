"""Modes that the mesh resists: a bent round beam that turns about its own line is free but for its elements."""

from __future__ import annotations

import numpy as np

from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.structure.refine import refine
from flexctrl.study.subject import Subject

__all__ = ["Vanishing", "vanishing"]

_CANCELS = 1e-6
"""Of its terms: what the stiffness of a mode sums to at most, for the mesh to be asked about it."""
_LEFT = 0.5
"""Of ω² with twice as many elements: below, what went was more than what a finer mesh can show to be the machine's."""


@frozen
class Vanishing:
    """A mode most of whose stiffness is the mesh's.

    Attributes
    ----------
    mode : int
        From 0.
    omega_squared : float
        (rad/s)².
    finer : float
        With twice as many elements.
    """

    mode: int
    omega_squared: float
    finer: float


def vanishing(scene: Subject, modes: Modes) -> tuple[Vanishing, ...]:
    """Return the modes that the mesh resists: twice as many elements leave less than half of their ω².

    Where terms of φᵀ K φ do not cancel nearly all, the mesh is not asked.

    Parameters
    ----------
    scene : Scene
    modes : Modes
        The lowest of its linear model, all of them up to the highest that is asked about.

    Returns
    -------
    tuple of Vanishing
        None as well where the mesh cannot be made finer.
    """
    asked = [k for k in range(modes.unstable + modes.rigid, len(modes)) if _cancels(scene.linear, modes, k)]
    if not asked:
        return ()
    try:
        finer = scene.with_(structure=refine(scene.structure, 2)).linear.modes().omega_squared
    except FlexctrlError:  # nodes tied by numbers, or no equilibrium is found
        return ()
    found = [Vanishing(k, float(modes.omega_squared[k]), float(finer[k])) for k in asked]
    return tuple(v for v in found if abs(v.finer) < _LEFT * v.omega_squared)


def _cancels(linear: LinearModel, modes: Modes, k: int) -> bool:
    shape = np.abs(modes.shapes[:, k])
    return bool(modes.omega_squared[k] < _CANCELS * (shape @ (abs(linear.K) @ shape)))
