"""Eigenpairs of K φ = λ M φ that are right at the low end, with exact zeros where zero is meant.

A dense solver of the pencil (K, M) is wrong by eps·λ_max in every λ, which is all of the lowest ones
of a fine mesh; a solver of the inverted pencil (M, K − σM) is wrong by eps·λ²/|σ|. Low pairs are taken
from the inverted one, high pairs from the direct one in the M-orthogonal rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from flexctrl.errors import LinearizationError
from flexctrl.model.pencil import EPS, HIDDEN, Pencil, ShiftedPencil, stiffness_noise

__all__ = ["Eigenpairs", "complete_pairs", "coordinate_scales", "lowest_pairs", "stiffness_noise"]

RIGID_NOISE = 30.0
SOFT_NOISE = 1e6
RIGID_GAP = 1e-8
UNCLEAR = 1e5 * EPS


@dataclass(frozen=True)
class Eigenpairs:
    """Pairs in ascending order of λ; the rigid ones have λ = 0 exactly.

    Attributes
    ----------
    values : numpy.ndarray, shape (k,)
        λ = ω², (rad/s)²; negative where the equilibrium is unstable.
    shapes : numpy.ndarray, shape (n, k)
        φ, with φᵀ M φ = 1.
    rigid : numpy.ndarray of bool, shape (k,)
        Which of them are rigid-body modes.
    """

    values: np.ndarray
    shapes: np.ndarray
    rigid: np.ndarray


def coordinate_scales(M: sp.spmatrix, C: sp.spmatrix, K: sp.spmatrix) -> np.ndarray:
    """Scales s (powers of two, so that scaling rounds nothing) with diag(S (K + w²M) S) about 1.

    Parameters
    ----------
    M, C, K : sparse matrices, shape (n, n)

    Returns
    -------
    numpy.ndarray, shape (n,)
        q = s · scaled coordinate.
    """
    m, c, k = (np.abs(A.diagonal()) for A in (M, C, K))
    both = (m > 0) & (k > 0)
    w2 = float(np.median(k[both] / m[both])) if both.any() else 1.0
    d = k + w2 * m + np.sqrt(w2) * c
    return 2.0 ** -np.round(0.5 * np.log2(np.where(d > 0, d, 1.0)))


def complete_pairs(
    K: sp.csc_matrix, M: sp.csc_matrix, origin: tuple[sp.csc_matrix, sp.csc_matrix] | None = None
) -> Eigenpairs:
    """All eigenpairs, dense; M positive definite.

    Parameters
    ----------
    K, M : sparse matrices, shape (n, n), symmetric, scaled
    origin : tuple of two sparse matrices, optional
        K₀ and T where K = Tᵀ K₀ T: rounding is then judged by the entries of K₀.

    Returns
    -------
    Eigenpairs
    """
    pencil = Pencil(K, M, origin=origin)
    k, m = pencil.K.toarray(), pencil.M.toarray()
    lam, phi = _direct(k, m)
    top = np.abs(lam).max(initial=0.0)
    if top == 0.0:
        return _settled(pencil, lam, phi, 0.0)
    sigma = pencil.below_all(-pencil.soft_scale())
    for _ in range(4):
        if top <= 1e4 * -sigma:
            break
        lam, phi = _low_and_high(pencil.at(sigma), k, m, np.sqrt(top * -sigma))
        scale = _first_flexible(pencil, lam, phi, sigma)
        if scale == 0.0 or 0.01 * scale <= -sigma <= 10.0 * max(scale, -lam[0]):
            break
        # twice: at −scale there may be an eigenvalue, the negative one that set the scale
        sigma = pencil.below_all(-2.0 * scale)
    return _settled(pencil, lam, phi, sigma)


def lowest_pairs(K: sp.csc_matrix, M: sp.csc_matrix, count: int) -> Eigenpairs:
    """At least `count` lowest eigenpairs by shift-invert Lanczos; none is missed (Sturm count).

    Parameters
    ----------
    K, M : sparse matrices, shape (n, n), symmetric, scaled
        M may be singular; K may be indefinite.
    count : int

    Returns
    -------
    Eigenpairs
        A few more than asked, so that repeated modes are not cut in two.

    Raises
    ------
    LinearizationError
        If the Sturm count of K − μM never agrees with the modes found.
    """
    n, (pencil, order) = K.shape[0], Pencil(K, M).reordered()
    wanted, sigma = min(count + 8, n - 2), -pencil.soft_scale()
    for seed in range(20):
        sigma = pencil.below_all(sigma)
        lam, phi = pencil.at(sigma).lanczos(wanted, seed)
        scale = _first_flexible(pencil, lam, phi, sigma)
        if scale == 0.0 and 2 * wanted < n - 2:
            wanted *= 2
        elif scale > 0.0 and not 0.01 * scale <= -sigma <= 10.0 * max(scale, -lam[0]):
            sigma = -2.0 * scale
        elif _none_missed(pencil, lam, count):
            pairs = _settled(pencil, lam, phi, sigma)
            return Eigenpairs(pairs.values, pairs.shapes[np.argsort(order)], pairs.rigid)
    raise LinearizationError("the lowest modes could not be certified by a Sturm count; ask for another count")


def _direct(k: np.ndarray, m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    try:
        return la.eigh(k, m)
    except la.LinAlgError as error:
        raise LinearizationError("the mass matrix is not positive definite on the freedoms kept") from error


def _low_and_high(inverted: ShiftedPencil, k: np.ndarray, m: np.ndarray, split: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs under `split` from the inverted pencil, the rest from the direct one in their complement."""
    inverse = inverted.solve(np.eye(len(k)))
    theta, y = la.eigh(m @ (0.5 * (inverse + inverse.T)) @ m, m)
    low = y[:, theta > 1.0 / (split - inverted.sigma)][:, ::-1]
    lam_low, low = inverted.ritz(low)
    if low.shape[1] == len(k):
        return lam_low, low
    rest = la.qr(m @ low)[0][:, low.shape[1] :]
    lam_high, y = _direct(rest.T @ k @ rest, rest.T @ m @ rest)
    return np.concatenate([lam_low, lam_high]), np.hstack([low, rest @ y])


