"""What holds dry contacts that stick: their slip directions W, and how forces and motions are split along them.

Motions are measured by the mass of each degree of freedom by itself, G⁻¹ = diag M, and each contact by the mass d⁻²
that it feels then, d² = (W G Wᵀ)_kk. So neither units nor what is heavy and what is light beside it decide which
contacts hold the same motion: these share what holds it, so that Σ (d λ)² is least.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Hold", "easiness", "hold"]

Force = TypeVar("Force", np.ndarray, sp.csr_matrix)

_WELL = 1e4
_SAME = 1e-13


@frozen(eq=False)
class Hold:
    """The contacts that stick.

    Attributes
    ----------
    W : numpy.ndarray, shape (stuck, n)
        Slip speeds from the rates of the degrees of freedom.
    back : numpy.ndarray, shape (n, stuck)
        G Wᵀ (W G Wᵀ)⁺: the motion of which each contact slips by one and the others not at all.
    masses : numpy.ndarray, shape (stuck,)
        About what each contact moves [kg or kg m²]: what makes equations of slips ones of forces.
    """

    W: np.ndarray
    back: np.ndarray
    masses: np.ndarray

    def still(self, motion: np.ndarray) -> np.ndarray:
        """Return what is left of a motion when what sticks does not move."""
        return motion - self.back @ (self.W @ motion)

    def borne(self, force: np.ndarray) -> np.ndarray:
        """Return what the contacts bear of generalised forces."""
        return np.asarray(self.back.T @ force)

    def freed(self, force: Force) -> Force:
        """Return generalised forces, or their slopes, without what the contacts bear of them."""
        if isinstance(force, np.ndarray):
            return force - self.W.T @ self.borne(force)
        return self.firm(force, 0.0)

    def against(self, slip: np.ndarray) -> np.ndarray:
        """Return the generalised forces of contacts that push their masses against slips."""
        return self.W.T @ (self.masses * slip)

    def firm(self, slope: sp.csr_matrix, firmness: float) -> sp.csr_matrix:
        """Return slopes of forces that are `freed`, and less those of `against` by how firm slips are held."""
        along = self.back.T @ slope + firmness * self.masses[:, None] * self.W
        return sp.csr_matrix(slope - sp.csr_matrix(self.W.T) @ sp.csr_matrix(along))


def easiness(model: Model) -> np.ndarray:
    """Return how easily each degree of freedom moves by itself at rest: 1/M_ii, or 0 if it has no mass, shape (n,)."""
    still = np.zeros(model.n)
    slope = model.slope(model.rest.loose, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs)))
    masses = -slope.diagonal()
    heavy = masses > model.dust
    return np.where(heavy, 1.0 / np.where(heavy, masses, 1.0), 0.0)


def hold(W: np.ndarray, ease: np.ndarray) -> Hold:
    """Return what holds contacts.

    Parameters
    ----------
    W : numpy.ndarray, shape (stuck, n)
    ease : numpy.ndarray, shape (n,)
        G, as of `easiness`.
    """
    root = np.sqrt(ease)
    felt = W * root
    sizes = np.linalg.norm(felt, axis=1)
    sizes = np.where(sizes > 0.0, sizes, 1.0)  # else nothing with mass is there: a run does not begin
    back = root[:, None] * _inverse(felt / sizes[:, None]) / sizes
    return Hold(W, back, sizes**-2.0)


def _inverse(Y: np.ndarray) -> np.ndarray:
    """The pseudo-inverse of rows of length one; exact where they are unit vectors."""
    square = Y @ Y.T
    if len(Y) and np.linalg.cond(square) < _WELL:
        return np.asarray(np.linalg.solve(square, Y).T)
    return np.linalg.pinv(Y, rcond=_SAME)
