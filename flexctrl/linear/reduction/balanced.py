"""Balanced truncation of the stable part; integrators, unstable and undamped modes are kept as they are."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag, eig, eigvals, schur, solve_sylvester

from flexctrl.errors import ReductionError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.reduction.gramian import Balanced, balance
from flexctrl.linear.reduction.low_frequency import low_frequency, undamped, unsymmetric
from flexctrl.linear.reduction.modal import modal_model
from flexctrl.linear.reduction.states import ReducedStates, Triple
from flexctrl.linear.statespace import FirstOrder, modal_first_order
from flexctrl.linear.undamped import COMPLETE

__all__ = ["BalancedTruncation", "hankel_singular_values"]

POOL = 5
UNDAMPED = 1e-10
UNTOUCHED = 1e-10
WORST_BASIS = 1e6


@frozen
class BalancedTruncation:
    """Keep the states that are easiest to reach and to observe (B. C. Moore, IEEE TAC 26 (1981) 17–32).

    The model is written in scaled modal coordinates and split exactly: free rigid-body motion becomes
    pure integrators, unstable and undamped modes stay untouched (undamped ones that no input moves or no output
    sees are left out), and the stable rest is balanced from Gramian factors (never from squared Gramians, so that
    damping ratios of 1e-6 do no harm). The result is first order. ‖G − G_r‖∞ ≤ 2 Σ σ_i over the Hankel singular
    values left out, but for rounding: poles p of a first-order form of n states are known to about 2√n ε max|p|,
    which shows at the peak of a pole much slower than that. The ``bound`` contains both.

    Models of more than 1000 coordinates are first cut to their lowest modes with static correction; then
    there is no bound, only the measured error.

    Parameters
    ----------
    order : int
        Number of states, the exactly kept ones included; more than there are to keep are not taken.
    match_dc : bool
        Let the states left out follow statically instead of dropping them (singular perturbation
        approximation): the DC gain of the stable part is exact and the bound stays the same.
    """

    order: int
    match_dc: bool = False

    def apply(self, full: LinearModel) -> ReducedStates:
        """Reduce a model.

        Parameters
        ----------
        full : LinearModel

        Returns
        -------
        ReducedStates

        Raises
        ------
        ReductionError
            If the order does not even hold the states that cannot be balanced.
        """
        full = _of_matrices(full)
        exact, stable, feedthrough, bases, rounding = _balanced(full, 0 if _complete(full) else POOL * self.order)
        kept = len(exact.A)
        if self.order < max(kept, 1):
            raise ReductionError(
                f"order {self.order} asked for, but {kept} states (integrators, unstable and undamped modes) "
                f"cannot be balanced and are kept: ask for at least {kept}, or add damping"
            )
        room = self.order - kept
        small, direct = _truncated(stable, bases, room, self.match_dc)
        tail = 2.0 * bases.hankel[len(small.A) :].sum() if _complete(full) else np.inf
        bound = tail + rounding
        return ReducedStates(full, self, _joined(exact, small), feedthrough + direct, kept, bases.hankel, bound)


def hankel_singular_values(linear: LinearModel) -> np.ndarray:
    """Hankel singular values of the stable part, decreasing.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    numpy.ndarray
        Their units mix those of the signals: scale inputs and outputs before comparing channels.
    """
    full = linear.condense()
    return _balanced(full, 0 if _complete(full) else COMPLETE)[3].hankel


@lru_cache(maxsize=1)
def _of_matrices(full: LinearModel) -> LinearModel:
    """The model as its matrices tell, without what the machine knows beyond their digits: one for all orders tried."""
    return replace(full, place=None)


def _complete(full: LinearModel) -> bool:
    return len(full.coordinates) <= COMPLETE


@lru_cache(maxsize=1)
def _balanced(full: LinearModel, pool: int) -> tuple[Triple, Triple, np.ndarray, Balanced, np.ndarray]:
    """The model split, its stable part balanced, and its rounding: the same for every order that a search tries."""
    exact, stable, feedthrough = _split(full, pool)
    bases = balance(stable.A, stable.B, stable.C, len(stable.A))
    return exact, stable, feedthrough, bases, _rounding(full, stable)


def _rounding(full: LinearModel, stable: Triple) -> np.ndarray:
    """What 2√n ε max|p| in the place of a pole makes of its own share R/(s − p) at its peak: |R| |δp|/|Re p|²."""
    if not (len(stable.A) and _complete(full)):
        return np.zeros(full.D.shape)
    poles, shapes = eig(stable.A)
    off = 2.0 * np.finfo(float).eps * np.sqrt(len(poles)) * abs(poles).max()
    share = off * abs(np.linalg.solve(shapes, stable.B)) / (poles.real**2)[:, None]
    return np.asarray((abs(stable.C @ shapes)[:, :, None] * share).max(axis=1))


def _truncated(stable: Triple, bases: Balanced, room: int, match_dc: bool) -> tuple[Triple, np.ndarray]:
    """The leading ``room`` balanced states, and the feedthrough of the rest."""
    n = None if match_dc else room
    left, right = bases.left[:, :n], bases.right[:, :n]
    A, B, C = left.T @ stable.A @ right, left.T @ stable.B, stable.C @ right
    none = np.zeros((len(stable.C), stable.B.shape[1]))
    if len(A) <= room:
        return Triple(A, B, C), none
    fast = np.linalg.inv(A[room:, room:])
    slow = Triple(
        A[:room, :room] - A[:room, room:] @ fast @ A[room:, :room],
        B[:room] - A[:room, room:] @ fast @ B[room:],
        C[:, :room] - C[:, room:] @ fast @ A[room:, :room],
    )
    return slow, -C[:, room:] @ fast @ B[room:]


def _split(full: LinearModel, pool: int) -> tuple[Triple, Triple, np.ndarray]:
    """G = exact + stable + feedthrough, decoupled."""
    few = full.modes(max(pool, 100)) if len(full.coordinates) > COMPLETE else None
    first = modal_first_order(full, few)
    missing = np.zeros_like(first.D) if few is None else _missing_static(full, few)
    if unsymmetric(full):
        marginal, stable = _marginal_apart(Triple(first.A, first.B, first.C))
        return _touched(marginal, first), stable, first.D
    modes = full.modes() if few is None else few
    position = 2 * modes.unstable + 2 * np.arange(modes.rigid)
    loose = undamped(full, modes.shapes[:, modes.unstable : modes.unstable + modes.rigid])
    free, rest = _free_motion_apart(first, position[loose], position[~loose])
    integrators, autonomous = _integrators_apart(rest)
    marginal, stable = _marginal_apart(autonomous)
    return _joined(free, integrators, _touched(marginal, first)), stable, first.D + missing


@frozen
class _Coupled:
    """Damped rigid positions η driven by the states z: η̇ = E z, ż = A z + B u, y = H η + C z."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    E: np.ndarray
    H: np.ndarray


