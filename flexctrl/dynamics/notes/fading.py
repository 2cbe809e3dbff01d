"""What steps do to what vibrates: how much of it they damp away, and by how much they turn it too slowly."""

from __future__ import annotations

import math

from flexctrl.dynamics.alpha.method import AdaptiveAlpha, GeneralizedAlpha
from flexctrl.dynamics.alpha.spectrum import damping_and_shift
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.methods.midpoint import ConservingMidpoint
from flexctrl.dynamics.steps import Integrator

__all__ = ["fading", "radius"]


def radius(method: Integrator) -> float:
    """Return the spectral radius of the steps of a method at infinite frequency; NaN for one that is not told of.

    Parameters
    ----------
    method : Integrator

    Returns
    -------
    float
    """
    method = method.method if isinstance(method, Richardson) else method
    if isinstance(method, AdaptiveAlpha | GeneralizedAlpha):
        return method.rho
    return 1.0 if isinstance(method, ConservingMidpoint) else math.nan


def fading(method: Integrator, turned: float, angle: float) -> tuple[float, float]:
    """Return the power of e by which a vibration is damped by steps, and by how much they have it lag [rad].

    Parameters
    ----------
    method : Integrator
    turned : float
        What it turns by in a step [rad].
    angle : float
        What it turns by in all [rad].

    Returns
    -------
    float, float
        0 for methods that resolve what they do not damp.
    """
    rho = radius(method)
    if isinstance(method, Richardson) or math.isnan(rho) or not turned > 0.0:
        return 0.0, 0.0
    damping, shift = damping_and_shift(rho, turned)
    return damping * angle, abs(shift) * angle
