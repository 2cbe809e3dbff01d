"""Root locus from eigenvalues, with every branch followed by name; critical gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from flexctrl.errors import LinearizationError, StructureError
from flexctrl.frozen import frozen
from flexctrl.study.branches import TREMBLE, followed, in_s, sided
from flexctrl.study.frequency import NOISE, Crossing, loop_grid, phase_crossings
from flexctrl.study.loop import Loop, check_loop

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

__all__ = ["CriticalGain", "RootLocus", "critical_gains", "root_locus"]

DECADES = 1e12
START = 50
SAME = 1e-6


@frozen
class CriticalGain:
    """A gain at which a closed-loop pole crosses the stability boundary.

    Attributes
    ----------
    gain : float
        Factor on the loop.
    omega : float
        Where on the boundary, rad/s.
    unstable_above : bool
        Whether the pole leaves the stable region as the gain grows.
    """

    gain: float
    omega: float
    unstable_above: bool


@frozen(eq=False)
class RootLocus:
    """Closed-loop poles over the gain.

    Attributes
    ----------
    gains : numpy.ndarray, shape (N,)
        Ascending from 0.
    loci : numpy.ndarray of complex, shape (N, n)
        One column a branch.
    poles, zeros : numpy.ndarray of complex
        Of the open loop.
    loop : Loop
    """

    gains: np.ndarray
    loci: np.ndarray
    poles: np.ndarray
    zeros: np.ndarray
    loop: Loop = field(repr=False)

    @property
    def dt(self) -> float:
        """Sampling time, s; 0 for continuous time."""
        return self.loop.dt

    @cached_property
    def critical(self) -> tuple[CriticalGain, ...]:
        """Gains at which a branch crosses the stability boundary, see `critical_gains`."""
        return critical_gains(self.loop, self)

    def in_s(self) -> RootLocus:
        """The same with every z as s = ln(z)/dt, for drawing; branches are cut where they pass z = 0.

        A branch along the negative real axis of z is at the one of ±iπ/dt that it comes from. What is at z = 0
        but for rounding (deadbeat) is at −23/dt: as fast as can be told.

        Returns
        -------
        RootLocus
        """
        if not self.dt:
            return self
        poles, zeros = in_s(self.poles, self.dt), in_s(self.zeros, self.dt)
        loci = sided(self.loci, self.dt)
        jumps = np.abs(np.diff(loci.imag, axis=0, prepend=loci.imag[:1])) > 0.5 * np.pi / self.dt
        return replace(self, poles=poles, zeros=zeros, loci=np.where(jumps, np.nan, loci))

    def to_control(self) -> control.pzmap.PoleZeroData:
        """As python-control's data object."""
        from control.pzmap import PoleZeroData

        return PoleZeroData(
            self.poles, self.zeros, self.gains, self.loci, dt=self.dt, sysname=self.loop.name, sort_loci=False
        )

    def plot(self, top: float | None = None) -> Figure:
        """Draw poles, zeros and branches, and where they cross the stability boundary.

        Parameters
        ----------
        top : float, optional
            Largest imaginary part shown, rad/s; default: some way above the first critical gain's, else as high as
            there are poles that move.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.root_locus import locus_figure

        return locus_figure(self, top)


def root_locus(loop: Loop, gains: Sequence[float] | np.ndarray | None = None) -> RootLocus:
    """Closed-loop poles eig(A − k B (1 + kD)⁻¹ C) over the gain, one column a branch.

    The states are in scaled modal form, so eigenvalues stay right where polynomial coefficients overflow
    their digits (from about 60 states). Consecutive gains are matched by the cheapest assignment to linearly
    extrapolated branches; gains are inserted until the assignment is unambiguous and the branches smooth, and
    where two branches meet on the real axis.

    Parameters
    ----------
    loop : Loop
        From :func:`open_loop`; closed by negative feedback.
    gains : array_like, optional
        Positive gains that must be among those computed; chosen from the size of L if left out.

    Returns
    -------
    RootLocus

    Raises
    ------
    StructureError
        For gains that are not ascending positive numbers.
    """
    check_loop(loop, "root_locus")
    wanted = _gain_range(loop) if gains is None else _checked(gains)
    used, loci = followed(loop, np.concatenate([[0.0], wanted[wanted > 0]]))
    return RootLocus(used, loci, loop.poles, loop.zeros, loop)


def critical_gains(loop: Loop, locus: RootLocus | None = None) -> tuple[CriticalGain, ...]:
    """Gains at which a branch of the root locus crosses the stability boundary, ascending.

    Bracketed by the branches, bisected on the eigenvalue, and finished on 1 + k L(iω) = 0 itself; and, whatever the
    branches show, where L(iω) crosses the negative real axis. Up to the largest gain of the locus; gains chosen
    by `root_locus` reach beyond every crossing, and beyond 1.

    Parameters
    ----------
    loop : Loop
    locus : RootLocus, optional
        From :func:`root_locus`, if already computed.

    Returns
    -------
    tuple of CriticalGain
        One for each conjugate pair or real pole that crosses.

    Raises
    ------
    StructureError
        For a locus that is none.
    """
    if locus is not None and not isinstance(locus, RootLocus):
        raise StructureError(f"critical_gains: locus = {locus!r}; expected what root_locus(loop) returns, or nothing")
    check_loop(loop, "critical_gains")
    locus = root_locus(loop) if locus is None else locus
    found = _on_branches(loop, locus) + _on_response(loop, float(locus.gains[-1]))
    apart: list[CriticalGain] = []
    for c in sorted((c for c in found if _is_crossing(loop, c)), key=lambda c: c.gain):
        if not any(_same(c, known) for known in apart):
            apart.append(c)
    return tuple(apart)


def _same(one: CriticalGain, other: CriticalGain) -> bool:
    near = abs(one.gain - other.gain) <= SAME * one.gain and one.unstable_above == other.unstable_above
    return near and abs(one.omega - other.omega) <= SAME * max(one.omega, other.omega) + 1e-9


def _on_branches(loop: Loop, locus: RootLocus) -> list[CriticalGain]:
    """Where a branch is inside the boundary at one gain and outside at the next."""
    outside = _depth(locus.loci, loop.dt)
    # poles of an undamped machine run along the boundary and only tremble by their rounding
    outside = np.where(abs(outside) > TREMBLE * abs(locus.loci), outside, 0.0)
    integrates = loop.at_rest(loop.poles).any()
    found = []
    for i, j in np.argwhere(np.sign(outside[1:-1]) * np.sign(outside[2:]) < 0):
        here, there = locus.loci[i + 1, j], locus.loci[i + 2, j]
        if here.imag + there.imag >= 0 and not (integrates and loop.at_rest(np.array([here, there])).any()):
            gain, pole = _crossing(loop, (locus.gains[i + 1], locus.gains[i + 2]), (here, there))
            omega = abs(np.angle(pole)) / loop.dt if loop.dt else abs(pole.imag)
            found.append(CriticalGain(gain, omega, bool(outside[i + 2, j] > 0)))
    return [_finished(loop, c) for c in found]


def _on_response(loop: Loop, most: float) -> list[CriticalGain]:
    """Where L is −1/k up to a gain; steps between gains, however chosen, hide none of these.

    With s(k) the pole, 1 + k L(s(k)) = 0: ds/dk = 1 / (k² dL/ds), so it leaves where Im L grows with ω.
    """
    found = []
    for crossing in (*phase_crossings(loop, *loop_grid(loop)), *_at_zero(loop)):
        w, step = crossing.omega, 1e-6 * crossing.omega or 1e-6 * _slowest(loop)
        if crossing.margin <= most * (1.0 + 1e-9):
            before, after = loop.at(np.array([w - step, w + step])).imag
            found.append(CriticalGain(crossing.margin, w, bool(after > before)))
    return found


def _at_zero(loop: Loop) -> tuple[Crossing, ...]:
    """The crossing of a real pole through s = 0 (z = 1); a zero there leaves of L(0) its rounding."""
    if not len(loop.poles) or loop.at_rest(loop.poles).any():
        return ()
    value, nearby = _still(loop), loop.at(np.array([0.1 * _slowest(loop)]))[0]
    return (Crossing(0.0, -1.0 / float(value.real)),) if value.real < -NOISE * abs(nearby) else ()


def _still(loop: Loop) -> complex:
    """L at rest, where no pole is."""
    try:
        return complex(loop.at(np.zeros(1))[0])
    except LinearizationError:  # what rounding leaves of free motion that the loop neither drives nor sees
        still = (np.eye(len(loop.A)) if loop.dt else 0.0) - loop.A
        return complex((loop.D + loop.C @ np.linalg.solve(still, loop.B)).item())


def _slowest(loop: Loop) -> float:
    """The smallest rate of the open loop's poles, rest left out."""
    moving = loop.poles[~loop.at_rest(loop.poles)]
    rates = abs(np.log(moving[moving != 0])) / loop.dt if loop.dt else abs(moving)
    return float(rates.min(initial=np.inf))


