"""Where to evaluate a frequency response so that no peak and no anti-resonance is missed."""

from __future__ import annotations

import numpy as np

from flexctrl.linear.transfer import Transfer

__all__ = ["peak_grid", "refined"]

OFFSETS = np.array([0, 0.2, 0.4, 0.6, 0.8, 1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 7, 10, 14, 20])
PER_DECADE = 40
UNDAMPED = 1e-6
SHARP = 1e-9
CLOSEST = 1e-7


def peak_grid(poles: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Logarithmic grid with every pole's peak in it: ω_d ± multiples of its half width.

    Parameters
    ----------
    poles : numpy.ndarray of complex
        1/s.
    span : tuple of two floats
        rad/s, above 0.

    Returns
    -------
    numpy.ndarray
        Ascending, rad/s. A pole without damping (or with a mere rounding of it) is left out, its flanks are in.
    """
    low, high = span
    count = max(2, int(np.ceil(PER_DECADE * np.log10(high / low))) + 1)
    points = [np.geomspace(low, high, count)]
    for pole in poles[poles.imag > 0]:
        width = max(abs(pole.real), UNDAMPED * abs(pole))
        sharp = abs(pole.real) <= SHARP * abs(pole)
        offsets = OFFSETS[1:] if sharp else OFFSETS
        points += [pole.imag + width * offsets, pole.imag - width * offsets]
        crest = pole.imag**2 - pole.real**2
        if not sharp and crest > 0.0:
            points.append(np.array([np.sqrt(crest)]))
    grid = np.unique(np.concatenate(points))
    return grid[(grid >= low) & (grid <= high)]


def refined(evaluate: Transfer, omega: np.ndarray, most: int, tolerance: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Halve intervals until log H, read linearly between points, is right to `tolerance` in the middle.

    Sharp minima (anti-resonances) are followed down to a relative width of 1e-7.

    Parameters
    ----------
    evaluate : callable
        H(s).
    omega : numpy.ndarray, shape (N,)
    most : int
        No further refinement beyond this number of points.
    tolerance : float

    Returns
    -------
    omega : numpy.ndarray, shape (N',)
    H : numpy.ndarray of complex, shape (n_outputs, n_inputs, N')
    """
    H = evaluate(1j * omega)
    open_left = np.arange(omega.size - 1)
    while open_left.size and omega.size + open_left.size <= most:
        left, right = omega[open_left], omega[open_left + 1]
        # off the middle where the interval is narrow: between the flanks of an undamped pole lies the pole itself
        middle = np.where(right - left < 1e-5 * left, left + 0.47 * (right - left), np.sqrt(left * right))
        new = evaluate(1j * middle)
        rough = _misread(H[..., open_left], new, H[..., open_left + 1]) > tolerance
        rough &= (right - left) > CLOSEST * left
        order = np.argsort(np.concatenate([omega, middle]), kind="stable")
        fresh = np.concatenate([np.zeros(omega.size, bool), rough])[order]
        omega = np.concatenate([omega, middle])[order]
        H = np.concatenate([H, new], axis=-1)[..., order]
        at = np.flatnonzero(fresh)
        open_left = np.unique(np.concatenate([at - 1, at]))
    return omega, H


def _misread(left: np.ndarray, middle: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Largest relative error over the channels of the geometric mean against the middle."""
    tiny = np.finfo(float).tiny
    mean = np.sqrt(left) * np.sqrt(right)
    mean = np.where((np.conj(mean) * (left + right)).real < 0, -mean, mean)
    wrong = np.abs(mean - middle) / np.maximum(np.maximum(np.abs(middle), np.abs(mean)), tiny)
    return wrong.reshape(-1, wrong.shape[-1]).max(axis=0, initial=0.0)
