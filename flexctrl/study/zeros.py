"""Transmission zeros and what they say about a choice of sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eig, eigvals, qr, svd

from flexctrl.errors import LinearizationError, StructureError, check_kind, shortened
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction.low_frequency import unsymmetric
from flexctrl.study.channel import Quadruple, channel_states

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SensorChoice", "Zeros", "deflated_zeros", "sensor_choices", "zeros"]

EPS = float(np.finfo(float).eps)


@frozen
class Zeros:
    """Transmission zeros.

    Attributes
    ----------
    finite : numpy.ndarray of complex
        Finite zeros in rad/s, by magnitude.
    uncertainty : numpy.ndarray
        Relative change of each zero when the entries of the model change in their last digit
        (condition number × eps): zeros far from the mode band and multiple ones are uncertain by nature.
    infinite : int
        Number of zeros at infinity (for one channel: the excess of poles over zeros).
    """

    finite: np.ndarray
    uncertainty: np.ndarray
    infinite: int

    @property
    def nonminimum_phase(self) -> np.ndarray:
        """Zeros in the open right half-plane, beyond their uncertainty."""
        return self.finite[self.finite.real > 10 * self.uncertainty * abs(self.finite)]

    def plot(self) -> Figure:
        """Draw the finite zeros in the complex plane, with their uncertainty.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.root_locus import zeros_figure

        return zeros_figure(self)


