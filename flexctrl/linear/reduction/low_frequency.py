"""The response near s = 0 with rigid-body modes present, and the static solves it needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.undamped import ROUND_OFF

__all__ = [
    "LowFrequency",
    "flexibility",
    "low_frequency",
    "nearest_modes",
    "rigid_basis",
    "undamped",
    "unsymmetric",
]

ROUNDING = 1e-12


@frozen
class LowFrequency:
    """Coefficients of G(s) = double/s² + single/s + constant + O(s).

    Attributes
    ----------
    double, single, constant : numpy.ndarray, shape (n_outputs, n_inputs)
        Without rigid-body modes the first two vanish and ``constant`` is the DC gain; with them,
        ``constant`` is the DC gain of what is left: the flexible part.
    """

    double: np.ndarray
    single: np.ndarray
    constant: np.ndarray


def flexibility(linear: LinearModel, rigid: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Factor K once; solve K x = f − M R Rᵀ f with Rᵀ M x = 0 (inertia relief) many times.

    Parameters
    ----------
    linear : LinearModel
        Symmetric K is assumed.
    rigid : numpy.ndarray, shape (n, r)
        Rigid-body modes R, Rᵀ M R = I, K R = 0; r may be 0.

    Returns
    -------
    callable
        From loads (n, k) to elastic displacements (n, k).
    """
    n, r = rigid.shape
    border = linear.M @ rigid
    scale = (abs(linear.K).max() or 1.0) / abs(border).max() if r else 1.0
    side = sp.csc_matrix(scale * border)
    factor = splu(sp.csc_matrix(sp.bmat([[linear.K, side], [side.T, None]])) if r else linear.K)

    def solve(load: np.ndarray) -> np.ndarray:
        return factor.solve(np.vstack([load, np.zeros((r, load.shape[1]))]))[:n]

    return solve


def low_frequency(linear: LinearModel, rigid: np.ndarray) -> LowFrequency:
    """Expand G(s) = (Cq + s Cv)(K + s C + s² M)⁻¹ B + D about s = 0.

    The displacement series X = X₋₂/s² + X₋₁/s + X₀ + … obeys K X_j + C X_{j−1} + M X_{j−2} = B δ_{j0};
    its rigid parts R a_j follow from the solvability conditions Rᵀ(C X_j + M X_{j−1}) = Rᵀ B δ_{j,−1},
    a least-squares system of three unknowns per rigid-body mode. Damping may couple rigid and
    elastic motion.

    Parameters
    ----------
    linear : LinearModel
        Symmetric K is assumed.
    rigid : numpy.ndarray, shape (n, r)
        Rigid-body modes R, Rᵀ M R = I.

    Returns
    -------
    LowFrequency
    """
    solve = flexibility(linear, rigid)
    if not rigid.shape[1]:
        x0 = solve(linear.B)
        none = np.zeros_like(linear.D)
        return LowFrequency(none, none, linear.Cq @ x0 + linear.D)
    x2, x1, x0 = _displacement_series(linear, rigid, solve)
    return LowFrequency(
        linear.Cq @ x2,
        linear.Cq @ x1 + linear.Cv @ x2,
        linear.Cq @ x0 + linear.Cv @ x1 + linear.D,
    )


def rigid_basis(full: LinearModel) -> np.ndarray:
    """The rigid-body modes.

    Parameters
    ----------
    full : LinearModel

    Returns
    -------
    numpy.ndarray, shape (n, n_rigid)
        M-orthonormal. None where loads follow: their K is not symmetric, and nothing moves without resistance.
    """
    if unsymmetric(full):
        return np.zeros((len(full.coordinates), 0))
    modes = full.modes(min(12, len(full.coordinates)))
    return modes.shapes[:, modes.unstable : modes.unstable + modes.rigid]


def unsymmetric(linear: LinearModel) -> bool:
    """Tell whether loads that follow the machine make K unsymmetric: there are no real undamped modes then.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    bool
    """
    return linear._scaled.stiffness[1] > ROUND_OFF


def nearest_modes(linear: LinearModel) -> Modes:
    """Return the modes; where loads follow, those of the symmetric part of K, in which the model is still complete.

    Parameters
    ----------
    linear : LinearModel

    Returns
    -------
    Modes
    """
    return linear._modal.modes if unsymmetric(linear) else linear.modes()


def undamped(linear: LinearModel, rigid: np.ndarray) -> np.ndarray:
    """Which rigid-body modes no damper resists, beyond round-off.

    Parameters
    ----------
    linear : LinearModel
    rigid : numpy.ndarray, shape (n, r)
        Rigid-body modes with diagonal Rᵀ C R.

    Returns
    -------
    numpy.ndarray of bool, shape (r,)
        Where rᵀ C r is lost in the rounding of its terms, C r = 0 is meant (C is semidefinite). With
        gyroscopic terms (C not symmetric) C r itself must be lost.
    """
    C, size = linear.C, abs(rigid)
    terms, force = abs(C) @ size, abs(C @ rigid)
    if abs(C - C.T).max() <= 1e-9 * abs(C).max():
        return np.asarray(abs((rigid * (C @ rigid)).sum(axis=0)) <= ROUNDING * (size * terms).sum(axis=0))
    scale = np.sqrt(np.maximum(linear.M.diagonal(), 1e-12 * linear.M.diagonal().max()))[:, None]
    return np.asarray((force / scale).max(axis=0, initial=0.0) <= ROUNDING * (terms / scale).max(initial=0.0))


def _displacement_series(
    linear: LinearModel, rigid: np.ndarray, solve: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """X₋₂, X₋₁, X₀, each affine in the rigid amplitudes a₋₂, a₋₁, a₀, a₁ (one block of columns each)."""
    R = _damping_axes(linear, rigid)
    r, m, M, C = R.shape[1], linear.B.shape[1], linear.M, linear.C
    resisted = ~undamped(linear, R)
    left, right = (C.T @ R * resisted).T, C @ R * resisted
    a2, a1, a0, a_next = np.eye(4 * r, 4 * r + m).reshape(4, r, 4 * r + m)
    force = linear.B @ np.eye(m, 4 * r + m, 4 * r)
    e1 = solve(-right @ a2)
    e0 = solve(force - right @ a1 - C @ e1)
    e_next = solve(-right @ a0 - C @ e0 - M @ e1)
    damping = R.T @ right
    condition = np.vstack(
        [
            damping @ a2,
            damping @ a1 + left @ e1 + a2 - R.T @ force,
            damping @ a0 + left @ e0 + a1,
            damping @ a_next + left @ e_next + a0,
        ]
    )
    amplitude = _equilibrated_lstsq(condition[:, : 4 * r], -condition[:, 4 * r :])
    mix = np.vstack([amplitude, np.eye(m)])
    return R @ a2 @ mix, (R @ a1 + e1) @ mix, (R @ a0 + e0) @ mix


def _damping_axes(linear: LinearModel, rigid: np.ndarray) -> np.ndarray:
    """Rotate the rigid-body modes so that damped and undamped motions are separate."""
    damping = rigid.T @ (linear.C @ rigid)
    return rigid @ np.linalg.eigh(damping + damping.T)[1]


def _equilibrated_lstsq(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least squares with unit rows and columns, so that units do not decide the rank."""
    rows = np.linalg.norm(A, axis=1)
    rows[rows == 0.0] = 1.0
    scaled = A / rows[:, None]
    cols = np.linalg.norm(scaled, axis=0)
    cols[cols == 0.0] = 1.0
    return np.linalg.lstsq(scaled / cols, b / rows[:, None], rcond=1e-10)[0] / cols[:, None]
