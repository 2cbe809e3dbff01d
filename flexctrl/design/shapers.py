"""Input shapers: a few impulses that move a flexible machine without leaving it swinging."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, overload

import numpy as np

from flexctrl.design.controller import ControllerError

__all__ = [
    "Mode",
    "Shaper",
    "convolve",
    "ei",
    "um_zv",
    "um_zv_fit",
    "um_zvd",
    "um_zvd_fit",
    "zv",
    "zvd",
    "zvdd",
]


class Mode(NamedTuple):
    """A vibration a shaper is designed for: undamped frequency (rad/s) and damping ratio."""

    omega: float
    zeta: float = 0.0


@dataclass(frozen=True)
class Shaper:
    """Impulses A_i at times t_i that a command is convolved with: r(t) → Σ A_i r(t − t_i).

    Attributes
    ----------
    amplitudes : tuple of float
        Sum to one, so that a shaped move ends where the move does.
    times : tuple of float
        Increasing, from 0, s.
    modes : tuple of Mode
        What it was designed for.
    """

    amplitudes: tuple[float, ...]
    times: tuple[float, ...]
    modes: tuple[Mode, ...] = ()

    def __post_init__(self) -> None:
        values = np.array([*self.amplitudes, *self.times], dtype=float)
        if len(self.amplitudes) != len(self.times) or not self.times or not np.isfinite(values).all():
            raise ControllerError(f"a shaper needs as many finite amplitudes as times: {self.amplitudes}, {self.times}")
        if self.times[0] < 0 or any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ControllerError(f"the times of a shaper must increase from 0 or later: {self.times}")
        if abs(sum(self.amplitudes) - 1) > 1e-9:
            raise ControllerError(f"the amplitudes of a shaper must sum to 1, not {sum(self.amplitudes)}")

    @property
    def duration(self) -> float:
        """Time it adds to a command, s."""
        return self.times[-1]

    @property
    def shortest_period(self) -> float:
        """Shortest undamped period of its modes, s; inf without modes."""
        return 2 * math.pi / max((mode.omega for mode in self.modes), default=0.0) if self.modes else math.inf

    @overload
    def residual(self, omega: float, zeta: float = ...) -> float: ...
    @overload
    def residual(self, omega: np.ndarray, zeta: float = ...) -> np.ndarray: ...
    def residual(self, omega: Any, zeta: float = 0.0) -> Any:
        """Return the vibration left behind, relative to that after one unit impulse at the last time.

        V = e^(−ζ ω t_n) |Σ A_i exp((ζ ω + i ω √(1−ζ²)) t_i)| (Singer & Seering 1990).

        Parameters
        ----------
        omega : float or numpy.ndarray
            Undamped frequency of the vibrating mode, rad/s.
        zeta : float
            Its damping ratio, 0 ≤ ζ < 1.

        Returns
        -------
        float or numpy.ndarray
            Fraction; 0.05 is the usual bound.
        """
        _check_damping(zeta)
        pole = zeta + 1j * math.sqrt(1 - zeta**2)
        phases = np.multiply.outer(np.asarray(omega, dtype=float) * pole, np.array(self.times) - self.duration)
        left = np.abs(np.exp(phases) @ np.array(self.amplitudes))
        return float(left) if left.ndim == 0 else left

    def band(self, omega: float, zeta: float = 0.0, tolerance: float = 0.05) -> tuple[float, float]:
        """Return the frequencies around ``omega`` between which the residual stays within the tolerance.

        Parameters
        ----------
        omega : float
            A frequency inside, rad/s.
        zeta : float
            Damping ratio of the vibrating mode.
        tolerance : float
            Largest residual allowed.

        Returns
        -------
        tuple of float
            Lowest and highest frequency, rad/s; both ``omega`` if the residual there is too large already, and
            a highest of inf if it never grows too large (strong damping).
        """
        _check_mode(omega, zeta)
        return self._edge(omega, zeta, tolerance, -1), self._edge(omega, zeta, tolerance, +1)

    def insensitivity(self, omega: float, zeta: float = 0.0, tolerance: float = 0.05) -> float:
        """Return the width of `band` relative to ``omega``.

        Parameters
        ----------
        omega : float
            Frequency the shaper is meant for, rad/s.
        zeta : float
            Damping ratio.
        tolerance : float
            Largest residual allowed.

        Returns
        -------
        float
            (ω_high − ω_low)/ω, e.g. 0.2871 for ZVD at 5 %.
        """
        low, high = self.band(omega, zeta, tolerance)
        return (high - low) / omega

    def _edge(self, omega: float, zeta: float, tolerance: float, direction: int) -> float:
        from scipy.optimize import brentq

        level = tolerance * (1 + 1e-9)  # a hump that just touches the tolerance stays inside
        for grid in self._scan(omega, tolerance, direction):
            beyond = np.flatnonzero(self.residual(grid, zeta) > level)
            if beyond.size and beyond[0] == 0:
                return omega
            if beyond.size:
                near, far = grid[beyond[0] - 1], grid[beyond[0]]
                return float(brentq(lambda w: self.residual(w, zeta) - level, near, far, xtol=1e-14 * omega))
        return math.inf if direction > 0 else 0.0

    def _scan(self, omega: float, tolerance: float, direction: int) -> Iterator[np.ndarray]:
        """Overlapping runs of frequencies, close enough that no rise above the tolerance is missed."""
        slope = max(sum(map(abs, self.amplitudes)) * self.duration, 1e-9 / omega)
        step, end = 0.1 * tolerance / slope, omega if direction < 0 else 20 * omega
        for first in np.arange(0.0, end, 1000 * step):
            offsets = np.minimum(first + step * np.arange(1001), end)
            yield omega + direction * offsets


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
    _check_mode(omega, zeta)
    V, z, period = tolerance, zeta, _damped_period(omega, zeta)
    if not 0 < V < 1:
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


def convolve(*shapers: Shaper) -> Shaper:
    """Return the shaper that does what all of them do: one for several modes.

    Parameters
    ----------
    *shapers : Shaper
        One per mode; none gives the unit impulse.

    Returns
    -------
    Shaper
        Impulses at equal times are merged.
    """
    amplitudes, times = np.ones(1), np.zeros(1)
    for shaper in shapers:
        amplitudes = np.multiply.outer(amplitudes, shaper.amplitudes).ravel()
        times = np.add.outer(times, shaper.times).ravel()
    order = np.argsort(times, kind="stable")
    amplitudes, times = amplitudes[order], times[order]
    starts = np.flatnonzero(np.diff(times, prepend=-np.inf) > 1e-12 * times[-1])
    merged = np.add.reduceat(amplitudes, starts)
    modes = tuple(dict.fromkeys(mode for shaper in shapers for mode in shaper.modes))
    return Shaper(tuple(merged.tolist()), tuple(times[starts].tolist()), modes)


def _binomial(omega: float, zeta: float, order: int) -> Shaper:
    _check_mode(omega, zeta)
    K, half = math.exp(-zeta * math.pi / math.sqrt(1 - zeta**2)), _damped_period(omega, zeta) / 2
    amplitudes = tuple(math.comb(order, i) * K**i / (1 + K) ** order for i in range(order + 1))
    return Shaper(amplitudes, tuple(i * half for i in range(order + 1)), (Mode(omega, zeta),))


def _unity_fit(omega: float, zeta: float, rows: tuple[tuple[float, ...], ...]) -> Shaper:
    _check_mode(omega, zeta)
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


def _check_mode(omega: float, zeta: float) -> None:
    if not (omega > 0 and math.isfinite(omega)):
        raise ControllerError(f"shaper: the frequency {omega} rad/s must be > 0")
    _check_damping(zeta)


def _check_damping(zeta: float) -> None:
    if not 0 <= zeta < 1:
        raise ControllerError(f"shaper: the damping ratio {zeta} must be at least 0 and below 1")
