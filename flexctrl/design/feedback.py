"""Feedback laws as ordinary python-control systems, from named plant outputs to named plant inputs.

All are regulators with their minus sign inside, u = −K y: connect them by name (``flexctrl.simulate``,
``control.interconnect([plant, law])``) or with ``control.feedback(plant, law, sign=1)``; the loop gain for margins
is ``-law * plant``. `Tracking` makes them follow a reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexctrl.design.piecewise import require_finite
from flexctrl.design.wrapping import check_plant, matrix
from flexctrl.errors import ControllerError, check_kind
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

__all__ = ["FilteredRate", "observer", "observer_feedback", "pd", "pi", "pid", "state_feedback"]


@frozen
class FilteredRate:
    """The rate of a measured signal from the signal itself: s/(T s + 1), where no rate is measured.

    Attributes
    ----------
    time : float
        Filter time constant T > 0, s.
    """

    time: float

    def __post_init__(self) -> None:
        if not numbers([self.time])[0] > 0:
            raise ControllerError(f"FilteredRate: the time constant {self.time} s must be > 0")


def pd(kp: float, kd: float, *, measured: str, rate: str | FilteredRate, command: str) -> Any:
    """Return u = −kp y − kd ẏ.

    Parameters
    ----------
    kp, kd : float
        Gains, command per unit of y and of ẏ.
    measured : str
        Plant output y.
    rate : str or FilteredRate
        Plant output ẏ, or how to filter it from y.
    command : str
        Plant input u.

    Returns
    -------
    control.StateSpace
        Continuous.
    """
    return pid(kp, 0.0, kd, measured=measured, rate=rate, command=command)


def pi(kp: float, ki: float, *, measured: str, command: str) -> Any:
    """Return u = −kp y − ki ∫y.

    Parameters
    ----------
    kp, ki : float
        Gains, command per unit of y and of its integral.
    measured : str
        Plant output y.
    command : str
        Plant input u.

    Returns
    -------
    control.StateSpace
        Continuous; its state is ``integral``.
    """
    require_finite("pi: gain", kp, ki)
    return _law(_integral(ki), [[-kp]], [measured], command)


def pid(kp: float, ki: float, kd: float, *, measured: str, rate: str | FilteredRate, command: str) -> Any:
    """Return u = −kp y − ki ∫y − kd ẏ.

    With limits on u the integral winds up: see `AntiWindup`.

    Parameters
    ----------
    kp, ki, kd : float
        Gains, command per unit of y, of its integral and of its rate; ki = 0 leaves out the integrator.
    measured : str
        Plant output y.
    rate : str or FilteredRate
        Plant output ẏ, or how to filter it from y.
    command : str
        Plant input u.

    Returns
    -------
    control.StateSpace
        Continuous; its states are ``integral`` and ``filtered``, as far as needed.

    Raises
    ------
    ControllerError
        If the rate is the measured signal itself, or a gain is no finite number.
    """
    require_finite("pid: gain", kp, ki, kd)
    check_rate(measured, rate, "pid")
    if isinstance(rate, FilteredRate):
        # With the filtered signal z, T ż = y − z, the filtered rate is (y − z)/T.
        slow = [("filtered", -1 / rate.time, 1 / rate.time, kd / rate.time)] if kd else []
        return _law(_integral(ki) + slow, [[-kp - kd / rate.time]], [measured], command)
    return _law(_integral(ki), [[-kp, -kd]], [measured, rate], command)


def check_rate(measured: str, rate: str | FilteredRate, owner: str) -> None:
    """Raise if the signal of the rate is the measured one itself.

    Parameters
    ----------
    measured : str
    rate : str or FilteredRate
    owner : str
        The law, for the message.

    Raises
    ------
    ControllerError
    """
    if rate == measured:
        raise ControllerError(
            f"{owner}: rate = {rate!r} is the measured signal itself; give the signal of its rate, "
            "or the time constant of a filter that makes it (in Python: FilteredRate)"
        )


def state_feedback(gain: np.ndarray, plant: Any) -> Any:
    """Return u = −K x, with x read from the plant's outputs: the gain G with G C = K, so u = −G y.

    For a plant whose outputs tell its states, as the rigid twin with every coordinate and rate measured (in
    whatever coordinates it was exported). Otherwise estimate the states: `observer_feedback`. To read only
    some outputs, give the plant as ``plant[["angle", "angle_rate"], :]``.

    Parameters
    ----------
    gain : numpy.ndarray, shape (n_inputs, n)
        K, for example `lqr`'s.
    plant : control.StateSpace
        What it was designed on, with named signals.

    Returns
    -------
    control.StateSpace
        Static, from the plant's outputs to its inputs.

    Raises
    ------
    ControllerError
        If K x cannot be told from the outputs, naming the state that is missing most.
    """
    check_plant(plant, "state_feedback")
    K = matrix(gain, (plant.ninputs, plant.nstates), "state_feedback: the gain")
    if np.any(plant.D):
        raise ControllerError(
            "state_feedback: an output of the plant depends on its inputs directly (an acceleration?): leave it "
            "out, plant[[names], :], or use observer_feedback"
        )
    sizes = np.linalg.norm(plant.C, axis=1)
    sizes[sizes == 0] = 1.0
    rows = plant.C / sizes[:, None]
    G = np.linalg.lstsq(rows.T, K.T, rcond=None)[0].T
    missing = np.abs(G @ rows - K).max(axis=0)
    if missing.max(initial=0.0) > 1e-8 * np.abs(K).max(initial=0.0):
        raise ControllerError(
            f"state_feedback: the outputs {list(plant.output_labels)} do not tell state "
            f"{plant.state_labels[int(np.argmax(missing))]!r}: add outputs (positions and rates), or use "
            "observer_feedback"
        )
    return _static(-G / sizes, plant.output_labels, plant.input_labels)


def observer(plant: Any, gain: np.ndarray) -> Any:
    """Return the state estimator x̂˙ = A x̂ + B u + L (y − C x̂ − D u), as a system of its own.

    Parameters
    ----------
    plant : control.StateSpace
        Continuous or sampled (then the one-step predictor).
    gain : numpy.ndarray, shape (n, n_outputs)
        L, for example `kalman`'s.

    Returns
    -------
    control.StateSpace
        From the plant's inputs and outputs to ``<state>_hat``.
    """
    import control

    check_plant(plant, "observer")
    L = matrix(gain, (plant.nstates, plant.noutputs), "observer: the gain")
    n = plant.nstates
    return control.StateSpace(
        plant.A - L @ plant.C,
        np.hstack([plant.B - L @ plant.D, L]),
        np.eye(n),
        np.zeros((n, plant.ninputs + plant.noutputs)),
        plant.dt,
        inputs=[*plant.input_labels, *plant.output_labels],
        outputs=[f"{_legal(state)}_hat" for state in plant.state_labels],
    )


def observer_feedback(gain: np.ndarray, observer_gain: np.ndarray, plant: Any) -> Any:
    """Return state feedback on estimated states, u = −K x̂, running on the plant's outputs alone.

    x̂˙ = (A − B K − L C + L D K) x̂ + L y. Designed on a rigid model it can be run on the flexible machine, as
    long as that has outputs and inputs of the same names.

    Parameters
    ----------
    gain : numpy.ndarray, shape (n_inputs, n)
        K.
    observer_gain : numpy.ndarray, shape (n, n_outputs)
        L.
    plant : control.StateSpace
        What both were designed on.

    Returns
    -------
    control.StateSpace
        With the plant's time base, from its outputs to its inputs.
    """
    import control

    check_plant(plant, "observer_feedback")
    K = matrix(gain, (plant.ninputs, plant.nstates), "observer_feedback: the gain")
    L = matrix(observer_gain, (plant.nstates, plant.noutputs), "observer_feedback: the observer gain")
    return control.StateSpace(
        plant.A - plant.B @ K - L @ plant.C + L @ plant.D @ K,
        L,
        -K,
        np.zeros((plant.ninputs, plant.noutputs)),
        plant.dt,
        inputs=list(plant.output_labels),
        outputs=list(plant.input_labels),
        states=[f"{_legal(state)}_hat" for state in plant.state_labels],
    )


State = tuple[str, float, float, float]  # name, pole, gain from the measured signal, gain to the command


def _integral(ki: float) -> list[State]:
    return [("integral", 0.0, 1.0, -ki)] if ki else []


def _law(states: list[State], direct: list[list[float]], inputs: Sequence[str], command: str) -> Any:
    """First-order states driven by the first input, side by side."""
    import control

    for name in (*inputs, command):
        check_kind(name, str, "feedback law: a signal", "the name of one", ControllerError)
    if not states:
        return _static(np.array(direct), inputs, [command])
    names, poles, drives, weights = zip(*states, strict=True)
    B = np.zeros((len(states), len(inputs)))
    B[:, 0] = drives
    return control.StateSpace(
        np.diag(poles), B, [list(weights)], direct, 0, inputs=list(inputs), outputs=[command], states=list(names)
    )


def _static(gain: np.ndarray, inputs: Sequence[str], outputs: Sequence[str]) -> Any:
    import control

    p, m = gain.shape
    empty = np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0))
    # A static law is continuous (dt = 0), not "any time base", so that what it is wrapped in knows.
    return control.StateSpace(*empty, gain, 0, inputs=list(inputs), outputs=list(outputs))


def _legal(state: str) -> str:
    return state if state.isidentifier() else state.replace("[", "_").replace("]", "")
