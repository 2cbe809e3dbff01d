"""K − σM for many shifts σ: factors, Sylvester counts, inverse iteration, block Lanczos."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.linalg import lapack

from flexctrl.errors import LinearizationError
from flexctrl.frozen import frozen
from flexctrl.linear.banded import Band, band_of
from flexctrl.linear.krylov import Blocks, Space, krylov
from flexctrl.linear.pattern import aligned, with_entries

__all__ = [
    "EPS",
    "HIDDEN",
    "SINGULAR",
    "SOFT_NOISE",
    "TINY",
    "DensePencil",
    "Matrix",
    "Pencil",
    "ShiftedPencil",
    "faint_shift",
    "stiffness_noise",
]

EPS = float(np.finfo(float).eps)
HIDDEN, SINGULAR = -1, -2
TINY = 1e-12
FAINT = 100.0 * EPS
FIRM = 1e-9
SOFT_NOISE = 1e6

Matrix: TypeAlias = "np.ndarray | sp.csc_matrix"


def stiffness_noise(K: Matrix, shapes: np.ndarray) -> np.ndarray:
    """Spread of φᵀ K φ when every entry of K carries its own rounding error.

    Parameters
    ----------
    K : array or sparse matrix, shape (n, n)
    shapes : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray, shape (k,)
    """
    return _noise(_squared(K), shapes)


def _squared(K: Matrix) -> Matrix:
    return K * K if isinstance(K, np.ndarray) else with_entries(K, K.data**2)


def _noise(squared: Matrix, shapes: np.ndarray) -> np.ndarray:
    squares = shapes * shapes
    return EPS * np.sqrt(np.einsum("ij,ij->j", squares, squared @ squares))


@frozen
class ShiftedPencil:
    """K − σM, factorised.

    Attributes
    ----------
    K, M : array or sparse matrix, shape (n, n)
    sigma : float
        (rad/s)².
    inverse : callable
        rhs ↦ (K − σM)⁻¹ rhs.
    below : int
        How many λ lie under σ (Sylvester); HIDDEN if the pivoting does not tell.
    firm : bool
        Whether no motion is nearly without stiffness, as far as the pivots tell; False if they are not looked at.
    recurrence : callable, optional
        q of M-length one and M q ↦ the Krylov space that begins with q, where that is compiled.
    """

    K: Matrix
    M: Matrix
    sigma: float
    inverse: Callable[[np.ndarray], np.ndarray]
    below: int
    firm: bool = False
    recurrence: Callable[[np.ndarray, np.ndarray], Space] | None = None

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """(K − σM)⁻¹ rhs with one step of refinement."""
        x = self.inverse(rhs)
        return x + self.inverse(rhs - self.K @ x + self.sigma * (self.M @ x))

    def iterate(self, x: np.ndarray) -> np.ndarray:
        """One step of inverse iteration."""
        return self.solve(self.M @ x)

    def ritz(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One refined step of subspace iteration, and the pairs within the space; ascending when λ > σ."""
        image = self.M @ x
        return self._within(x, image, self.solve(image))

    def misfit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far x, of M-length one, are from eigenvectors, and their λ − σ, of which that is a share.

        With A = K − σM, θ = xᵀ A x and the residual r = A x − θ M x, A^-½ r = (1 − θ A^-½ M A^-½) A^½ x: for some λ of
        the pencil, θ is within the share |A^-½ r| / |A^½ x| of λ − σ.
        """
        image = self.M @ x
        force = self.K @ x - self.sigma * image
        size = np.abs(np.einsum("ij,ij->j", x, force))
        rest = force - size * image
        return np.sqrt(np.abs(np.einsum("ij,ij->j", rest, self.inverse(rest))) / size), size

    def _within(self, x: np.ndarray, image: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pairs within the space of x, given M x and (K − σM)⁻¹ M x."""
        theta, z, _ = lapack.dsygvd(image.T @ after, x.T @ image)
        theta = np.maximum(theta, EPS * EPS * theta[-1])  # beside what nothing holds, stiff motions round to none
        return self.sigma + 1.0 / theta[::-1], after @ (z / theta)[:, ::-1]

    def lanczos(self, start: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, Space]:
        """The `count` pairs nearest to σ, which must lie under all of them, and on to the next gap; ascending.

        With them, the Krylov space that they come from.
        """
        space = self._space(start, 3 * (count + start.shape[1]))
        found = krylov(space, count)
        image, near = found.images, found.theta * found.vectors
        after = near + self.inverse(image + self.sigma * (found.theta * image) - self.K @ near)
        return *self._within(found.vectors, image, after), space

    def _space(self, start: np.ndarray, room: int) -> Space:
        if self.recurrence is None or start.shape[1] > 1:
            return Blocks(self.inverse, self.M, start, room)
        first = self.inverse(self.M @ start)
        image = self.M @ first
        length = np.sqrt(first.T @ image)
        return self.recurrence(first / length, image / length)


