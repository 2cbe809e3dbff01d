"""Responses finished by a step of refinement with residuals of extended precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.modal import ModalSystem
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.resolvent import cached_resolvent
from flexctrl.linear.statespace import first_order

__all__ = ["refined_transfer"]

CHUNK = 256
LONG = np.longdouble
FINER = 0.01
SETTLED = 1e-8
ENOUGH, PROBES = 3e-10, 12


def refined_transfer(
    linear: LinearModel, system: ModalSystem, rough: Callable[[np.ndarray], np.ndarray]
) -> Callable[[np.ndarray], np.ndarray]:
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
    rough : callable
        H(s) without refinement: for s = 0, and where a machine has no extended precision.

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N); the rough one if it needs no refinement: right to 3e-10
        in every channel at a dozen frequencies spread over the modes.
    """
    if np.finfo(LONG).eps > FINER * np.finfo(float).eps:
        return rough
    state, residual = _state(system), _residual(linear, system.modes)
    loads = np.asarray(linear.B, complex)[:, :, None]

    def moving(s: np.ndarray) -> np.ndarray:
        q = state(np.repeat(loads, s.size, axis=2), s)
        step = state(residual(q, s), s)
        q = q + step
        far = (np.abs(step) > SETTLED * np.abs(q)).any(axis=(0, 1))
        if far.any():
            q[..., far] += state(residual(q[..., far], s[far]), s[far])
        return _times(linear.Cq, q) + s * _times(linear.Cv, q) + linear.D[:, :, None]

    probes = 1j * _probes(system)
    fine = moving(probes)
    if (np.abs(rough(probes) - fine) <= ENOUGH * np.abs(fine)).all():
        return rough

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        values = rough(s)
        places = np.flatnonzero(s != 0.0)
        for i in range(0, places.size, CHUNK):
            piece = places[i : i + CHUNK]
            values[..., piece] = moving(s[piece])
        return values

    return evaluate


def _probes(system: ModalSystem) -> np.ndarray:
    """Frequencies between those of some modes, and beyond them on both sides [rad/s]."""
    omega = np.unique(system.modes.omega[system.modes.omega > 0.0])
    if not omega.size:
        return np.ones(1)
    some = omega[np.unique(np.linspace(0, omega.size - 1, PROBES).astype(int))]
    return np.concatenate([[0.1 * some[0]], np.sqrt(some[:-1] * some[1:]), [2.0 * some[-1]]])


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A on the first axis of x."""
    return np.asarray((A @ x.reshape(len(x), -1)).reshape(len(A), *x.shape[1:]))


def _residual(linear: LinearModel, modes: Modes) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(q, s) ↦ B − (Pᵀ K P + s C + s² M) q, shapes (n, m, N) and (N,); P takes out the rigid-body modes.

    K resists these by its rounding, which at low frequencies is more than their inertia.
    """
    K, C, M = (sp.csr_matrix(A).astype(LONG) for A in (linear.K, linear.C, linear.M))
    B = linear.B[:, :, None]
    rigid = modes.shapes[:, modes.unstable : modes.unstable + modes.rigid].astype(LONG)
    momenta = M @ rigid

    def residual(q: np.ndarray, s: np.ndarray) -> np.ndarray:
        n = len(q)
        parts = np.hstack([q.real.reshape(n, -1), q.imag.reshape(n, -1)]).astype(LONG)

        def joined(both: np.ndarray) -> np.ndarray:
            both = both.reshape(n, 2, *q.shape[1:])
            return np.asarray(both[:, 0] + 1j * both[:, 1])

        elastic = K @ (parts - rigid @ (momenta.T @ parts))
        elastic = joined(elastic - momenta @ (rigid.T @ elastic))
        long = s.astype(np.clongdouble)
        return np.asarray(B - elastic - long * (joined(C @ parts) + long * joined(M @ parts)), dtype=complex)

    return residual


def _state(system: ModalSystem) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(loads, s) ↦ displacements, both of shape (n, m, N), through the modal first-order form."""
    modes, A = system.modes, first_order(system).A
    size = np.sqrt(np.abs(modes.omega_squared))
    shapes = modes.shapes / np.where(size > 0.0, size, 1.0)
    solve = _solver(A)

    def state(loads: np.ndarray, s: np.ndarray) -> np.ndarray:
        push = np.zeros((len(A), *loads.shape[1:]), complex)
        push[1 : 2 * len(modes) : 2] = _times(modes.shapes.T, loads)
        return _times(shapes, solve(push, s)[0 : 2 * len(modes) : 2])

    return state


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
