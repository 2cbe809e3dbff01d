"""Undamped modes found: every pair or the lowest, soft ones to more digits than K has, equal ones in one basis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError
from flexctrl.linear.basis import canonical, clusters
from flexctrl.linear.columns import energies
from flexctrl.linear.condense import Scaled, scaled, static_map
from flexctrl.linear.eigen import EPS, MISFIT, RIGID_NOISE, Eigenpairs, complete_pairs, lowest_pairs
from flexctrl.linear.massless import STIFFNESS_RANK, null_split
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes, shares_of
from flexctrl.linear.parts import energies_by_part
from flexctrl.structure.freedoms import check_whole

__all__ = ["modes", "modes_of", "refuse_unsymmetric", "unseen"]

DENSE = 300
COMPLETE = 1000
DEFAULT_COUNT = 20
BLURRED = 1e-13
ROUND_OFF = 2e-13
UNSURE, UNSEEN, LOST = 1e-7, 1e-6, 0.05
STRESS_NOISE = 5.0
EXTENDED_EPS = float(np.finfo(np.longdouble).eps)


def modes(linear: LinearModel, count: int | None = None) -> Modes:
    """Undamped modes: shift-invert Lanczos for a few of many, dense for all.

    A mode counts as rigid-body when φᵀKφ is indistinguishable from the rounding of K's entries, or is both
    under 1e-8 of the first flexible ω² and within 1e6 of that rounding: a slow pendulum on a stiff structure
    stays a pendulum. Where weights or loads may make it swing, the machine itself is asked whether it does. No mode
    is missed: the number found is checked by a Sturm count.

    Parameters
    ----------
    linear : LinearModel
        K symmetric.
    count : int, optional
        How many; left out: all of them up to 1000 coordinates, the 20 lowest beyond.

    Returns
    -------
    Modes

    Raises
    ------
    LinearizationError
        If K is not symmetric (use ``damped_poles``), M not positive semidefinite, or ω² span more than doubles hold.
    MechanismError
        For a motion with neither mass nor stiffness.
    """
    base = scaled(linear)
    if linear.certificate is not None and linear.certificate.loads:
        refuse_unsymmetric(base, ROUND_OFF)
    if len(linear.coordinates) > DENSE:
        return modes_of(linear, base, count)
    _check_count(count)
    return linear._every_mode if count is None else linear._every_mode.lowest(count)


def modes_of(linear: LinearModel, base: Scaled, count: int | None) -> Modes:
    """As :func:`modes`, with the scaling and the massless freedoms already known.

    Parameters
    ----------
    linear : LinearModel
    base : Scaled
        Of the same model.
    count : int or None

    Returns
    -------
    Modes
    """
    n = len(linear.coordinates)
    _check_count(count)
    refuse_unsymmetric(base)
    K, M = base.stiffness[0], base.mass
    null = base.massless.every
    finite = n - null.shape[1]
    wanted = min(finite, count or (finite if n <= COMPLETE else DEFAULT_COUNT))
    if base.massless.relaxing.shape[1]:
        K = sp.csc_matrix(K + _grounded(base))
    dense = n <= DENSE or wanted + 30 > finite // 2
    pairs = _complete(K, M, null) if dense else lowest_pairs(K, M, wanted, base.band)
    _refuse_misfits(linear, base.scales, pairs)
    known = _recalculated(linear, base, _sharpened(K, M, pairs))
    return _described(linear, base, _settled_basis(base, known), wanted)


def _recalculated(linear: LinearModel, base: Scaled, pairs: Eigenpairs) -> Eigenpairs:
    """Soft modes whose λ is unsure by the rounding of K, by Rayleigh–Ritz with the stiffness of the machine itself."""
    if linear.place is None:
        return pairs
    told = np.array(pairs.values)
    told[pairs.rigid] = energies(base.stiffness[0], pairs.shapes[:, pairs.rigid])
    slight = unseen(linear, pairs.values)
    # beside stiff motions a slow swing counts as none: what hangs is asked whether it has one
    swings = (np.abs(told) > slight) & (linear.place.pull > 0.0)
    hidden = (RIGID_NOISE * pairs.noise > slight) | swings
    unsure = np.flatnonzero(np.where(pairs.rigid, hidden, pairs.noise > UNSURE * np.abs(told)))
    if not unsure.size:
        return pairs
    exact = linear.place.strain(base.scales[:, None] * pairs.shapes[:, unsure])
    if (np.abs(exact.diagonal() - told[unsure]) > 100.0 * pairs.noise[unsure]).any():
        return pairs  # the machine has another K by now
    values, shapes, noise, rigid = (a.copy() for a in (pairs.values, pairs.shapes, pairs.noise, pairs.rigid))
    values[unsure], turned = np.linalg.eigh(0.5 * (exact + exact.T))
    shapes[:, unsure] = shapes[:, unsure] @ turned
    spread = (turned**2).T @ noise[unsure]
    rigid[unsure] = (np.abs(values[unsure]) <= STRESS_NOISE * spread) & rigid[unsure].any()
    values[rigid], noise[unsure] = 0.0, spread * EXTENDED_EPS / EPS
    order = np.argsort(values, kind="stable")
    return Eigenpairs(values[order], shapes[:, order], rigid[order], noise[order])


def unseen(linear: LinearModel, omega_squared: np.ndarray) -> float:
    """Return the ω² that nobody misses: beside that of what hangs in the machine, or else of its first flexible mode.

    Parameters
    ----------
    linear : LinearModel
    omega_squared : numpy.ndarray, shape (k,)
        Of its modes.

    Returns
    -------
    float
    """
    first = float(omega_squared.min(initial=np.inf, where=omega_squared > 0.0))
    first, pull = first if np.isfinite(first) else 0.0, linear.place.pull if linear.place else 0.0
    return LOST * pull if pull > 0.0 else UNSEEN * first


def _complete(K: sp.csc_matrix, M: sp.csc_matrix, null: sp.csc_matrix) -> Eigenpairs:
    """All pairs, the massless freedoms eliminated first."""
    if not null.shape[1]:
        return complete_pairs(K.toarray(), M.toarray())
    T, _ = static_map(K, null)
    pairs = complete_pairs((T.T @ K @ T).toarray(), (T.T @ M @ T).toarray(), origin=(K, T))
    return replace(pairs, shapes=T @ pairs.shapes)


def _refuse_misfits(linear: LinearModel, scales: np.ndarray, pairs: Eigenpairs) -> None:
    """Raise LinearizationError for pairs that the solver has not brought to satisfy K φ = ω² M φ."""
    wrong = np.flatnonzero(pairs.misfit > MISFIT)
    if wrong.size:
        i = int(wrong[0])
        name = linear.coordinates[int(np.argmax(np.abs(scales * pairs.shapes[:, i])))]
        raise LinearizationError(
            f"modes: the motion of {name} with {pairs.values[i]:.3g} (rad/s)² misses K φ = ω² M φ by "
            f"{pairs.misfit[i]:.1e}: beside the fastest motion, {np.abs(pairs.values).max():.1e} (rad/s)², doubles do "
            "not hold it. Make the stiffest part rigid, or softer"
        )


def refuse_unsymmetric(base: Scaled, limit: float = 1e-9) -> None:
    """Raise LinearizationError if K is not symmetric to a share of its largest entry.

    Parameters
    ----------
    base : Scaled
    limit : float
    """
    skew = base.stiffness[1]
    if skew > limit:
        raise LinearizationError(
            f"K is not symmetric (relative difference {skew:.1e}; follower loads, LuGreFriction?): undamped modes do "
            "not exist as real shapes; use damped_poles()"
        )


def _check_count(count: int | None) -> None:
    if count is not None:
        check_whole(count, "count", "modes", least=1)


def _grounded(base: Scaled) -> sp.csc_matrix:
    """Unit stiffness on massless motions that only a damper holds; no mode moves them."""
    relaxing, K = base.massless.relaxing, base.model.K
    creeping = relaxing @ null_split(relaxing.T @ K @ relaxing, STIFFNESS_RANK)[0]
    return sp.csc_matrix(creeping @ creeping.T)


def _sharpened(K: sp.csc_matrix, M: sp.csc_matrix, pairs: Eigenpairs) -> Eigenpairs:
    """Soft λ, which the rounding of φᵀ K φ blurs, as Rayleigh quotients with that in extended precision.

    The error of the vectors, which have an M-length of one, is in them squared (B. N. Parlett, The Symmetric
    Eigenvalue Problem, 1998, § 4.6). In φᵀ M φ little cancels: the double sum has fourteen digits on meshes where
    that of φᵀ K φ has none.
    """
    soft = ~pairs.rigid & (pairs.noise > BLURRED * np.abs(pairs.values))
    if not soft.any():
        return pairs
    phi = pairs.shapes[:, soft]
    values = pairs.values.copy()
    values[soft] = energies(K, phi) / _energy(M, phi)
    return replace(pairs, values=values)


def _settled_basis(base: Scaled, pairs: Eigenpairs) -> Eigenpairs:
    """Equal eigenvalues made equal, their vectors turned to the canonical basis."""
    groups = clusters(pairs.values, pairs.rigid, 30.0 * pairs.noise)
    values = pairs.values.copy()
    for group in groups:
        if group.stop - group.start > 1:
            values[group] = values[group].mean()
    weight = np.sqrt(np.abs(base.model.M.diagonal()))
    shapes = canonical(pairs.shapes, weight, base.model.C, groups)
    rigid = shapes[:, pairs.rigid]
    rigid[np.abs(rigid) < 8.0 * EPS * np.abs(rigid).max(axis=0, initial=0.0)] = 0.0
    shapes[:, pairs.rigid] = rigid
    return replace(pairs, values=values, shapes=shapes)


def _described(linear: LinearModel, base: Scaled, pairs: Eigenpairs, count: int) -> Modes:
    values, rigid = pairs.values[:count], pairs.rigid[:count]
    shapes = base.scales[:, None] * pairs.shapes[:, :count]
    strain, kinetic = energies_by_part(linear.parts, shapes)
    return Modes(
        omega_squared=values,
        shapes=shapes,
        rigid=int(np.count_nonzero(rigid)),
        unstable=int(np.count_nonzero(values < 0)),
        massless=base.massless.every.shape[1],
        decay=_energy(linear.C, shapes),
        input_gain=shapes.T @ linear.B,
        output_gain=linear.Cq @ shapes,
        output_rate_gain=linear.Cv @ shapes,
        coordinates=linear.coordinates,
        inputs=linear.inputs,
        outputs=linear.outputs,
        strain_shares=dict(zip(linear.parts, shares_of(np.where(rigid, 0.0, strain), axis=0), strict=True)),
        kinetic_shares=dict(zip(linear.parts, shares_of(kinetic, axis=0), strict=True)),
        place=linear.place,
    )


def _energy(A: sp.spmatrix, shapes: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ij->j", shapes, A @ shapes)
