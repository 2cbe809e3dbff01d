"""Coning: what the rotation vector of a step has beside the integral of the spin.

A spin ω that turns away, ω̇ across it, turns over a step by ∫ω dt − h³ η(h|ω|) ω × ω̇, with η of the inverse tangent of
the exponential (`flexctrl.mechanics.rotation.inverse_tangent`): to first order in ω̇ for any h|ω|, and for small ones
the commutator h³/12 of Magnus (1954). Left out, a fast top precesses too slowly, by about (h|ω|)²/12, which no change
of the accelerations shows.
"""

from __future__ import annotations

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import cross
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

__all__ = ["LARGEST", "Coning", "coning_of", "eta"]

LARGEST = np.pi**2
"""Squares of h|ω| beyond are taken for this one: η goes to infinity at whole turns."""


def eta(square: float) -> float:
    """Return η(φ) = (1 − (φ/2) cot(φ/2))/φ² from φ² up to `LARGEST`: a series, right to a thousandth there."""
    return 1 / 12 + square * (1 / 720 + square * (1 / 30240 + square * (1 / 1209600 + square * (1 / 47900160))))


@frozen(eq=False)
class Coning:
    """The rotations of a model that turn all ways.

    Attributes
    ----------
    triples : numpy.ndarray of int, shape (count, 3)
        Their degrees of freedom.
    """

    triples: np.ndarray

    def __call__(self, h: float, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return what a step of length h has beside the integral of the rates, from these at both ends, shape (n,)."""
        turned = np.zeros(len(before))
        if len(self.triples):
            spin = h * before[self.triples]
            share = [eta(min(float(square), LARGEST)) for square in (spin * spin).sum(axis=1)]
            turned[self.triples] = -h * np.array(share)[:, None] * cross(spin, after[self.triples])
        return turned


def coning_of(model: Plant) -> Coning:
    """Return the rotations of a model that turn all ways: three degrees of freedom of a node about space axes.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    Coning
    """
    if not (isinstance(model, Model) and model.large):
        return Coning(np.zeros((0, 3), dtype=int))
    motion = model.motion
    cells = np.delete(motion.place, [int(motion.nodes[i]) for i, _ in motion.linkage.lines], axis=0)[:, 3:]
    return Coning(np.unique(cells[(cells < motion.n).all(axis=1)], axis=0))
