"""Where a linear model comes from: the machine, its state, and what displacements its coordinates stand for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen

__all__ = ["Place"]

Shape = TypeVar("Shape")


class Elastic(Protocol):
    """A machine that can tell its stiffness along some motions better than a matrix of doubles holds it."""

    def strain(self, state: Any, u: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of motions Φ, shape (n, k), about a state under inputs u."""


Machine = TypeVar("Machine", bound=Elastic)


@frozen(eq=False)
class Place(Generic[Machine, Shape]):
    """The machine that a linear model is of: for drawing its modes, and for stiffnesses to more digits.

    Attributes
    ----------
    model : Model
    state : State
        The equilibrium.
    basis : scipy.sparse.csc_matrix, shape (model.n, n)
        Displacements of the machine's degrees of freedom for one of each coordinate.
    inputs : numpy.ndarray, shape (inputs,)
        What it is in equilibrium with.
    pull : float
        The ω² at which the machine would swing as a whole under the forces at work [(rad/s)²]; 0 for none.
    springs : scipy.sparse.csc_matrix, shape (n, n), optional
        Stiffness on the coordinates that the machine is without: of shafts whose twists they are.
    """

    model: Machine
    state: Shape
    basis: sp.csc_matrix
    inputs: np.ndarray
    pull: float
    springs: sp.csc_matrix | None = None

    def projected(self, basis: sp.spmatrix) -> Place[Machine, Shape]:
        """Return the same of other coordinates b, q = T b.

        Parameters
        ----------
        basis : sparse matrix, shape (n, k)
        """
        springs = None if self.springs is None else sp.csc_matrix(basis.T @ self.springs @ basis)
        return replace(self, basis=sp.csc_matrix(self.basis @ basis), springs=springs)

    def strain(self, shapes: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of displacements of the coordinates, from the machine itself.

        Parameters
        ----------
        shapes : numpy.ndarray, shape (n, k)

        Returns
        -------
        numpy.ndarray, shape (k, k)
        """
        found = self.model.strain(self.state, self.inputs, self.basis @ shapes)
        return found if self.springs is None else found + shapes.T @ (self.springs @ shapes)
