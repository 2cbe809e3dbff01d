"""Frequency response of a linear model on a grid of its own or of the user's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.grid import peak_grid, refined
from flexctrl.linear.model import LinearModel
from flexctrl.linear.poles import second_order_roots
from flexctrl.linear.transfer import routed, transfer
from flexctrl.linear.undamped import COMPLETE
from flexctrl.structure.freedoms import numbers

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

__all__ = ["FrequencyResponse", "frequencies_of", "frequency_response", "response_span"]

MOST_POINTS = 20_000
MOST_SOLVES = 3_000
DENSE_POLES = 300


@frozen(eq=False)
class FrequencyResponse:
    """Samples of H(iω) with names.

    Attributes
    ----------
    omega : numpy.ndarray, shape (N,)
        rad/s, ascending.
    values : numpy.ndarray of complex, shape (n_outputs, n_inputs, N)
        Output unit per input unit, SI.
    inputs, outputs : tuple of str
    name : str
    """

    omega: np.ndarray
    values: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    name: str = "linear"

    @property
    def frequencies(self) -> np.ndarray:
        """Hz, shape (N,)."""
        return self.omega / (2.0 * np.pi)

    @property
    def magnitude(self) -> np.ndarray:
        """|H|, shape (n_outputs, n_inputs, N)."""
        return np.abs(self.values)

    @property
    def phase(self) -> np.ndarray:
        """Continuous phase, rad, shape (n_outputs, n_inputs, N)."""
        return np.unwrap(np.angle(self.values), axis=-1)

    def channel(self, output: str, input: str) -> np.ndarray:
        """H from one input to one output.

        Parameters
        ----------
        output, input : str
            Signal names.

        Returns
        -------
        numpy.ndarray of complex, shape (N,)
        """
        return np.asarray(self.values[_index(output, self.outputs), _index(input, self.inputs)])

    def to_control(self) -> control.FrequencyResponseData:
        """As python-control's data object, with the signal names."""
        import control

        return control.FrequencyResponseData(
            self.values,
            self.omega,
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            name=self.name,
        )

    def plot(self) -> Figure:
        """Draw magnitude and phase, of several outputs the magnitudes; ``to_control().plot()`` is python-control's.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.frequency import response_figure

        return response_figure(self)


def frequency_response(
    linear: LinearModel,
    omega: np.ndarray | Sequence[float] | None = None,
    span: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Response y(iω)/u(iω) from the second-order form; never through an ill-conditioned state space.

    Parameters
    ----------
    linear : LinearModel
    omega : array_like, optional
        Angular frequencies, rad/s. Left out: a grid that holds every lightly damped peak (pole ± multiples
        of its half width), halved until it shows every anti-resonance.
    span : tuple of two floats, optional
        Limits of that grid, rad/s; left out: from a tenth of the lowest pole to three times the highest (in a
        model of more than 1000 freedoms, to the 20th mode).

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    LinearizationError
        If a frequency hits an undamped pole (an integrator at 0): the response is infinite there.
    StructureError
        For frequencies that are negative or not finite, none at all, or a span that is empty or starts at 0.
    """
    if omega is not None:
        points = frequencies_of(omega)
        top = float(points.max(initial=0.0)) or 1.0
        values = transfer(linear, top)(1j * points)
    else:
        poles = _leading_poles(linear)
        low, high = _own_span(linear, poles) if span is None else _checked_span(span)
        evaluate, cheap = routed(linear, high)
        points, values = refined(evaluate, peak_grid(poles, (low, high)), MOST_POINTS if cheap else MOST_SOLVES)
    return FrequencyResponse(points, values, linear.inputs, linear.outputs, linear.name)


def response_span(poles: np.ndarray) -> tuple[float, float]:
    """From a tenth of the smallest non-zero pole to three times the largest oscillating one.

    Parameters
    ----------
    poles : numpy.ndarray of complex

    Returns
    -------
    tuple of two floats
        rad/s; (0.01, 100) for a model without poles other than 0.
    """
    size = np.abs(poles)
    size = size[size > 0]
    if not size.size:
        return 0.01, 100.0
    turning = np.abs(poles[poles.imag > 0])
    return 0.1 * float(size.min()), 3.0 * float(turning.max() if turning.size else size.max())


def _own_span(linear: LinearModel, poles: np.ndarray) -> tuple[float, float]:
    low, high = response_span(poles)
    return (low, high) if _is_complete(linear) else (low, high / 2.9)


def _leading_poles(linear: LinearModel) -> np.ndarray:
    """Damped poles; for a large model those of its lowest modes, each taken alone."""
    if len(linear.coordinates) <= DENSE_POLES:
        return linear.damped_poles()
    modes = linear.modes(min(20, len(linear.coordinates))) if not _is_complete(linear) else linear._modal.modes
    return second_order_roots(modes.decay, modes.omega_squared).ravel()


def _is_complete(linear: LinearModel) -> bool:
    return len(linear.coordinates) <= COMPLETE


def frequencies_of(given: np.ndarray | Sequence[float]) -> np.ndarray:
    """Return the frequencies that a response is asked for at, in ascending order.

    Parameters
    ----------
    given : array_like
        rad/s.

    Returns
    -------
    numpy.ndarray, shape (N,)

    Raises
    ------
    StructureError
        For frequencies that are negative or not finite, or none at all.
    """
    omega = np.atleast_1d(np.asarray(given))
    several = omega.ndim == 1 and omega.size and omega.dtype.kind in "iuf"
    if not several or not np.isfinite(omega).all() or (omega < 0).any():
        raise StructureError(
            f"frequency_response: omega = {np.array2string(omega, threshold=8)}; expected a list of finite real "
            "angular frequencies in rad/s, one at least and none negative (the response is at s = iω)"
        )
    return np.sort(omega.astype(float))


def _checked_span(span: tuple[float, float]) -> tuple[float, float]:
    limits = numbers(span)
    if len(limits) != 2 or not 0.0 < limits[0] < limits[1] < np.inf:
        raise StructureError(f"span = {span!r}: give two limits, 0 < lowest < highest angular frequency, rad/s")
    return limits[0], limits[1]


def _index(name: str, known: tuple[str, ...]) -> int:
    if name not in known:
        raise StructureError(f"{name!r} is not a signal of this response{did_you_mean(name, known)}")
    return known.index(name)
