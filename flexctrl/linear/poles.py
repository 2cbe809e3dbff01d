"""Damped poles: roots of det(s² M + s C + K) = 0, with the zeros of rigid-body motion exact."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from flexctrl.errors import LinearizationError
from flexctrl.linear.condense import Scaled, scaled
from flexctrl.linear.modal import ModalSystem, modal_damping
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.statespace import first_order
from flexctrl.linear.undamped import COMPLETE, modes_of

__all__ = ["damped_poles", "second_order_roots"]


def damped_poles(linear: LinearModel, count: int | None = None) -> np.ndarray:
    """Poles of the damped model, smallest modulus first.

    Classically damped models in closed form, others by the eigenvalues of the modal first-order form, with
    the exact zeros of rigid-body modes taken out beforehand. Massless but damped freedoms give their
    first-order poles, undamped massless ones none.

    Parameters
    ----------
    linear : LinearModel
    count : int, optional
        The `count` smallest; needed beyond 1000 freedoms, where shift-invert Arnoldi finds them.

    Returns
    -------
    numpy.ndarray of complex, 1/s

    Raises
    ------
    LinearizationError
        If the model is large and no count is given.
    """
    if len(linear.coordinates) > COMPLETE:
        if count is None:
            raise LinearizationError(f"{len(linear.coordinates)} freedoms: say how many poles, damped_poles(count)")
        return _sparse_poles(linear, count)
    system = linear._modal
    poles = _classical(system) if system.classical else _general(first_order(system).A)
    return _sorted(poles)[:count]


def second_order_roots(damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Both roots of s² + d s + λ = 0 without cancellation.

    Parameters
    ----------
    damping, stiffness : numpy.ndarray, shape (k,)
        d in 1/s and λ in 1/s².

    Returns
    -------
    numpy.ndarray of complex, shape (2, k)
        Their product is λ; conjugates where they oscillate.
    """
    half = 0.5 * damping
    # two factors: half² - λ would lose the difference of nearly critical damping
    omega = np.sqrt(np.abs(stiffness))
    inside = np.where(stiffness >= 0, (half - omega) * (half + omega), half**2 + omega**2)
    root = np.sqrt(np.abs(inside))
    far = -(half + np.where(half < 0, -1.0, 1.0) * root)
    near = np.where(far != 0, stiffness / np.where(far != 0, far, 1.0), 0.0)
    oscillating = inside < 0
    first = np.where(oscillating, -half + 1j * root, near)
    second = np.where(oscillating, -half - 1j * root, far)
    return np.stack([first, second])


def _classical(system: ModalSystem) -> np.ndarray:
    roots = second_order_roots(np.diag(system.damping), system.modes.omega_squared)
    return np.concatenate([roots.ravel(), -system.relaxation.rates])


def _general(A: np.ndarray) -> np.ndarray:
    """Eigenvalues; a column of zeros is an exact eigenvalue 0, and is cut out with its row."""
    zeros = 0
    while True:
        dead = ~A.any(axis=0) | ~A.any(axis=1)
        if not dead.any():
            break
        zeros += int(np.count_nonzero(dead))
        A = A[~dead][:, ~dead]
    return np.concatenate([np.zeros(zeros), la.eigvals(A) if A.size else np.zeros(0)])


def _sorted(poles: np.ndarray) -> np.ndarray:
    poles = np.asarray(poles, dtype=complex)
    size = np.abs(poles)
    order = np.lexsort((-poles.imag, poles.real, np.round(np.log(np.where(size > 0, size, 1e-300)), 9)))
    return poles[order]


def _sparse_poles(linear: LinearModel, count: int) -> np.ndarray:
    """Shift-invert Arnoldi on the companion form; only K + σC + σ²M is factorised."""
    base = scaled(linear)
    modes = modes_of(linear, base, max(count // 2 + 2, 8))
    omega = float(modes.omega[modes.flexible][0]) if modes.omega.any() else 1.0
    found = _arnoldi(base, 0.3 * omega, omega, count + 4)
    zeros = _exact_zeros(linear, modes)
    found = _sorted(found)
    found[:zeros] = 0.0
    return found[:count]


def _arnoldi(base: Scaled, sigma: float, unit: float, count: int) -> np.ndarray:
    M, C, K = base.model.M, base.model.C, base.model.K
    n = M.shape[0]
    lu = sla.splu(sp.csc_matrix(K + sigma * C + sigma**2 * M), permc_spec="MMD_AT_PLUS_A")

    def apply(x: np.ndarray) -> np.ndarray:
        q, v = x[:n], x[n:] * unit
        moved = -lu.solve(M @ v + C @ q + sigma * (M @ q))
        return np.concatenate([moved, (q + sigma * moved) / unit])

    operator = sla.LinearOperator((2 * n, 2 * n), matvec=apply, dtype=float)
    start = np.random.default_rng(0).standard_normal(2 * n)
    theta = sla.eigs(operator, count, v0=start, ncv=min(2 * n, 3 * count + 20), return_eigenvectors=False)
    return sigma + 1.0 / theta


def _exact_zeros(linear: LinearModel, modes: Modes) -> int:
    """One zero for each rigid-body mode, two where nothing damps it."""
    rigid = modes.shapes[:, modes.unstable : modes.unstable + modes.rigid]
    drag = modal_damping(linear.C, rigid)
    return 2 * rigid.shape[1] - (int(np.linalg.matrix_rank(drag)) if drag.size else 0)