def zeros(linear: LinearModel, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Zeros:
    """Transmission zeros of the channels between inputs and outputs.

    Zeros are the s at which the Rosenbrock matrix [s²M + sC + K, −B; Cq + s Cv, D] loses rank. Those at
    infinity are deflated in scaled modal coordinates (A. Emami-Naeini, P. Van Dooren, Automatica 18
    (1982) 415–430); the finite ones are then polished on the second-order Rosenbrock matrix itself, in
    physical coordinates, where they keep the accuracy of the entries of M, C and K. Free rigid-body motion
    that the channel neither drives nor sees gives no zeros; a flexible mode of that kind gives zeros on its
    poles. Under loads that follow the machine (K not symmetric) the same equations hold.

    Parameters
    ----------
    linear : LinearModel
    inputs, outputs : sequence of str, optional
        Signals; all of them if left out.

    Returns
    -------
    Zeros
    """
    if not isinstance(linear, LinearModel):
        raise StructureError(f"zeros: {shortened(linear)} is no linear model; give what linearize returns")
    channel = linear.select(inputs, outputs).condense()
    A, B, C, D = channel_states(channel)
    rough = deflated_zeros(A, B, C, D)
    upper = rough[rough.imag >= 0]
    found = np.array([_polished(channel, complex(s)) for s in upper]).reshape(-1, 2)
    finite, doubt = _without_twins(upper, found[:, 0], found[:, 1].real)
    mirrored = upper.imag > 0
    finite = np.concatenate([finite, finite[mirrored].conj()])
    doubt = np.concatenate([doubt, doubt[mirrored]])
    order = np.lexsort([finite.imag, abs(finite)])
    return Zeros(finite[order], doubt[order], len(A) - len(finite))


def _unit_gains(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> Quadruple:
    """Time and signals scaled so that the rank decisions of the deflation are between numbers near 1."""
    speed = float(np.linalg.norm(A, 2)) or 1.0
    by = np.linalg.norm(B, axis=0, keepdims=True)
    by[by == 0] = 1.0
    cy = np.linalg.norm(C, axis=1, keepdims=True)
    cy[cy == 0] = 1.0
    return A, B / by * speed, C / cy * speed, D / by / cy * speed**2


def deflated_zeros(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Finite invariant zeros of a state-space model (not polished).

    Parameters
    ----------
    A, B, C, D : numpy.ndarray
        Balanced states, so that every block of A has the size of its poles.

    Returns
    -------
    numpy.ndarray of complex
    """
    if not len(A):
        return np.zeros(0, complex)
    speed = float(np.linalg.norm(A, 2)) or 1.0
    A, B, C, D = _unit_gains(A, B, C, D)
    tol = 1e-12 * float(np.linalg.norm(np.block([[A, B], [C, D]]), 2))
    A, B, C, D = _deflated(A, B, C, D, tol)
    At, Ct, Bt, Dt = _deflated(A.T, C.T, B.T, D.T, tol)
    A, B, C, D = At.T, Bt.T, Ct.T, Dt.T
    n = len(A)
    if n == 0 or D.size == 0:
        return np.asarray(eigvals(A)) if n else np.zeros(0, complex)
    kernel = qr(np.hstack([C, D]).T)[0][:, len(D) :]
    alpha, beta = eig(np.hstack([A, B]) @ kernel, kernel[:n], right=False, homogeneous_eigvals=True)
    finite = abs(beta) * speed > 1e-13 * abs(alpha)
    return np.asarray(alpha[finite] / beta[finite])


def _deflated(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, tol: float) -> Quadruple:
    """Remove the states that outputs without feedthrough force to zero, until D has full row rank."""
    while len(A):
        u, sigma, _ = svd(D) if D.size else (np.eye(len(D)), np.zeros(0), D)
        rank = int(np.count_nonzero(sigma > tol))
        C, D = u.T @ C, u.T @ D
        if rank == len(D):
            break
        _, sigma, vh = svd(C[rank:])
        forced = int(np.count_nonzero(sigma > tol))
        if forced == 0:
            return A, B, C[:rank], D[:rank]
        stay, gone = vh[forced:].T, vh[:forced]
        C, D = np.vstack([C[:rank] @ stay, gone @ A @ stay]), np.vstack([D[:rank], gone @ B])
        A, B = stay.T @ A @ stay, stay.T @ B
    return A, B, C, D


def _polished(channel: LinearModel, s: complex) -> tuple[complex, float]:
    """Newton on the smallest singular triplet of the scaled Rosenbrock matrix; the zero and its doubt."""
    start = s
    for _ in range(12):
        matrix, slope = _rosenbrock(channel, s)
        u, sigma, vh = svd(matrix)
        left, right = u[:, -1].conj(), vh[-1].conj()
        change = left @ slope @ right
        doubt = EPS * sigma[0] / max(abs(change) * abs(s), EPS * sigma[0])
        step = (left @ matrix @ right) / change if abs(change) > 0 else 0.0
        s = s - step
        if abs(step) <= 4 * EPS * abs(s):
            break
    return (s, doubt) if abs(s - start) <= 0.3 * abs(start) else (start, 1.0)


def _without_twins(start: np.ndarray, found: np.ndarray, doubt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two different starts that ended on one zero: the farther one goes back, fully in doubt."""
    found, doubt = found.copy(), doubt.copy()
    for i, j in np.argwhere(np.triu(abs(found[:, None] - found) <= 1e-10 * abs(found), 1)):
        if abs(start[i] - start[j]) > 1e-4 * abs(start[i]):
            far = i if abs(start[i] - found[i]) > abs(start[j] - found[j]) else j
            found[far], doubt[far] = start[far], 1.0
    return found, doubt


def _rosenbrock(channel: LinearModel, s: complex) -> tuple[np.ndarray, np.ndarray]:
    """The Rosenbrock matrix and its derivative in s, rows and columns scaled to unit size."""
    M, C, K = (A.toarray() for A in (channel.M, channel.C, channel.K))
    n, m, p = len(M), channel.B.shape[1], channel.Cq.shape[0]
    full = np.zeros((n + p, n + m), complex)
    slope = np.zeros_like(full)
    full[:n, :n], slope[:n, :n] = K + s * C + s * s * M, C + 2 * s * M
    full[:n, n:], full[n:, n:] = -channel.B, channel.D
    full[n:, :n], slope[n:, :n] = channel.Cq + s * channel.Cv, channel.Cv
    mass, drag, spring = (abs(A.diagonal()) for A in (M, C, K))
    slow = 1e-3 * float(np.sqrt((spring[mass > 0] / mass[mass > 0]).max(initial=0.0))) or 1.0
    size = np.sqrt(spring + max(abs(s), slow) * drag + max(abs(s), slow) ** 2 * mass)
    rows, cols = np.concatenate([size, np.ones(p)]), np.concatenate([size, np.ones(m)])
    full, slope = full / rows[:, None] / cols, slope / rows[:, None] / cols
    rows = np.concatenate([np.ones(n), np.linalg.norm(full[n:], axis=1)])
    cols = np.concatenate([np.ones(n), np.linalg.norm(full[:, n:], axis=0)])
    rows[rows == 0], cols[cols == 0] = 1.0, 1.0
    return full / rows[:, None] / cols, slope / rows[:, None] / cols


@frozen
class SensorChoice:
    """How one output sees one input, mode by mode.

    Attributes
    ----------
    input, output : str
        The channel.
    collocated : bool
        The output measures the motion its input works on (its row is a multiple of the input's
        column), or its velocity: poles and zeros alternate and no phase is lost, unless loads follow the machine.
    in_phase : bool
        Every mode looked at has a residue of the sign of the first: minimum phase so far.
    first_flip : float
        Angular frequency (rad/s) of the first mode of opposite sign, where the phase falls behind;
        infinite if there is none.
    """

    input: str
    output: str
    collocated: bool
    in_phase: bool
    first_flip: float


def sensor_choices(linear: LinearModel, below: float = np.inf) -> tuple[SensorChoice, ...]:
    """Label every input–output pair collocated, in phase, or not.

    The residue of a mode is (c φ)(ψᵀ b) with ψᵀ M φ = 1. Under loads that follow the machine the left shape ψ, of
    Kᵀ ψ = ω² M ψ, is another than φ: there a collocated pair may have residues of both signs, and only ``in_phase``
    speaks of phase.

    Parameters
    ----------
    linear : LinearModel
    below : float
        Look at modes below this angular frequency, rad/s.

    Returns
    -------
    tuple of SensorChoice
        Outputs run fastest.

    Raises
    ------
    LinearizationError
        If modes looked at flutter: their residues have no sign.
    StructureError
        If ``below`` is no positive number.
    """
    if not isinstance(below, int | float | np.number) or not below > 0.0:
        raise StructureError(f"sensor_choices: below = {below!r}; expected a positive angular frequency in rad/s")
    check_kind(linear, LinearModel, "sensor_choices: linear", "a LinearModel, as linearize(model) gives")
    condensed = linear.condense()
    omega, right, left = _two_sided(condensed) if unsymmetric(condensed) else _one_sided(condensed)
    seen = omega <= below
    shapes = omega[seen], right[:, seen], left[:, seen]
    _refuse_flutter(*shapes[:2])
    return tuple(
        _label(condensed, *shapes, i, j) for i in range(len(linear.inputs)) for j in range(len(linear.outputs))
    )


def _one_sided(linear: LinearModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    modes = linear.modes()
    return modes.omega, modes.shapes, modes.shapes


def _two_sided(linear: LinearModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ω and both shapes of K φ = ω² M φ, from those of the symmetric part of K; ω by its size where it is no number."""
    system = linear._modal
    values, left, right = eig(np.diag(system.modes.omega_squared) + system.circulatory, left=True)
    order = np.argsort(np.abs(values), kind="stable")
    values, left, right = values[order], left[:, order].conj(), right[:, order]
    left = left / np.einsum("ij,ij->j", left, right)
    omega = np.where(np.abs(values.imag) > 0.0, np.sqrt(np.abs(values)), np.sqrt(np.maximum(values.real, 0.0)))
    real = not np.iscomplexobj(right) or not right.imag.any()
    right, left = (right.real, left.real) if real else (right, left)
    return omega, system.modes.shapes @ right, system.modes.shapes @ left


def _refuse_flutter(omega: np.ndarray, shapes: np.ndarray) -> None:
    turning = np.abs(shapes.imag).any(axis=0)
    if turning.any():
        raise LinearizationError(
            f"sensor_choices: the mode at {omega[turning][0]:.4g} rad/s flutters, so its residues have no sign; take "
            "load off, or look at modes below it: sensor_choices(linear, below=…)"
        )


def _label(linear: LinearModel, omega: np.ndarray, right: np.ndarray, left: np.ndarray, i: int, j: int) -> SensorChoice:
    column = linear.B[:, i]
    row = linear.Cq[j] if linear.Cq[j].any() else linear.Cv[j]
    seen, driven = row @ right.real, column @ left.real
    share, size = seen * driven, np.linalg.norm(seen) * np.linalg.norm(driven)
    levels, member = np.unique(omega, return_inverse=True)
    share = np.bincount(member, share, len(levels))  # repeated and rigid-body modes count together
    visible = abs(share) > 1e-9 * size
    signs, at = np.sign(share[visible]), levels[visible]
    flipped = np.flatnonzero(signs != signs[0]) if len(signs) else np.zeros(0, int)
    parallel = abs(row @ column) >= (1 - 1e-12) * np.linalg.norm(row) * np.linalg.norm(column) > 0
    mixed = linear.Cq[j].any() and linear.Cv[j].any()
    first = float(at[flipped[0]]) if len(flipped) else np.inf
    return SensorChoice(linear.inputs[i], linear.outputs[j], bool(parallel and not mixed), not len(flipped), first)
