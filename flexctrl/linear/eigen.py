"""Eigenpairs of K φ = λ M φ that are right at the low end, with exact zeros where zero is meant.

A dense solver of the pencil (K, M) is wrong by eps·λ_max in every λ, which is all of the lowest ones
of a fine mesh; a solver of the inverted pencil (M, K − σM) is wrong by eps·λ²/(λ₁ − σ). Low pairs are taken
from the inverted one, high pairs from the direct one in the M-orthogonal rest.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from flexctrl.errors import LinearizationError
from flexctrl.frozen import frozen
from flexctrl.linear.banded import Band
from flexctrl.linear.krylov import Space
from flexctrl.linear.pencil import (
    EPS,
    HIDDEN,
    SOFT_NOISE,
    TINY,
    DensePencil,
    Matrix,
    Pencil,
    ShiftedPencil,
    faint_shift,
    stiffness_noise,
)

__all__ = ["Eigenpairs", "complete_pairs", "coordinate_scales", "lowest_pairs", "stiffness_noise"]

RIGID_NOISE = 30.0
RIGID_GAP = 1e-8
UNCLEAR = 1e5 * EPS
SHORT_SPAN, LONG_SPAN = 1e4, 1e7
WIDTH = 4
BLUR, STEP = 1e3, 1e4
MISFIT = 1e-4
GROWTH, CLEAR = 1e5, 1e-3
NEARLY = 1e-3


@frozen
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
    noise : numpy.ndarray, shape (k,)
        Spread of λ by the rounding of K's entries.
    misfit : numpy.ndarray, shape (k,) or (0,)
        Share of λ, or of about the first flexible λ if that is more, by which a pair misses K φ = λ M φ beyond what
        rounding explains; empty where a Sturm count has told that none is missed.
    """

    values: np.ndarray
    shapes: np.ndarray
    rigid: np.ndarray
    noise: np.ndarray
    misfit: np.ndarray = field(default_factory=lambda: np.zeros(0))


