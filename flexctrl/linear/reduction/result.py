"""What a reduction returns: the reduced model, where it came from, and its measured error."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import ReductionError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction.low_frequency import low_frequency, undamped
from flexctrl.linear.transfer import Transfer, transfer
from flexctrl.structure.freedoms import numbers

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

    from flexctrl.linear.modes import Modes
    from flexctrl.linear.reduction.error import ErrorReport
    from flexctrl.linear.response import FrequencyResponse

__all__ = ["Method", "Reduced", "ReducedModel", "corrected", "galerkin"]


class Method(Protocol):
    """A way to reduce, as a frozen value."""

    def apply(self, full: LinearModel) -> Reduced:
        """Reduce a model without massless freedoms."""
        ...


@frozen(eq=False)
class Reduced(ABC):
    """A reduced model with its origin.

    Attributes
    ----------
    full : LinearModel
        The model reduced (massless freedoms condensed).
    method : Method
        How it was reduced.
    """

    full: LinearModel
    method: Method

    def __str__(self) -> str:
        return f"{self.full.name}: {self.order} of {len(self.full.coordinates)} coordinates by {self.method}"

    @property
    @abstractmethod
    def order(self) -> int:
        """Number of coordinates (second order) or states (first order)."""

    @abstractmethod
    def transfer(self, top: float) -> Transfer:
        """Evaluator of G_r(s).

        Parameters
        ----------
        top : float
            Good up to |s| = top, rad/s.

        Returns
        -------
        callable
            s, shape (N,) to G_r, shape (n_outputs, n_inputs, N).
        """

    @abstractmethod
    def damped_poles(self) -> np.ndarray:
        """Poles of the reduced model, smallest modulus first, rad/s."""

    @abstractmethod
    def frequency_response(
        self, omega: np.ndarray | Sequence[float] | None = None, span: tuple[float, float] | None = None
    ) -> FrequencyResponse:
        """Response of the reduced model.

        Parameters
        ----------
        omega : array_like, optional
            Angular frequencies, rad/s; left out: an adaptive grid with every peak.
        span : tuple of two floats, optional
            Limits of the adaptive grid, rad/s.

        Returns
        -------
        FrequencyResponse
        """

    @abstractmethod
    def to_ss(self) -> control.StateSpace:
        """The reduced model for python-control."""

    def plot(self) -> Figure:
        """Draw full and reduced responses and their difference, channel by channel.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.reduction import reduction_figure

        return reduction_figure(self)

    @cached_property
    def error(self) -> ErrorReport:
        """Measured error over all frequencies of the full model (see :func:`error_report`)."""
        from flexctrl.linear.reduction.error import error_report

        return error_report(self)

    def error_up_to(self, hz: float) -> ErrorReport:
        """Measured error from 0 up to a frequency.

        Parameters
        ----------
        hz : float
            End of the band, Hz.

        Returns
        -------
        ErrorReport
        """
        from flexctrl.linear.reduction.error import error_report

        if not all(value > 0.0 for value in numbers((hz,))):
            raise ReductionError(f"error_up_to: hz = {hz!r}; expected a frequency above 0")
        return error_report(self, 2 * np.pi * hz)


