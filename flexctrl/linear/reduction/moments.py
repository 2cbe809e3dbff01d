"""Moment matching: second-order Krylov subspaces at chosen points, structure kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from flexctrl.errors import ReductionError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction.low_frequency import flexibility, rigid_basis, unsymmetric
from flexctrl.linear.reduction.result import ReducedModel, galerkin

__all__ = ["MomentMatching"]

NOTHING_NEW = 1e-11

Solver = Callable[[np.ndarray], np.ndarray]


@frozen
class MomentMatching:
    """Galerkin projection on second-order Krylov spaces of inputs and outputs.

    At every point s the columns of (K + sC + s²M)⁻¹ B and (K + sC + s²M)⁻ᵀ Cᵀ and their derivatives
    are spanned, so that k derivatives on each side match 2k moments of G there; M, C and K stay
    symmetric and definite (Z. Bai, Y. Su, SIAM J. Matrix Anal. 26 (2005) 640–659). Rigid-body modes
    are put in exactly, and the expansion at 0 is then that of the elastic rest.

    Parameters
    ----------
    points : tuple of float or complex
        Expansion points s in rad/s, e.g. ``(0.0, 30j)``; a complex point brings its conjugate.
    order : int
        Largest number of coordinates, rigid-body modes included; more than the model has are not taken.
    """

    points: tuple[complex, ...]
    order: int

    def apply(self, full: LinearModel) -> ReducedModel:
        """Reduce a model.

        Parameters
        ----------
        full : LinearModel

        Returns
        -------
        ReducedModel

        Raises
        ------
        ReductionError
            If the order holds no more than the rigid-body modes, a point is a pole, or the model has no signals.
        """
        if not full.inputs and not full.outputs:
            raise ReductionError(
                "MomentMatching matches the response, and the model has neither inputs nor outputs: give the structure "
                "some, or use ModalTruncation"
            )
        rigid = rigid_basis(full)
        r = rigid.shape[1]
        if self.order <= r or not self.points:
            raise ReductionError(
                f"MomentMatching needs points and an order above the {r} rigid-body modes; got "
                f"{len(self.points)} points, order {self.order}"
            )
        basis = _collect(full, rigid, self.points, min(self.order, len(full.coordinates)))
        names = (*(f"rigid{j + 1}" for j in range(r)), *(f"krylov{j + 1}" for j in range(basis.shape[1] - r)))
        return galerkin(full, self, basis, names, np.eye(len(names), r))


def _collect(full: LinearModel, rigid: np.ndarray, points: tuple[complex, ...], room: int) -> np.ndarray:
    """The rigid modes, then round-robin over the points what is new, until the room is used."""
    sources, weight = [_directions(full, rigid, complex(s)) for s in points], _weight(full)
    basis = rigid
    for _ in range(2 * room + 2):
        for source in sources:
            for column in next(source).T:
                basis = _extended(basis, column, weight)
                if basis.shape[1] == room:
                    return basis
    return basis


def _weight(full: LinearModel) -> sp.csc_matrix:
    """M, and so little of K that only what has no mass shows it: what is light and stiff keeps its mass beside all."""
    stiffness, mass = abs(full.K.diagonal()), full.M.diagonal()
    heavy = (mass > 0.0) & (stiffness > 0.0)
    fastest = float((stiffness[heavy] / mass[heavy]).max(initial=0.0)) or 1.0
    return sp.csc_matrix(full.M + (0.5 / fastest) * (full.K + full.K.T))


def _extended(basis: np.ndarray, column: np.ndarray, weight: sp.csc_matrix) -> np.ndarray:
    """Append the part of the column that is new, of weight 1 (Gram–Schmidt, three times)."""
    size = _length(column, weight)
    for _ in range(3):
        column = column - basis @ (basis.T @ (weight @ column))
        rest = _length(column, weight)
        if rest <= NOTHING_NEW * size:
            return basis
        column, size = column / rest, 1.0
    return np.column_stack([basis, column])


def _length(column: np.ndarray, weight: sp.csc_matrix) -> float:
    return float(np.sqrt(max(float(column @ (weight @ column)), 0.0)))


def _directions(full: LinearModel, rigid: np.ndarray, s: complex) -> Iterator[np.ndarray]:
    """Real directions block by block: the inputs' Krylov vectors, then the outputs', one derivative deeper."""
    value = s if s.imag else s.real
    forward, backward = _solvers(full, rigid, value)
    first = 2 * value * full.M + full.C
    loads = np.vstack([full.Cq, full.Cv[abs(full.Cv).max(axis=1, initial=0.0) > 0]]).T
    inputs = _krylov(forward, first, full.M, full.B)
    outputs = _krylov(backward, first.T, full.M.T, loads)
    for block, dual in zip(inputs, outputs, strict=True):
        both = np.hstack([block, dual])
        yield np.hstack([both.real, both.imag]) if s.imag else both


def _krylov(solve: Solver, first: sp.spmatrix, M: sp.spmatrix, load: np.ndarray) -> Iterator[np.ndarray]:
    """Displacement halves of an orthonormal basis of the companion Krylov space (two-level Arnoldi)."""
    n = len(load)
    block = solve(load)
    pair = np.vstack([block, np.zeros_like(block)])
    known = np.zeros((2 * n, 0), pair.dtype)
    while True:
        for _ in range(2):
            pair = pair - known @ (known.conj().T @ pair)
        pair = np.linalg.qr(pair)[0]
        known = np.hstack([known, pair])
        yield pair[:n]
        pair = np.vstack([-solve(first @ pair[:n] + M @ pair[n:]), pair[:n]])


def _solvers(full: LinearModel, rigid: np.ndarray, s: complex) -> tuple[Solver, Solver]:
    if s == 0 and not unsymmetric(full):
        solve = flexibility(full, rigid)
        return solve, solve
    try:
        factor = splu(sp.csc_matrix(full.K + s * full.C + s**2 * full.M))
    except RuntimeError as error:
        raise ReductionError(f"the point s = {s:.6g} rad/s is a pole of the model; move it") from error
    dtype = type(s)
    return (lambda f: factor.solve(f.astype(dtype))), (lambda f: factor.solve(f.astype(dtype), trans="T"))