def _free_motion_apart(first: FirstOrder, free: np.ndarray, dragged: np.ndarray) -> tuple[Triple, _Coupled]:
    """Undamped rigid-body motion, which nothing couples to, apart from the rest."""
    A, B, C = first.A, first.B, first.C
    pairs = np.concatenate([free, free + 1])
    z = np.setdiff1d(np.arange(len(A)), np.concatenate([pairs, dragged]))
    double = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(len(free)))
    rest = _Coupled(A[np.ix_(z, z)], B[z], C[:, z], A[np.ix_(dragged, z)], C[:, dragged])
    return Triple(double, B[pairs] * (np.arange(len(pairs)) >= len(free))[:, None], C[:, pairs]), rest


def _integrators_apart(rest: _Coupled) -> tuple[Triple, Triple]:
    """Positions of damped rigid modes as pure integrators: ξ = η + w z with w = −E A⁻¹ has ξ̇ = w B u."""
    r = len(rest.E)
    if not r:
        return Triple(np.zeros((0, 0)), rest.B[:0], rest.H), Triple(rest.A, rest.B, rest.C)
    w = -np.linalg.solve(rest.A.T, rest.E.T).T
    return Triple(np.zeros((r, r)), w @ rest.B, rest.H), Triple(rest.A, rest.B, rest.C - rest.H @ w)


def _marginal_apart(system: Triple) -> tuple[Triple, Triple]:
    """Split off what does not decay, by an ordered Schur form and a Sylvester equation."""
    A, B, C = system
    poles = eigvals(A) if len(A) else np.zeros(0)
    if (poles.real < -UNDAMPED * abs(poles)).all():
        return Triple(A[:0, :0], B[:0], C[:, :0]), system
    T, Q, k = schur(A, sort=lambda re, im: re >= -UNDAMPED * np.hypot(re, im))
    X = solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:])
    B, C = Q.T @ B, C @ Q
    return (
        Triple(T[:k, :k], B[:k] - X @ B[k:], C[:, :k]),
        Triple(T[k:, k:], B[k:], C[:, k:] + C[:, :k] @ X),
    )


def _touched(marginal: Triple, first: FirstOrder) -> Triple:
    """Without the undamped modes that no input moves or no output sees, to rounding; growing ones stay."""
    A, B, C = marginal
    poles, V = eig(A) if len(A) else (np.zeros(0), np.zeros((0, 0)))
    if not len(A) or np.linalg.cond(V) > WORST_BASIS:
        return marginal
    W = np.linalg.inv(V)
    moved = (abs(W @ B) > UNTOUCHED * abs(first.B).max(axis=0)).any(axis=1)
    seen = (abs(C @ V) > UNTOUCHED * abs(first.C).max(axis=1)[:, None]).any(axis=0)
    keep = (moved & seen) | (poles.real > UNDAMPED * abs(poles))
    keep = np.array([keep[abs(poles - p.conj()) <= UNTOUCHED * abs(p)].any() for p in poles]) | keep
    if keep.all():
        return marginal
    upper = keep & (poles.imag >= 0.0)
    halves = np.hstack([V[:, upper].real, V[:, upper & (poles.imag > 0.0)].imag])
    left = np.linalg.pinv(halves) @ (V[:, keep] @ W[keep]).real
    return Triple(left @ A @ halves, left @ B, C @ halves)


def _joined(*systems: Triple) -> Triple:
    return Triple(
        block_diag(*(s.A for s in systems)),
        np.vstack([s.B for s in systems]),
        np.hstack([s.C for s in systems]),
    )


def _missing_static(full: LinearModel, modes: Modes) -> np.ndarray:
    """Static response of the modes beyond the pool."""
    zero = slice(modes.unstable, modes.unstable + modes.rigid)
    cut = modal_model(full, modes, np.arange(len(modes)))
    rigid = np.eye(len(modes))[:, zero]
    return low_frequency(full, modes.shapes[:, zero]).constant - low_frequency(cut, rigid).constant
