"""How wrong a reduced model is, measured; and the smallest model that is right enough."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from flexctrl.errors import ReductionError, StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.linear.grid import peak_grid, refined
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.poles import second_order_roots
from flexctrl.linear.reduction.low_frequency import low_frequency, nearest_modes, rigid_basis, undamped
from flexctrl.linear.reduction.modal import ModalTruncation
from flexctrl.linear.response import response_span
from flexctrl.linear.transfer import Transfer, transfer
from flexctrl.linear.undamped import COMPLETE
from flexctrl.structure.freedoms import numbers

if TYPE_CHECKING:
    from flexctrl.linear.reduction.result import Method, Reduced

__all__ = ["ErrorReport", "RelativeError", "error_report", "smallest"]

DENSE_POLES = 300
MOST_POINTS = 6000
SILENT = 1e-4


@frozen(eq=False)
class ErrorReport:
    """Largest distance between two frequency responses, channel by channel.

    Attributes
    ----------
    absolute : numpy.ndarray, shape (n_outputs, n_inputs)
        max |G − G_r| over the band, output unit per input unit.
    relative : numpy.ndarray, shape (n_outputs, n_inputs)
        The same over max |G − G₋₂/s² − G₋₁/s|, the peak of the response without its rigid-body motion (for a
        channel that is nearly silent, by symmetry or by place: over 1e-4 of what its input and output could do; of a
        machine with rigid-body motion alone: over what they could do at the end of the band).
    at : numpy.ndarray, shape (n_outputs, n_inputs)
        Where, rad/s.
    up_to : float
        End of the band, rad/s.
    inputs, outputs : tuple of str
        Signal names.
    """

    absolute: np.ndarray
    relative: np.ndarray
    at: np.ndarray
    up_to: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def worst(self) -> float:
        """Largest relative error of all channels."""
        return float(self.relative.max(initial=0.0))

    def __str__(self) -> str:
        lines = [f"error up to {self.up_to / (2 * np.pi):.6g} Hz: {self.worst:.3g} of the peak at worst"]
        for i, output in enumerate(self.outputs):
            lines += [
                f"  {name} -> {output}: {self.absolute[i, j]:.3g} ({self.relative[i, j]:.3g} of the peak) "
                f"at {self.at[i, j] / (2 * np.pi):.6g} Hz"
                for j, name in enumerate(self.inputs)
            ]
        return "\n".join(lines)


@frozen
class RelativeError:
    """Ask a reduction for an error instead of an order.

    Attributes
    ----------
    tolerance : float
        Largest relative error of any channel (see :class:`ErrorReport`), e.g. 0.01.
    up_to_hz : float
        Band from 0 to here, Hz; everything if left out.
    """

    tolerance: float
    up_to_hz: float = np.inf

    def __post_init__(self) -> None:
        if not all(value > 0.0 for value in numbers((self.tolerance, self.up_to_hz))):
            raise ReductionError(
                f"tolerance {self.tolerance!r} and up_to_hz {self.up_to_hz!r} must be positive numbers"
            )


class Reference:
    """The full model's response on a band, evaluated once for many comparisons."""

    def __init__(self, full: LinearModel, top: float) -> None:
        self.full, self.top = full, top
        modes = _modes_below(full, top)
        self.poles = second_order_roots(modes.decay, modes.omega_squared).ravel()
        if len(full.coordinates) <= DENSE_POLES:
            self.poles = full.damped_poles()
        self.low = min(0.1 * _slowest(full, modes), 0.1 * top)
        self.evaluate = transfer(full, 1.001 * top)
        self.omega, self.values = refined(self.evaluate, peak_grid(self.poles, (self.low, top)), MOST_POINTS)
        expansion = low_frequency(full, rigid_basis(full))
        s = 1j * self.omega
        rigid = expansion.double[:, :, None] / s**2 + expansion.single[:, :, None] / s
        self.peak = np.maximum(abs(self.values - rigid).max(axis=-1), _silence(modes, top))

    def compare(self, reduced: Reduced) -> ErrorReport:
        """Measure a reduced model against this response."""
        other = reduced.transfer(self.top)
        extra = np.setdiff1d(peak_grid(reduced.damped_poles(), (self.low, self.top)), self.omega)
        omega = np.concatenate([self.omega, extra])
        full = np.concatenate([self.values, self.evaluate(1j * extra)], axis=-1)
        order = np.argsort(omega)
        omega, full = omega[order], full[..., order]
        error = abs(full - other(1j * omega))
        difference = partial(_difference, self.evaluate, other)
        absolute, at = np.zeros(self.peak.shape), np.zeros(self.peak.shape)
        for i, j in np.ndindex(absolute.shape):
            absolute[i, j], at[i, j] = _highest(difference, omega, error[i, j], (i, j))
        relative = np.divide(absolute, self.peak, out=np.zeros_like(absolute), where=self.peak > 0)
        return ErrorReport(absolute, relative, at, self.top, self.full.inputs, self.full.outputs)


def error_report(reduced: Reduced, top: float = np.inf) -> ErrorReport:
    """Measure the error of a reduced model on a grid that holds every peak of both models.

    Parameters
    ----------
    reduced : Reduced
    top : float
        End of the band, rad/s. Left out: three times the highest mode of the full model; of a model of more
        than 1000 coordinates, three times the highest mode kept, or that a reduced model of this order can hold
        (the highest poles of a projection, as by moment matching, belong to no mode).

    Returns
    -------
    ErrorReport
    """
    return Reference(reduced.full, _band(reduced.full, top, partial(_kept, reduced))).compare(reduced)


