"""Audit of freedoms, and exact condensation of the massless ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from flexctrl.errors import LinearizationError, MechanismError
from flexctrl.frozen import frozen
from flexctrl.linear.banded import Band, band_of
from flexctrl.linear.eigen import coordinate_scales
from flexctrl.linear.massless import DENSE_BLOCK, Massless, as_dense, massless, pivots, solved
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pattern import aligned, asymmetry, congruent, mirror, symmetric
from flexctrl.linear.proportional import Proportional, proportional
from flexctrl.linear.words import motions_in_words

__all__ = ["Audit", "Freedom", "Scaled", "audit", "condense", "scaled", "scaled_any", "static_map", "static_response"]


class Freedom(Enum):
    """What a coordinate is, dynamically."""

    DYNAMIC = "dynamic"
    STATIC = "massless but stiff"
    RELAXING = "massless but damped"
    FALLING = "massless on negative stiffness"
    MECHANISM = "mechanism"


@frozen
class Audit:
    """Label of every coordinate.

    Where a massless direction does not lie along one coordinate, the coordinate that carries most of it
    bears the label.

    Attributes
    ----------
    coordinates : tuple of str
    labels : tuple of Freedom
    mechanisms : tuple of tuple of str
        For each motion without mass and stiffness, the coordinates that move, most first.
    motions : tuple of str
        The same in words: which nodes turn about or move along which axis.
    """

    coordinates: tuple[str, ...]
    labels: tuple[Freedom, ...]
    mechanisms: tuple[tuple[str, ...], ...]
    motions: tuple[str, ...] = ()

    def named(self, kind: Freedom) -> tuple[str, ...]:
        """Names of the coordinates with this label.

        Parameters
        ----------
        kind : Freedom

        Returns
        -------
        tuple of str
        """
        return tuple(name for name, label in zip(self.coordinates, self.labels, strict=True) if label is kind)

    def __str__(self) -> str:
        lines = [f"{len(self.coordinates)} freedoms"]
        for kind in Freedom:
            names = self.named(kind)
            shown = "" if kind is Freedom.DYNAMIC else ": " + ", ".join(names)
            if names:
                lines.append(f"  {len(names)} {kind.value}{shown}")
        lines += [f"  nothing holds or weighs: {motion}" for motion in self.motions]
        return "\n".join(lines)


@frozen
class Scaled:
    """A linear model in coordinates scaled by powers of two, with its massless freedoms.

    Attributes
    ----------
    model : LinearModel
        In scaled coordinates z; q = scales · z. It knows neither parts nor place.
    scales : numpy.ndarray, shape (n,)
    massless : Massless
    band : Band or None
        Of the common pattern of M and K, in a larger model where it is narrow.
    """

    model: LinearModel
    scales: np.ndarray
    massless: Massless
    band: Band | None

    @cached_property
    def stiffness(self) -> tuple[sp.csc_matrix, float]:
        """The symmetric part of K, and the largest entry of K − Kᵀ relative to the stiffnesses it stands between."""
        even, gap = symmetric(self.model.K, self._across)
        return even, asymmetry(self.model.K, even) if gap else 0.0

    @cached_property
    def mass(self) -> sp.csc_matrix:
        """The symmetric part of M."""
        return symmetric(self.model.M, self._across)[0]

    @cached_property
    def matched(self) -> tuple[sp.csc_matrix, ...]:
        """M, C and K on one pattern."""
        return aligned(self.model.M, self.model.C, self.model.K)

    @cached_property
    def proportional(self) -> Proportional:
        """What of C is proportional to M and K."""
        return proportional(*self.matched)

    @cached_property
    def _across(self) -> np.ndarray | None:
        return mirror(self.model.K)  # M has the same pattern


def audit(linear: LinearModel) -> Audit:
    """Label every coordinate dynamic, static, relaxing, falling or mechanism.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    Audit
        Never raises for a mechanism; :func:`condense` does.
    """
    base, names = linear._scaled, linear.coordinates
    kinds = base.massless
    labels = [Freedom.DYNAMIC] * len(linear.coordinates)
    for basis, kind in (
        (kinds.static, Freedom.STATIC),
        (kinds.relaxing, Freedom.RELAXING),
        (kinds.falling, Freedom.FALLING),
        (kinds.mechanisms, Freedom.MECHANISM),
    ):
        for i in pivots(basis):
            labels[i] = kind
    loose = _moving(kinds.mechanisms, names)
    return Audit(names, tuple(labels), loose, motions_in_words(kinds.mechanisms, names, base.scales))


def scaled(linear: LinearModel) -> Scaled:
    """Scale the coordinates and sort the massless freedoms.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    Scaled

    Raises
    ------
    MechanismError
        For a motion with neither mass nor stiffness (nor damping), by coordinate names.
    LinearizationError
        For a motion without mass on negative stiffness: as its mass vanishes it runs away ever faster; and for those
        that push each other by their velocities.
    """
    result = linear._scaled
    loose, falling, whirling = result.massless.mechanisms, result.massless.falling, result.massless.whirling
    if loose.shape[1]:
        raise MechanismError(
            f"{loose.shape[1]} motion(s) with neither mass nor stiffness: {_told(loose, linear, result.scales)}. "
            "Hold the freedom, or give it stiffness or inertia."
        )
    if falling.shape[1]:
        raise LinearizationError(
            f"{falling.shape[1]} motion(s) without mass on negative stiffness (buckled, or upside down): "
            f"{_told(falling, linear, result.scales)}. As mass vanishes they run away ever faster, so there is no "
            "model without it: give them mass, take load off, or linearise about a stable equilibrium."
        )
    if whirling.shape[1]:
        raise LinearizationError(
            f"{whirling.shape[1]} motion(s) without mass that push each other by their velocities (gyroscopic): "
            f"{_told(whirling, linear, result.scales)}. As mass vanishes they turn about each other ever faster, so "
            "there is no model without it: give them inertia (rhoJ of a section) or damping."
        )
    return result


def condense(linear: LinearModel) -> LinearModel:
    """Eliminate massless, undamped freedoms exactly (the limit of vanishing mass).

    With N the null space common to M and to the damping of N itself, the equations Nᵀ(C q̇ + K q − B u) = 0 are
    algebraic in N's own coordinates; solved, q = T b + N (Nᵀ K N)⁻¹ Nᵀ (B u − C T ḃ), where b are the coordinates kept
    (their names stay) and Nᵀ K T = 0. Without gyroscopic coupling static condensation (Guyan 1965) is exact. Velocities
    that push a freedom of N (`RotatingFrame`) make it follow them, and so add the mass −Tᵀ C N (Nᵀ K N)⁻¹ Nᵀ C T.
    Inputs acting on eliminated freedoms become feedthrough D. Massless but damped freedoms stay: M remains singular
    there.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    LinearModel
        The same model if nothing is to be eliminated.

    Raises
    ------
    MechanismError
        For a motion with neither mass nor stiffness, by coordinate names.
    LinearizationError
        If an output measures the velocity of an eliminated freedom that an input moves directly, or such a freedom
        pushes others by its velocity: the response would contain the derivative of the input.
    """
    base = scaled(linear)
    static, model = base.massless.static, base.model
    if not static.shape[1]:
        return linear
    right, kept = static_map(model.K, static)
    left, _ = static_map(model.K.T, static)
    direct = static_response(base)
    refuse_improper(model, direct)
    inner = sp.diags(1.0 / base.scales[kept])
    outer = sp.diags(base.scales)
    names = [linear.coordinates[i] for i in kept]
    reduced = linear.projected(outer @ right @ inner, names, left=outer @ left @ inner)
    reduced = replace(reduced, D=linear.D + model.Cq @ direct)
    if not base.massless.pushed.shape[1]:
        return reduced
    _refuse_derivatives(linear, base, left.T @ model.C @ direct)
    follow = static @ solved(static.T @ model.K @ static, static.T @ model.C @ right)
    return _with_followers(reduced, base, follow @ inner, inner @ left.T @ model.C @ follow @ inner)


def _with_followers(reduced: LinearModel, base: Scaled, follow: sp.spmatrix, share: sp.spmatrix) -> LinearModel:
    """The model with freedoms that follow the velocities of others, q = T b − F ḃ: a mass, and what outputs see."""
    gap = _largest(share - share.T)
    if gap > 1e-9 * _largest(share):
        raise LinearizationError(
            "massless freedoms are pushed by velocities of others that they do not push back (a force that is neither "
            "gyroscopic nor a damper's): give them inertia or damping"
        )
    M = sp.csc_matrix(reduced.M - 0.5 * (share + share.T))
    slid, flung = base.model.Cq @ follow, base.model.Cv @ follow
    reduced = replace(reduced, M=M, Cv=reduced.Cv - slid)
    if not np.abs(flung).max(initial=0.0):
        return reduced
    try:
        gain = sla.splu(sp.csc_matrix(M.T)).solve(np.asarray(flung.T)).T
    except RuntimeError as error:
        raise LinearizationError(
            "an output is the velocity of a massless freedom that velocities of others push, and some of these have "
            "damping but no mass: give them inertia, or measure a position"
        ) from error
    return replace(
        reduced, Cq=reduced.Cq + gain @ reduced.K, Cv=reduced.Cv + gain @ reduced.C, D=reduced.D - gain @ reduced.B
    )


def _refuse_derivatives(linear: LinearModel, base: Scaled, felt: sp.spmatrix) -> None:
    """Refuse inputs whose derivative acts on other freedoms, through massless ones that push them by their velocity."""
    pushed, model = base.massless.pushed, base.model
    size = np.abs(as_dense(felt)).max(axis=0, initial=0.0)
    bad = np.flatnonzero(size > 1e-11 * _largest(model.C))
    if bad.size:
        acted = pushed[:, np.abs(pushed.T @ model.B[:, bad[0]]) > 0.0]
        raise LinearizationError(
            f"input {linear.inputs[bad[0]]!r} acts on a motion without mass that pushes others by its velocity "
            f"(gyroscopic): {_told(acted, linear, base.scales)}. They would feel the derivative of the input: give it "
            "inertia (rhoJ of a section), or let the input act elsewhere"
        )


def _largest(A: sp.spmatrix) -> float:
    return float(np.abs(A.data).max(initial=0.0)) if sp.issparse(A) else float(np.abs(A).max(initial=0.0))


def static_response(base: Scaled) -> np.ndarray:
    """Displacement of the condensed freedoms per input.

    Parameters
    ----------
    base : Scaled

    Returns
    -------
    numpy.ndarray, shape (n, n_inputs)
        Scaled; exactly zero for an input that acts on none of them.
    """
    static, model = base.massless.static, base.model
    if not static.shape[1]:
        return np.zeros_like(model.B)
    acting = static.T @ model.B
    acting = np.where(np.abs(acting) > 1e-13 * (abs(static).T @ np.abs(model.B)), acting, 0.0)
    return np.asarray((static @ solved(static.T @ model.K @ static, acting)).toarray())


def static_map(K: sp.spmatrix, null: sp.csc_matrix) -> tuple[sp.csc_matrix, np.ndarray]:
    """T with Nᵀ K T = 0 and the identity on the coordinates kept.

    Parameters
    ----------
    K : sparse matrix, shape (n, n)
    null : sparse matrix, shape (n, r)
        Columns N.

    Returns
    -------
    T : sparse matrix, shape (n, n - r)
    kept : numpy.ndarray of int, shape (n - r,)
    """
    n = K.shape[0]
    gone = pivots(null)
    kept = np.setdiff1d(np.arange(n), gone)
    rows = sp.csc_matrix(null.T @ K)
    unit = sp.identity(n, format="csc")
    return sp.csc_matrix(unit[:, kept] - unit[:, gone] @ solved(rows[:, gone], rows[:, kept])), kept


def refuse_improper(model: LinearModel, direct: sp.spmatrix | np.ndarray) -> None:
    """Raise if a velocity output sees a freedom that follows an input without delay.

    Parameters
    ----------
    model : LinearModel
    direct : array or sparse matrix, shape (n, n_inputs)
        Immediate displacement of each coordinate per input.

    Raises
    ------
    LinearizationError
    """
    dense = as_dense(direct)
    jump = np.abs(model.Cv @ dense)
    size = max(float((np.abs(model.Cv) @ np.abs(dense)).max(initial=0.0)), _largest(model.Cv) * _largest(model.B))
    bad = np.argwhere(jump > 1e-12 * size)
    if bad.size:
        y, u = bad[0]
        raise LinearizationError(
            f"output {model.outputs[y]!r} is the velocity of a massless freedom that input "
            f"{model.inputs[u]!r} moves at once: give that freedom inertia or damping, or measure its position"
        )


def scaled_any(linear: LinearModel) -> Scaled:
    """As :func:`scaled`, mechanisms included.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    Scaled
    """
    s = coordinate_scales(linear.M, linear.C, linear.K)
    (M, K), (C,) = congruent(s, linear.M, linear.K), congruent(s, linear.C)
    band = band_of(K) if len(s) > DENSE_BLOCK else None
    return Scaled(linear._rescaled(s, M, C, K), s, massless(M, C, K, band), band)


def _told(basis: sp.csc_matrix, linear: LinearModel, scales: np.ndarray) -> str:
    """The coordinates that move in some motions, and the same in words."""
    names, words = _moving(basis, linear.coordinates), motions_in_words(basis, linear.coordinates, scales)
    return "; ".join(f"{' with '.join(moving)} ({said})" for moving, said in zip(names, words, strict=True))


def _moving(basis: sp.csc_matrix, names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    motions: list[tuple[str, ...]] = []
    for column in np.abs(basis.toarray()).T if basis.shape[1] else ():
        order = np.argsort(-column, kind="stable")[:6]
        motions.append(tuple(names[i] for i in order if column[i] > 0.1 * column.max()))
    return tuple(motions)
