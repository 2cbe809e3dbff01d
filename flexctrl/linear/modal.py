"""The linear model in modal coordinates, complete: modes, relaxing freedoms, feedthrough of the static ones."""

from __future__ import annotations

from dataclasses import replace
from types import NoneType

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, check_kind
from flexctrl.frozen import frozen
from flexctrl.linear.condense import Scaled, condense, refuse_improper, scaled, static_response
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.pattern import symmetric, with_entries
from flexctrl.linear.undamped import COMPLETE, ROUND_OFF, refuse_unsymmetric

__all__ = ["ModalSystem", "Relaxation", "modal_damping", "modal_system", "proper", "rayleigh"]

EPS = float(np.finfo(float).eps)


@frozen(eq=False)
class Relaxation:
    """First-order states a of the freedoms with damping but no mass: ȧ = -rates a + input u - drag η̇.

    Attributes
    ----------
    rates : numpy.ndarray, shape (d,)
        1/s.
    input : numpy.ndarray, shape (d, n_inputs)
    drag : numpy.ndarray, shape (d, k)
        Wᵀ C Φ.
    reaction : numpy.ndarray, shape (k, d)
        Φᵀ C W: force of ȧ on the modes.
    output, output_rate : numpy.ndarray, shape (n_outputs, d)
    """

    rates: np.ndarray
    input: np.ndarray
    drag: np.ndarray
    reaction: np.ndarray
    output: np.ndarray
    output_rate: np.ndarray


@frozen(eq=False)
class ModalSystem:
    """η̈ + damping η̇ + (Λ + circulatory) η + reaction ȧ = φᵀ B u;  y = … + feedthrough u + jump u̇.

    Attributes
    ----------
    modes : Modes
    damping : numpy.ndarray, shape (k, k)
        Φᵀ C Φ, rounding dust removed.
    circulatory : numpy.ndarray, shape (k, k)
        Φᵀ (K - Kᵀ) Φ / 2; zero unless loads follow.
    relaxation : Relaxation
    feedthrough : numpy.ndarray, shape (n_outputs, n_inputs)
        D of the model and of the condensed freedoms.
    jump : numpy.ndarray, shape (n_outputs, n_inputs)
        What a velocity output sees of u̇ through a condensed freedom; zero for a proper model.
    classical : bool
        Whether the modes are uncoupled (damping diagonal, nothing else couples them).
    """

    modes: Modes
    damping: np.ndarray
    circulatory: np.ndarray
    relaxation: Relaxation
    feedthrough: np.ndarray
    jump: np.ndarray
    classical: bool


def modal_system(linear: LinearModel, modes: Modes | None = None) -> ModalSystem:
    """Transform to modal coordinates.

    Parameters
    ----------
    linear : LinearModel
    modes : Modes, optional
        Only these; left out: all of them.

    Returns
    -------
    ModalSystem

    Raises
    ------
    LinearizationError
        If all modes of a model of more than 1000 freedoms are asked for.
    """
    if modes is None and len(linear.coordinates) > COMPLETE:
        raise LinearizationError(
            f"a complete modal form of {len(linear.coordinates)} freedoms is too much; give modes(count) or "
            "reduce the model first"
        )
    check_kind(modes, (Modes, NoneType), "modes", "Modes, as linear.modes(count) gives")
    if linear._scaled.massless.pushed.shape[1] and modes is not None:
        raise LinearizationError(
            "some massless freedoms follow velocities of others, which the modes do not know: take the modes of "
            "linear.condense(), and its modal form"
        )
    if modes is None and (linear._scaled.stiffness[1] > ROUND_OFF or linear._scaled.massless.pushed.shape[1]):
        linear = condense(linear)
    even = _with_even_stiffness(linear)
    base = scaled(even)
    chosen = even._every_mode if modes is None else modes
    direct = static_response(base)
    feedthrough, jump = base.model.D + base.model.Cq @ direct, base.model.Cv @ direct
    fit = rayleigh(base)
    if fit is not None:
        damping = np.diag(fit[0] + fit[1] * chosen.omega_squared)
        relaxation = _relaxation(base, chosen, fit[1])
    else:
        damping = modal_damping(linear.C, chosen.shapes)
        relaxation = _relaxation(base, chosen, 0.0)
    circulatory = _circulatory(linear, chosen.shapes)
    coupled = circulatory.any() or relaxation.drag.any() or relaxation.reaction.any()
    classical = not coupled and not np.any(damping - np.diag(np.diag(damping)))
    return ModalSystem(chosen, damping, circulatory, relaxation, feedthrough, jump, classical)


