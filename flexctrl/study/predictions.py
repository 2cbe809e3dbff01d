"""What a linear model predicts and a nonlinear one tells: by runs, by equilibria, by frequencies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import field

import numpy as np
import scipy.linalg as la
from scipy.interpolate import CubicSpline

from flexctrl.dynamics.alpha.method import GeneralizedAlpha
from flexctrl.dynamics.methods.checked import Unchecked
from flexctrl.dynamics.run import Status
from flexctrl.dynamics.simulate import simulate
from flexctrl.dynamics.steps import Integrator
from flexctrl.errors import EquilibriumError, LinearizationError, StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.statespace import modal_first_order
from flexctrl.model.linearize import linearize
from flexctrl.study.amplitudes import Amplitude, Case, ConstantLoad
from flexctrl.study.giving_way import gives_way, loaded
from flexctrl.study.unstopped import unstopped

__all__ = [
    "CurveDifference",
    "CurveValue",
    "Deflection",
    "FinalValue",
    "Frequency",
    "Peak",
    "Period",
    "Quantity",
    "Trial",
    "linear_outputs",
    "trial",
]

_POINTS = 800
_NONE = np.zeros(0)


@frozen(eq=False)
class Trial:
    """Prediction and truth at one amplitude.

    Attributes
    ----------
    amplitude, predicted, actual : float
        ``predicted`` by the linear model, ``actual`` by the nonlinear one; for a curve difference their RMS
        values. Infinite where there is no such value (it does not oscillate, it has no equilibrium).
    error : float
        |actual − predicted|/|predicted|, for a curve the RMS difference over the RMS prediction.
    t, linear, nonlinear : numpy.ndarray
        The curves compared, as deviations from rest; empty if nothing was run.
    gave_way : bool
        Whether the machine, loaded on from rest, stopped bearing the load before this amplitude; the error is
        then infinite.
    """

    amplitude: float
    predicted: float
    actual: float
    error: float
    t: np.ndarray = field(default_factory=lambda: _NONE)
    linear: np.ndarray = field(default_factory=lambda: _NONE)
    nonlinear: np.ndarray = field(default_factory=lambda: _NONE)
    gave_way: bool = False


@frozen
class CurveValue(ABC):
    """A number read off the curve of an output.

    Attributes
    ----------
    output : str
    """

    output: str

    @abstractmethod
    def value(self, t: np.ndarray, y: np.ndarray) -> float:
        """Return the number.

        Parameters
        ----------
        t : numpy.ndarray, shape (m,)
            Time [s].
        y : numpy.ndarray, shape (m,)
            Deviation of the output from rest.

        Returns
        -------
        float
            Infinite if the curve has no such number.
        """


@frozen
class Period(CurveValue):
    """Mean period of an output: between its crossings, in one direction, of the level midway of its extremes [s].

    Attributes
    ----------
    output : str
    """

    def value(self, t: np.ndarray, y: np.ndarray) -> float:
        curve = CubicSpline(t, y - 0.5 * (y.max() + y.min()))
        roots = curve.roots(extrapolate=False)
        rising = curve(roots, 1) > 0.0
        laps = [np.diff(roots[way]) for way in (rising, ~rising)]
        found = np.concatenate(laps)
        return float(found.mean()) if found.size else np.inf

    def __str__(self) -> str:
        return f"period of {self.output}"


@frozen
class Peak(CurveValue):
    """Largest deviation of an output from rest.

    Attributes
    ----------
    output : str
    """

    def value(self, t: np.ndarray, y: np.ndarray) -> float:
        return float(np.abs(y).max())

    def __str__(self) -> str:
        return f"peak of {self.output}"


@frozen
class FinalValue(CurveValue):
    """Deviation of an output from rest at the end.

    Attributes
    ----------
    output : str
    """

    def value(self, t: np.ndarray, y: np.ndarray) -> float:
        return float(y[-1])

    def __str__(self) -> str:
        return f"final value of {self.output}"


@frozen
class CurveDifference:
    """RMS difference of an output's curves over the RMS of the linear one.

    Attributes
    ----------
    output : str
    """

    output: str

    def __str__(self) -> str:
        return f"curve of {self.output}"


@frozen
class Deflection:
    """Static deviation of an output under a load, in equilibrium.

    Attributes
    ----------
    output : str
    """

    output: str

    def __str__(self) -> str:
        return f"deflection of {self.output}"


@frozen
class Frequency:
    """Frequency of small vibrations about the loaded shape, against that about the shape without the load [Hz].

    Attributes
    ----------
    mode : int
        As in ``linear.modes()``, from 1; found again under the load by its shape.
    """

    mode: int

    def __str__(self) -> str:
        return f"frequency of mode {self.mode}"


Quantity = CurveValue | CurveDifference | Deflection | Frequency


def trial(
    case: Case, vary: Amplitude, quantity: Quantity, amplitude: float, until: float, method: Integrator | None
) -> Trial:
    """Compare prediction and truth at one amplitude.

    Parameters
    ----------
    case : Case
    vary : Amplitude
    quantity : Quantity
    amplitude : float
    until : float
        Length of the runs [s].
    method : GeneralizedAlpha, AdaptiveAlpha or None
        Of the nonlinear run; None: generalised alpha, two steps between points.

    Returns
    -------
    Trial
    """
    if isinstance(quantity, Deflection | Frequency):
        if not isinstance(vary, ConstantLoad):
            raise StructureError(f"the {quantity} is that of a loaded machine: vary a ConstantLoad or ask for a Period")
        u = vary.begin(case, amplitude)[2]
        if isinstance(quantity, Deflection):
            return _static(case, quantity, amplitude, u)
        return _tuned(case, quantity, amplitude, u)
    return _run(case, vary, quantity, amplitude, until, method)


def _place(case: Case, output: str) -> int:
    if output not in case.model.outputs:
        raise StructureError(f"the model has no output {output!r}{did_you_mean(output, case.model.outputs)}")
    return case.model.outputs.index(output)


def _static(case: Case, quantity: Deflection, amplitude: float, u: np.ndarray) -> Trial:
    place, linear = _place(case, quantity.output), case.linear
    chosen = linear.select(outputs=[quantity.output])
    predicted = float((chosen.frequency_response([0.0]).values[0, :, 0].real @ u).item())
    if not np.isfinite(predicted):
        raise StructureError(f"{linear.name} drifts away under this load; deflection has no meaning")
    try:
        rest = loaded(case, u)
    except EquilibriumError:
        return Trial(amplitude, predicted, np.inf, np.inf, gave_way=True)
    if gives_way(case, rest, u):
        return Trial(amplitude, predicted, np.inf, np.inf, gave_way=True)
    actual = rest.outputs[quantity.output] - float(case.outputs[place])
    return Trial(amplitude, predicted, actual, _relative(predicted, actual))


def _tuned(case: Case, quantity: Frequency, amplitude: float, u: np.ndarray) -> Trial:
    before = case.linear.modes()
    if not before.unstable + before.rigid < quantity.mode <= len(before):
        raise StructureError(f"mode {quantity.mode} of {case.linear.name} has no frequency; see linear.modes()")
    shape, predicted = before.shapes[:, quantity.mode - 1], float(before.frequencies[quantity.mode - 1])
    try:
        rest = loaded(case, u)
        now = linearize(case.model, at=rest)
    except (EquilibriumError, LinearizationError):
        return Trial(amplitude, predicted, np.inf, np.inf, gave_way=True)
    if gives_way(case, rest, u):
        return Trial(amplitude, predicted, np.inf, np.inf, gave_way=True)
    after = now.modes()
    same = int(np.argmax(np.abs(after.shapes.T @ (now.M @ shape))))
    actual = float(after.frequencies[same])
    return Trial(amplitude, predicted, actual, _relative(predicted, actual))


def _run(
    case: Case,
    vary: Amplitude,
    quantity: CurveValue | CurveDifference,
    amplitude: float,
    until: float,
    method: Integrator | None,
) -> Trial:
    place = _place(case, quantity.output)
    step, v, u = vary.begin(case, amplitude)
    t = np.linspace(0.0, until, _POINTS + 1)
    linear = linear_outputs(case, step, v, u, t)[:, place]
    run = simulate(
        case.model,
        until=until,
        start=case.model.advance(case.rest, step, v, 0.0),
        inputs=dict(zip(case.model.inputs, (case.inputs + u).tolist(), strict=True)),
        method=method or Unchecked(GeneralizedAlpha(until / (2 * _POINTS))),
        every=until / _POINTS,
    )
    if unstopped(run).status is not Status.FINISHED:
        return Trial(amplitude, np.inf, np.inf, np.inf)
    nonlinear = run.y[:, place] - case.outputs[place]
    if isinstance(quantity, CurveDifference):
        values = [float(np.sqrt(np.mean(y**2))) for y in (linear, nonlinear, nonlinear - linear)]
        error = values[2] / values[0] if values[0] else np.inf
        return Trial(amplitude, values[0], values[1], error, t, linear, nonlinear)
    predicted, actual = (quantity.value(t, y) for y in (linear, nonlinear))
    return Trial(amplitude, predicted, actual, _relative(predicted, actual), t, linear, nonlinear)


def _relative(predicted: float, actual: float) -> float:
    if not np.isfinite(predicted) or predicted == 0.0:
        raise StructureError(
            "the linear model predicts no such value (the output does not move, or does not oscillate in this time): "
            "choose another output, or a longer until"
        )
    return abs(actual - predicted) / abs(predicted) if np.isfinite(actual) else np.inf


def linear_outputs(case: Case, step: np.ndarray, v: np.ndarray, u: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the exact response of the linear model at even instants, as deviations from rest.

    Parameters
    ----------
    case : Case
    step, v : numpy.ndarray, shape (n,)
        Initial displacement and rates.
    u : numpy.ndarray, shape (inputs,)
        Constant additional inputs.
    t : numpy.ndarray, shape (m,)

    Returns
    -------
    numpy.ndarray, shape (m, outputs)
    """
    linear = case.linear
    modes, first = linear._modal.modes, modal_first_order(linear)
    if len(first.states) > 2 * len(modes):
        raise StructureError(
            f"{linear.name} has massless freedoms with damping, whose start displacements do not tell: give them mass"
        )
    size = np.sqrt(np.abs(modes.omega_squared))
    weights = modes.shapes.T @ linear.M
    x = np.zeros(2 * len(modes))
    x[0::2] = np.where(size > 0.0, size, 1.0) * (weights @ step)
    x[1::2] = weights @ v
    found = np.empty((len(t), len(x)))
    for rows in first.blocks:
        found[:, rows] = _marched(first.A[rows, rows], first.B[rows] @ u, x[rows], t)
    return found @ first.C.T + first.D @ u


def _marched(A: np.ndarray, push: np.ndarray, x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """ẋ = A x + push at even instants, by the exponential of one step."""
    n = len(x)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = A, push
    step, z = la.expm(whole * (t[1] - t[0])), np.append(x, 1.0)
    found = np.empty((len(t), n))
    for k in range(len(t)):
        found[k], z = z[:n], step @ z
    return found