class Pencil:
    """K − σM, sparse, for many σ: both matrices on one pattern, so that shifting costs one addition.

    Parameters
    ----------
    K, M : scipy.sparse.csc_matrix, shape (n, n), symmetric
    band : Band, optional
        Of their common pattern, where that is known already.
    """

    def __init__(self, K: sp.csc_matrix, M: sp.csc_matrix, band: Band | None = None) -> None:
        self.K, self.M = aligned(K, M)
        self._known = band

    @cached_property
    def _squares(self) -> Matrix:
        return _squared(self.K)

    def noise(self, shapes: np.ndarray) -> np.ndarray:
        """Spread of φᵀ K φ by the rounding of the entries of K."""
        return _noise(self._squares, shapes)

    def at(self, sigma: float) -> ShiftedPencil:
        """Factorise K − σM.

        Raises
        ------
        LinearizationError
            If it is singular: a freedom with neither mass nor stiffness, or σ an eigenvalue.
        """
        A = with_entries(self.K, self._data(sigma))
        options = {"SymmetricMode": True}
        try:
            lu = sla.splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, panel_size=1, options=options)
        except RuntimeError as error:
            raise LinearizationError(
                f"K - ({sigma:.3g}) M is singular: a freedom has neither mass nor stiffness; see audit()"
            ) from error
        hidden = (lu.perm_r != lu.perm_c).any()
        below = HIDDEN if hidden else int(np.count_nonzero(lu.U.diagonal() < 0))
        return ShiftedPencil(self.K, self.M, sigma, lu.solve, below)

    @cached_property
    def _band(self) -> Band | None:
        return band_of(self.K) if self._known is None else self._known

    def _data(self, sigma: float) -> np.ndarray:
        return np.asarray(self.K.data - sigma * self.M.data)

    def _under(self, sigma: float) -> ShiftedPencil:
        """As `at` for σ under all λ, in a band where that is narrow."""
        if self._band is None:
            return self.at(sigma)
        factor = self._band.factorise(self._data(sigma))
        if factor is None:
            raise LinearizationError(f"K - ({sigma:.3g}) M is not positive definite")
        firm = bool((factor.pivots > FIRM * factor.diagonal).all())
        recurrence = factor.space and partial(factor.space, self.M.data)
        return ShiftedPencil(self.K, self.M, sigma, factor.solve, 0, firm, recurrence)

    def below(self, sigma: float, near: Space | None = None, growth: float = 1.0) -> int:
        """How many λ lie under σ; SINGULAR or HIDDEN where the factors do not tell.

        A space that holds about the eigenvectors of these λ, and more, makes it quicker where the band is narrow; so
        does a growth of the rounding of K that would not bring another λ to σ.
        """
        if near is not None and self._band is not None:
            found = self._band.negative(self._data(sigma), lambda: near.vectors, growth)
            if found is not None:
                return found
        try:
            return self.at(sigma).below
        except LinearizationError:
            return SINGULAR

    def below_all(self, sigma: float) -> ShiftedPencil:
        """Factors at or under σ with no λ under it, and far enough from 0 to be seen beside K."""
        return _below_all(self._under, sigma)


class DensePencil:
    """K − σM, dense, for many σ.

    Parameters
    ----------
    K, M : numpy.ndarray, shape (n, n), symmetric
    origin : tuple of two sparse matrices, optional
        K₀ and T where K = Tᵀ K₀ T: rounding is judged by the entries of K₀.
    """

    def __init__(self, K: np.ndarray, M: np.ndarray, origin: tuple[Matrix, Matrix] | None = None) -> None:
        self.K, self.M, self.origin = K, M, origin

    def noise(self, shapes: np.ndarray) -> np.ndarray:
        """Spread of φᵀ K φ by the rounding of the entries that K was made from."""
        return _noise(self._squares, shapes if self.origin is None else self.origin[1] @ shapes)

    @cached_property
    def _squares(self) -> Matrix:
        return _squared(self.K if self.origin is None else self.origin[0])

    def at(self, sigma: float) -> ShiftedPencil:
        """Factorise K − σM.

        Raises
        ------
        LinearizationError
            If it is not positive definite: σ is not under all λ.
        """
        factor, info = lapack.dpotrf(self.K - sigma * self.M, lower=1)
        if info:
            raise LinearizationError(f"K - ({sigma:.3g}) M is not positive definite")
        return ShiftedPencil(self.K, self.M, sigma, lambda rhs: lapack.dpotrs(factor, rhs, lower=1)[0], 0)

    def below_all(self, sigma: float) -> ShiftedPencil:
        """Factors at or under σ with no λ under it."""
        return _below_all(self.at, sigma)

    def direct(self) -> tuple[np.ndarray, np.ndarray]:
        """All λ and φ by the pencil (K, M), ascending: right at the high end.

        Raises
        ------
        LinearizationError
            If M is not positive definite.
        """
        values, shapes, info = lapack.dsygvd(self.K, self.M)
        if info:
            raise LinearizationError("the mass matrix is not positive definite on the freedoms kept")
        return values, shapes


def _below_all(at: Callable[[float], ShiftedPencil], sigma: float) -> ShiftedPencil:
    for _ in range(60):
        try:
            shifted = at(sigma)
        except LinearizationError:
            shifted = None
        if shifted is not None and shifted.below in (0, HIDDEN):
            return shifted
        sigma *= 4.0
    raise LinearizationError("K + s M is singular for every s: a freedom has neither mass nor stiffness")


def faint_shift(K: Matrix, M: Matrix, noise: np.ndarray | None = None) -> float:
    """A negative σ so small that it is seen only where K has no stiffness at all.

    Parameters
    ----------
    K, M : array or sparse matrix, shape (n, n)
    noise : numpy.ndarray of shape (n,) or None, optional
        Of K's diagonal, where it is known.

    Returns
    -------
    float
    """
    k, m = np.abs(K.diagonal()), M.diagonal()
    both = (k > 0) & (m > 0)
    if not both.any():
        return -TINY
    ratios = k[both] / m[both]
    clear = ratios > FAINT * np.median(ratios)  # less may be rounding over a mass
    if noise is not None:
        clear |= k[both] > SOFT_NOISE * noise[both]
    return -TINY * float(ratios[clear].min())