def coordinate_scales(M: Matrix, C: Matrix, K: Matrix) -> np.ndarray:
    """Scales s (powers of two, so that scaling rounds nothing) with diag(S (K + w²M) S) about 1.

    Parameters
    ----------
    M, C, K : arrays or sparse matrices, shape (n, n)

    Returns
    -------
    numpy.ndarray, shape (n,)
        q = s · scaled coordinate.
    """
    m, c, k = (np.abs(A.diagonal()) for A in (M, C, K))
    both = (m > 0) & (k > 0)
    ratios = np.sort(k[both] / m[both])
    w2 = float(0.5 * (ratios[(ratios.size - 1) // 2] + ratios[ratios.size // 2])) if ratios.size else 1.0
    d = k + w2 * m + np.sqrt(w2) * c
    return np.ldexp(1.0, -np.round(0.5 * np.log2(np.where(d > 0, d, 1.0))).astype(int))


def complete_pairs(
    K: np.ndarray, M: np.ndarray, origin: tuple[sp.csc_matrix, sp.csc_matrix] | None = None
) -> Eigenpairs:
    """All eigenpairs; M positive definite.

    Parameters
    ----------
    K, M : numpy.ndarray, shape (n, n), symmetric, scaled
    origin : tuple of two sparse matrices, optional
        K₀ and T where K = Tᵀ K₀ T: rounding is then judged by the entries of K₀.

    Returns
    -------
    Eigenpairs
    """
    if not K.size:
        return Eigenpairs(np.zeros(0), np.zeros((0, 0)), np.zeros(0, dtype=bool), np.zeros(0))
    pencil = DensePencil(K, M, origin)
    lam, phi = pencil.direct()
    top = float(np.abs(lam).max())
    if top > SHORT_SPAN * np.abs(lam).min():
        shifted, lowest = _scouted(pencil, lam, phi)
        middle = np.sqrt(top * max(lowest, 0.0))
        low = int(np.count_nonzero(lam <= middle))
        lam[:low], phi[:, :low] = shifted.ritz(phi[:, :low])
        if middle > LONG_SPAN * lowest:
            _mend_between(pencil, lam, phi, middle, float(np.sqrt(top / middle)))
        if EPS * top > lowest:  # direct ones are blurred past the softest, which then are in all that was found of them
            lam[:low], phi[:, :low] = shifted.ritz(_orthonormal(pencil.M, phi[:, :low]))
    else:
        shifted = pencil.below_all(-2.0 * max(top, 1.0))  # at -top there may be an eigenvalue
    pairs = _settled(pencil, _found(pencil, shifted, lam, phi))
    return replace(pairs, misfit=_misfit(shifted, pairs))


def _mend_between(pencil: DensePencil, lam: np.ndarray, phi: np.ndarray, middle: float, reach: float) -> None:
    """Find pairs about the middle of a long spectrum anew, in place: both ends are too far away to tell their λ.

    A shift of −s leaves in λ an error of about EPS (λ/s + s/λ) λ.
    """
    under = int(np.count_nonzero(lam <= middle * reach))
    found, shapes = pencil.below_all(-middle).ritz(_orthonormal(pencil.M, phi[:, :under]))
    near = found > middle / reach
    lam[:under][near], phi[:, :under][:, near] = found[near], shapes[:, near]


def _misfit(shifted: ShiftedPencil, pairs: Eigenpairs) -> np.ndarray:
    """The misfit of those that the direct pencil mixes, beyond what the rounding of K and of the shapes explains."""
    mixed = pairs.values <= _mixed(pairs.values)
    share, size = shifted.misfit(pairs.shapes[:, mixed])
    noise = pairs.noise[mixed] / size
    blurred = np.sqrt(noise * noise.max(initial=0.0)) + EPS * np.sqrt(size / size.min(initial=np.inf))
    found = np.zeros(len(mixed))
    found[mixed] = np.maximum(share - RIGID_NOISE * blurred, 0.0)
    return found


def _mixed(values: np.ndarray) -> float:
    """Motions of less than this λ the direct pencil mixes with each other."""
    return BLUR * EPS * float(np.abs(values).max())


def _scouted(pencil: DensePencil, values: np.ndarray, phi: np.ndarray) -> tuple[ShiftedPencil, float]:
    """A shift that suits the lowest pairs, given pairs near them, and its distance to the lowest.

    Beside a shift of less than EPS λ, the inverted pencil does not tell λ from infinity: what it blurs leaks into all
    others. So only vectors that the shift spans are looked at. They hold all that the direct pencil has mixed; where
    nothing but free motion is among them, the shift and their number grow.
    """
    least = TINY * max(_mixed(values), float(values[0]))
    sigma = min(faint_shift(pencil.K, pencil.M, pencil.noise(np.eye(len(pencil.K)))), -least)
    while True:
        shifted, lam, x = pencil.below_all(sigma), values, phi
        for _ in range(4):
            x = x[:, TINY * lam <= -shifted.sigma]
            lam, x = shifted.ritz(_orthonormal(pencil.M, x))
            better = _better_shift(_found(pencil, shifted, lam, x, 0), shifted.sigma)
            if better in (0.0, shifted.sigma):
                break
            shifted = pencil.below_all(better)
        if better != 0.0 or TINY * float(values[-1]) <= -sigma:
            return shifted, lam[0] - shifted.sigma
        sigma *= STEP


def lowest_pairs(K: sp.csc_matrix, M: sp.csc_matrix, count: int, band: Band | None = None) -> Eigenpairs:
    """At least `count` lowest eigenpairs by shift-invert Lanczos; none is missed (Sturm count).

    Parameters
    ----------
    K, M : sparse matrices, shape (n, n), symmetric, scaled
        M may be singular; K may be indefinite.
    count : int
    band : Band, optional
        Of their common pattern, where that is known.

    Returns
    -------
    Eigenpairs
        On to the next gap, so that repeated modes are not cut in two.

    Raises
    ------
    LinearizationError
        If the Sturm count of K − μM never agrees with the modes found.
    """
    n, pencil = K.shape[0], Pencil(K, M, band)
    wanted, shifted = min(count, n - 2), pencil.below_all(faint_shift(K, M))
    # one vector at a time is quickest, but finds equal eigenvalues, such as those of free motion, one by one
    width = 1 if shifted.firm else WIDTH
    start = _noise(n, width)
    for _ in range(20):
        near, shapes, space = shifted.lanczos(start, wanted)
        found = _found(pencil, shifted, near, shapes)
        better = _better_shift(found, shifted.sigma)
        if better == 0.0 and 2 * wanted < n - 2:
            wanted, start = 2 * wanted, np.hstack([found.phi, _noise(n, width)])
        elif better not in (0.0, shifted.sigma):
            shifted, start = pencil.below_all(better), np.hstack([found.phi, _noise(n, width)])
        else:
            missed = _missed(pencil, found, count, space)
            if missed == 0:
                return _settled(pencil, found.without_last())
            # more equal modes than the block is wide, or a start that does not hold one
            width = min(max(2 * width, missed + 1), n // 4)
            start = _noise(n, width)
    raise LinearizationError("the lowest modes could not be certified by a Sturm count; ask for another count")


@frozen
class _Found:
    """Pairs near a shift; soft ones, whose λ may be rounding alone, are polished."""

    lam: np.ndarray
    phi: np.ndarray
    noise: np.ndarray
    soft: np.ndarray

    @cached_property
    def rigid(self) -> np.ndarray:
        """Which λ are 0 as far as can be told."""
        size = np.abs(self.lam)
        flexible = size[~self.soft].min(initial=np.inf)
        gap = RIGID_GAP * flexible if np.isfinite(flexible) else 0.0
        return self.soft & (size <= np.maximum(RIGID_NOISE * self.noise, gap))

    def without_last(self) -> _Found:
        return _Found(self.lam[:-1], self.phi[:, :-1], self.noise[:-1], self.soft[:-1])


def _found(
    pencil: Pencil | DensePencil, shifted: ShiftedPencil, lam: np.ndarray, phi: np.ndarray, polish: int = 3
) -> _Found:
    noise = pencil.noise(phi)
    soft = _soft(lam, noise, shifted.sigma)
    if soft.any():
        # what is as near to 0 as the rounding of one of them is mixed with it, and its own noise does not tell
        near = soft | (np.abs(lam) <= SOFT_NOISE * noise[soft].max())
        phi[:, near], lam[near] = _polished(pencil, phi[:, near], shifted, polish)
        noise[near] = pencil.noise(phi[:, near])
        soft |= near & (np.abs(lam) <= noise[near].max())
    return _Found(lam, phi, noise, soft)


def _soft(lam: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    """Which λ may be rounding alone."""
    return np.asarray(np.abs(lam) <= np.maximum(SOFT_NOISE * noise, UNCLEAR * abs(sigma)))


def _polished(
    pencil: Pencil | DensePencil, x: np.ndarray, shifted: ShiftedPencil, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse iteration on a soft subspace, then Rayleigh–Ritz within it."""
    x = _orthonormal(pencil.M, x)
    for _ in range(steps):
        x = _orthonormal(pencil.M, shifted.iterate(x))
    ritz, y = np.linalg.eigh(x.T @ (pencil.K @ x))
    return x @ y, ritz


@lru_cache(maxsize=4)
def _noise(n: int, width: int) -> np.ndarray:
    return np.random.default_rng(width).standard_normal((n, width))


def _better_shift(found: _Found, sigma: float) -> float:
    """The shift if it suits the pairs found with it, another if not; 0 if all of them are without stiffness.

    With rigid-body modes it has to be about as large as the first flexible λ, or these lose digits beside them.
    """
    clear = ~found.rigid & (np.abs(found.lam) > UNCLEAR * abs(sigma))
    if not clear.any():
        return 0.0
    scale = float(np.abs(found.lam[clear]).min())
    small_enough = -sigma <= 10.0 * max(scale, -float(found.lam.min()))
    # twice: at -scale there may be an eigenvalue, the negative one that set the scale
    return sigma if small_enough and (clear.all() or 0.01 * scale <= -sigma) else -2.0 * scale


def _missed(pencil: Pencil, found: _Found, count: int, space: Space) -> int:
    """How many more λ lie under some gap beyond `count` than were found there; 1 if that cannot be told."""
    order = np.argsort(found.lam)
    lam, noise = found.lam[order], found.noise[order]
    for i in range(min(count, lam.size - 1), lam.size):
        gap = lam[i] - lam[i - 1] if i else 0.0
        if gap > 1e-6 * abs(lam[i]):
            growth = min(GROWTH, CLEAR * gap / noise[: i + 1].max())
            below = pencil.below(0.5 * (lam[i] + lam[i - 1]), space, growth)
            return 0 if below == HIDDEN else max(below - i, 1) if below != i else 0
    return 0


def _settled(pencil: Pencil | DensePencil, found: _Found) -> Eigenpairs:
    """Set λ of the rigid ones to 0, orthonormalise (these first) and sort."""
    first = np.argsort(~found.rigid, kind="stable")
    phi = _orthonormal(pencil.M, _arranged(found.phi, first))
    lam, rigid, noise = np.where(found.rigid, 0.0, found.lam)[first], found.rigid[first], found.noise[first]
    order = np.argsort(lam, kind="stable")
    return Eigenpairs(lam[order], _arranged(phi, order), rigid[order], noise[order])


def _arranged(phi: np.ndarray, order: np.ndarray) -> np.ndarray:
    return phi if (order[1:] > order[:-1]).all() else phi.take(order, axis=1)


def _orthonormal(M: np.ndarray | sp.csc_matrix, phi: np.ndarray) -> np.ndarray:
    """M-orthonormal columns spanning the same nested spaces (Cholesky, until nothing is left to do)."""
    for _ in range(2):
        gram = phi.T @ (M @ phi)
        gap = np.abs(gram - np.eye(len(gram))).max(initial=0.0)
        if gap > 8.0 * EPS:
            root, info = lapack.dpotrf(gram, lower=1)
            if info:
                return _one_by_one(M, phi)
            phi = lapack.dtrtrs(root, phi.T, lower=1)[0].T
        if gap < NEARLY:
            break
    return phi


def _one_by_one(M: np.ndarray | sp.csc_matrix, phi: np.ndarray) -> np.ndarray:
    """The same by Gram–Schmidt: right for columns so alike that their products do not tell them apart."""
    known = np.zeros((len(phi), 0))
    for column in phi.T:
        for _ in range(3):
            column = column - known @ (known.T @ (M @ column))
            mass = float(column @ (M @ column))
            if not mass > 0.0:
                raise LinearizationError("the mass matrix is not positive definite on the freedoms kept")
            column = column / np.sqrt(mass)
        known = np.column_stack([known, column])
    return known
