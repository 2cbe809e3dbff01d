"""What a loop's frequency response says: margins, sensitivity peaks, H-infinity norm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.grid import peak_grid, refined
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction import Reduced
from flexctrl.linear.response import response_span
from flexctrl.linear.transfer import transfer
from flexctrl.study.loop import Loop, check_loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Crossing", "Margins", "Peak", "loop_grid", "margins", "peak_gain", "phase_crossings"]

MOST_POINTS = 20_000
ON_AXIS = 1e-12
NOISE = 1e-11
PAST = 30.0
FAINT = 1e-12


@frozen
class Peak:
    """A largest value and where it is.

    Attributes
    ----------
    value : float
        Infinite where the response has no bound.
    omega : float
        rad/s.
    """

    value: float
    omega: float


@frozen
class Crossing:
    """Where the loop crosses the unit circle or the negative real axis.

    Attributes
    ----------
    omega : float
        rad/s.
    margin : float
        Phase margin in rad (unit circle), or the gain factor −1/L (negative real axis).
    """

    omega: float
    margin: float


@frozen
class Margins:
    """How far a closed loop is from instability.

    Attributes
    ----------
    stable : bool
        Whether the closed loop is stable, from its poles (see :meth:`Loop.is_stable`). The margins of an
        unstable loop say nothing.
    gain_up, gain_down : Crossing
        Smallest factor above 1 and largest below 1 that bring the loop to −1; infinite and 0 if there is none.
    phase : Crossing
        The smallest phase margin in magnitude, rad in (−π, π]; infinite if the gain never crosses 1.
    delay : Crossing
        The smallest delay (s) that brings the loop to −1; infinite if there is none.
    modulus : Peak
        min |1 + L|, the distance to −1, and where.
    sensitivity, complementary : Peak
        Ms = max |1/(1 + L)| and Mt = max |L/(1 + L)|.
    gain_crossings, phase_crossings : tuple of Crossing
        All of them: |L| = 1 with phase margins, and negative real L with gain factors.
    loop : Loop
    """

    stable: bool
    gain_up: Crossing
    gain_down: Crossing
    phase: Crossing
    delay: Crossing
    modulus: Peak
    sensitivity: Peak
    complementary: Peak
    gain_crossings: tuple[Crossing, ...]
    phase_crossings: tuple[Crossing, ...]
    loop: Loop = field(repr=False)

    @cached_property
    def verdict(self) -> str:
        """``stable``, ``on the verge (undamped)`` (see :meth:`Loop.is_marginal`) or ``UNSTABLE``."""
        return "on the verge (undamped)" if self.loop.is_marginal() else "stable" if self.stable else "UNSTABLE"

    def plot(self) -> Figure:
        """Draw the loop with its margins: Bode, Nyquist, sensitivities.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.loops import margins_figure

        return margins_figure(self)

    def __str__(self) -> str:
        hz = 2 * np.pi
        lines = [f"closed loop {self.verdict}{': the margins mean nothing' if self.verdict == 'UNSTABLE' else ''}"]
        lines += [
            f"gain margin   {self.gain_down.margin:.4g} … {self.gain_up.margin:.4g} "
            f"({20 * np.log10(self.gain_up.margin):.4g} dB) at {self.gain_up.omega / hz:.5g} Hz",
            f"phase margin  {np.degrees(self.phase.margin):.4g} deg at {self.phase.omega / hz:.5g} Hz",
            f"delay margin  {self.delay.margin:.4g} s at {self.delay.omega / hz:.5g} Hz",
            f"modulus       {self.modulus.value:.4g} at {self.modulus.omega / hz:.5g} Hz",
            f"Ms {self.sensitivity.value:.4g}, Mt {self.complementary.value:.4g} "
            f"at {self.complementary.omega / hz:.5g} Hz",
        ]
        return "\n".join(lines)