def _checked(gains: Sequence[float] | np.ndarray) -> np.ndarray:
    try:
        k = np.asarray(gains, float)
    except (TypeError, ValueError) as error:
        raise StructureError(
            f"root_locus: gains = {gains!r}; expected ascending real numbers, e.g. [0.1, 1.0] (a complex gain is "
            "a phase: put it into the controller)"
        ) from error
    if k.ndim != 1 or not np.isfinite(k).all() or (k < 0).any() or (np.diff(k) <= 0).any():
        raise StructureError("gains must be ascending, finite and not negative")
    return k


def _gain_range(loop: Loop) -> np.ndarray:
    """From where the highest peak begins to move its pole to where the poles have reached the zeros.

    What an integrator adds far below the slowest other pole is no peak.
    """
    omega, values = loop_grid(loop)
    slowest = _slowest(loop)
    size = abs(values[omega >= 0.01 * slowest]) if np.isfinite(slowest) else abs(values)
    size = size[size > 0] if (size > 0).any() else abs(values[abs(values) > 0])
    if not size.size:
        raise StructureError("the loop's response is zero: its input does not reach its output")
    least = 0.01 / size.max()
    turned = (CriticalGain(p.margin, p.omega, True) for p in (*phase_crossings(loop, omega, values), *_at_zero(loop)))
    last = [c.gain for c in turned if _is_crossing(loop, c)]
    most = max(10.0 / np.quantile(size, 0.25), 2.0 * max([1.0, *last]))
    return np.geomspace(max(least, most / DECADES), most, START)


