"""Functions of time with exact derivatives, the stuff reference commands are made of."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import ControllerError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import listed, numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ROUND_OFF", "Constant", "PiecewisePolynomial", "Sum", "Trajectory", "simplified"]

ROUND_OFF = 1e-12  # a sample instant this near a break (relative) counts as past it, not a sample early


class Trajectory(ABC):
    """A scalar function of time with its derivative.

    Only ``__call__`` and ``derivative`` must be given; breaks are the instants (s) at which the value or a
    derivative jumps, and the value there is the one after the jump. The acceleration of ``path`` is
    ``path.derivative.rate(t)``, or as a trajectory ``path.derivative.derivative``.
    """

    @abstractmethod
    def __call__(self, t: float) -> float:
        """Return the value at time t (s)."""

    @property
    @abstractmethod
    def derivative(self) -> Trajectory:
        """The rate as a trajectory of its own (the impulse of a jump is left out)."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Instants at which the value or a derivative jumps, s."""
        return ()

    def along(self, times: np.ndarray) -> np.ndarray:
        """Return the values at many instants, the same as one by one.

        Parameters
        ----------
        times : numpy.ndarray, shape (n,)
            [s]

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        return np.array([self(t) for t in times.tolist()], dtype=float)

    def plot(self, until: float | None = None) -> Figure:
        """Draw value, rate and acceleration.

        Parameters
        ----------
        until : float, optional
            End of the time axis [s]; default: a tenth past the last break.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.design import trajectory_figure

        return trajectory_figure(self, until)

    @property
    def shortest_period(self) -> float:
        """Shortest period a shaper in it was designed for, s; inf if there is none."""
        return math.inf

    def rate(self, t: float) -> float:
        """Return the rate at time t.

        Parameters
        ----------
        t : float
            Time, s.

        Returns
        -------
        float
            Unit of the value per second.
        """
        return self.derivative(t)


@frozen
class PiecewisePolynomial(Trajectory):
    """Σ_k c[i][k] (t − knots[i])^k from knot i until the next, the last one for ever.

    Attributes
    ----------
    knots : tuple of float
        Increasing instants, s.
    coefficients : tuple of tuple of float
        One row per knot, ascending powers.
    before : float
        Value before the first knot.
    """

    knots: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]
    before: float = 0.0

    def __post_init__(self) -> None:
        # Plain floats: numpy's scalars would make every evaluation several times slower.
        object.__setattr__(self, "knots", reals(self.knots, "piecewise polynomial: knots"))
        row_of = "piecewise polynomial: coefficients"
        object.__setattr__(self, "coefficients", tuple(reals(row, row_of) for row in listed(self.coefficients, row_of)))
        require_finite("piecewise polynomial: before", self.before)
        object.__setattr__(self, "before", float(self.before))
        if len(self.knots) != len(self.coefficients) or not self.knots:
            raise ControllerError(f"{len(self.knots)} knots need as many rows, not {len(self.coefficients)}")
        require_finite("piecewise polynomial", *self.knots, self.before, *(c for row in self.coefficients for c in row))
        if any(b <= a for a, b in zip(self.knots, self.knots[1:], strict=False)):
            raise ControllerError(f"the knots of a trajectory must increase: {self.knots}")

    def __call__(self, t: float) -> float:
        piece = bisect_right(self._reached, t) - 1
        if piece < 0:
            return self.before
        s, value = t - self.knots[piece], 0.0
        for coefficient in self._descending[piece]:
            value = value * s + coefficient
        return value

    def along(self, times: np.ndarray) -> np.ndarray:
        piece = np.searchsorted(self._reached, times, side="right") - 1
        known = np.maximum(piece, 0)
        s, value = times - np.array(self.knots)[known], np.zeros(len(times))
        for column in self._rising[:, ::-1].T:
            value = value * s + column[known]
        return np.where(piece < 0, self.before, value)

    @cached_property
    def _rising(self) -> np.ndarray:
        rows = [[*row, *(0.0,) * (self.width - len(row))] for row in self.coefficients]
        return np.array(rows)

    @cached_property
    def _reached(self) -> tuple[float, ...]:
        return tuple(knot - ROUND_OFF * (1.0 + abs(knot)) for knot in self.knots)

    @cached_property
    def _descending(self) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(row[::-1]) for row in self.coefficients)

    @cached_property
    def derivative(self) -> PiecewisePolynomial:
        rows = tuple(tuple(k * c for k, c in enumerate(row))[1:] or (0.0,) for row in self.coefficients)
        return PiecewisePolynomial(self.knots, rows)

    @property
    def breaks(self) -> tuple[float, ...]:
        return self.knots

    @property
    def pieces(self) -> PiecewisePolynomial:
        """Itself."""
        return self

    def convolved(self, amplitudes: Sequence[float], delays: Sequence[float]) -> PiecewisePolynomial:
        """Return Σ A_i p(t − t_i), the delayed copies added up once and for all.

        Parameters
        ----------
        amplitudes, delays : sequence of float
            A_i, and t_i in s.

        Returns
        -------
        PiecewisePolynomial
        """
        knots = distinct(knot + delay for knot in self.knots for delay in delays)
        copies = tuple(zip(amplitudes, delays, strict=True))
        rows = tuple(
            tuple(sum(column) for column in zip(*(self.expanded(a, knot - delay) for a, delay in copies), strict=True))
            for knot in knots
        )
        return PiecewisePolynomial(knots, rows, self.before * sum(amplitudes))

    def expanded(self, amplitude: float, instant: float) -> tuple[float, ...]:
        """Return the piece at an instant, times an amplitude, in powers of the time since that instant.

        Parameters
        ----------
        amplitude : float
        instant : float
            [s]

        Returns
        -------
        tuple of float
        """
        piece = bisect_right(self._reached, instant) - 1
        row, s = (self.coefficients[piece], instant - self.knots[piece]) if piece >= 0 else ((self.before,), 0.0)
        shifted = [sum(math.comb(k, m) * row[k] * s ** (k - m) for k in range(m, len(row))) for m in range(len(row))]
        return (*(amplitude * c for c in shifted), *(0.0,) * (self.width - len(row)))

    @cached_property
    def width(self) -> int:
        """Most coefficients of a piece."""
        return max(map(len, self.coefficients))

    def piece(self, t: float) -> tuple[float, tuple[float, ...]]:
        """Return the piece at a time: its first instant, and coefficients of powers of the time since then.

        Parameters
        ----------
        t : float
            [s]

        Returns
        -------
        tuple of float and tuple of float
        """
        i = bisect_right(self._reached, t) - 1
        return (self.knots[i], self.coefficients[i]) if i >= 0 else (self.knots[0], (self.before,))


