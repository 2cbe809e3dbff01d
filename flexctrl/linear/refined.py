"""Responses finished by a step of refinement with residuals of extended precision."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.modal import ModalSystem
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.pattern import with_entries
from flexctrl.linear.resolvent import cached_resolvent
from flexctrl.linear.statespace import first_order

__all__ = ["State", "modal_state", "refined_transfer", "refinement"]

CHUNK = 256
LONG = np.longdouble
FINER = 0.01
SETTLED, LOST = 1e-8, 1e-6
ENOUGH, PROBES = 3e-10, 12
APART = 1e-6

Response: TypeAlias = Callable[[np.ndarray], np.ndarray]
State: TypeAlias = Callable[[np.ndarray], Callable[[np.ndarray], np.ndarray]]
"""s, shape (N,) ↦ (loads ↦ displacements, both of shape (n, m, N))."""


def refinement(
    linear: LinearModel, system: ModalSystem, state: State, plain: Callable[[], Response]
) -> Response | None:
    """H(s) by modal coordinates, then a step or two of iterative refinement against K + s C + s² M itself.

    The modes of a machine with soft and stiff directions carry the rounding of the stiff ones, and so does every
    response made of them, most in channels that are nearly silent. The residual B − (K + s C + s² M) q, in extended
    precision, tells what is missing; the modal equations give the correction (N. J. Higham, Accuracy and Stability of
    Numerical Algorithms, 2002, ch. 12).

    Parameters
    ----------
    linear : LinearModel
        Without massless freedoms.
    system : ModalSystem
        Of the same model.
    state : State
        By the modal equations.
    plain : callable
        Makes an evaluator for where that leads nowhere.

    Returns
    -------
    callable or None
        s of shape (N,), none of them 0, to H of shape (n_outputs, n_inputs, N); None where a machine has no extended
        precision.
    """
    if np.finfo(LONG).eps > FINER * np.finfo(float).eps:
        return None
    residual = _residual(linear, system.modes)
    loads, moves = np.asarray(linear.B, complex)[:, :, None], np.any(linear.Cv)

    def seen(q: np.ndarray, s: np.ndarray) -> np.ndarray:
        return _times(linear.Cq, q) + s * _times(linear.Cv, q) if moves else _times(linear.Cq, q)

    def moving(s: np.ndarray) -> np.ndarray:
        solve = state(s)
        q = solve(np.broadcast_to(loads, (*loads.shape[:2], s.size)))
        step = solve(residual(q, s))
        y, more = seen(q, s), seen(step, s)
        far = (np.abs(more) > SETTLED * np.abs(y)).any(axis=(0, 1))
        y += more
        if far.any():
            q = q[..., far] + step[..., far]
            last = seen(state(s[far])(residual(q, s[far])), s[far])
            y[..., far] += last
            lost = np.flatnonzero(far)[~(np.abs(last) <= LOST * np.abs(y[..., far])).all(axis=(0, 1))]
            if lost.size:
                y[..., lost] = plain()(s[lost]) - linear.D[:, :, None]
        return y + linear.D[:, :, None]

    return lambda s: np.concatenate([moving(s[i : i + CHUNK]) for i in range(0, s.size, CHUNK)], axis=-1)


def refined_transfer(system: ModalSystem, rough: Response, fine: Response) -> Response:
    """The rough evaluator if it needs no refinement: right to 3e-10 at a dozen frequencies spread over the modes.

    Parameters
    ----------
    system : ModalSystem
    rough, fine : callable
        H(s) by modal coordinates, and what `refinement` makes of it.

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N).
    """
    probes = 1j * _probes(system)
    exact = fine(probes)
    if (np.abs(rough(probes) - exact) <= ENOUGH * np.abs(exact)).all():
        return rough

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        values, places = rough(s), np.flatnonzero(s != 0.0)
        if places.size:
            values[..., places] = fine(s[places])
        return values

    return evaluate


def _probes(system: ModalSystem) -> np.ndarray:
    """Frequencies between those of some modes, and beyond them on both sides [rad/s]."""
    omega = system.modes.omega[system.modes.omega > 0.0]
    if not omega.size:
        return np.ones(1)
    omega = omega[np.append(True, np.diff(omega) > APART * omega[1:])]
    some = omega[[*range(0, omega.size - 1, max(1, omega.size // (PROBES - 1))), -1]]
    return np.concatenate([[0.1 * some[0]], np.sqrt(some[:-1] * some[1:]), [2.0 * some[-1]]])


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A on the first axis of x."""
    return np.asarray((A @ x.reshape(len(x), -1)).reshape(len(A), *x.shape[1:]))


