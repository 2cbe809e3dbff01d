"""The shapers of the literature: ZV, ZVD, ZVDD, extra-insensitive and unity-magnitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from flexctrl.design.shaper import Mode, Shaper, check_mode
from flexctrl.errors import ControllerError
from flexctrl.structure.freedoms import numbers

__all__ = ["ei", "um_zv", "um_zv_fit", "um_zvd", "um_zvd_fit", "zv", "zvd", "zvdd"]


def zv(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the zero-vibration shaper: two impulses half a damped period apart (Smith 1957).

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio, 0 ≤ ζ < 1.

    Returns
    -------
    Shaper
    """
    return _binomial(omega, zeta, 1)


def zvd(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the zero-vibration-and-derivative shaper: three impulses (Singer & Seering 1990).

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio, 0 ≤ ζ < 1.

    Returns
    -------
    Shaper
    """
    return _binomial(omega, zeta, 2)


def zvdd(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the shaper with two zero derivatives: four impulses.

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio, 0 ≤ ζ < 1.

    Returns
    -------
    Shaper
    """
    return _binomial(omega, zeta, 3)


def ei(omega: float, zeta: float = 0.0, tolerance: float = 0.05) -> Shaper:
    """Return the extra-insensitive shaper: the residual is ``tolerance`` at ω and zero on both sides of it.

    Exact without damping; with damping the curve fit of Singhose (0 < ζ ≤ 0.3, 0 < V ≤ 0.15), whose residual
    at ω is within 4 % of V (so its `Shaper.band` at exactly V may be empty: ask for 1.05 V).

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio.
    tolerance : float
        Residual V accepted at ω.

    Returns
    -------
    Shaper
    """
    check_mode(omega, zeta)
    V, z, period = tolerance, zeta, _damped_period(omega, zeta)
    if not 0 < numbers([V])[0] < 1:
        raise ControllerError(f"EI shaper: the tolerance {V} must lie between 0 and 1 (0.05 is usual)")
    if z == 0:
        return Shaper(((1 + V) / 4, (1 - V) / 2, (1 + V) / 4), (0.0, period / 2, period), (Mode(omega, z),))
    _check_fit("EI", z)
    first = 0.24968 + 0.24961 * V + 0.80008 * z + 1.23328 * V * z + 0.49599 * z**2 + 3.17316 * V * z**2
    last = 0.25149 + 0.21474 * V - 0.83249 * z + 1.41498 * V * z + 0.85181 * z**2 - 4.90094 * V * z**2
    middle = 0.4999 + 0.46159 * V * z + 4.26169 * V * z**2 + 1.75601 * V * z**3
    middle += 8.57843 * V**2 * z - 108.644 * V**2 * z**2 + 336.989 * V**2 * z**3
    return Shaper((first, 1 - first - last, last), (0.0, middle * period, period), (Mode(omega, z),))


def um_zv_fit(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the unity-magnitude ZV shaper {1, −1, 1} by curve fit (Singhose, Singer & Seering 1997).

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio ≤ 0.3.

    Returns
    -------
    Shaper
        With up to 0.06 % residual at ω; `um_zv` has none.
    """
    rows = ((0.16658, 0.29277, 0.075438, 0.21335), (0.33323, 0.0053322, 0.17914, 0.20125))
    return _unity_fit(omega, zeta, rows)


def um_zvd_fit(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the unity-magnitude ZVD shaper {1, −1, 1, −1, 1} by curve fit (Singhose et al. 1997).

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio ≤ 0.3.

    Returns
    -------
    Shaper
        With up to 0.02 % residual at ω; `um_zvd` has none.
    """
    rows = (
        (0.08945, 0.28411, 0.23013, 0.16401),
        (0.36613, -0.08833, 0.24048, 0.17001),
        (0.64277, 0.29103, 0.23262, 0.43784),
        (0.73228, 0.00992, 0.49385, 0.38633),
    )
    return _unity_fit(omega, zeta, rows)


def um_zv(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the unity-magnitude ZV shaper: quicker than ZV, but it excites modes above ω.

    The zero-residual equations are solved from the curve fit; without damping the times are T/6 and T/3.

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio ≤ 0.3.

    Returns
    -------
    Shaper
    """
    return _polished(um_zv_fit(omega, zeta))


def um_zvd(omega: float, zeta: float = 0.0) -> Shaper:
    """Return the unity-magnitude ZVD shaper: residual and its slope are zero at ω; excites modes above ω.

    Parameters
    ----------
    omega : float
        Undamped frequency of the mode, rad/s.
    zeta : float
        Damping ratio ≤ 0.3.

    Returns
    -------
    Shaper
    """
    return _polished(um_zvd_fit(omega, zeta))


def _binomial(omega: float, zeta: float, order: int) -> Shaper:
    check_mode(omega, zeta)
    K, half = math.exp(-zeta * math.pi / math.sqrt(1 - zeta**2)), _damped_period(omega, zeta) / 2
    amplitudes = tuple(math.comb(order, i) * K**i / (1 + K) ** order for i in range(order + 1))
    return Shaper(amplitudes, tuple(i * half for i in range(order + 1)), (Mode(omega, zeta),))


def _unity_fit(omega: float, zeta: float, rows: tuple[tuple[float, ...], ...]) -> Shaper:
    check_mode(omega, zeta)
    _check_fit("unity-magnitude", zeta)
    period = 2 * math.pi / omega  # the fit is in undamped periods
    times = [period * sum(c * zeta**k for k, c in enumerate(row)) for row in rows]
    amplitudes = tuple((-1.0) ** i for i in range(len(times) + 1))
    return Shaper(amplitudes, (0.0, *times), (Mode(omega, zeta),))


def _polished(fit: Shaper) -> Shaper:
    """The times nearest to a fit's at which the residual (and its derivatives, as far as they go) vanish."""
    from scipy.optimize import root

    (omega, zeta), signs = fit.modes[0], np.array(fit.amplitudes)
    pole = zeta + 1j * math.sqrt(1 - zeta**2)

    def misfit(phases: np.ndarray) -> np.ndarray:
        at = np.array([0.0, *phases])
        sums = [(signs * at**k) @ np.exp(pole * at) for k in range(len(phases) // 2)]
        return np.array([part for total in sums for part in (total.real, total.imag)])

    found: Callable[..., Any] = root
    solution = found(misfit, omega * np.array(fit.times[1:]), tol=1e-15)
    if np.abs(misfit(solution.x)).max() > 1e-11:
        raise ControllerError(f"no unity-magnitude shaper was found for a damping ratio of {zeta}")
    return Shaper(fit.amplitudes, (0.0, *(float(p) for p in solution.x / omega)), fit.modes)


def _damped_period(omega: float, zeta: float) -> float:
    return 2 * math.pi / (omega * math.sqrt(1 - zeta**2))


def _check_fit(what: str, zeta: float) -> None:
    if zeta > 0.3:
        raise ControllerError(f"{what} shaper: its fit holds up to a damping ratio of 0.3, not {zeta}; use zv or zvd")
