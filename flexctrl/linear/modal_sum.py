"""Sums over second-order terms at many s: the inner loop of a frequency response."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import can_compile
from flexctrl.kernels.native import Packed
from flexctrl.linear.direct import infinite
from flexctrl.linear.modal_loops import Summing, add_modes
from flexctrl.linear.modes import Modes

__all__ = ["ModalSum", "divided", "modal_sum", "outer", "pole_sum"]

CACHED = 8192
MANY, FEW = 8192, 32


@frozen(eq=False)
class ModalSum:
    """Σ (still + s moving)/(s² + d s + λ) for many s, as matrix products.

    Attributes
    ----------
    values, damping : numpy.ndarray, shape (k,)
        λ and d.
    omega, growth_squared : numpy.ndarray, shape (k,)
        √λ and 0, or 0 and −λ.
    still, moving : numpy.ndarray, shape (k, n_outputs · n_inputs)
    """

    values: np.ndarray
    damping: np.ndarray
    omega: np.ndarray
    growth_squared: np.ndarray
    still: np.ndarray
    moving: np.ndarray

    @cached_property
    def moves(self) -> bool:
        """Whether anything is seen of velocities."""
        return bool(self.moving.any())

    @cached_property
    def still_damped(self) -> np.ndarray:
        """d · still."""
        return self.damping[:, None] * self.still

    @cached_property
    def moving_damped(self) -> np.ndarray:
        """d · moving."""
        return self.damping[:, None] * self.moving

    @cached_property
    def _shares(self) -> np.ndarray:
        """still and, if anything is seen of velocities, moving beside it."""
        return np.ascontiguousarray(np.hstack([self.still, self.moving]) if self.moves else self.still)

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Shape (N, n_outputs · n_inputs)."""
        if s.real.any():
            turning = s[:, None] ** 2 + self.values + self.damping * s[:, None]
            return divided(self.still, self.moving, s, turning, "a mode")
        quick = self._compiled(s.imag) if self._worth_compiling(s.size) else None
        if quick is not None:
            return quick
        result = np.empty((s.size, self.still.shape[1]), dtype=complex)
        # pieces that stay in the cache: three times faster than all at once
        step = max(1, min(s.size, CACHED // max(1, self.values.size)))
        room = np.empty((2, step, self.values.size))
        for i in range(0, s.size, step):
            piece = s.imag[i : i + step, None]
            self._on_the_axis(piece, result[i : i + step], room[:, : len(piece)])
        return result

    def _worth_compiling(self, points: int) -> bool:
        return points * self.values.size > MANY and self.still.shape[1] <= FEW and can_compile()

    def _compiled(self, omega: np.ndarray) -> np.ndarray | None:
        """On the imaginary axis in compiled loops; None where that meets a pole."""
        points, shares = -(-omega.size // 8) * 8, self._shares
        at = np.empty(points)
        at[: omega.size], at[omega.size :] = omega, omega[-1]
        real, imag = np.empty((2, shares.shape[1], points))
        summing = Summing(
            points=points,
            terms=len(shares),
            channels=shares.shape[1],
            omega=np.ascontiguousarray(self.omega),
            growth_squared=np.ascontiguousarray(self.growth_squared),
            damping=np.ascontiguousarray(self.damping),
            still=shares.ravel(),
            at=at,
            real=real.ravel(),
            imag=imag.ravel(),
        )
        Packed(summing).bound(add_modes)()
        if not (np.isfinite(real).all() and np.isfinite(imag).all()):
            return None
        count = self.still.shape[1]
        found = np.empty((count, omega.size), dtype=complex)
        found.real, found.imag = real[:count, : omega.size], imag[:count, : omega.size]
        if self.moves:
            found.real -= omega * imag[count:, : omega.size]
            found.imag += omega * real[count:, : omega.size]
        return found.T

    def _on_the_axis(self, omega: np.ndarray, result: np.ndarray, room: np.ndarray) -> None:
        """With 1/(g + i d ω) = (g - i d ω)/(g² + d² ω²); g = (ω_i - ω)(ω_i + ω) keeps the difference to a near pole."""
        gap, size = room
        np.add(self.omega, omega, out=size)
        np.subtract(self.omega, omega, out=gap)
        gap *= size
        gap -= self.growth_squared
        np.multiply(self.damping, omega, out=size)
        size *= size
        size += gap * gap
        if not size.all():
            below = gap + 1j * self.damping * omega
            result[:] = divided(self.still, self.moving, 1j * omega[:, 0], below, "a mode")
            return
        np.reciprocal(size, out=size)
        gap *= size
        result.real, result.imag = gap @ self.still, -omega * (size @ self.still_damped)
        if self.moves:
            result.real += omega**2 * (size @ self.moving_damped)
            result.imag += omega * (gap @ self.moving)


def modal_sum(modes: Modes, damping: np.ndarray) -> ModalSum:
    """The sum over modes.

    Parameters
    ----------
    modes : Modes
    damping : numpy.ndarray, shape (k,)

    Returns
    -------
    ModalSum
    """
    still, moving = (outer(gain, modes.input_gain) for gain in (modes.output_gain, modes.output_rate_gain))
    return ModalSum(modes.omega_squared, damping, modes.omega, modes.growth**2, still, moving)


def pole_sum(poles: np.ndarray, residues: np.ndarray) -> ModalSum:
    """Σ R/(s − p) over conjugate pairs, given one of each.

    Parameters
    ----------
    poles : numpy.ndarray of complex, shape (k,)
    residues : numpy.ndarray of complex, shape (k, n_outputs · n_inputs)

    Returns
    -------
    ModalSum
    """
    size = np.abs(poles)
    still = -2.0 * (residues * poles.conj()[:, None]).real
    return ModalSum(size**2, -2.0 * poles.real, size, np.zeros(poles.size), still, 2.0 * residues.real)


def divided(still: np.ndarray, moving: np.ndarray, s: np.ndarray, below: np.ndarray, who: str) -> np.ndarray:
    """Σ_k (still_k + s moving_k) / below_k; a pole without residue counts nothing, another is an error.

    Parameters
    ----------
    still, moving : numpy.ndarray, shape (k, n_outputs · n_inputs)
    s : numpy.ndarray of complex, shape (N,)
    below : numpy.ndarray of complex, shape (N, k)
    who : str
        What has the poles.

    Returns
    -------
    numpy.ndarray of complex, shape (N, n_outputs · n_inputs)

    Raises
    ------
    LinearizationError
    """
    hit = below == 0
    if hit.any():
        where, mode = np.argwhere(hit).T
        residue = np.abs(still[mode]).max(axis=1) + np.abs(s[where] * moving[mode].max(axis=1, initial=0.0))
        if residue.any():
            raise infinite(complex(s[where[int(np.argmax(residue))]]), who)
        below = np.where(hit, 1.0, below)
    inverse = 1.0 / below
    result = inverse @ still
    return result + (s[:, None] * inverse) @ moving if moving.any() else result


def outer(output: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """c_k b_k for every pair of signals.

    Parameters
    ----------
    output : numpy.ndarray, shape (n_outputs, k)
    gain : numpy.ndarray, shape (k, n_inputs)

    Returns
    -------
    numpy.ndarray, shape (k, n_outputs · n_inputs)
    """
    return np.einsum("pk,km->kpm", output, gain).reshape(gain.shape[0], output.shape[0] * gain.shape[1])