def _residual(linear: LinearModel, modes: Modes) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(q, s) ↦ B − (Pᵀ K P + s C + s² M) q, shapes (n, m, N) and (N,); P takes out the rigid-body modes.

    K resists these by its rounding, which at low frequencies is more than their inertia.
    """
    K, C, M = (_long(A) for A in (linear.K, linear.C, linear.M))
    B = linear.B[:, :, None]
    rigid = modes.shapes[:, modes.unstable : modes.unstable + modes.rigid].astype(LONG)
    momenta = M @ rigid

    def elastic(x: np.ndarray) -> np.ndarray:
        if not rigid.shape[1]:
            return np.asarray(K @ x)
        force = K @ (x - rigid @ (momenta.T @ x))
        return np.asarray(force - momenta @ (rigid.T @ force))

    def residual(q: np.ndarray, s: np.ndarray) -> np.ndarray:
        n, both = len(q), (2, *q.shape[1:])
        parts = np.stack([q.real, q.imag], axis=1, dtype=LONG).reshape(n, -1)
        stiff, drag, inert = (a.reshape(n, *both) for a in (elastic(parts), C @ parts, M @ parts))
        u, w = s.real.astype(LONG), s.imag.astype(LONG)
        # (u + iw)(drag + (u + iw) inert), real and imaginary parts apart
        a, b = drag[:, 0] + u * inert[:, 0] - w * inert[:, 1], drag[:, 1] + u * inert[:, 1] + w * inert[:, 0]
        result = np.empty(q.shape, complex)
        result.real, result.imag = B - stiff[:, 0] - (u * a - w * b), -(stiff[:, 1] + (u * b + w * a))
        return result

    return residual


def _long(A: sp.spmatrix) -> sp.csc_matrix:
    A = A if isinstance(A, sp.csc_matrix) else sp.csc_matrix(A)
    return with_entries(A, A.data.astype(LONG))


def modal_state(system: ModalSystem) -> State:
    """Displacements under loads through the modal first-order form.

    Parameters
    ----------
    system : ModalSystem

    Returns
    -------
    State
    """
    modes, A = system.modes, first_order(system).A
    size = np.sqrt(np.abs(modes.omega_squared))
    shapes = modes.shapes / np.where(size > 0.0, size, 1.0)
    solve = _solver(A)

    def moved(s: np.ndarray, loads: np.ndarray) -> np.ndarray:
        push = np.zeros((len(A), *loads.shape[1:]), complex)
        push[1 : 2 * len(modes) : 2] = _times(modes.shapes.T, loads)
        return _times(shapes, solve(push, s)[0 : 2 * len(modes) : 2])

    return lambda s: partial(moved, s)


def _solver(A: np.ndarray) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(f, s) ↦ (s − A)⁻¹ f; states that nothing depends on are integrated last, so that their poles at 0 stay exact."""
    dead = ~A.any(axis=0)
    if not A.size or not dead.any():
        form = cached_resolvent(A) if A.size else None
        return lambda f, s: f if form is None else form.solve(f, s)
    inner, row = _solver(A[np.ix_(~dead, ~dead)]), A[np.ix_(dead, ~dead)]

    def solve(f: np.ndarray, s: np.ndarray) -> np.ndarray:
        x = np.zeros(f.shape, complex)
        x[~dead] = inner(f[~dead], s)
        x[dead] = (_times(row, x[~dead]) + f[dead]) / s
        return x

    return solve
