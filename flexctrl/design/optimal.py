"""LQR, Kalman filter and LQG that check what the Riccati solver returned."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from flexctrl.design.feedback import observer_feedback
from flexctrl.design.wrapping import by_name, check_plant, matrix
from flexctrl.errors import ControllerError, DesignError
from flexctrl.frozen import frozen

__all__ = ["Estimator", "IdleInputWarning", "Regulator", "bryson", "kalman", "lqg", "lqr"]


class IdleInputWarning(UserWarning):
    """An input that no state feels: a law on it does nothing."""


_TOLERANCE = 1e-8  # largest Riccati residual accepted, relative to the terms of the equation
_ROUNDING = 1e-10  # share of the largest eigenvalue below zero that products of matrices may leave


@frozen(eq=False)
class Regulator:
    """A linear-quadratic state feedback u = −K x, checked.

    Attributes
    ----------
    gain : numpy.ndarray, shape (n_inputs, n)
        K.
    cost : numpy.ndarray, shape (n, n)
        S, the Riccati solution: the cost from state x is xᵀ S x.
    poles : numpy.ndarray, shape (n,)
        Eigenvalues of A − B K, all stable.
    residual : float
        What is left of the Riccati equation, relative to its terms.
    """

    gain: np.ndarray
    cost: np.ndarray
    poles: np.ndarray
    residual: float


@frozen(eq=False)
class Estimator:
    """A steady Kalman filter gain, checked.

    Attributes
    ----------
    gain : numpy.ndarray, shape (n, n_outputs)
        L.
    covariance : numpy.ndarray, shape (n, n)
        Of the estimation error.
    poles : numpy.ndarray, shape (n,)
        Eigenvalues of A − L C, all stable.
    residual : float
        What is left of the Riccati equation, relative to its terms.
    """

    gain: np.ndarray
    covariance: np.ndarray
    poles: np.ndarray
    residual: float


def bryson(plant: Any, outputs: Mapping[str, float], inputs: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the cost matrices that weigh each signal by its largest acceptable value (Bryson's rule).

    Q = Σ c_iᵀ c_i / ŷ_i² over the outputs named, R = diag(1/û_j²).

    Parameters
    ----------
    plant : control.StateSpace
        With named signals.
    outputs : mapping of str to float
        Output → largest acceptable deviation; outputs left out cost nothing.
    inputs : mapping of str to float
        Input → largest acceptable command; all of them.

    Returns
    -------
    tuple of numpy.ndarray
        Q, shape (n, n), and R, shape (n_inputs, n_inputs), for `lqr`.
    """
    check_plant(plant, "bryson")
    largest = by_name(outputs, plant.output_labels, np.inf, "bryson: outputs")
    command = by_name(inputs, plant.input_labels, np.inf, "bryson: inputs")
    for name, value in [
        *zip(plant.input_labels, command, strict=True),
        *zip(plant.output_labels, largest, strict=True),
    ]:
        if not value > 0.0:
            raise ControllerError(f"bryson: the largest value of {name!r} = {value:g}; expected a number > 0")
    if free := [name for name, value in zip(plant.input_labels, command, strict=True) if np.isinf(value)]:
        raise ControllerError(f"bryson: inputs: {', '.join(free)}: every input needs a largest command, finite and > 0")
    rows = plant.C / largest[:, None]
    return rows.T @ rows, np.diag(command**-2.0)


def lqr(plant: Any, state_cost: np.ndarray, input_cost: np.ndarray) -> Regulator:
    """Return the state feedback that minimises ∫ xᵀ Q x + uᵀ R u (a sum for a sampled plant).

    ``control.lqr`` (or ``dlqr``) does the work; the Riccati residual is then checked, improved by Newton steps
    (Kleinman 1968) if need be, and the closed-loop poles are verified.

    Parameters
    ----------
    plant : control.StateSpace
        Continuous or sampled.
    state_cost : numpy.ndarray, shape (n, n)
        Q, symmetric, positive semidefinite.
    input_cost : numpy.ndarray, shape (n_inputs, n_inputs)
        R, symmetric, positive definite.

    Returns
    -------
    Regulator

    Raises
    ------
    ControllerError
        For a cost of another shape, or one that is not symmetric or not (semi)definite as it must be.
    DesignError
        If no stabilising solution was found; names the mode that cannot be moved or that the cost does not see.

    Warns
    -----
    IdleInputWarning
        For inputs that no state feels, as of a motor that is held: their gains are zero.
    """
    check_plant(plant, "lqr")
    A, B = plant.A, plant.B
    Q, R = _semidefinite(state_cost, len(A), "state cost"), _definite(input_cost, B.shape[1], "input cost")
    equation = _Riccati(A, B, Q, R, bool(plant.isdtime(strict=True)))
    K, S, residual = _checked(equation, plant, "lqr", ("no input moves", "the state cost does not see"))
    _warn_of_idle(plant)
    return Regulator(K, S, np.linalg.eigvals(A - B @ K), residual)


