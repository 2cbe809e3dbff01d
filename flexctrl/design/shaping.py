"""Shaped commands: exact in continuous time, and as a filter on a sample grid."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.design.piecewise import PiecewisePolynomial, Trajectory, distinct, simplified
from flexctrl.design.shaper import Shaper
from flexctrl.errors import ControllerError, check_kind
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_seconds

__all__ = ["CoarseGridWarning", "Shaped", "check_grid", "fir"]


class CoarseGridWarning(UserWarning):
    """A shaper is run on samples too coarse for the fastest mode it is meant for."""


@frozen
class Shaped(Trajectory):
    """A trajectory convolved with a shaper, exactly in continuous time: Σ A_i r(t − t_i).

    Attributes
    ----------
    trajectory : Trajectory
        The command as it would be given unshaped.
    shaper : Shaper
        The impulses.
    """

    trajectory: Trajectory
    shaper: Shaper

    def __post_init__(self) -> None:
        check_kind(self.trajectory, Trajectory, "Shaped: trajectory", "one, as MinimumJerk(…)", ControllerError)
        check_kind(self.shaper, Shaper, "Shaped: shaper", "one, as zvd(omega)", ControllerError)

    def __call__(self, t: float) -> float:
        return self._value(t)

    @cached_property
    def _value(self) -> Callable[[float], float]:
        """The delayed copies added up beforehand, where they are polynomials."""
        pieces = simplified(self.trajectory)
        if isinstance(pieces, PiecewisePolynomial):
            return pieces.convolved(self.shaper.amplitudes, self.shaper.times)
        return self._copies

    @property
    def pieces(self) -> Trajectory:
        """The same trajectory as polynomials; itself where it is none."""
        return self._value if isinstance(self._value, PiecewisePolynomial) else self

    def along(self, times: np.ndarray) -> np.ndarray:
        value = self._value
        return value.along(times) if isinstance(value, PiecewisePolynomial) else super().along(times)

    def _copies(self, t: float) -> float:
        base = self.trajectory
        return sum([a * base(t - delay) for a, delay in zip(self.shaper.amplitudes, self.shaper.times, strict=True)])

    @cached_property
    def derivative(self) -> Trajectory:
        return Shaped(self.trajectory.derivative, self.shaper)

    @property
    def breaks(self) -> tuple[float, ...]:
        return distinct(b + delay for b in self.trajectory.breaks for delay in self.shaper.times)

    @property
    def shortest_period(self) -> float:
        return min(self.shaper.shortest_period, self.trajectory.shortest_period)


def check_grid(shortest_period: float, sample_time: float) -> None:
    """Warn if samples are too coarse for a shaper: more than a twentieth of its shortest period.

    Parameters
    ----------
    shortest_period : float
        Seconds, `Shaper.shortest_period`.
    sample_time : float
        Seconds.

    Warns
    -----
    CoarseGridWarning
    """
    if sample_time > shortest_period / 20:
        warnings.warn(
            f"samples of {sample_time:g} s are coarser than a twentieth of the shaper's shortest period "
            f"{shortest_period:g} s: it will leave vibration behind; sample faster or shape the slower modes only",
            CoarseGridWarning,
            stacklevel=3,
        )


def fir(shaper: Shaper, sample_time: float, *, source: str, shaped: str) -> Any:
    """Return the shaper as a sampled filter, a finite impulse response on the sample grid.

    Each impulse is shared by the two samples beside it, corrected (least change) so that the gain is one and
    the residual at each design mode is exactly that of the continuous shaper.

    Parameters
    ----------
    shaper : Shaper
        The impulses.
    sample_time : float
        Seconds.
    source, shaped : str
        Names of its input and output.

    Returns
    -------
    control.StateSpace
        A chain of delays, as long as the shaper in samples.

    Warns
    -----
    CoarseGridWarning
        If a design mode has fewer than 20 samples a period.
    """
    import control

    check_kind(shaper, Shaper, "fir: shaper", "one, as zvd(omega)", ControllerError)
    for name in (source, shaped):
        check_kind(name, str, "fir: a signal", "the name of one", ControllerError)
    check_seconds(sample_time, "sample_time", "fir")
    check_grid(shaper.shortest_period, sample_time)
    taps = _taps(shaper, sample_time)
    n = len(taps) - 1
    source_column = np.eye(n, 1)
    return control.StateSpace(
        np.eye(n, k=-1), source_column, taps[None, 1:], taps[None, :1], sample_time, inputs=[source], outputs=[shaped]
    )


def _taps(shaper: Shaper, sample_time: float) -> np.ndarray:
    places = np.array(shaper.times) / sample_time
    places = np.where(np.abs(places - np.rint(places)) < 1e-9, np.rint(places), places)
    below = np.floor(places).astype(int)
    share = places - below
    taps = np.zeros(below[-1] + 2)
    np.add.at(taps, below, (1 - share) * np.array(shaper.amplitudes))
    np.add.at(taps, below + 1, share * np.array(shaper.amplitudes))
    used = np.flatnonzero(taps)
    taps[used] += _correction(shaper, taps[used], used * sample_time)
    return np.trim_zeros(taps, "b")


def _correction(shaper: Shaper, taps: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Least change of the taps that keeps the gain and the spectrum Σ A e^(−s t) at each design pole."""
    poles = np.array([0.0, *(m.omega * (-m.zeta + 1j * math.sqrt(1 - m.zeta**2)) for m in shaper.modes)])
    rows = np.exp(-np.multiply.outer(poles, instants))
    missing = np.exp(-np.multiply.outer(poles, shaper.times)) @ np.array(shaper.amplitudes) - rows @ taps
    rows, missing = np.vstack([rows.real, rows.imag]), np.concatenate([missing.real, missing.imag])
    return np.linalg.lstsq(rows, missing, rcond=1e-12)[0]
