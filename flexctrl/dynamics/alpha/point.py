"""Generalised alpha: its constants, and the points that it goes from and to."""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.steps import Point
from flexctrl.frozen import frozen

__all__ = ["AlphaPoint", "Coefficients"]


@frozen
class Coefficients:
    """Constants of the method for a spectral radius at infinity."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of(cls, rho: float) -> Coefficients:
        """Return the optimal set for 0 ≤ ρ ≤ 1."""
        alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma)

    @property
    def damping(self) -> bool:
        """Whether the highest frequencies lose energy: ρ < 1."""
        return self.gamma > 0.5

    def blend(self, rate: np.ndarray, before: np.ndarray, algorithmic: np.ndarray) -> np.ndarray:
        """Return the method's own acceleration after a step, from the true ones at both ends and its own before."""
        return ((1.0 - self.alpha_f) * rate + self.alpha_f * before - self.alpha_m * algorithmic) / (1.0 - self.alpha_m)


@frozen
class AlphaPoint(Point):
    """A point of the method: its own accelerations beside the true ones, and how these grow.

    ``trend`` is the change of the true accelerations over the last step, ``lean`` the share of the one before that
    best foretold it: the next one is expected to be that share of it. ``came`` is the length of the last step [s]; 0 at
    the start and beyond corners.
    """

    algorithmic: np.ndarray
    trend: np.ndarray
    lean: float = 1.0
    came: float = 0.0