@frozen(eq=False)
class ReducedModel(Reduced):
    """A reduced model that is still second order, with the signal names of the full one.

    Attributes
    ----------
    linear : LinearModel
        The reduced model.
    basis : numpy.ndarray, shape (n, r)
        q ≈ basis · q_reduced, in the coordinates of ``full``.
    rigid : int
        Rigid-body modes, kept exactly.
    bound : numpy.ndarray, shape (n_outputs, n_inputs)
        What |G − G_r| cannot exceed at any frequency, known beforehand; infinite where no bound is known.
    """

    linear: LinearModel
    basis: np.ndarray
    rigid: int
    bound: np.ndarray

    @property
    def order(self) -> int:
        """Number of coordinates."""
        return len(self.linear.coordinates)

    def modes(self, count: int | None = None) -> Modes:
        """Modes of the reduced model; as :meth:`LinearModel.modes`."""
        return self.linear.modes(count)

    def transfer(self, top: float) -> Transfer:
        """Evaluator of G_r(s), good up to |s| = top (rad/s)."""
        return transfer(self.linear, top)

    def damped_poles(self) -> np.ndarray:
        """Poles of the reduced model; as :meth:`LinearModel.damped_poles`."""
        return self.linear.damped_poles()

    def frequency_response(
        self, omega: np.ndarray | Sequence[float] | None = None, span: tuple[float, float] | None = None
    ) -> FrequencyResponse:
        """Response of the reduced model; as :meth:`LinearModel.frequency_response`."""
        return self.linear.frequency_response(omega, span)

    def to_ss(self) -> control.StateSpace:
        """First-order form of the reduced model; as :meth:`LinearModel.to_ss`."""
        return self.linear.to_ss()


def galerkin(
    full: LinearModel,
    method: Method,
    basis: np.ndarray,
    names: Sequence[str],
    rigid_coordinates: np.ndarray,
    static_correction: bool = False,
) -> ReducedModel:
    """Project a model, keeping its rigid-body motion exact.

    Parameters
    ----------
    full : LinearModel
    method : Method
        Kept with the result.
    basis : numpy.ndarray, shape (n, r)
    names : sequence of r str
    rigid_coordinates : numpy.ndarray, shape (r, n_rigid)
        The rigid-body modes in reduced coordinates, M-orthonormal: basis @ rigid_coordinates.
    static_correction : bool
        Add the feedthrough that makes the DC gain exact.

    Returns
    -------
    ReducedModel
    """
    reduced = full.projected(basis, names)
    if rigid_coordinates.shape[1]:
        reduced = _with_exact_rigid_motion(full, reduced, basis, rigid_coordinates)
    if static_correction:
        reduced = corrected(full, reduced, basis @ rigid_coordinates, rigid_coordinates)
    unknown = np.full(full.D.shape, np.inf)
    return ReducedModel(full, method, reduced, basis, rigid_coordinates.shape[1], unknown)


def corrected(full: LinearModel, reduced: LinearModel, rigid: np.ndarray, rigid_reduced: np.ndarray) -> LinearModel:
    """Add the feedthrough by which the expansions of both models at s = 0 agree in the constant term.

    Parameters
    ----------
    full, reduced : LinearModel
    rigid, rigid_reduced : numpy.ndarray
        Rigid-body modes of either, M-orthonormal.

    Returns
    -------
    LinearModel
    """
    missing = low_frequency(full, rigid).constant - low_frequency(reduced, rigid_reduced).constant
    return replace(reduced, D=reduced.D + missing)


def _with_exact_rigid_motion(
    full: LinearModel, reduced: LinearModel, basis: np.ndarray, rigid: np.ndarray
) -> LinearModel:
    """Take the round-off of the projection out of K R = 0, and out of C R = 0 where no damper resists."""
    K = _deflated(full.K, reduced.K, reduced.M, basis, rigid)
    C = _deflated(full.C, reduced.C, reduced.M, basis, rigid[:, undamped(full, basis @ rigid)])
    return replace(reduced, C=C, K=K)


def _deflated(
    full: sp.spmatrix, reduced: sp.spmatrix, M: sp.spmatrix, basis: np.ndarray, rigid: np.ndarray
) -> sp.csc_matrix:
    """The matrix with A R = 0 exact; what is left of its rounding elsewhere stays."""
    rest = np.eye(len(rigid)) - rigid @ (M @ rigid).T
    A = rest.T @ (reduced @ rest)
    rounding = np.finfo(float).eps * (abs(basis).T @ (abs(full) @ abs(basis)))
    return sp.csc_matrix(np.where(abs(A) > 1e-3 * rounding, A, 0.0))
