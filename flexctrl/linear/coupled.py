"""Responses of models whose damping couples the modes: the eigenvectors or a Schur form, then all s at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexctrl.errors import LinearizationError
from flexctrl.frozen import frozen
from flexctrl.linear.modal import ModalSystem
from flexctrl.linear.modal_sum import divided, pole_sum
from flexctrl.linear.resolvent import cached_resolvent
from flexctrl.linear.statespace import FirstOrder, first_order

__all__ = ["coupled_transfer"]

CHUNK = 512


@frozen(eq=False)
class _Integrators:
    """States that nothing else depends on (A has a zero column): x = (row x_rest + input u) / s.

    Attributes
    ----------
    row, input : numpy.ndarray
        Their rows of A (columns of the rest) and of B.
    weight : numpy.ndarray
        How the wanted rows of the level above see these states.
    """

    row: np.ndarray
    input: np.ndarray
    weight: np.ndarray


def coupled_transfer(system: ModalSystem) -> Callable[[np.ndarray], np.ndarray]:
    """H(s) from the energy-scaled first-order modal form.

    Positions of rigid-body modes (zero columns of A) are peeled off first, so that their poles at 0 stay
    exact. The rest is diagonalised if its eigenvectors are well conditioned (light damping: they are nearly
    unitary), else brought to Schur form, which is backward stable for critically damped modes too.

    Parameters
    ----------
    system : ModalSystem

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N).
    """
    first = first_order(replace(system, jump=np.zeros_like(system.jump)))
    levels, A, B, wanted = _peeled(first)
    rest = _resolvent(A, B, wanted)

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        pieces = [rest(s[i : i + CHUNK]) for i in range(0, s.size, CHUNK)]
        values = np.concatenate(pieces, axis=-1) if pieces else np.zeros((len(wanted), B.shape[1], 0), complex)
        for level in reversed(levels):
            values = _integrated(level, values, s)
        return values + first.D[:, :, None] + system.jump[:, :, None] * s

    return evaluate


def _peeled(first: FirstOrder) -> tuple[list[_Integrators], np.ndarray, np.ndarray, np.ndarray]:
    """Integrators level by level, and A, B and the rows wanted of what is left."""
    A, B, wanted = first.A, first.B, first.C
    levels: list[_Integrators] = []
    while A.size and not np.all(A.any(axis=0)):
        dead = np.asarray(~A.any(axis=0))
        row = A[np.ix_(dead, ~dead)]
        levels.append(_Integrators(row, B[dead], wanted[:, dead]))
        A, B, wanted = A[np.ix_(~dead, ~dead)], B[~dead], np.vstack([wanted[:, ~dead], row])
    return levels, A, B, wanted


def _integrated(level: _Integrators, values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Rows wanted of the level above, from those of this one (the integrators' own rows come last)."""
    count = len(level.weight)
    sources = values[count:] + level.input[:, :, None]
    seen = np.einsum("pi,imn->pmn", level.weight, sources)
    still = s == 0
    if seen[..., still].any():
        raise _infinite(0.0)
    return values[:count] + seen / np.where(still, 1.0, s)


def _resolvent(A: np.ndarray, B: np.ndarray, wanted: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """s ↦ wanted (s I - A)⁻¹ B, shape (rows, n_inputs, N)."""
    if not A.size:
        return lambda s: np.zeros((len(wanted), B.shape[1], s.size), dtype=complex)
    form = cached_resolvent(A)
    if form.T.ndim == 1:
        residues = np.einsum("pk,km->kpm", wanted @ form.Q, form.inverse @ B).reshape(len(A), -1)
        return _summed(form.T, residues, (len(wanted), B.shape[1]))

    def substituted(s: np.ndarray) -> np.ndarray:
        _nonzero(s[:, None] - form.poles, s)
        return np.einsum("pi,imn->pmn", wanted, form.solve(np.repeat(B[:, :, None], s.size, axis=2), s))

    return substituted


def _summed(poles: np.ndarray, residues: np.ndarray, shape: tuple[int, int]) -> Callable[[np.ndarray], np.ndarray]:
    """Σ R/(s − p) of a real system, its conjugate pairs together."""
    turning, real = poles.imag > 0, poles.imag == 0
    pairs, own, rates = pole_sum(poles[turning], residues[turning]), residues[real].real, poles[real].real
    still = np.zeros_like(own)

    def evaluate(s: np.ndarray) -> np.ndarray:
        values = pairs(s)
        if rates.size:
            values = values + divided(own, still, s, s[:, None] - rates, "the model")
        return values.T.reshape(*shape, s.size)

    return evaluate


def _nonzero(below: np.ndarray, s: np.ndarray) -> np.ndarray:
    if not below.all():
        raise _infinite(complex(s[np.argwhere(below == 0)[0][0]]))
    return below


def _infinite(s: complex) -> LinearizationError:
    return LinearizationError(
        f"the response at s = {complex(s):.6g} is infinite: the model has an undamped pole there; leave that "
        "frequency out (for an integrator: start above 0)"
    )