def smallest(full: LinearModel, goal: RelativeError, using: Callable[[int], Method]) -> Reduced:
    """The smallest order that meets an error, found by doubling and bisection.

    Parameters
    ----------
    full : LinearModel
    goal : RelativeError
    using : callable
        From an order to a method: a class such as ``ModalTruncation``, or a function.

    Returns
    -------
    Reduced

    Raises
    ------
    ReductionError
        If even the largest order misses the goal.
    """
    most = 2 * len(full.coordinates)
    reference = Reference(full, _band(full, 2 * np.pi * goal.up_to_hz))

    def meeting(order: int) -> Reduced | None:
        trial = _attempt(full, using, order)
        meets = trial is not None and reference.compare(trial).worst <= goal.tolerance
        return trial if meets else None

    failed, order = 0, 2
    while (best := meeting(order)) is None and order < most:
        failed, order = order, min(2 * order, most)
    if best is None:
        raise ReductionError(
            f"no order up to {most} brings the relative error to {goal.tolerance:.3g} up to "
            f"{goal.up_to_hz:.6g} Hz; ask for a narrower band, add static correction, or another method"
        )
    while order - failed > 1:
        middle = (failed + order) // 2
        trial = meeting(middle)
        best, order, failed = (best, order, middle) if trial is None else (trial, middle, failed)
    return best


def _attempt(full: LinearModel, using: Callable[[int], Method], order: int) -> Reduced | None:
    """A reduction of this order; none if the order is too small for what must be kept."""
    try:
        method = using(order)
        if isinstance(method, type) or not hasattr(method, "apply"):
            raise StructureError(
                f"reduce: using({order}) gave {shortened(method)}, no method; expected e.g. ModalTruncation(8)"
            )
        return method.apply(full)
    except ReductionError:
        if order >= 2 * len(full.coordinates):
            raise
        return None


def _difference(one: Transfer, two: Transfer, channel: tuple[int, int], omega: float) -> float:
    s = np.array([1j * omega])
    return float(abs(one(s) - two(s))[channel][0])


def _highest(
    difference: Callable[[tuple[int, int], float], float],
    omega: np.ndarray,
    error: np.ndarray,
    channel: tuple[int, int],
) -> tuple[float, float]:
    """The maximum of the error, polished between the neighbours of the highest grid point."""
    k = int(error.argmax())
    left, right = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
    found = minimize_scalar(lambda w: -difference(channel, w), bounds=(left, right), options={"xatol": 1e-6 * left})
    return (float(-found.fun), float(found.x)) if -found.fun > error[k] else (float(error[k]), float(omega[k]))


def _band(full: LinearModel, top: float, kept: Callable[[], float] | None = None) -> float:
    """The end of the band: as asked, else three times the highest mode (kept, in a large model), or rate."""
    if np.isfinite(top):
        return top
    if len(full.coordinates) <= COMPLETE:
        modes = nearest_modes(full)
        highest = np.sqrt(abs(modes.omega_squared).max(initial=0.0)) or abs(modes.decay).max(initial=0.0)
        return 3.0 * float(highest) or response_span(np.zeros(0))[1]
    if kept is None:
        raise ReductionError(f"{len(full.coordinates)} coordinates: say up to which frequency, up_to_hz")
    return 3.0 * kept()


def _kept(reduced: Reduced) -> float:
    """The highest pole, of a projection no higher than the mode of the full model with the number of its poles."""
    poles = abs(reduced.damped_poles())
    highest = float(poles.max(initial=0.0))
    if isinstance(reduced.method, ModalTruncation):
        return highest
    return min(highest, float(reduced.full.modes(max(len(poles) // 2, 1)).omega[-1])) or highest


def _modes_below(full: LinearModel, top: float) -> Modes:
    modes = nearest_modes(full)
    while len(full.coordinates) > COMPLETE and modes.omega[-1] < top and len(modes) < COMPLETE:
        modes = full.modes(2 * len(modes))
    return modes


def _slowest(full: LinearModel, modes: Modes) -> float:
    """The lowest frequency, or rate of a damped rigid-body mode, that is not zero."""
    zero = slice(modes.unstable, modes.unstable + modes.rigid)
    dragged = ~undamped(full, modes.shapes[:, zero])
    rates = np.concatenate([np.sqrt(abs(np.delete(modes.omega_squared, zero))), modes.decay[zero][dragged]])
    return float(rates.min(initial=np.inf))


def _silence(modes: Modes, top: float) -> np.ndarray:
    """A peak that counts as none: 1e-4 of what a channel could do if both its ends met where each is strongest.

    Of a machine where nothing bends, what a channel could do at the end of the band: nothing is lost of such a one.
    """
    bent = modes.select(np.arange(len(modes))[modes.flexible])
    if not len(bent):
        still = 1.0 / (top**2 + abs(modes.omega_squared))
        seen = abs(modes.output_gain) ** 2 + abs(top * modes.output_rate_gain) ** 2
        return _met(seen * still, abs(modes.input_gain.T) ** 2 * still)
    sharp = 1.0 / (2 * np.maximum(bent.damping, 1e-4) * np.maximum(bent.omega_squared, np.finfo(float).tiny))
    seen = abs(bent.output_gain) ** 2 + abs(bent.omega * bent.output_rate_gain) ** 2
    return SILENT * _met(seen * sharp, abs(bent.input_gain.T) ** 2 * sharp)


def _met(seen: np.ndarray, moved: np.ndarray) -> np.ndarray:
    return np.sqrt(np.outer(seen.max(axis=1, initial=0.0), moved.max(axis=1, initial=0.0)))
