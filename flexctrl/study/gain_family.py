"""A closed loop as a function of its gain: where its eigenvalues are, how they move, and which one crosses first."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment

from flexctrl.design.controller import LinearController
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import modal_first_order

__all__ = ["Crossing", "GainFamily", "Spectrum", "first_crossing", "gain_family"]

_RATIO = 1.4
_HALVINGS = 7
_ROUND = 1e-9
_NOISE = 1e-12
_UNTOUCHED = 1e-10


@frozen(eq=False)
class Spectrum:
    """Eigenvalues of the loop at one gain.

    Attributes
    ----------
    gain : float
    poles : numpy.ndarray of complex, shape (n,)
    drift : numpy.ndarray of complex, shape (n,)
        Derivatives by the gain.
    shapes : numpy.ndarray of complex, shape (n, n)
        Eigenvectors, one a column.
    depth, slope : numpy.ndarray, shape (n,)
        How far beyond the stability boundary (Re s, or |z| − 1), and its derivative by the gain.
    noise : numpy.ndarray, shape (n,)
        Up to which depth a pole counts as on the boundary.
    """

    gain: float
    poles: np.ndarray
    drift: np.ndarray
    shapes: np.ndarray
    depth: np.ndarray
    slope: np.ndarray
    noise: np.ndarray

    @property
    def unstable(self) -> np.ndarray:
        """Which poles are beyond the boundary."""
        return np.asarray(self.depth > self.noise)

    @property
    def stable(self) -> bool:
        """Whether none is."""
        return not self.unstable.any()

    @property
    def worst(self) -> int:
        """The pole farthest beyond the boundary."""
        return int(np.argmax(self.depth - self.noise))


@frozen(eq=False)
class GainFamily:
    """ẋ = (start + k slope) x (or the next sample's x): plant and controller, the loop's gain times k.

    Attributes
    ----------
    start, slope : numpy.ndarray, shape (n, n)
        The plant's modal states first.
    states : numpy.ndarray of int
        Number of each of them among all modal states of the linear model; the controller's follow.
    plant : tuple of numpy.ndarray
        A and B of the linear model with all its modal states, seen through the law's signals.
    command : numpy.ndarray, shape (commands, n)
        Commands at gain 1.
    dt : float
        Sampling time [s]; 0 for continuous time.
    """

    start: np.ndarray
    slope: np.ndarray
    states: np.ndarray
    plant: tuple[np.ndarray, np.ndarray]
    command: np.ndarray
    dt: float

    def at(self, gain: float) -> Spectrum:
        """Return the eigenvalues at a gain."""
        if not len(self.start):
            none = np.zeros(0)
            return Spectrum(gain, none, none, np.zeros((0, 0)), none, none, none)
        poles, left, right = la.eig(self.start + gain * self.slope, left=True, right=True)
        overlap = np.einsum("ij,ij->j", left.conj(), right)
        moved = np.einsum("ij,ij->j", left.conj(), self.slope @ right)
        drift = moved / np.where(np.abs(overlap) > 1e-14, overlap, 1e-14)
        size = np.abs(poles)
        if self.dt:
            depth, slope = size - 1.0, (poles.conj() * drift).real / np.where(size > 0.0, size, 1.0)
            return Spectrum(gain, poles, drift, right, depth, slope, np.full(len(poles), 0.1 * _ROUND))
        noise = _ROUND * size + _NOISE * size.max()
        return Spectrum(gain, poles, drift, right, poles.real, drift.real, noise)

    def near(self, gain: float, pole: complex) -> tuple[Spectrum, int]:
        """Return the eigenvalues at a gain and the number of the one nearest to a guess."""
        spectrum = self.at(gain)
        return spectrum, int(np.argmin(np.abs(spectrum.poles - pole)))

    def followed(self, here: Spectrum, pole: int, gain: float, halvings: int = 6) -> tuple[Spectrum, int]:
        """Return the same pole at another gain; in smaller steps where another one is nearly as near."""
        guess = here.poles[pole] + (gain - here.gain) * here.drift[pole]
        there = self.at(gain)
        gap = np.abs(there.poles - guess)
        order = np.argsort(gap)
        if not halvings or len(order) < 2 or gap[order[0]] < 0.2 * gap[order[1]]:
            return there, int(order[0])
        return self.followed(*self.followed(here, pole, 0.5 * (here.gain + gain), halvings - 1), gain, halvings - 1)

    def motion(self, spectrum: Spectrum, pole: int) -> tuple[np.ndarray, np.ndarray]:
        """Return all modal states of the plant in one closed-loop mode, and the commands.

        Modes that are driven but not seen move along.
        """
        (A, B), x = self.plant, spectrum.shapes[:, pole]
        u = spectrum.gain * (self.command @ x)
        full, others = np.zeros(len(A), dtype=complex), np.setdiff1d(np.arange(len(A)), self.states)
        full[self.states] = x[: len(self.states)]
        push = B[others] @ u
        if np.abs(push).max(initial=0.0) > 0.0:
            resolvent = spectrum.poles[pole] * np.eye(len(others)) - A[np.ix_(others, others)]
            full[others] = np.linalg.lstsq(resolvent, push, rcond=None)[0]
        return full, u

    def continuous(self, pole: complex) -> complex:
        """Return the exponent s of a pole: itself, or log(z)/dt."""
        return complex(np.log(pole) / self.dt) if self.dt else complex(pole)


@frozen(eq=False)
class Crossing:
    """Where a pole leaves the stable region.

    Attributes
    ----------
    spectrum : Spectrum
        At the critical gain.
    pole : int
        Number of the pole in it.
    """

    spectrum: Spectrum
    pole: int

    @property
    def gain(self) -> float:
        """The critical gain."""
        return self.spectrum.gain


def gain_family(linear: LinearModel, law: LinearController) -> GainFamily:
    """Return the loop of a linear model and a linear law; a sampled law samples the model exactly.

    Modes that the law does not drive or does not see, to rounding, keep their own eigenvalues at every gain and
    are left out unless they are unstable.

    Parameters
    ----------
    linear : LinearModel
    law : LinearController
        u = C(y), its own sign inside; its signals are the model's.

    Returns
    -------
    GainFamily

    Raises
    ------
    StructureError
        If a measured output depends directly on a commanded input.
    """
    chosen = linear.select(law.outputs, law.inputs)
    first = modal_first_order(chosen)
    A, B, C, D = first.A, first.B, first.C, first.D
    kept = _touched(A, B, C, first.blocks)
    if law.sample_time:
        sampled = chosen.discretize(law.sample_time)
        A, B, C, D = (np.asarray(m) for m in (sampled.A, sampled.B, sampled.C, sampled.D))
    if np.any(D):
        raise StructureError(
            "a measured output depends directly on a commanded input through a massless freedom: give that freedom "
            "inertia (a drive its motor's), or measure another output"
        )
    C, n = C[:, kept], len(law.A)
    command = np.hstack([law.D @ C, law.C])
    start = np.block([[A[np.ix_(kept, kept)], np.zeros((len(kept), n))], [law.B @ C, law.A]])
    slope = np.vstack([B[kept] @ command, np.zeros((n, len(kept) + n))])
    return GainFamily(start, slope, kept, (A, B), command, law.sample_time)


def _touched(A: np.ndarray, B: np.ndarray, C: np.ndarray, blocks: tuple[slice, ...]) -> np.ndarray:
    """States of the modes that are both driven and seen, or unstable."""
    driven = np.abs(B) > _UNTOUCHED * np.abs(B).max(axis=0, initial=0.0)
    seen = np.abs(C) > _UNTOUCHED * np.abs(C).max(axis=1, initial=0.0)[:, None]
    states = np.arange(len(A))
    found = [
        states[rows]
        for rows in blocks
        if (driven[rows].any() and seen[:, rows].any()) or la.eigvals(A[rows, rows]).real.max() > _ROUND
    ]
    return np.concatenate(found) if found else np.zeros(0, dtype=int)


def first_crossing(family: GainFamily, start: float, end: float) -> Crossing | None:
    """Return the first gain on the way from ``start`` to ``end`` at which a pole leaves the stable region, or None.

    Between two gains every pole is followed as a cubic with the right ends and slopes; the interval is halved
    while such a curve, or its uncertainty, reaches the boundary, so that a mode which is unstable over a short
    range of gains only is not stepped over.

    Parameters
    ----------
    family : GainFamily
    start : float
        Where the loop is stable.
    end : float
        Positive; above or below ``start``.

    Returns
    -------
    Crossing or None
    """
    before = family.at(start)
    while before.gain != end:
        on = min(end, _RATIO * before.gain) if end > start else max(end, before.gain / _RATIO)
        after = family.at(on)
        for a, b in _brackets(family, before, after, _HALVINGS):
            return _refined(family, a, b)
        before = after
    return None


def _brackets(family: GainFamily, a: Spectrum, b: Spectrum, halvings: int) -> Iterator[tuple[Spectrum, Spectrum]]:
    """Yield, in order, intervals at whose far end the loop is unstable."""
    if b.stable and not _may_cross(a, b):
        return
    if halvings:
        middle = family.at(0.5 * (a.gain + b.gain))
        yield from _brackets(family, a, middle, halvings - 1)
        if middle.stable:
            yield from _brackets(family, middle, b, halvings - 1)
    elif not b.stable:
        yield a, b


def _may_cross(a: Spectrum, b: Spectrum) -> bool:
    """Whether some pole may be beyond the boundary between two gains at which none is."""
    h = b.gain - a.gain
    gap = np.abs((a.poles + 0.5 * h * a.drift)[:, None] - (b.poles - 0.5 * h * b.drift))
    gap = np.where(np.isfinite(gap), gap, np.finfo(float).max)
    i, j = linear_sum_assignment(gap)
    x = np.linspace(0.0, 1.0, 17)[1:-1, None]
    ends = a.depth[i] * (1 + 2 * x) * (1 - x) ** 2 + b.depth[j] * x * x * (3 - 2 * x)
    slopes = h * (a.slope[i] * x * (1 - x) ** 2 - b.slope[j] * x * x * (1 - x))
    doubt = 0.25 * gap[i, j]
    return bool(((ends + slopes).max(axis=0, initial=-np.inf) + doubt > np.maximum(a.noise[i], b.noise[j])).any())


def _refined(family: GainFamily, a: Spectrum, b: Spectrum) -> Crossing:
    """Newton's method on the depth of the pole that is beyond the boundary at b, kept inside the bracket."""
    stable, unstable, here, pole = a.gain, b.gain, b, b.worst
    for _ in range(60):
        if here.depth[pole] > 0.0:
            unstable = here.gain
        else:
            stable = here.gain
        slope = here.slope[pole]
        gain = here.gain - here.depth[pole] / slope if slope else stable
        if not min(stable, unstable) < gain < max(stable, unstable):
            gain = 0.5 * (stable + unstable)
        guess = here.poles[pole] + (gain - here.gain) * here.drift[pole]
        step = abs(gain - here.gain)
        here, pole = family.near(gain, guess)
        if step <= 1e-13 * gain:
            break
    return Crossing(here, pole)
