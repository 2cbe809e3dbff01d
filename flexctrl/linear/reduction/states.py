"""A reduced model that is first order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import eigvals, schur, solve_triangular

from flexctrl.frozen import frozen
from flexctrl.linear.grid import peak_grid, refined
from flexctrl.linear.reduction.result import Reduced
from flexctrl.linear.response import MOST_POINTS, FrequencyResponse, frequencies_of, response_span
from flexctrl.linear.transfer import Transfer

if TYPE_CHECKING:
    import control

__all__ = ["ReducedStates", "Triple", "states_transfer"]

_CLOSEST = float(np.finfo(float).eps)


class Triple(NamedTuple):
    """ẋ = A x + B u, y = C x."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray


def states_transfer(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> Transfer:
    """Evaluator of D + C (sI − A)⁻¹ B through one Schur form: n² operations for each s, no squared memory.

    Parameters
    ----------
    A, B, C, D : numpy.ndarray
        Balanced states, so that every block of A has the size of its poles.

    Returns
    -------
    callable
        s, shape (N,) to G, shape (n_outputs, n_inputs, N).
    """
    T, Q = schur(A, output="complex") if len(A) else (np.zeros((0, 0)), np.zeros((0, 0)))
    load, seen = Q.conj().T @ B, C @ Q

    poles = np.diag(T)
    off = np.maximum(_CLOSEST * np.abs(poles), _CLOSEST**2)

    def away(s: np.ndarray) -> np.ndarray:
        """s less the poles; on a pole itself as near as round-off lets s be, so that a search sees a large value."""
        gap = s - poles[:, None]
        return np.where(gap == 0.0, off[:, None], gap)

    def together(s: np.ndarray) -> np.ndarray:
        """State by state, all points at once."""
        x, gap = np.zeros((*load.shape, s.size), complex), away(s)
        for k in range(len(T) - 1, -1, -1):
            x[k] = (load[k, :, None] + np.tensordot(T[k, k + 1 :], x[k + 1 :], 1)) / gap[k]
        return x

    def singly(s: np.ndarray) -> np.ndarray:
        """Point by point: quicker where there are few."""
        x, gap, matrix, diagonal = np.zeros((*load.shape, s.size), complex), away(s), -T, np.arange(len(T))
        for j in range(s.size):
            matrix[diagonal, diagonal] = gap[:, j]
            x[:, :, j] = solve_triangular(matrix, load, check_finite=False)
        return x

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        x = (singly if s.size < len(T) else together)(s)
        return np.asarray(np.tensordot(seen, x, 1) + D[:, :, None])

    return evaluate


@frozen(eq=False)
class ReducedStates(Reduced):
    """A reduced model in first-order form, with the signal names of the full one.

    Attributes
    ----------
    system : Triple
        A, B, C; the states kept exactly come first.
    D : numpy.ndarray, shape (n_outputs, n_inputs)
        Feedthrough.
    exact : int
        States that were not approximated (integrators, unstable and undamped modes).
    hankel : numpy.ndarray
        Hankel singular values of the balanced part, decreasing.
    bound : numpy.ndarray, shape (n_outputs, n_inputs)
        2 Σ of the Hankel singular values left out, and the rounding of poles: what |G − G_r| cannot exceed at any
        frequency; infinite for a model cut to its lowest modes beforehand.
    """

    system: Triple
    D: np.ndarray
    exact: int
    hankel: np.ndarray
    bound: np.ndarray

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.system.A)

    def transfer(self, top: float) -> Transfer:
        """Evaluator of G_r(s), any s."""
        return states_transfer(*self.system, self.D)

    def frequency_response(
        self, omega: np.ndarray | Sequence[float] | None = None, span: tuple[float, float] | None = None
    ) -> FrequencyResponse:
        """Response of the reduced model; as :meth:`LinearModel.frequency_response`."""
        evaluate, poles = self.transfer(np.inf), self.damped_poles()
        if omega is None:
            points, values = refined(evaluate, peak_grid(poles, span or response_span(poles)), MOST_POINTS)
        else:
            points = frequencies_of(omega)
            values = evaluate(1j * points)
        return FrequencyResponse(points, values, self.full.inputs, self.full.outputs, self.full.name)

    def damped_poles(self) -> np.ndarray:
        """Poles, smallest modulus first."""
        poles = eigvals(self.system.A) if self.order else np.zeros(0)
        return poles[np.argsort(abs(poles), kind="stable")]

    def to_ss(self) -> control.StateSpace:
        """The reduced model for python-control."""
        import control

        exact = [f"exact{i + 1}" for i in range(self.exact)]
        rest = [f"balanced{i + 1}" for i in range(self.order - self.exact)]
        return control.ss(
            *self.system,
            self.D,
            inputs=list(self.full.inputs),
            outputs=list(self.full.outputs),
            states=exact + rest,
            name=self.full.name,
        )
