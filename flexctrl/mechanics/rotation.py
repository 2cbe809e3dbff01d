"""Rotations: as casadi expressions for the kernels, as arrays for the drivers."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.kernels.kernel import Kernel

_ETA = (
    *(0.08333333333333333, 0.0013888888888888493, 3.3068783069078855e-05, 8.267195758525202e-07),
    *(2.0876758315209403e-08, 5.28417794137108e-10, 1.3383265242757227e-11, 3.386709585497541e-13),
    *(8.671092499832682e-15, 2.0016174875509711e-16, 8.022753758112899e-18, -1.1632690148455092e-19),
    *(2.1135102640476063e-20, -6.650216022370511e-22, 1.8721620991907154e-23),
)
"""(1 − (x/2) cot(x/2))/x² as a polynomial in x², by Chebyshev's points of 0 ≤ x² ≤ 10."""


_ABOVE = (
    *(0.1567005519014545, 0.37623227974137, 0.32500369379038174, 0.12213847162823188, 0.0190057068906299),
    *(0.000916612748130235, 2.68329980173041e-06),
)
_BELOW = (
    *(0.09975866968137832, 0.30302524987053703, 0.3499363083130913, 0.191358408398208, 0.050152210334620646),
    *(0.00558644680067099, 0.00018270660149372035),
)
"""φ/sin φ as a quotient of polynomials in cos φ, by Chebyshev's points of 0 ≤ φ ≤ π/2: right to 6e-17."""


_SINE = (
    *(1.0, -0.1666666666666653, 0.00833333333331891, -0.00019841269835498102),
    *(2.7557318089388517e-06, -2.5051987209390023e-08, 1.6051867549565362e-10, -7.425343761199178e-13),
)
_VERSINE = (
    *(0.5, -0.04166666666666659, 0.0013888888888880858, -2.4801587298373496e-05),
    *(2.755731859227031e-07, -2.0876689528588596e-09, 1.1466751414244952e-11, -4.656073212874717e-14),
)
"""sin φ/φ and (1 − cos φ)/φ² as polynomials in φ², by Chebyshev's points of 0 ≤ φ² ≤ 2: right to 5e-17."""

NEAR = 0.8
"""What each component of a rotation vector may be for those polynomials [rad]."""


def rotation_vector(R: ca.SX) -> ca.SX:
    """Return θ with R = exp(θ×), |θ| < π (casadi).

    θ = (|θ|/sin|θ|) s with 2 s the axial vector of R − Rᵀ. The quotient is one of polynomials of the cosine of half
    the angle: smooth through zero, and no arctangent.
    """
    import casadi as ca

    s, c = _sine_and_cosine(R)
    # near half a turn, what 1 + c is, is in the sine alone
    return _vector(s, 0.5 * ca.if_else(c > 0.0, 1.0 + c, ca.dot(s, s) / (1.0 + ca.fabs(c))))


def bend_vector(R: ca.SX) -> ca.SX:
    """Return the same of what is not turned by nearly half a turn (casadi), without a quotient for that.

    It is right to 1e-13 of itself up to 3.1 rad.
    """
    s, c = _sine_and_cosine(R)
    return _vector(s, 0.5 + 0.5 * c)


def _sine_and_cosine(R: ca.SX) -> tuple[ca.SX, ca.SX]:
    import casadi as ca

    s = 0.5 * ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return s, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)


def _vector(s: ca.SX, square: ca.SX) -> ca.SX:
    """The rotation vector along s; ``square`` is that of the cosine of half its angle."""
    import casadi as ca

    half = ca.sqrt(square)
    return _polynomial(half, _ABOVE) / (half * _polynomial(half, _BELOW)) * s


def _polynomial(x: ca.SX, coefficients: tuple[float, ...]) -> ca.SX:
    """Return a polynomial, coefficients from the lowest power up; even and odd powers apart: half the waiting."""
    import casadi as ca

    square = x * x
    before, last = ca.SX(coefficients[-1]), ca.SX(coefficients[-2])
    for coefficient in coefficients[-3::-1]:
        before, last = last, before * square + coefficient
    return last + x * before


def rotation_of(theta: ca.SX) -> ca.SX:
    """Return exp(θ×) (casadi), smooth through zero; sine and cosine from the tangent of half the angle."""
    import casadi as ca

    square = ca.dot(theta, theta)
    small = square < 1e-8
    angle = ca.sqrt(ca.if_else(small, 1.0, square))
    half = ca.tan(0.5 * angle)
    quotient = 2.0 * half / (angle * (1.0 + half * half))
    a = ca.if_else(small, 1.0 - square / 6.0, quotient)
    b = ca.if_else(small, 0.5 - square / 24.0, quotient * half / angle)
    return _rotation(theta, a, b)


