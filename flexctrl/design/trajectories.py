"""Reference commands: what the machine is asked to do, as exact functions of time."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import fields
from functools import cached_property
from numbers import Real

import numpy as np

from flexctrl.design.piecewise import PiecewisePolynomial, Trajectory, reals, require_finite
from flexctrl.errors import ControllerError, check_kind
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

__all__ = [
    "MinimumJerk",
    "Ramp",
    "Spline",
    "Step",
    "Table",
    "TimeOptimalPendulum",
    "TrapezoidalVelocity",
]


class _Profile(Trajectory):
    """A trajectory told by a few parameters and evaluated through its ``pieces``."""

    @property
    @abstractmethod
    def pieces(self) -> PiecewisePolynomial:
        """The same trajectory as polynomials."""

    def __post_init__(self) -> None:
        for given in fields(self):  # type: ignore[arg-type]
            if given.type == "float":
                what = f"{type(self).__name__}: {given.name}"
                check_kind(getattr(self, given.name), Real, what, "a number", ControllerError)
        _ = self.pieces  # made once, so that what cannot be is refused at construction

    def __call__(self, t: float) -> float:
        return self.pieces(t)

    def along(self, times: np.ndarray) -> np.ndarray:
        return self.pieces.along(times)

    @property
    def derivative(self) -> Trajectory:
        return self.pieces.derivative

    @property
    def breaks(self) -> tuple[float, ...]:
        return self.pieces.knots


@frozen
class Step(_Profile):
    """A jump of ``size`` at time ``at``; the impulse in its rate is left out.

    Attributes
    ----------
    size : float
        Height of the jump.
    at : float
        Time of the jump, s.
    start : float
        Value before it.
    """

    size: float
    at: float = 0.0
    start: float = 0.0

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        return PiecewisePolynomial((self.at,), ((self.start + self.size,),), self.start)


@frozen
class Ramp(_Profile):
    """A rise at a constant slope for ``duration`` seconds, then held.

    Attributes
    ----------
    slope : float
        Per second.
    duration : float
        Seconds; ``math.inf`` rises for ever.
    at : float
        Start time, s.
    start : float
        Value before it.
    """

    slope: float
    duration: float = math.inf
    at: float = 0.0
    start: float = 0.0

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        _positive("ramp", duration=self.duration)
        rise = (self.start, self.slope)
        if math.isinf(self.duration):
            return PiecewisePolynomial((self.at,), (rise,), self.start)
        knots = (self.at, self.at + self.duration)
        return PiecewisePolynomial(knots, (rise, (self.start + self.slope * self.duration,)), self.start)


@frozen
class TrapezoidalVelocity(_Profile):
    """Rest to rest: constant acceleration, constant speed, constant deceleration (triangular if short).

    Attributes
    ----------
    distance : float
        Signed.
    speed, acceleration : float
        Largest magnitudes, > 0.
    at : float
        Start time, s.
    start : float
        Value before it.
    """

    distance: float
    speed: float
    acceleration: float
    at: float = 0.0
    start: float = 0.0

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        _positive("trapezoidal velocity", speed=self.speed, acceleration=self.acceleration)
        if not self.distance:
            return PiecewisePolynomial((self.at,), ((self.start,),), self.start)
        ramp = min(self.speed / self.acceleration, math.sqrt(abs(self.distance) / self.acceleration))
        cruise = abs(self.distance) / (self.acceleration * ramp) - ramp
        a = math.copysign(self.acceleration, self.distance)
        return _accelerated(self.at, self.start, self.distance, ((ramp, a), (cruise, 0.0), (ramp, -a)))

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return self.breaks[-1] - self.at


@frozen
class MinimumJerk(_Profile):
    """Rest to rest with d (10 τ³ − 15 τ⁴ + 6 τ⁵), τ = (t − at)/T: the least ∫ jerk² (Flash & Hogan 1985).

    Attributes
    ----------
    distance : float
        d, signed.
    duration : float
        T, s.
    at : float
        Start time, s.
    start : float
        Value before it.
    """

    distance: float
    duration: float
    at: float = 0.0
    start: float = 0.0

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        _positive("minimum jerk", duration=self.duration)
        d, T = self.distance, self.duration
        move = (self.start, 0.0, 0.0, 10 * d / T**3, -15 * d / T**4, 6 * d / T**5)
        return PiecewisePolynomial((self.at, self.at + T), (move, (self.start + d,)), self.start)


@frozen
class Table(_Profile):
    """Values at instants with straight lines between them; held before the first and after the last.

    Attributes
    ----------
    times : tuple of float
        Increasing, s.
    values : tuple of float
        One per instant.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        t, v = _points("table", self.times, self.values)
        slopes = [*(np.diff(v) / np.diff(t)).tolist(), 0.0]
        return PiecewisePolynomial(tuple(t), tuple(zip(v, slopes, strict=True)), v[0])