def kalman(plant: Any, process: np.ndarray, measurement: np.ndarray) -> Estimator:
    """Return the steady Kalman filter gain for white noise on the states and on the outputs.

    Parameters
    ----------
    plant : control.StateSpace
        Continuous (noise intensities) or sampled (covariances; the gain is that of the one-step predictor).
    process : numpy.ndarray, shape (n, n)
        Noise on ẋ, positive semidefinite; ``plant.B @ W @ plant.B.T`` for noise on the inputs.
    measurement : numpy.ndarray, shape (n_outputs, n_outputs)
        Noise on y, positive definite.

    Returns
    -------
    Estimator

    Raises
    ------
    ControllerError
        For noise of another shape, or that is not symmetric or not (semi)definite as it must be.
    DesignError
        If no stable filter was found; names the mode that no output sees or that no noise moves.
    """
    check_plant(plant, "kalman")
    A, C = plant.A, plant.C
    W, V = _semidefinite(process, len(A), "process noise"), _definite(measurement, len(C), "measurement noise")
    equation = _Riccati(A.T, C.T, W, V, bool(plant.isdtime(strict=True)))
    K, P, residual = _checked(equation, plant, "kalman", ("no output sees", "the process noise does not move"))
    return Estimator(K.T, P, np.linalg.eigvals(A - K.T @ C), residual)


def lqg(
    plant: Any, state_cost: np.ndarray, input_cost: np.ndarray, process: np.ndarray, measurement: np.ndarray
) -> Any:
    """Return the LQG controller: `lqr` on the states that `kalman` estimates.

    Parameters
    ----------
    plant : control.StateSpace
        Continuous or sampled, for example the rigid twin.
    state_cost, input_cost : numpy.ndarray
        Q and R of `lqr`.
    process, measurement : numpy.ndarray
        Noises of `kalman`.

    Returns
    -------
    control.StateSpace
        From the plant's outputs to its inputs; see `observer_feedback`.
    """
    regulator = lqr(plant, state_cost, input_cost)
    estimator = kalman(plant, process, measurement)
    return observer_feedback(regulator.gain, estimator.gain, plant)


Solution = tuple[np.ndarray, np.ndarray, float]  # gain, Riccati solution, residual


@frozen(eq=False)
class _Riccati:
    """The Riccati equation of min ∫ xᵀQx + uᵀRu, ẋ = A x + B u, or of the sum for x⁺ = A x + B u."""

    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    sampled: bool

    def solve(self) -> Solution:
        """python-control's solution, improved by Newton steps (Kleinman) as long as they help."""
        import control

        K, S, _ = (control.dlqr if self.sampled else control.lqr)(self.A, self.B, self.Q, self.R)
        best = np.asarray(K), np.asarray(S), self.residual(np.asarray(S))
        for _ in range(5):
            if best[2] < 1e-13 or self.growth(best[0]) >= 0:
                break
            S = self.cost(best[0])
            tried = self.gain(S), S, self.residual(S)
            if not tried[2] < best[2]:
                break
            best = tried
        return best

    def cost(self, K: np.ndarray) -> np.ndarray:
        """Cost of the stable law u = −K x."""
        from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

        closed, spent = self.A - self.B @ K, self.Q + K.T @ self.R @ K
        S = solve_discrete_lyapunov(closed.T, spent) if self.sampled else solve_continuous_lyapunov(closed.T, -spent)
        return (S + S.T) / 2

    def gain(self, S: np.ndarray) -> np.ndarray:
        """Best law for the cost S."""
        if self.sampled:
            return np.linalg.solve(self.R + self.B.T @ S @ self.B, self.B.T @ S @ self.A)
        return np.linalg.solve(self.R, self.B.T @ S)

    def residual(self, S: np.ndarray) -> float:
        """Norm of what is left of the equation over the sum of the norms of its terms."""
        A = self.A
        quadratic = self.gain(S).T @ self.B.T @ S @ (A if self.sampled else np.eye(len(A)))
        linear = (A.T @ S @ A, -S) if self.sampled else (A.T @ S, S @ A)
        terms = (*linear, -quadratic, self.Q)
        scale = sum(float(np.linalg.norm(term)) for term in terms)
        return float(np.linalg.norm(sum(terms))) / scale if scale else 0.0

    def growth(self, K: np.ndarray) -> float:
        """How far the least stable pole is beyond the border of stability; stable if negative."""
        return float(_beyond(np.linalg.eigvals(self.A - self.B @ K), self.sampled).max(initial=-1.0))

    def mode_is_stuck(self, pole: complex) -> bool:
        """Whether B cannot move the mode at a pole (Hautus test)."""
        return _loses_rank(np.hstack([pole * np.eye(len(self.A)) - self.A, self.B]))

    def mode_is_unseen(self, pole: complex) -> bool:
        """Whether Q does not see the mode at a pole (Hautus test)."""
        return _loses_rank(np.hstack([(pole * np.eye(len(self.A)) - self.A).conj().T, self.Q]))