def near_rotation_of(theta: ca.SX) -> ca.SX:
    """Return exp(θ×) (casadi) of components up to `NEAR`: by polynomials, without roots and quotients."""
    import casadi as ca

    square = ca.dot(theta, theta)
    return _rotation(theta, _polynomial(square, _SINE), _polynomial(square, _VERSINE))


def _rotation(theta: ca.SX, a: ca.SX, b: ca.SX) -> ca.SX:
    """1 + a θ× + b θ×θ×."""
    import casadi as ca

    K = ca.skew(theta)
    return ca.DM.eye(3) + a * K + b * (K @ K)


def inverse_tangent(theta: ca.SX, v: ca.SX) -> ca.SX:
    """Return T(θ)⁻ᵀ v = v + ½ θ×v + η θ×(θ×v) (casadi), with η = (1 − (|θ|/2) cot(|θ|/2))/|θ|².

    T maps the rate of the rotation vector to the spatial spin, so T⁻ᵀ carries a moment conjugate to
    the rotation vector to a moment about space axes (Cardona & Géradin 1988). η is a polynomial in |θ|², right to
    1e-16 up to half a turn, beyond which no rotation vector goes.
    """
    import casadi as ca

    eta = _polynomial(ca.dot(theta, theta), _ETA)
    turned = ca.cross(theta, v)
    return v + 0.5 * turned + eta * ca.cross(theta, turned)


@cache
def turn_kernel(rotation: Callable[[ca.SX], ca.SX] = rotation_of) -> Kernel:
    """Return the kernel (R, θ) → exp(θ×) R, row by row, with R's round-off drift from orthonormality removed.

    Parameters
    ----------
    rotation : callable
        `rotation_of`, or `near_rotation_of`.

    Returns
    -------
    Kernel
    """
    import casadi as ca

    from flexctrl.kernels.kernel import Kernel

    rows, theta = ca.SX.sym("R", 9), ca.SX.sym("theta", 3)
    turned = turned_rows(rows, rotation(theta))
    return Kernel("turn", ca.vertcat(rows, theta), ca.SX.sym("p", 0), turned, replaces=True)


def turned_rows(rows: ca.SX, by: ca.SX) -> ca.SX:
    """Return a rotation times R, R given and returned row by row, nearer to orthonormal than R.

    Its first two rows are made so to first order in what they are not; the third is across them.
    """
    import casadi as ca

    R = ca.reshape(rows, 3, 3).T
    one, two = by[0, :] @ R, by[1, :] @ R
    skew = 0.5 * ca.dot(one, two)
    first, second = ((1.5 - 0.5 * ca.dot(own, own)) * own - skew * other for own, other in ((one, two), (two, one)))
    return ca.vertcat(first.T, second.T, ca.cross(first, second).T)


def exponential(theta: np.ndarray) -> np.ndarray:
    """Return exp(θ×) for rotation vectors of shape (n, 3), as matrices of shape (n, 3, 3)."""
    square = np.einsum("ni,ni->n", theta, theta)
    small = square < 1e-8
    angle = np.sqrt(np.where(small, 1.0, square))
    a = np.where(small, 1.0 - square / 6.0, np.sin(angle) / angle)
    b = np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(angle)) / (angle * angle))
    x, y, z = theta.T
    R = b[:, None, None] * np.einsum("ni,nj->nij", theta, theta)
    diagonal = 1.0 - b * square
    R[:, 0, 0] += diagonal
    R[:, 1, 1] += diagonal
    R[:, 2, 2] += diagonal
    for i, j, part in ((1, 0, z), (2, 1, x), (0, 2, y)):
        R[:, i, j] += a * part
        R[:, j, i] -= a * part
    return R


def logarithm(R: np.ndarray) -> np.ndarray:
    """Return rotation vectors, shape (n, 3), |θ| ≤ π, of matrices of shape (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def orthonormal(R: np.ndarray) -> np.ndarray:
    """Return R (n, 3, 3) with its round-off drift from orthonormality removed (one Newton step)."""
    return R @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(R, -1, -2) @ R)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a × b along the last axis; quicker than numpy.cross for small arrays."""
    c = np.empty(np.broadcast_shapes(a.shape, b.shape))
    c[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    c[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    c[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return c