def _depth(poles: np.ndarray, dt: float) -> np.ndarray:
    """How far outside the stable region, signed."""
    return np.asarray(abs(poles) - 1.0 if dt else poles.real)


def _crossing(loop: Loop, gains: tuple[float, float], poles: tuple[complex, complex]) -> tuple[float, complex]:
    """Bisect one branch between two gains."""

    def nearest(gain: float) -> complex:
        share = (gain - gains[0]) / (gains[1] - gains[0])
        guess = poles[0] + share * (poles[1] - poles[0])
        found = loop.closed_poles(gain)
        return complex(found[abs(found - guess).argmin()])

    gain = float(brentq(lambda k: float(_depth(np.array(nearest(k)), loop.dt)), *gains, rtol=1e-12))
    return gain, nearest(gain)


def _finished(loop: Loop, rough: CriticalGain) -> CriticalGain:
    """Secant steps on Im L(iω) = 0, where k = −1/L; a real crossing at ω = 0 stays as it is."""
    w = rough.omega
    if w <= 1e-9 * abs(loop.poles).max():
        return rough
    ends = np.array([w * (1 - 1e-6), w * (1 + 1e-6)])
    for _ in range(8):
        value = loop.at(ends).imag
        if value[0] == value[1]:
            break
        ends = np.array([ends[1], ends[1] - value[1] * (ends[1] - ends[0]) / (value[1] - value[0])])
    gain = -1.0 / loop.at(ends[1:]).real[0]
    good = abs(gain - rough.gain) < 1e-4 * rough.gain
    return CriticalGain(float(gain), float(ends[1]), rough.unstable_above) if good else rough


def _is_crossing(loop: Loop, found: CriticalGain) -> bool:
    """Whether L really passes −1/k there: a branch that runs along the boundary only trembles across it."""
    w, nyquist = found.omega, np.pi / loop.dt if loop.dt else np.inf
    if w <= loop.rest_radius and loop.at_rest(loop.poles).any():
        return False  # an integrator: L(0) is infinite, so no gain brings a pole there
    if w <= loop.rest_radius or w >= nyquist * (1 - 1e-9):
        return bool(abs(1 + found.gain * (loop.at(np.array([w]))[0] if w else _still(loop))) < 1e-4)
    steps = 10.0 ** np.arange(-10.0, -2.0)
    before, after = (np.sin(np.angle(loop.at(w * (1 + sign * steps)))) for sign in (-1, 1))
    return bool(((before * after < 0) & (np.minimum(abs(before), abs(after)) > NOISE)).any())