def loop_grid(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """A grid that holds every peak and notch of a loop and its crossover, and L on it.

    Parameters
    ----------
    loop : Loop

    Returns
    -------
    omega : numpy.ndarray, shape (N,)
        rad/s.
    L : numpy.ndarray of complex, shape (N,)
    """
    poles = _continuous(loop.poles[~loop.at_rest(loop.poles)], loop.dt)
    span = _wide_span(loop, *response_span(poles))
    both = np.concatenate([poles, _continuous(loop.closed_poles(), loop.dt)])
    omega, values = refined(lambda s: loop.at(abs(s))[None, None], peak_grid(both, span), MOST_POINTS)
    return omega, values[0, 0]


def margins(loop: Loop) -> Margins:
    """Gain, phase, delay and modulus margin, and the sensitivity peaks.

    Crossings are bracketed on a grid that holds every lightly damped peak of the open and the closed
    loop, then found to round-off on L itself (no polynomials, no interpolation).

    Parameters
    ----------
    loop : Loop
        From :func:`open_loop`.

    Returns
    -------
    Margins
        Infinite where L crosses nothing.

    Raises
    ------
    StructureError
        For what is no loop.
    """
    omega, L = loop_grid(check_loop(loop, "margins"))
    through_one = _roots(lambda w: np.log(_size(loop.at(w))), omega, np.log(_size(L)))
    gains = tuple(Crossing(w, _wrapped(np.angle(_one(loop, w)) + np.pi)) for w in through_one)
    phases = phase_crossings(loop, omega, L)
    lags = [Crossing(g.omega, (g.margin % (2 * np.pi)) / g.omega) for g in gains]
    nothing = Crossing(np.inf, np.inf)
    distance = _lowest(lambda w: abs(1 + loop.at(w)), omega, abs(1 + L))
    mt = _lowest(lambda w: _return_ratio(loop.at(w)), omega, _return_ratio(L))
    return Margins(
        stable=loop.is_stable(),
        gain_up=min((p for p in phases if p.margin > 1), key=_margin, default=nothing),
        gain_down=max((p for p in phases if p.margin < 1), key=_margin, default=Crossing(np.inf, 0.0)),
        phase=min(gains, key=lambda g: abs(g.margin), default=nothing),
        delay=min(lags, key=_margin, default=nothing),
        modulus=distance,
        sensitivity=_inverse(distance),
        complementary=_inverse(mt),
        gain_crossings=gains,
        phase_crossings=phases,
        loop=loop,
    )


def phase_crossings(loop: Loop, omega: np.ndarray, L: np.ndarray) -> tuple[Crossing, ...]:
    """Where a loop crosses the negative real axis, with the gain factors −1/L.

    Parameters
    ----------
    loop : Loop
    omega, L : numpy.ndarray
        From :func:`loop_grid`.

    Returns
    -------
    tuple of Crossing
    """
    through_axis = _roots(lambda w: np.sin(np.angle(loop.at(w))), omega, np.sin(np.angle(L)))
    phases = tuple(Crossing(w, -1.0 / value.real) for w in through_axis if (value := _one(loop, w)).real < 0)
    return phases + _at_nyquist(loop)


def _at_nyquist(loop: Loop) -> tuple[Crossing, ...]:
    """The crossing of a sampled loop at z = −1, where L is real and the grid ends."""
    if not loop.dt:
        return ()
    end = np.pi / loop.dt
    value = _one(loop, end)
    return (Crossing(end, -1.0 / value.real),) if value.real < 0 and abs(value.imag) < 1e-6 * abs(value) else ()


def peak_gain(system: LinearModel | Reduced) -> Peak:
    """H-infinity norm: the largest singular value of G(iω), and where.

    Parameters
    ----------
    system : LinearModel or Reduced
        Scale its signals first where units differ.

    Returns
    -------
    Peak
        Infinite, with the frequency, if a pole on the imaginary axis (an integrator, an undamped mode)
        is seen by the inputs and outputs, or if a mode is unstable.
    """
    if not isinstance(system, LinearModel | Reduced):
        raise StructureError(f"peak_gain: {system!r} is no linear model; give what linearize or reduce returns")
    poles = system.damped_poles()
    span = response_span(poles)
    evaluate = transfer(system, 10 * span[1]) if isinstance(system, LinearModel) else system.transfer(10 * span[1])

    def largest(omega: np.ndarray) -> np.ndarray:
        G = np.moveaxis(evaluate(1j * np.atleast_1d(np.abs(omega))), -1, 0)
        return np.asarray(np.linalg.norm(G, 2, axis=(1, 2)))

    unbounded = [p for p in poles if p.real >= -ON_AXIS * abs(p) and _is_seen(evaluate, p)]
    if unbounded:
        return Peak(np.inf, float(abs(unbounded[0].imag)))
    omega, values = refined(lambda s: largest(abs(s))[None, None], peak_grid(poles, span), MOST_POINTS)
    low = _lowest(lambda w: 1.0 / largest(w), omega, 1.0 / abs(values[0, 0]))
    return _inverse(low)


def _is_seen(evaluate: Callable[[np.ndarray], np.ndarray], pole: complex) -> bool:
    """Whether the response grows without bound towards the pole."""
    size = abs(pole) or 1.0
    near, nearer = (abs(evaluate(np.array([pole + size * step]))).max() for step in (1e-3, 1e-6))
    return bool(nearer > 10.0 * near)


def _continuous(poles: np.ndarray, dt: float) -> np.ndarray:
    return np.log(poles[poles != 0].astype(complex)) / dt if dt else poles


def _wide_span(loop: Loop, low: float, high: float) -> tuple[float, float]:
    """Stretched until the loop is small at the top and, if it integrates, large at the bottom."""
    nyquist = np.pi / loop.dt if loop.dt else np.inf
    for _ in range(12):
        if abs(_one(loop, high)) > 0.1:
            high *= 10.0
        if abs(_one(loop, low)) < 10.0 and abs(_one(loop, 0.1 * low)) > 3.0 * abs(_one(loop, low)):
            low *= 0.1
    high = min(_past_poles(loop, low, high), nyquist)
    return min(low, 1e-3 * high), high


def _past_poles(loop: Loop, low: float, high: float) -> float:
    """Stretched to where every pole, a real one too, has turned the phase; not to where nothing is left of L."""
    last = PAST * float(abs(_continuous(loop.poles, loop.dt)).max(initial=0.0))
    if last <= high:
        return high
    floor = FAINT * min(1.0, float(abs(loop.at(np.geomspace(low, high, 50))).max()))
    further = np.geomspace(high, last, 4 + int(4.0 * np.log10(last / high)))[1:]
    heard = np.logical_and.accumulate(abs(loop.at(further)) > floor)
    return float(further[heard].max(initial=high))


def _roots(function: Callable[[np.ndarray], np.ndarray], omega: np.ndarray, values: np.ndarray) -> list[float]:
    """Every sign change between grid points, found to round-off; jumps through a pole are left out."""

    def value(w: float) -> float:
        return float(function(np.array([w]))[0])

    found = []
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        left, right = omega[k], omega[k + 1]
        if value(left) * value(right) < 0 and max(abs(values[k]), abs(values[k + 1])) > NOISE:
            root = float(brentq(value, left, right, xtol=1e-15 * left))
            if abs(value(root)) < 1e-4:
                found.append(root)
    return found + [float(w) for w in omega[values == 0.0]]


def _lowest(function: Callable[[np.ndarray], np.ndarray], omega: np.ndarray, values: np.ndarray) -> Peak:
    """The least value, polished around the three lowest valleys of the grid."""
    inner = np.r_[True, values[1:] <= values[:-1]] & np.r_[values[:-1] <= values[1:], True]
    valleys = np.flatnonzero(inner)
    valleys = valleys[np.argsort(values[valleys])][:3]
    first = int(valleys[0])
    best = Peak(float(values[first]), float(omega[first]))
    for k in valleys.tolist():
        ends = np.log(omega[max(k - 1, 0)]), np.log(omega[min(k + 1, len(omega) - 1)])
        trial = minimize_scalar(
            lambda x: float(function(np.array([np.exp(x)]))[0]), bounds=ends, options={"xatol": 1e-12}
        )
        if trial.fun < best.value:
            best = Peak(float(trial.fun), float(np.exp(trial.x)))
    return best


def _size(L: Any) -> Any:
    """|L|, and no zero where nothing comes back."""
    return np.maximum(np.abs(L), np.finfo(float).tiny)


def _return_ratio(L: np.ndarray) -> np.ndarray:
    return np.asarray(abs(1 + L) / _size(L))


def _inverse(low: Peak) -> Peak:
    return Peak(1.0 / low.value if low.value else np.inf, low.omega)


def _one(loop: Loop, omega: float) -> complex:
    return complex(loop.at(np.array([omega]))[0])


def _wrapped(angle: float) -> float:
    return float(np.pi - (np.pi - angle) % (2 * np.pi))


def _margin(crossing: Crossing) -> float:
    return crossing.margin
