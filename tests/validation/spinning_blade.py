"""Swaying of a clamped blade in its plane of rotation by Ritz's method, written independently of the package.

L = ρA = EI = 1. Unknowns are the stretch s(x) and the deflection v(x) in the turning axes, coupled by Coriolis forces:
the linearised energies are ½∫ EA s′² + N v′² + EI ((v′/λ)′)² − Ω² (s² + v²), with the steady stretch λ(x) and the pull
N = EA (λ − 1)/λ that the spin gives the blade. ``stretched`` False leaves λ at 1 and takes N = Ω² (1 − x²)/2.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre

SHAPES, POINTS = 20, 60


def lagging(spin: float, slenderness: float, stretched: bool) -> float:
    """The lowest ω at a spin; EA = slenderness²."""
    EA = slenderness**2
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    x, w = 0.5 * (nodes + 1.0), 0.5 * weights
    k = spin / slenderness
    stretch = np.cos(k * x) / np.cos(k) if stretched else np.ones_like(x)
    grows = -k * np.sin(k * x) / np.cos(k) if stretched else np.zeros_like(x)
    pull = EA * (stretch - 1.0) / stretch if stretched else 0.5 * spin**2 * (1.0 - x * x)
    place = Legendre.identity(domain=[0, 1])
    along = [place * Legendre.basis(i, domain=[0, 1]) for i in range(SHAPES)]
    across = [place * p for p in along]
    s, ds, v, dv, ddv = (
        np.column_stack([f.deriv(order)(x) if order else f(x) for f in family])
        for family, order in ((along, 0), (along, 1), (across, 0), (across, 1), (across, 2))
    )
    curvature = ddv / stretch[:, None] - dv * (grows / stretch**2)[:, None]

    def over(a: np.ndarray, b: np.ndarray, factor: np.ndarray | float = 1.0) -> np.ndarray:
        return a.T @ ((w * factor)[:, None] * b)

    none, mass_s, mass_v, turn = np.zeros((SHAPES, SHAPES)), over(s, s), over(v, v), 2.0 * spin * over(s, v)
    K = np.block([[EA * over(ds, ds), none], [none, over(curvature, curvature) + over(dv, dv, pull)]])
    M = np.block([[mass_s, none], [none, mass_v]])
    gyroscopic = np.block([[none, -turn], [turn.T, none]])
    still, unit = np.zeros_like(M), np.eye(2 * SHAPES)
    first_order = np.block([[still, unit], [-np.linalg.solve(M, K - spin**2 * M), -np.linalg.solve(M, gyroscopic)]])
    frequencies = np.linalg.eigvals(first_order).imag
    return float(frequencies[frequencies > 1e-6].min())
