"""Freedoms without mass: which are stiff (static), which creep through a damper (relaxing), which are mechanisms.

They are null vectors of M, along coordinates or not. Numerical ranks are judged on matrices scaled to unit
diagonal, component by component of their graph, so that a light part does not pass for a massless one.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.linalg import lapack
from scipy.sparse.csgraph import connected_components

from flexctrl.errors import LinearizationError
from flexctrl.frozen import frozen
from flexctrl.linear.banded import Band, band_of

__all__ = ["Massless", "as_dense", "massless", "null_split", "pivots", "solved"]

MASS_RANK = 1e-12
STIFFNESS_RANK = 1e-13
MASS_DUST = 1e-26
DUST = 1e-14
PUSH = 1e-11
DENSE_BLOCK = 300
SMALL_PIVOT = 1e-8


@frozen
class Massless:
    """Bases (columns, in scaled coordinates) of the three kinds of massless freedom.

    Attributes
    ----------
    static : scipy.sparse.csc_matrix, shape (n, r)
        Neither mass nor damping, but stiffness.
    relaxing : scipy.sparse.csc_matrix, shape (n, d)
        Damping but no mass (K-orthogonal to the static ones): first-order states.
    mechanisms : scipy.sparse.csc_matrix, shape (n, k)
        Neither mass, damping nor stiffness.
    falling : scipy.sparse.csc_matrix, shape (n, f)
        Static ones of negative stiffness, as of a buckled column: the less mass, the faster they run away.
    pushed : scipy.sparse.csc_matrix, shape (n, p)
        Static ones that velocities of others push (gyroscopic).
    whirling : scipy.sparse.csc_matrix, shape (n, w)
        Those that push each other by their velocities: as mass vanishes they turn ever faster about each other.
    """

    static: sp.csc_matrix
    relaxing: sp.csc_matrix
    mechanisms: sp.csc_matrix
    falling: sp.csc_matrix
    pushed: sp.csc_matrix
    whirling: sp.csc_matrix

    @property
    def every(self) -> sp.csc_matrix:
        """Static and relaxing together, shape (n, r + d)."""
        if not self.relaxing.shape[1]:
            return self.static
        return sp.csc_matrix(sp.hstack([self.static, self.relaxing]))


def massless(M: sp.csc_matrix, C: sp.csc_matrix, K: sp.csc_matrix, band: Band | None = None) -> Massless:
    """Sort the null space of M.

    Parameters
    ----------
    M, C, K : sparse matrices, shape (n, n)
        Scaled to about unit diagonal.
    band : Band, optional
        Of the pattern of M, where that is known.

    Returns
    -------
    Massless

    Raises
    ------
    LinearizationError
        If M is not positive semidefinite.
    """
    if _heavy(M, band):
        none = sp.csc_matrix((M.shape[0], 0))
        return Massless(*(none,) * 6)
    null, _ = null_split(_without_dust(M), MASS_RANK, semidefinite=True)
    if not null.shape[1]:
        return Massless(*(null,) * 6)
    own = _restricted(C, null)
    undamped, damped = null_split(0.5 * (own + own.T), MASS_RANK, size=_size(C, null).diagonal())
    static, relaxing = null @ undamped, null @ damped
    pushed = static[:, _largest(C @ static, C.T @ static) > PUSH * _peak(C)]
    among = undamped.T @ (own - own.T) @ undamped
    whirling = static[:, _largest(among) > PUSH * _peak(C)]
    held = _restricted(K, static)
    free, _ = null_split(held, STIFFNESS_RANK, size=_size(K, static).diagonal())
    if relaxing.shape[1] and static.shape[1] and not free.shape[1]:
        relaxing = relaxing - static @ solved(static.T @ K @ static, static.T @ K @ relaxing)
    down = sp.csc_matrix((held.shape[0], 0)) if free.shape[1] else _downhill(held)
    bases = (static, relaxing, static @ free, static @ down, pushed, whirling)
    return Massless(*(sp.csc_matrix(basis) for basis in bases))


def null_split(
    A: sp.spmatrix, tolerance: float, semidefinite: bool = False, size: np.ndarray | None = None
) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    """Bases of the null space of a symmetric matrix and of a complement.

    Parameters
    ----------
    A : sparse matrix, shape (n, n)
    tolerance : float
        Eigenvalues of the matrix scaled to unit diagonal under this are zero.
    semidefinite : bool
        Refuse a negative eigenvalue.
    size : numpy.ndarray, shape (n,), optional
        What the diagonal was rounded from, where that is larger: then it is scaled by that.

    Returns
    -------
    null, rest : sparse matrices, shapes (n, r) and (n, n - r)
        Unit vectors wherever the null space lies along coordinates.
    """
    A = sp.csc_matrix(A)
    n = A.shape[0]
    largest = np.sqrt(abs(A).max(axis=1).toarray().ravel()) if n else np.zeros(0)
    diagonal = np.sqrt(np.abs(A.diagonal()) if size is None else np.maximum(np.abs(A.diagonal()), size))
    scale = np.where(diagonal > 0, diagonal, largest)
    empty = np.flatnonzero(largest == 0.0)
    full = np.flatnonzero(largest > 0.0)
    unit = sp.identity(n, format="csc")
    if not full.size:
        return unit[:, empty], unit[:, full]
    invert = sp.diags(1.0 / scale[full])
    block = sp.csc_matrix(invert @ A[full][:, full] @ invert)
    if _definite(block, np.ones(full.size)):
        return unit[:, empty], unit[:, full]
    null, rest = _split_components(block, tolerance, semidefinite)
    back = unit[:, full] @ invert
    return sp.csc_matrix(sp.hstack([unit[:, empty], back @ null])), sp.csc_matrix(back @ rest)


def pivots(basis: sp.csc_matrix) -> np.ndarray:
    """One coordinate for each column: its own where it lies along one, else by pivoted QR.

    Parameters
    ----------
    basis : sparse matrix, shape (n, r)

    Returns
    -------
    numpy.ndarray of int, shape (r,)
    """
    basis = sp.csc_matrix(basis)
    basis.eliminate_zeros()
    single = np.diff(basis.indptr) == 1
    chosen = np.zeros(basis.shape[1], dtype=int)
    chosen[single] = basis[:, single].indices
    free = np.ones(basis.shape[0])
    free[chosen[single]] = 0.0
    others = sp.csc_matrix(sp.diags(free) @ basis[:, ~single])
    columns = np.flatnonzero(~single)
    for group in _groups(others.T @ others):
        block = sp.csc_matrix(others[:, group])
        rows = np.unique(block.indices)
        leading = la.qr(block[rows].toarray().T, mode="r", pivoting=True)[1][: group.size]
        chosen[columns[group]] = rows[leading]
    return chosen


def solved(A: sp.spmatrix, rhs: sp.spmatrix | np.ndarray) -> sp.csc_matrix:
    """A⁻¹ rhs for a well-conditioned sparse A."""
    return sp.csc_matrix(sla.splu(sp.csc_matrix(A)).solve(as_dense(rhs)))


def as_dense(A: sp.spmatrix | np.ndarray) -> np.ndarray:
    """A as an ndarray."""
    return A.toarray() if isinstance(A, sp.spmatrix | sp.sparray) else np.asarray(A)


def _without_dust(M: sp.csc_matrix) -> sp.csc_matrix:
    """Drop rows whose mass is only the rounding error of a rotation (cos 90° squared)."""
    diagonal = np.abs(M.diagonal())
    dust = diagonal < MASS_DUST * diagonal.max(initial=0.0)
    keep = sp.diags((~dust).astype(float))
    return sp.csc_matrix(keep @ M @ keep)


def _heavy(M: sp.csc_matrix, band: Band | None) -> bool:
    """Whether M is plainly positive definite."""
    diagonal = M.diagonal()
    if not diagonal.size or diagonal.min() <= MASS_DUST * diagonal.max():
        return False
    return _definite(M, diagonal, band)


def _restricted(A: sp.csc_matrix, N: sp.csc_matrix) -> sp.csc_matrix:
    """Nᵀ A N without the entries that are only rounding."""
    full = sp.csc_matrix(N.T @ A @ N)
    return sp.csc_matrix(full.multiply(abs(full) > DUST * _size(A, N)))


def _size(A: sp.csc_matrix, N: sp.csc_matrix) -> sp.csc_matrix:
    """The terms of Nᵀ A N without their signs."""
    return sp.csc_matrix(abs(N).T @ abs(A) @ abs(N))


def _largest(*matrices: sp.spmatrix) -> np.ndarray:
    """The largest entry of each column."""
    if not min(matrices[0].shape):
        return np.zeros(matrices[0].shape[1])
    return np.max([abs(A).max(axis=0).toarray().ravel() for A in matrices], axis=0)


def _peak(A: sp.spmatrix) -> float:
    return float(abs(A).max()) if A.shape[0] and A.shape[1] and A.nnz else 0.0


def _definite(block: sp.csc_matrix, size: np.ndarray, band: Band | None = None) -> bool:
    """Whether all pivots stand clear of zero beside the sizes of their rows."""
    least = SMALL_PIVOT * size
    if block.shape[0] <= DENSE_BLOCK:
        root, info = lapack.dpotrf(block.toarray(), lower=1)
        return bool(info == 0 and (np.square(root.diagonal()) > least).all())
    band = band or band_of(block)
    if band is not None:
        factor = band.factorise(block.data)
        return factor is not None and bool((factor.pivots > least[factor.order]).all())
    try:
        lu = _symmetric_lu(block)
    except RuntimeError:
        return False
    return bool((lu.perm_r == lu.perm_c).all() and (lu.U.diagonal() > least[np.argsort(lu.perm_c)]).all())


def _groups(A: sp.spmatrix) -> list[np.ndarray]:
    """Connected components of a symmetric pattern, as index arrays."""
    count, label = connected_components(A, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.searchsorted(label[order], np.arange(1, count))) if count else []


def _split_components(
    block: sp.csc_matrix, tolerance: float, semidefinite: bool
) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    nulls, rests = [], []
    for rows in _groups(block):
        null, rest = _split_block(block[rows][:, rows], tolerance, semidefinite)
        embed = sp.identity(block.shape[0], format="csc")[:, rows]
        nulls.append(embed @ null)
        rests.append(embed @ rest)
    return sp.csc_matrix(sp.hstack(nulls)), sp.csc_matrix(sp.hstack(rests))


def _split_block(block: sp.csc_matrix, tolerance: float, semidefinite: bool) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    if block.shape[0] <= DENSE_BLOCK:
        return _split_dense(block, tolerance, semidefinite)
    null, rest = _split_sparse(block)
    if _peak(block @ null) > 100.0 * tolerance:
        return _split_dense(block, tolerance, semidefinite)
    return null, rest


def _split_dense(block: sp.csc_matrix, tolerance: float, semidefinite: bool) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    values, vectors = la.eigh(block.toarray())
    limit = tolerance * max(np.abs(values).max(), 1.0)
    if semidefinite and values.min() < -1e-9 * np.abs(values).max():
        raise LinearizationError(
            f"the mass matrix is not positive semidefinite (scaled eigenvalue {values.min():.2e}); "
            "check for a negative mass or inertia"
        )
    null = np.abs(values) <= limit
    return sp.csc_matrix(vectors[:, null]), sp.csc_matrix(vectors[:, ~null])


def _split_sparse(block: sp.csc_matrix) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    """Coordinates with a vanishing pivot depend on the others: N = [-A_II⁻¹ A_IJ; 1], as sparse as A is local."""
    n = block.shape[0]
    unit = sp.identity(n, format="csc")
    lu = _symmetric_lu(sp.csc_matrix(block + 1e-13 * unit))
    pivot = np.zeros(n)
    pivot[np.argsort(lu.perm_c)] = lu.U.diagonal()
    dependent = np.flatnonzero(np.abs(pivot) < SMALL_PIVOT)
    free = np.setdiff1d(np.arange(n), dependent)
    weights = _symmetric_lu(block[free][:, free]).solve(block[free][:, dependent].toarray())
    weights[np.abs(weights) < 1e-13] = 0.0
    return sp.csc_matrix(unit[:, dependent] - unit[:, free] @ sp.csc_matrix(weights)), unit[:, free]


def _downhill(K: sp.csc_matrix) -> sp.csc_matrix:
    """Directions of negative stiffness: eigenvectors whose eigenvalues are real and negative."""
    n = K.shape[0]
    even = sp.csc_matrix(0.5 * (K + K.T))
    if not n or _definite(even, even.diagonal()) or (n > DENSE_BLOCK and (_symmetric_lu(even).U.diagonal() > 0).all()):
        return sp.csc_matrix((n, 0))
    unit = sp.identity(n, format="csc")
    return sp.csc_matrix(sp.hstack([unit[:, rows] @ _downhill_block(K[rows][:, rows]) for rows in _groups(K)]))


def _downhill_block(K: sp.csc_matrix) -> sp.csc_matrix:
    if K.shape[0] > DENSE_BLOCK:
        values, vectors = sla.eigsh(0.5 * (K + K.T), k=1, which="SA")
    elif _peak(K - K.T) > MASS_RANK * _peak(K):
        values, vectors = la.eig(K.toarray())
        real = np.abs(values.imag) <= MASS_RANK * np.abs(values)
        values, vectors = values[real].real, vectors[:, real].real
    else:
        values, vectors = la.eigh(K.toarray())
    return sp.csc_matrix(vectors[:, values < -STIFFNESS_RANK * _peak(K)])


def _symmetric_lu(A: sp.csc_matrix) -> sla.SuperLU:
    options = {"SymmetricMode": True}
    return sla.splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, panel_size=1, options=options)
