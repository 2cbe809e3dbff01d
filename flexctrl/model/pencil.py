"""K − σM, sparse, for many shifts σ: factors, Sylvester counts, inverse iteration, Lanczos."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from flexctrl.errors import LinearizationError

__all__ = ["EPS", "HIDDEN", "SINGULAR", "Pencil", "ShiftedPencil", "stiffness_noise"]

EPS = float(np.finfo(float).eps)
HIDDEN, SINGULAR = -1, -2


def stiffness_noise(K: sp.spmatrix, shapes: np.ndarray) -> np.ndarray:
    """Spread of φᵀ K φ when every entry of K carries its own rounding error.

    Parameters
    ----------
    K : sparse matrix, shape (n, n)
    shapes : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray, shape (k,)
    """
    squares = shapes * shapes
    return EPS * np.sqrt(np.einsum("ij,ij->j", squares, abs(K).power(2) @ squares))


@dataclass(frozen=True)
class ShiftedPencil:
    """K − σM, factorised.

    Attributes
    ----------
    K, M : scipy.sparse.csc_matrix, shape (n, n)
    sigma : float
        (rad/s)².
    lu : scipy.sparse.linalg.SuperLU
    below : int
        How many λ lie under σ (Sylvester); HIDDEN if the pivoting does not tell.
    """

    K: sp.csc_matrix
    M: sp.csc_matrix
    sigma: float
    lu: sla.SuperLU
    below: int

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """(K − σM)⁻¹ rhs with one step of refinement."""
        x = self.lu.solve(rhs)
        return x + self.lu.solve(rhs - self.K @ x + self.sigma * (self.M @ x))

    def iterate(self, x: np.ndarray) -> np.ndarray:
        """One step of inverse iteration."""
        return self.solve(self.M @ x)

    def ritz(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One refined step of subspace iteration, and the pairs within the space; ascending when λ > σ."""
        after = self.iterate(x)
        theta, z = la.eigh(x.T @ (self.M @ after), x.T @ (self.M @ x))
        return self.sigma + 1.0 / theta[::-1], (after @ z / theta)[:, ::-1]

    def lanczos(self, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """The `count` pairs nearest to σ, which must lie under all of them; ascending."""
        n = self.K.shape[0]
        inverse = sla.LinearOperator((n, n), matvec=self.lu.solve, dtype=float)
        start = self.iterate(np.random.default_rng(seed).standard_normal(n))
        _, phi = sla.eigsh(
            self.K, count, M=self.M, sigma=self.sigma, OPinv=inverse, v0=start, ncv=min(n, 2 * count + 20)
        )
        return self.ritz(phi)


class Pencil:
    """K − σM for many σ: both matrices on one sparsity pattern, so that shifting costs one addition.

    Parameters
    ----------
    K, M : sparse matrices, shape (n, n), symmetric
    ordered : bool
        The order of the coordinates is already one of little fill.
    origin : tuple of two sparse matrices, optional
        K₀ and T where K = Tᵀ K₀ T.
    """

    def __init__(
        self,
        K: sp.spmatrix,
        M: sp.spmatrix,
        ordered: bool = False,
        origin: tuple[sp.csc_matrix, sp.csc_matrix] | None = None,
    ) -> None:
        k, m = sp.coo_matrix(K), sp.coo_matrix(M)
        at = (np.concatenate([k.row, m.row]), np.concatenate([k.col, m.col]))
        none_k, none_m = np.zeros_like(k.data, dtype=float), np.zeros_like(m.data, dtype=float)
        self.K = sp.csc_matrix((np.concatenate([k.data, none_m]), at), shape=K.shape)
        self.M = sp.csc_matrix((np.concatenate([none_k, m.data]), at), shape=K.shape)
        self.spec = "NATURAL" if ordered else "MMD_AT_PLUS_A"
        self.origin = origin

    def noise(self, shapes: np.ndarray) -> np.ndarray:
        """Spread of φᵀ K φ by the rounding of the entries that K was made from."""
        if self.origin is None:
            return stiffness_noise(self.K, shapes)
        K, T = self.origin
        return stiffness_noise(K, T @ shapes)

    def reordered(self) -> tuple[Pencil, np.ndarray]:
        """The same in an order of little fill, found once; row i of it is row order[i] here."""
        n = self.K.shape[0]
        pattern = sp.csc_matrix((np.ones_like(self.K.data), self.K.indices, self.K.indptr), self.K.shape)
        lu = sla.splu(
            sp.csc_matrix(pattern + 2.0 * n * sp.identity(n, format="csc")),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        order = np.argsort(lu.perm_c)
        return Pencil(self.K[order][:, order], self.M[order][:, order], ordered=True), order

    def at(self, sigma: float) -> ShiftedPencil:
        """Factorise K − σM.

        Raises
        ------
        LinearizationError
            If it is singular: a freedom with neither mass nor stiffness, or σ an eigenvalue.
        """
        A = sp.csc_matrix((self.K.data - sigma * self.M.data, self.K.indices, self.K.indptr), self.K.shape)
        options = {"SymmetricMode": True}
        try:
            lu = sla.splu(A, permc_spec=self.spec, diag_pivot_thresh=0.0, panel_size=1, options=options)
        except RuntimeError as error:
            raise LinearizationError(
                f"K - ({sigma:.3g}) M is singular: a freedom has neither mass nor stiffness; see audit()"
            ) from error
        hidden = (lu.perm_r != lu.perm_c).any()
        below = HIDDEN if hidden else int(np.count_nonzero(lu.U.diagonal() < 0))
        return ShiftedPencil(self.K, self.M, sigma, lu, below)

    def below(self, sigma: float) -> int:
        """How many λ lie under σ; SINGULAR or HIDDEN where the factors do not tell."""
        try:
            return self.at(sigma).below
        except LinearizationError:
            return SINGULAR

    def below_all(self, sigma: float) -> float:
        """A shift at or under σ with no λ under it, and far enough from 0 to be seen beside K."""
        for _ in range(60):
            if self.below(sigma) in (0, HIDDEN):
                return sigma
            sigma *= 4.0
        raise LinearizationError("K + s M is singular for every s: a freedom has neither mass nor stiffness")

    def soft_scale(self) -> float:
        """The first positive λ within a factor of 10, by Sturm counts; rigid ones look like the lowest decade."""
        k, m = self.K.diagonal(), self.M.diagonal()
        both = (k > 0) & (m > 0)
        high = float((k[both] / m[both]).min()) if both.any() else 1.0
        decades = [0, 15]
        none = self.below(1e-15 * high)
        while decades[1] - decades[0] > 1:
            middle = sum(decades) // 2
            decades[int(self.below(10.0**-middle * high) <= none)] = middle
        return 10.0 ** -decades[0] * high
