"""An input shaper: a few impulses that move a flexible machine without leaving it swinging."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from flexctrl.design.piecewise import reals
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Mode", "Shaper", "check_mode", "convolve"]


class Mode(NamedTuple):
    """A vibration a shaper is designed for: undamped frequency (rad/s) and damping ratio."""

    omega: float
    zeta: float = 0.0


@frozen
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
        # Plain floats: numpy's scalars would make every evaluation of a shaped command several times slower.
        object.__setattr__(self, "amplitudes", reals(self.amplitudes, "shaper: amplitudes"))
        object.__setattr__(self, "times", reals(self.times, "shaper: times"))
        object.__setattr__(self, "modes", tuple(Mode(float(m[0]), float(m[1])) for m in self.modes))
        values = np.array([*self.amplitudes, *self.times], dtype=float)
        if len(self.amplitudes) != len(self.times) or not self.times or not np.isfinite(values).all():
            raise ControllerError(f"a shaper needs as many finite amplitudes as times: {self.amplitudes}, {self.times}")
        if self.times[0] < 0 or any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ControllerError(f"the times of a shaper must increase from 0 or later: {self.times}")
        if abs(sum(self.amplitudes) - 1) > 1e-9:
            raise ControllerError(f"the amplitudes of a shaper must sum to 1, not {sum(self.amplitudes)}")

    def plot(self) -> Figure:
        """Draw the impulses, and what vibration they leave over frequency.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.design import shaper_figure

        return shaper_figure(self)

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
        check_mode(omega, zeta)
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
        """Overlapping runs of frequencies, so close that no rise of a twentieth above the tolerance is missed."""
        slope = max(sum(map(abs, self.amplitudes)) * self.duration, 1e-9 / omega)
        step, end = 0.1 * tolerance / slope, omega if direction < 0 else 20 * omega
        for first in np.arange(0.0, end, 1000 * step):
            offsets = np.minimum(first + step * np.arange(1001), end)
            yield omega + direction * offsets


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


def check_mode(omega: float, zeta: float) -> None:
    """Raise a `ControllerError` unless ω > 0 and 0 ≤ ζ < 1."""
    if not 0 < numbers([omega])[0] < math.inf:
        raise ControllerError(f"shaper: the frequency {omega!r} rad/s must be > 0")
    _check_damping(zeta)


def _check_damping(zeta: float) -> None:
    if not 0 <= numbers([zeta])[0] < 1:
        raise ControllerError(f"shaper: the damping ratio {zeta} must be at least 0 and below 1")