@frozen
class Spline(_Profile):
    """Values at instants joined by a cubic spline with continuous curvature, at rest at both ends.

    Attributes
    ----------
    times : tuple of float
        Increasing, s.
    values : tuple of float
        One per instant.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        from scipy.interpolate import CubicSpline

        t, v = _points("spline", self.times, self.values)
        rows = CubicSpline(t, v, bc_type="clamped").c[::-1].T.tolist()
        return PiecewisePolynomial(tuple(t), (*map(tuple, rows), (v[-1],)), v[0])


@frozen
class TimeOptimalPendulum(_Profile):
    """Quickest path of a trolley, rest to rest, that leaves the pendulum under it at rest too.

    With ``|ẍ| ≤ A`` the acceleration switches +A, −A, +A, −A at t₁, T, 2T − t₁ and ends at 2T, where
    s = T − t₁ solves cos ω s = cos²(ω T/2) and T² = d/A + 2 s². Exact for the linear pendulum
    θ̈ + ω² θ = −ẍ/ℓ (small angles).

    Attributes
    ----------
    distance : float
        d, m, signed.
    acceleration : float
        Largest acceleration A of the trolley, m/s².
    omega : float
        Pendulum frequency √(g/ℓ), rad/s.
    at : float
        Start time, s.
    start : float
        Position before it, m.
    """

    distance: float
    acceleration: float
    omega: float
    at: float = 0.0
    start: float = 0.0

    @cached_property
    def switches(self) -> tuple[float, float, float, float]:
        """t₁, T, 2T − t₁ and the end 2T, in seconds after the start."""
        from scipy.optimize import brentq

        _positive("time-optimal move", acceleration=self.acceleration, omega=self.omega)
        drive, w = abs(self.distance) / self.acceleration, self.omega
        _positive("time-optimal move", distance=drive)

        def misfit(s: float) -> float:
            return math.cos(w * s) - math.cos(w * math.sqrt(drive + 2 * s * s) / 2) ** 2

        # The misfit falls strictly from sin² >= 0 at s = 0 to -cos² <= 0 at ω s = π/2: the root is the only one.
        s = brentq(misfit, 0.0, math.pi / (2 * w), xtol=1e-15 / w, rtol=1e-15) if misfit(0.0) > 0 else 0.0
        half = math.sqrt(drive + 2 * s * s)
        return half - s, half, half + s, 2 * half

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        first, half, last, end = self.switches
        a = math.copysign(self.acceleration, self.distance)
        phases = ((first, a), (half - first, -a), (last - half, a), (end - last, -a))
        return _accelerated(self.at, self.start, self.distance, phases)

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return self.switches[-1]


def _accelerated(
    at: float, start: float, distance: float, phases: Iterable[tuple[float, float]]
) -> PiecewisePolynomial:
    """Rest to rest through phases (duration, acceleration); those without duration are left out."""
    knots, rows, t, x, v = [], [], at, start, 0.0
    for duration, a in phases:
        if t + duration > t:
            knots.append(t)
            rows.append((x, v, a / 2))
        t, x, v = t + duration, x + v * duration + a * duration**2 / 2, v + a * duration
    return PiecewisePolynomial((*knots, t), (*rows, (start + distance,)), start)


def _points(what: str, times: Sequence[float], values: Sequence[float]) -> tuple[list[float], list[float]]:
    t, v = list(reals(times, f"{what}: times")), list(reals(values, f"{what}: values"))
    if len(t) != len(v) or len(t) < 2:
        raise ControllerError(f"a {what} needs two or more times and as many values, not {len(t)} and {len(v)}")
    require_finite(what, *t, *v)
    if min(np.diff(t)) <= 0:
        raise ControllerError(
            f"the times of a {what} must increase: {t[int(np.argmin(np.diff(t))) + 1]} s comes too early"
        )
    return t, v


def _positive(what: str, **values: float) -> None:
    for name, value in values.items():
        if not numbers([value])[0] > 0:
            raise ControllerError(f"{what}: {name} = {value!r} must be > 0")
