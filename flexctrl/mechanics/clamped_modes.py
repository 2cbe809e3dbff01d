"""Modes of a beam clamped at both ends, and their integrals with the shapes that move its ends.

Together with the cubic shapes of unit end motions they are the Craig–Bampton basis of a uniform beam (Craig & Bampton
1968): static shapes have no elastic energy in common with them. So have the shapes of stretch and twist, which are
polynomials. Lengths are over that of the beam, s = x/L.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from flexctrl.frozen import frozen

__all__ = ["ClampedModes", "HeldShapes", "clamped_modes", "held_shapes"]

_POINTS = 200


@frozen(eq=False)
class ClampedModes:
    """Integrals over s from 0 to 1 of the first modes φᵢ, ∫φᵢ² = 1, with the cubics N of (v₁, θ₁ L, v₂, θ₂ L).

    Attributes
    ----------
    stiffness : numpy.ndarray, shape (m,)
        ∫φ″², the fourth powers of the roots of cos β cosh β = 1.
    mass, rotary : numpy.ndarray, shape (4, m)
        ∫N φ and ∫N′ φ′.
    slope : numpy.ndarray, shape (m, m)
        ∫φᵢ′ φⱼ′.
    mean : numpy.ndarray, shape (m,)
        ∫φ.
    bow : numpy.ndarray, shape (2, m)
        ∫N′ φ′ of unit end rotations.
    drawn, drawn_ends : numpy.ndarray, shapes (m, m) and (2, m)
        ∫φᵢ′ φⱼ′ (s − ½), and of unit end rotations ∫N′ φ′ (s − ½).
    """

    stiffness: np.ndarray
    mass: np.ndarray
    rotary: np.ndarray
    slope: np.ndarray
    mean: np.ndarray
    bow: np.ndarray
    drawn: np.ndarray
    drawn_ends: np.ndarray


@cache
def clamped_modes(count: int) -> ClampedModes:
    """Return the integrals of the first modes.

    Parameters
    ----------
    count : int

    Returns
    -------
    ClampedModes
    """
    s, weights = np.polynomial.legendre.leggauss(_POINTS)
    s, weights = 0.5 * (s + 1.0), 0.5 * weights
    roots = np.array([_root(i) for i in range(1, count + 1)])
    shapes, slopes = np.array([_shape(b, s) for b in roots]).reshape(count, 2, _POINTS).transpose(1, 0, 2)
    N = np.array([1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2])
    dN = np.array([6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s])
    from_middle = weights * (s - 0.5)
    return ClampedModes(
        stiffness=roots**4,
        mass=(N * weights) @ shapes.T,
        rotary=(dN * weights) @ slopes.T,
        slope=(slopes * weights) @ slopes.T,
        mean=shapes @ weights,
        bow=(dN[[1, 3]] * weights) @ slopes.T,
        drawn=(slopes * from_middle) @ slopes.T,
        drawn_ends=(dN[[1, 3]] * from_middle) @ slopes.T,
    )


@frozen(eq=False)
class HeldShapes:
    """Integrals over s from 0 to 1 of shapes χᵢ of stretch or twist that are 0 at both ends.

    They are the integrals of Legendre's polynomials with ∫χᵢ′χⱼ′ = δᵢⱼ (Szabó & Babuška 1991): with the straight lines
    of the ends all polynomials of a degree, χ₁ the parabola.

    Attributes
    ----------
    ends : numpy.ndarray, shape (2, m)
        ∫(1 − s) χ and ∫s χ.
    mass : numpy.ndarray, shape (m, m)
        ∫χᵢ χⱼ.
    mean : numpy.ndarray, shape (m,)
        ∫χ.
    """

    ends: np.ndarray
    mass: np.ndarray
    mean: np.ndarray


@cache
def held_shapes(count: int) -> HeldShapes:
    """Return the integrals of the first shapes.

    Parameters
    ----------
    count : int

    Returns
    -------
    HeldShapes
    """
    s, weights = np.polynomial.legendre.leggauss(count + 2)
    s, weights = 0.5 * (s + 1.0), 0.5 * weights
    P = np.polynomial.legendre.legvander(2.0 * s - 1.0, count + 1).T
    k = np.arange(1, count + 1)
    shapes = (P[:-2] - P[2:]) / (2.0 * np.sqrt(2.0 * k + 1.0))[:, None]
    return HeldShapes(
        ends=(np.array([1.0 - s, s]) * weights) @ shapes.T,
        mass=(shapes * weights) @ shapes.T,
        mean=shapes @ weights,
    )


def clamped_shapes(count: int, s: np.ndarray) -> np.ndarray:
    """Return the first modes at shares of the length, shape (count, len(s))."""
    return np.array([_shape(_root(i), s)[0] for i in range(1, count + 1)]).reshape(count, len(s))


def _root(number: int) -> float:
    """The root of cos β cosh β = 1 near (number + ½) π."""
    middle = (number + 0.5) * np.pi
    from scipy.optimize import brentq

    return brentq(lambda b: np.cos(b) - 1.0 / np.cosh(b), middle - 0.1, middle + 0.1, xtol=1e-15)


def _shape(b: float, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A mode and its slope; hyperbolic functions taken apart, or their difference would lose all digits."""
    sums = np.sinh(b) - np.sin(b)
    ratio, rest = (np.cosh(b) - np.cos(b)) / sums, (np.cos(b) - np.sin(b) - np.exp(-b)) / sums
    falling, rising = 0.5 * (1.0 + ratio) * np.exp(-b * s), 0.5 * rest * np.exp(b * s)
    shape = falling + rising - np.cos(b * s) + ratio * np.sin(b * s)
    slope = b * (rising - falling + np.sin(b * s) + ratio * np.cos(b * s))
    return shape, slope
