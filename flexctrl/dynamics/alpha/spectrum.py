"""What generalised alpha does to an undamped oscillator: its numerical damping and its shift of the frequency."""

from __future__ import annotations

from functools import cache

import numpy as np

from flexctrl.errors import StructureError

__all__ = ["amplification", "damping_and_shift", "told_damping"]


def amplification(rho: float, x: float) -> np.ndarray:
    """Return the map of (q, h v, h² a) over a step for q̈ = −ω² q with ω h = x (a is the method's own acceleration).

    Parameters
    ----------
    rho : float
        Spectral radius at infinity, 0 … 1.
    x : float
        ω h.

    Returns
    -------
    numpy.ndarray, shape (3, 3)
    """
    if not (0.0 <= rho <= 1.0 and x > 0.0):
        raise StructureError(f"amplification: rho = {rho}, x = {x}; expected 0 ≤ rho ≤ 1 and x > 0")
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    onto = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1.0 - alpha_f) * x * x, 0.0, 1.0 - alpha_m]])
    start = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [-alpha_f * x * x, 0.0, -alpha_m]])
    return np.linalg.solve(onto, start)


def damping_and_shift(rho: float, x: float) -> tuple[float, float]:
    """Return the numerical damping ratio and the relative error of the frequency at ω h = x.

    Parameters
    ----------
    rho : float
    x : float
        Small enough that the motion still oscillates.

    Returns
    -------
    tuple of 2 floats
    """
    values = np.linalg.eigvals(amplification(rho, x))
    principal = values[np.argmax(values.imag)]
    exponent = np.log(principal)
    return float(-exponent.real / abs(exponent)), float(exponent.imag / x - 1.0)


@cache
def told_damping(rho: float) -> str:
    """Return a report's words on the damping of generalised alpha."""
    if rho == 1.0:
        return "no numerical damping"
    damping = damping_and_shift(rho, 0.1)[0]
    return f"spectral radius {rho:g} at infinite frequency, damping ratio {damping:.2g} at 63 steps a period"