def _checked(equation: _Riccati, plant: Any, what: str, blame: tuple[str, str]) -> Solution:
    try:
        K, S, residual = equation.solve()
    except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
        said = " ".join(str(error).split())
        raise DesignError(f"{what}: {said}; {_reason(equation, plant, blame)}") from error
    growth = equation.growth(K)
    if not (residual < _TOLERANCE and growth < 0):
        raise DesignError(
            f"{what}: the Riccati residual is {residual:.1e} and the least stable pole is "
            f"{'outside' if growth >= 0 else 'inside'} the stable region; {_reason(equation, plant, blame)}"
        )
    return K, S, residual


def _reason(equation: _Riccati, plant: Any, blame: tuple[str, str]) -> str:
    """The first mode that does not die out by itself and that B cannot move or Q does not see."""
    poles, shapes = np.linalg.eig(plant.A)
    slight = -1e-9 * float(np.linalg.norm(plant.A))
    for pole, shape in zip(poles, shapes.T, strict=True):
        if _beyond(np.array([pole]), equation.sampled)[0] < slight:
            continue
        tests = (equation.mode_is_stuck, equation.mode_is_unseen)
        for complaint, fails in zip(blame, tests, strict=True):
            if fails(pole):
                name = plant.state_labels[int(np.argmax(np.abs(shape)))]
                return f"{complaint} the mode at {pole:.4g} (mostly state {name!r}){_unfelt(plant)}"
    return "check the scaling of the model and of the weights"


def _unfelt(plant: Any) -> str:
    """What is to be said of inputs that no state feels."""
    names = ", ".join(_idle(plant))
    return f"; no state feels {names}: was all that it acts on held in the equilibrium?" if names else ""


def _idle(plant: Any) -> list[str]:
    return [name for name, column in zip(plant.input_labels, plant.B.T, strict=True) if not column.any()]


def _warn_of_idle(plant: Any) -> None:
    if not (names := _idle(plant)):
        return
    warnings.warn(
        f"lqr: no state feels {', '.join(names)}, so gains there are zero. Where all that an input acts on is held, "
        "linearize(model, at=rest.state, inputs=…) lets go of it, under inputs that bear what rest.holding tells",
        IdleInputWarning,
        stacklevel=3,
    )


def _beyond(poles: np.ndarray, sampled: bool) -> np.ndarray:
    return np.abs(poles) - 1.0 if sampled else poles.real


def _loses_rank(matrix: np.ndarray) -> bool:
    sizes = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(sizes > 0, sizes, 1.0)
    return bool(np.linalg.svd(scaled, compute_uv=False)[-1] < 1e-9)


def _semidefinite(given: np.ndarray, n: int, what: str) -> np.ndarray:
    array = _symmetric(given, n, what)
    values = np.linalg.eigvalsh(array)
    if values.size and values[0] < -_ROUNDING * np.abs(values).max():
        raise ControllerError(f"the {what} must be positive semidefinite; its least eigenvalue is {values[0]:.4g}")
    return array


def _definite(given: np.ndarray, n: int, what: str) -> np.ndarray:
    """What counts is whether it is so in units in which its diagonal is one: a motor in mN m beside one in kN m is."""
    array = _symmetric(given, n, what)
    unit = np.sqrt(np.maximum(array.diagonal(), 0.0))
    if not unit.all() or np.linalg.eigvalsh(array / np.outer(unit, unit)).min(initial=1.0) <= 0.0:
        least = np.linalg.eigvalsh(array)[0]
        raise ControllerError(f"the {what} must be positive definite; its least eigenvalue is {least:.4g}")
    return array


def _symmetric(given: np.ndarray, n: int, what: str) -> np.ndarray:
    array = matrix(given, (n, n), f"the {what}")
    if not np.allclose(array, array.T, rtol=1e-10, atol=1e-12 * np.abs(array).max(initial=0.0)):
        raise ControllerError(f"the {what} must be symmetric")
    return (array + array.T) / 2