@frozen
class Constant(Trajectory):
    """The same value at all times: a set point, or an operating point to work about.

    Attributes
    ----------
    value : float
        SI units of the signal.
    """

    value: float

    def __post_init__(self) -> None:
        require_finite("constant", self.value)

    def __call__(self, t: float) -> float:
        return self.value

    def along(self, times: np.ndarray) -> np.ndarray:
        return np.full(len(times), self.value)

    @property
    def derivative(self) -> Trajectory:
        return Constant(0.0)


@frozen
class Sum(Trajectory):
    """The sum of several trajectories: there and back, a disturbance on a move.

    Attributes
    ----------
    terms : tuple of Trajectory
        Added up.
    """

    terms: tuple[Trajectory, ...]

    def __call__(self, t: float) -> float:
        return sum(term(t) for term in self.terms)

    def along(self, times: np.ndarray) -> np.ndarray:
        return sum((term.along(times) for term in self.terms), np.zeros(len(times)))

    @cached_property
    def derivative(self) -> Trajectory:
        return Sum(tuple(term.derivative for term in self.terms))

    @property
    def breaks(self) -> tuple[float, ...]:
        return distinct(b for term in self.terms for b in term.breaks)

    @property
    def shortest_period(self) -> float:
        return min((term.shortest_period for term in self.terms), default=math.inf)


def simplified(path: Trajectory) -> Trajectory:
    """Return a trajectory as one polynomial in pieces, where it is one: sums are added up once and for all.

    Parameters
    ----------
    path : Trajectory

    Returns
    -------
    Trajectory
        A `PiecewisePolynomial`, or the trajectory itself.
    """
    if isinstance(path, Constant):
        return PiecewisePolynomial((0.0,), ((path.value,),), path.value)
    if isinstance(path, Sum):
        terms = [simplified(term) for term in path.terms]
        known = [term for term in terms if isinstance(term, PiecewisePolynomial)]
        return _added(known) if known and len(known) == len(terms) else path
    pieces = getattr(path, "pieces", path)
    return pieces if isinstance(pieces, PiecewisePolynomial) else path


def _added(terms: Sequence[PiecewisePolynomial]) -> PiecewisePolynomial:
    knots = distinct(knot for term in terms for knot in term.knots)
    rows = [zip_longest(*(term.expanded(1.0, knot) for term in terms), fillvalue=0.0) for knot in knots]
    return PiecewisePolynomial(knots, tuple(tuple(map(sum, row)) for row in rows), sum(term.before for term in terms))


def distinct(instants: Iterable[float]) -> tuple[float, ...]:
    """Return instants in order, those that differ by round-off only once."""
    kept: list[float] = []
    for instant in sorted(instants):
        if not kept or instant - kept[-1] > ROUND_OFF * (1.0 + abs(instant)):
            kept.append(instant)
    return tuple(kept)


def reals(values: object, what: str) -> tuple[float, ...]:
    """Return a list of numbers as floats; raise a `ControllerError` for what is none."""
    found = numbers(values)
    if any(map(math.isnan, found)) or not isinstance(values, Sequence | np.ndarray):
        raise ControllerError(f"{what} = {shortened(values)}: not a finite number each; expected a list of them")
    return found


def require_finite(what: str, *values: float) -> None:
    """Raise a `ControllerError` naming the first value that is not finite."""
    for value in values:
        if not math.isfinite(numbers([value])[0]):
            raise ControllerError(f"{what}: {value!r} is not a finite number")
