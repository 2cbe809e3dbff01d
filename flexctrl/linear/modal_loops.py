"""Sums over modes at many frequencies, eight frequencies at once in compiled loops."""

from __future__ import annotations

from flexctrl.frozen import frozen
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import Reals

__all__ = ["Summing", "add_modes"]


@frozen(eq=False)
class Summing:
    """Σ still/(ω_k² − growth² − ω² + i d ω) at many ω.

    Attributes
    ----------
    points : int
        How many ω, a multiple of eight.
    terms, channels : int
    omega, growth_squared, damping : numpy.ndarray, shape (terms,)
    still : numpy.ndarray, shape (terms · channels,)
    at : numpy.ndarray, shape (points,)
        ω.
    real, imag : numpy.ndarray, shape (channels · points,)
        Found.
    """

    points: int
    terms: int
    channels: int
    omega: Reals
    growth_squared: Reals
    damping: Reals
    still: Reals
    at: Reals
    real: Reals
    imag: Reals


def add_modes(m: Summing) -> int:
    """Sum; (ω_k − ω)(ω_k + ω) keeps the difference to a near pole."""
    for i in range(0, m.points, 8):
        here = eight(m.at[i:])
        for c in range(i, m.channels * m.points, m.points):
            put(m.real[c:], 0.0)
            put(m.imag[c:], 0.0)
        for k in range(m.terms):
            gap = (m.omega[k] - here) * (m.omega[k] + here) - m.growth_squared[k]
            drag = m.damping[k] * here
            inverse = 1.0 / (gap * gap + drag * drag)
            gap = gap * inverse
            drag = drag * inverse
            for c in range(m.channels):
                share = m.still[k * m.channels + c]
                place = c * m.points + i
                put(m.real[place:], eight(m.real[place:]) + share * gap)
                put(m.imag[place:], eight(m.imag[place:]) - share * drag)
    return 0