def _first_flexible(pencil: Pencil, lam: np.ndarray, phi: np.ndarray, sigma: float) -> float:
    """Smallest |λ| that stands clear of rounding; 0 if none does."""
    floor = np.maximum(RIGID_NOISE * pencil.noise(phi), UNCLEAR * abs(sigma))
    clear = np.abs(lam)[np.abs(lam) > floor]
    return float(clear.min()) if clear.size else 0.0


def _none_missed(pencil: Pencil, lam: np.ndarray, count: int) -> bool:
    """Whether as many λ lie under some gap beyond `count` as were found there."""
    for i in range(min(count, lam.size - 1), lam.size):
        gap = lam[i] - lam[i - 1] if i else 0.0
        if gap > 1e-6 * abs(lam[i]):
            return pencil.below(0.5 * (lam[i] + lam[i - 1])) in (i, HIDDEN)
    return True


def _settled(pencil: Pencil, lam: np.ndarray, phi: np.ndarray, sigma: float) -> Eigenpairs:
    """Orthonormalise, polish the soft vectors, set λ of the rigid ones to 0 and sort."""
    M = pencil.M
    soft = np.abs(lam) <= np.maximum(SOFT_NOISE * pencil.noise(phi), UNCLEAR * abs(sigma))
    flexible = np.abs(lam)[~soft].min() if not soft.all() else 0.0
    rigid = np.zeros(lam.size, dtype=bool)
    lam = lam.copy()
    if soft.any():
        phi, lam[soft] = _polished(pencil, phi, soft, sigma)
        noise = pencil.noise(phi)
        near = (np.abs(lam) <= RIGID_GAP * flexible) & soft
        rigid = soft & ((np.abs(lam) <= RIGID_NOISE * noise) | near)
        lam[rigid] = 0.0
    phi = _orthonormal(M, np.hstack([phi[:, rigid], phi[:, ~rigid]]))
    lam = np.concatenate([lam[rigid], lam[~rigid]])
    order = np.argsort(lam, kind="stable")
    return Eigenpairs(lam[order], phi[:, order], np.sort(rigid)[::-1][order])


def _polished(pencil: Pencil, phi: np.ndarray, soft: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Inverse iteration on the soft subspace, then Rayleigh–Ritz within it."""
    x = phi[:, soft]
    if sigma != 0.0:
        inverted = pencil.at(sigma)
        for _ in range(3):
            x = _orthonormal(pencil.M, inverted.iterate(x))
    ritz, y = la.eigh(x.T @ (pencil.K @ x))
    polished = phi.copy()
    polished[:, soft] = x @ y
    return polished, ritz


def _orthonormal(M: sp.csc_matrix, phi: np.ndarray) -> np.ndarray:
    """M-orthonormal columns spanning the same nested spaces (Cholesky, twice)."""
    for _ in range(2):
        gram = phi.T @ (M @ phi)
        phi = la.solve_triangular(la.cholesky(gram, lower=True), phi.T, lower=True).T
    return phi