def rayleigh(base: Scaled) -> tuple[float, float] | None:
    """(α, β) if C = α M + β K to rounding, else None.

    Parameters
    ----------
    base : Scaled

    Returns
    -------
    tuple of two floats, or None
    """
    if not np.any(base.model.C.data):
        return 0.0, 0.0
    found = base.proportional
    return None if found.rest.any() else (found.alpha, found.beta)


def modal_damping(C: sp.spmatrix, shapes: np.ndarray) -> np.ndarray:
    """Φᵀ C Φ without what is only rounding: under 100 eps |Φ|ᵀ|C||Φ|, or 1e-11 of the geometric mean.

    Parameters
    ----------
    C : sparse matrix, shape (n, n)
    shapes : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray, shape (k, k)
    """
    full = shapes.T @ (C @ shapes)
    noise = 100.0 * EPS * (np.abs(shapes).T @ (with_entries(C, np.abs(C.data)) @ np.abs(shapes)))
    own = np.sqrt(np.abs(np.diag(full)))
    small = np.abs(full) <= np.maximum(noise, 1e-11 * np.outer(own, own))
    np.fill_diagonal(small, np.abs(np.diag(full)) <= np.diag(noise))
    return np.where(small, 0.0, full)


def _with_even_stiffness(linear: LinearModel) -> LinearModel:
    """The model with K made symmetric."""
    base = linear._scaled
    if base.stiffness[1] > ROUND_OFF and base.massless.every.shape[1]:
        refuse_unsymmetric(base)
    return linear if base.stiffness[1] == 0.0 else replace(linear, K=symmetric(linear.K)[0])


def _circulatory(linear: LinearModel, shapes: np.ndarray) -> np.ndarray:
    """Φᵀ (K − Kᵀ) Φ / 2 where K is not symmetric."""
    if linear._scaled.stiffness[1] <= ROUND_OFF:
        return np.zeros((shapes.shape[1],) * 2)
    return np.asarray(0.5 * shapes.T @ ((linear.K - linear.K.T) @ shapes))


def _relaxation(base: Scaled, modes: Modes, beta: float) -> Relaxation:
    """First-order part; with β > 0 (Rayleigh) it is uncoupled and every rate is 1/β."""
    model, W = base.model, base.massless.relaxing
    if not W.shape[1]:
        k, m, p = len(modes), len(model.inputs), len(model.outputs)
        return Relaxation(*(np.zeros(shape) for shape in ((0,), (0, m), (0, k), (k, 0), (p, 0), (p, 0))))
    own, stiffness = (_small(W, A) for A in (model.C, model.K))
    try:
        rates, y = la.eigh(0.5 * (stiffness + stiffness.T), 0.5 * (own + own.T))
    except la.LinAlgError as error:
        raise LinearizationError("a massless freedom has negative damping: give it inertia") from error
    if np.abs(own - own.T).max() > 1e-12 * np.abs(own).max():
        raise LinearizationError("massless freedoms with gyroscopic coupling: give them inertia")
    V = W @ y
    shapes = modes.shapes / base.scales[:, None]
    drag, reaction = V.T @ (model.C @ shapes), (shapes.T @ (model.C @ V))
    if beta > 0.0:
        rates, drag, reaction = np.full_like(rates, 1.0 / beta), 0.0 * drag, 0.0 * reaction
    rates = np.where(np.abs(rates) < 1e-13 * np.abs(rates).max(), 0.0, rates)
    return Relaxation(rates, V.T @ model.B, drag, reaction, model.Cq @ V, model.Cv @ V)


def _small(W: sp.csc_matrix, A: sp.csc_matrix) -> np.ndarray:
    return np.asarray((W.T @ A @ W).toarray())


def proper(system: ModalSystem, linear: LinearModel) -> ModalSystem:
    """The system, refused if a velocity output sees the derivative of an input.

    Parameters
    ----------
    system : ModalSystem
    linear : LinearModel
        It came from.

    Returns
    -------
    ModalSystem
    """
    if system.jump.any():
        base = scaled(linear)
        refuse_improper(base.model, static_response(base))
    return replace(system, jump=np.zeros_like(system.jump))
