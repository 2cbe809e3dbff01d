"""A space for the response of a large model: Galerkin solution, and what that leaves of the equations, for many s."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pattern import aligned
from flexctrl.linear.resolvent import Resolvent, resolvent

__all__ = ["Metric", "Space", "grown", "metric_of", "started"]

ACCURACY = 2e-10
ROUNDING = 3.2 * float(np.finfo(float).eps)
DEPENDENT = 1e-12
NOTHING = 1e-13
CHUNK = 1000
TINY = float(np.finfo(float).tiny)
LONG = np.longdouble
OUTSIDE = 2.0

Faces: TypeAlias = "tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]"


@frozen(eq=False)
class Metric:
    """A model expanded about s = a, A(s) = A + z C + z² M with z = s − a, and P = sym(A) = Wᵀ W.

    Attributes
    ----------
    model : LinearModel
    a : float
    A, C, M, skew : scipy.sparse.csc_matrix
        The last is A − P.
    inverse : callable
        P⁻¹.
    root : callable
        W.
    rows : tuple of two numpy.ndarray, shape (n, n_outputs)
        W P⁻¹ of the rows of Cq and Cv.
    """

    model: LinearModel
    a: float
    A: sp.csc_matrix
    C: sp.csc_matrix
    M: sp.csc_matrix
    skew: sp.csc_matrix
    inverse: Callable[[np.ndarray], np.ndarray]
    root: Callable[[np.ndarray], np.ndarray]
    rows: tuple[np.ndarray, np.ndarray]

    @cached_property
    def exact(self) -> sp.csr_matrix:
        """A in extended precision: where it is soft, little of its entries is left."""
        model, a = self.model, self.a
        return sp.csr_matrix(model.K.astype(LONG) + a * model.C.astype(LONG) + a * a * model.M.astype(LONG))


def metric_of(model: LinearModel, a: float) -> Metric | None:
    """Expand a model about s = a.

    Parameters
    ----------
    model : LinearModel
        Scaled.
    a : float
        Right of all poles.

    Returns
    -------
    Metric or None
        None if P is not positive definite: damping or loads drive the model beyond its modes.
    """
    M, C, K = aligned(model.M, model.C, model.K)
    A = sp.csc_matrix(K + a * C + a * a * M)
    P = sp.csc_matrix(0.5 * (A + A.T))
    options = {"SymmetricMode": True}
    lu = sla.splu(P, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    order, upper = np.argsort(lu.perm_c), sp.csr_matrix(lu.U)
    pivots = upper.diagonal()
    if (lu.perm_r != lu.perm_c).any() or not (pivots > 0).all():
        return None
    W = sp.csr_matrix(sp.diags(1.0 / np.sqrt(pivots)) @ upper)

    def inverse(rhs: np.ndarray) -> np.ndarray:
        x = lu.solve(rhs)
        return np.asarray(x + lu.solve(rhs - P @ x))

    def root(x: np.ndarray) -> np.ndarray:
        return np.asarray(W @ x[order])

    rows = root(inverse(model.Cq.T.copy())), root(inverse(model.Cv.T.copy()))
    return Metric(model, a, A, sp.csc_matrix(C + 2.0 * a * M), M, sp.csc_matrix(A - P), inverse, root, rows)


@frozen(eq=False)
class Space:
    """The model within the span of V, and its residuals.

    Attributes
    ----------
    metric : Metric
    V, WV : numpy.ndarray, shape (n, k)
        P-orthonormal columns, and W of them.
    images : tuple of numpy.ndarray
        VᵀAV, VᵀCV, VᵀMV, VᵀB.
    Z : numpy.ndarray, shape (n, m + 3k)
        Orthonormal.
    faces : tuple of numpy.ndarray
        W V, and W P⁻¹ of (A − P) V, C V, M V and B, in terms of Z.
    dust : numpy.ndarray, shape (k,)
        |A V|_P⁻¹ if every entry of A is wrong by rounding: no solver leaves less.
    """

    metric: Metric
    V: np.ndarray
    WV: np.ndarray
    images: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    Z: np.ndarray
    faces: Faces
    dust: np.ndarray

    @cached_property
    def turn(self) -> np.ndarray:
        """Q, with QᵀVᵀMVQ diagonal: not turned, the first-order form would not be normal."""
        M = self.images[2]
        return np.asarray(la.eigh(0.5 * (M + M.T))[1])

    @cached_property
    def reduced(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The images, turned."""
        A, C, M, b = (self.turn.T @ image for image in self.images)
        return A @ self.turn, C @ self.turn, M @ self.turn, b

    @cached_property
    def inner(self) -> Resolvent:
        """Of the first-order form in μ = 1/z."""
        return _first_order(*self.reduced[:3])

    def values(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """H for each s, and the bound of its error.

        Parameters
        ----------
        s : numpy.ndarray of complex, shape (N,)

        Returns
        -------
        H : numpy.ndarray, shape (n_outputs, n_inputs, N)
        miss : numpy.ndarray, shape (N,)
            The bound as a multiple of what is allowed; not a number at a pole.
        """
        parts = [self._few(s[i : i + CHUNK]) for i in range(0, max(s.size, 1), CHUNK)]
        return np.concatenate([part[0] for part in parts], axis=-1), np.concatenate([part[1] for part in parts])

    def _few(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        model, z = self.metric.model, s - self.metric.a
        Cq, Cv = model.Cq @ self.V, model.Cv @ self.V
        with np.errstate(all="ignore"):
            y = _times(self.turn, _solved(self, z, _times(self.turn.T, self.images[3][:, :, None])))
            H = _times(Cq, y) + _times(Cv, y) * s + model.D[:, :, None]
            left = _residual(self, z, y)
            size = np.linalg.norm(left, axis=0)
            inside = _times(self.turn, _solved(self, z, _times(self.turn.T, _coupled(self, z, left))))
            far = self.reach[0][:, None] + np.abs(s) * self.reach[1][:, None]
            error = np.abs(_times(Cq, inside) + _times(Cv, inside) * s) + OUTSIDE * far[:, None, :] * size
            miss = (error / np.maximum(ACCURACY * np.abs(H), TINY)).max(axis=0, initial=0.0)
            dust = np.sqrt(np.einsum("k,kmn->mn", self.dust**2, np.abs(y) ** 2))
            return H, np.minimum(miss, size / dust).max(axis=0)

    @cached_property
    def reach(self) -> tuple[np.ndarray, np.ndarray]:
        """√(c P⁻¹ cᵀ) of the rows of Cq and Cv, without what lies in the span of V."""
        rows = (self.metric.model.Cq, self.metric.model.Cv)
        rest = (W - self.WV @ (c @ self.V).T for W, c in zip(self.metric.rows, rows, strict=True))
        lengths = [np.linalg.norm(x, axis=0) for x in rest]
        return lengths[0], lengths[1]


def started(metric: Metric, shapes: np.ndarray) -> Space:
    """The space of some shapes and of the static solutions.

    Parameters
    ----------
    metric : Metric
    shapes : numpy.ndarray, shape (n, k)

    Returns
    -------
    Space
    """
    n, m = metric.model.B.shape
    still = metric.inverse(metric.model.B)
    none, square = np.zeros((n, 0)), np.zeros((0, 0))
    Z, R = np.linalg.qr(metric.root(still))
    flat = np.zeros((len(R), 0))
    images, faces = (square, square, square, np.zeros((0, m))), (flat, flat, flat, flat, R)
    space = Space(metric, none, none, images, Z, faces, np.zeros(0))
    return grown(space, np.hstack([shapes, still, metric.inverse(metric.M @ still), metric.inverse(metric.C @ still)]))


def grown(space: Space, vectors: np.ndarray) -> Space:
    """The space with more vectors in it.

    Parameters
    ----------
    space : Space
    vectors : numpy.ndarray, shape (n, w)

    Returns
    -------
    Space
    """
    metric = space.metric
    new, Wnew = _fresh(space, vectors)
    V, width = np.hstack([space.V, new]), new.shape[1]
    terms = (metric.exact, metric.C, metric.M)
    moved = [np.asarray(X @ new, dtype=float) for X in terms]
    images = [
        np.block([[old, space.V.T @ move], [new.T @ np.asarray(X @ space.V, dtype=float), new.T @ move]])
        for old, X, move in zip(space.images[:3], terms, moved, strict=True)
    ]
    forces = np.hstack([metric.skew @ new, *moved[1:]])
    Z, faces = _extended(space, np.hstack([Wnew, metric.root(metric.inverse(forces))]), width)
    signs = np.random.default_rng(V.shape[1]).choice([-1.0, 1.0], new.shape)
    dust = np.linalg.norm(metric.root(metric.inverse(ROUNDING * signs * (abs(metric.A) @ np.abs(new)))), axis=0)
    force = np.vstack([space.images[3], new.T @ metric.model.B])
    return Space(
        metric,
        V,
        np.hstack([space.WV, Wnew]),
        (images[0], images[1], images[2], force),
        Z,
        faces,
        np.concatenate([space.dust, dust]),
    )


def _fresh(space: Space, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is new of some vectors, P-orthonormal, and W of it; directions under 1e-12 of their vector are left out."""
    x = vectors / _lengths(space.metric.root(vectors))
    for _ in range(3):
        x = x - space.V @ (space.WV.T @ space.metric.root(x))
        R, pivot = la.qr(space.metric.root(x), mode="r", pivoting=True, check_finite=False)
        rank = int(np.count_nonzero(np.abs(R.diagonal()) > DEPENDENT))
        x = la.solve_triangular(R[:rank, :rank], x[:, pivot[:rank]].T, trans="T").T
    return x, space.metric.root(x)


def _extended(space: Space, columns: np.ndarray, width: int) -> tuple[np.ndarray, Faces]:
    """Z with room for more columns, and the faces with these: all but that of B side by side, each `width` wide."""
    length = _lengths(columns)
    Z, R, known = columns / length, np.eye(length.size), np.zeros((space.Z.shape[1], length.size))
    for _ in range(3):
        share = space.Z.T @ Z
        Z, known = Z - space.Z @ share, known + share @ R
        Z, step, pivot = la.qr(Z, mode="economic", pivoting=True, check_finite=False)
        rank = int(np.count_nonzero(np.abs(step.diagonal()) > NOTHING))
        Z, R = Z[:, :rank], step[:rank, np.argsort(pivot)] @ R
    added = np.vstack([known, R]) * length
    old = [np.vstack([face, np.zeros((len(R), face.shape[1]))]) for face in space.faces]
    V, skew, C, M = (np.hstack([old[i], added[:, i * width : (i + 1) * width]]) for i in range(4))
    return np.hstack([space.Z, Z]), (V, skew, C, M, old[4])


def _first_order(A: np.ndarray, C: np.ndarray, M: np.ndarray) -> Resolvent:
    """μ x₁ = m x₂, μ x₂ = −A⁻¹ m x₁ − A⁻¹ C x₂ + b: then y = μ x₂. Without damping its matrix is normal."""
    k = len(A)
    m = np.sqrt(np.maximum(M.diagonal(), 0.0))
    coupled = np.linalg.solve(A, np.hstack([np.diag(m), C]))
    return resolvent(np.block([[np.zeros((k, k)), np.diag(m)], [-coupled[:, :k], -coupled[:, k:]]]))


def _solved(space: Space, z: np.ndarray, b: np.ndarray) -> np.ndarray:
    """y of shape (k, n_inputs, N) in turned coordinates, for forces b on these, with a step of refinement."""
    A, C, M, _ = space.reduced
    inverse, mu = np.linalg.inv(A), 1.0 / z
    y = np.zeros((*b.shape[:2], z.size), dtype=complex)
    for _ in range(2):
        rest = b - _times(A, y) - z * _times(C, y) - z**2 * _times(M, y)
        y = y + mu * space.inner.solve(np.concatenate([np.zeros_like(rest), _times(inverse, rest)]), mu)[len(A) :]
    return y


def _residual(space: Space, z: np.ndarray, y: np.ndarray) -> np.ndarray:
    """r in terms of Z, so that its length is |r|_P⁻¹; shape (columns of Z, n_inputs, N).

    What it seems to have along V is rounding, and large where V is soft.
    """
    V, skew, C, M, B = space.faces
    left = B[:, :, None] - _times(V + skew, y) - z * _times(C, y) - z**2 * _times(M, y)
    return np.asarray(left - _times(V, _times(V.T, left)))


def _coupled(space: Space, z: np.ndarray, left: np.ndarray) -> np.ndarray:
    """How P⁻¹ r, which is P-orthogonal to V, pushes V through the other terms of A(s); shape (k, n_inputs, N)."""
    _, skew, C, M, _ = space.faces
    return np.asarray(_times(skew.T, left) + z * _times(C.T, left) + z**2 * _times(M.T, left))


def _lengths(columns: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(columns, axis=0)
    return np.where(length > 0, length, 1.0)


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (A @ x.reshape(len(x), -1)).reshape(len(A), *x.shape[1:])
