"""What wrappers share: passing through, sampling, and values given by signal name."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexctrl.design.controller import Controller, as_controller
from flexctrl.errors import ControllerError, check_kind, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

__all__ = ["IntegratedController", "Stateless", "Wrapper", "breaks_of", "by_name", "discretised", "in_turn_of"]


def breaks_of(controller: object) -> tuple[float, ...]:
    """Return the instants at which a controller's (or a trajectory's) command jumps.

    Parameters
    ----------
    controller : Controller or Trajectory
        Anything; without ``breaks`` it has none.

    Returns
    -------
    tuple of float
        Seconds, in order.
    """
    return tuple(getattr(controller, "breaks", ()))


def in_turn_of(controller: object) -> int:
    """Return the samples after which a controller does the same again: more than one where it counts them.

    Parameters
    ----------
    controller : Controller
        Anything; without ``in_turn`` it does the same at each.

    Returns
    -------
    int
    """
    return int(getattr(controller, "in_turn", 1))


class Stateless:
    """A law without states: u = command(t, y)."""

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x

    update = rate


@frozen(eq=False)
class Wrapper:
    """Passes everything through to the controller it is wrapped around.

    Attributes
    ----------
    controller : Controller
        Given as anything `as_controller` takes.
    """

    controller: Controller

    def __post_init__(self) -> None:
        object.__setattr__(self, "controller", as_controller(self.controller))

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.controller.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        return self.controller.outputs

    @property
    def sample_time(self) -> float:
        return self.controller.sample_time

    @property
    def breaks(self) -> tuple[float, ...]:
        return breaks_of(self.controller)

    @property
    def in_turn(self) -> int:
        return in_turn_of(self.controller)

    def initial(self) -> np.ndarray:
        return self.controller.initial()

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.command(t, x, y)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.rate(t, x, y)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.update(t, x, y)

    def sampled(self, sample_time: float) -> Controller:
        """Return the same wrapper round the sampled controller.

        Parameters
        ----------
        sample_time : float
            Seconds.

        Returns
        -------
        Controller
            Sampled; whatever the wrapper adds is evaluated at the sample instants and held.
        """
        return dataclasses.replace(self, controller=discretised(self.controller, sample_time))


@frozen(eq=False)
class IntegratedController(Wrapper):
    """Any continuous controller, sampled: its state is integrated between samples with y held.

    LSODA at a relative tolerance of 1e-9 (about a millisecond a sample); time runs on between samples.

    Attributes
    ----------
    controller : Controller
        Continuous.
    sample_time : float
        Seconds.
    """

    sample_time: float = 0.0

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if not x.size:
            return x
        from scipy.integrate import solve_ivp

        run = solve_ivp(
            lambda s, z: self.controller.rate(s, z, y),
            (t, t + self.sample_time),
            x,
            method="LSODA",
            rtol=1e-9,
            atol=1e-12,
            t_eval=(t + self.sample_time,),
        )
        if not run.success or not np.isfinite(run.y).all():
            raise ControllerError(
                f"the state of {type(self.controller).__name__} could not be integrated over the sample at "
                f"t = {t} s: {run.message}"
            )
        return run.y[:, -1]


def discretised(controller: Controller, sample_time: float) -> Controller:
    """Return a continuous controller as sampled every ``sample_time`` seconds, y held between samples.

    Parameters
    ----------
    controller : Controller
        Continuous. Exact if it is linear, also inside wrappers; else its state is integrated.
    sample_time : float
        Seconds.

    Returns
    -------
    Controller
        With the same inputs and outputs.

    Raises
    ------
    ControllerError
        If it is already sampled at another rate.
    """
    own = controller.sample_time
    if own == sample_time:
        return controller
    if own:
        raise ControllerError(
            f"the controller is already sampled every {own} s and cannot be resampled to {sample_time} s; in a loop "
            "some times as fast, Held(controller, seconds) holds its commands"
        )
    sampler: Any = getattr(controller, "sampled", None)
    return sampler(sample_time) if sampler else IntegratedController(controller, sample_time)


def check_plant(plant: Any, owner: str) -> None:
    """Raise unless a plant is a python-control model in state space.

    Parameters
    ----------
    plant : object
    owner : str

    Raises
    ------
    ControllerError
    """
    import control

    expected = "a control.StateSpace, as linear.to_ss() gives"
    check_kind(plant, control.StateSpace, f"{owner}: plant", expected, ControllerError)


def matrix(values: Any, shape: tuple[int, int], what: str) -> np.ndarray:
    """Return a matrix of finite numbers.

    Parameters
    ----------
    values : array_like
    shape : tuple of int
    what : str

    Returns
    -------
    numpy.ndarray

    Raises
    ------
    ControllerError
        If it has another shape, or holds what is no finite number.
    """
    try:
        array = np.atleast_2d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        raise ControllerError(f"{what} = {shortened(values)}; expected a matrix of numbers, {shape}") from None
    if array.shape != shape:
        raise ControllerError(f"{what} must be of shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0].tolist()
        raise ControllerError(f"{what} must be finite; its entry [{row}, {column}] is {array[row, column]}")
    return array


def by_name(values: Mapping[str, float], names: Sequence[str], default: float, what: str) -> np.ndarray:
    """Return ``values`` as an array in the order of ``names``.

    Parameters
    ----------
    values : mapping of str to float
        Not NaN.
    names : sequence of str
        The signals there are.
    default : float
        For names that ``values`` leaves out.
    what : str
        What the values are, for the error message.

    Returns
    -------
    numpy.ndarray, shape (len(names),)

    Raises
    ------
    ControllerError
        If a name is unknown or a value is NaN.
    """
    check_names(values, names, what)
    array = np.array(numbers([values.get(name, default) for name in names]))
    if np.isnan(array).any():
        raise ControllerError(f"{what} of {names[int(np.argmax(np.isnan(array)))]!r} is not a number")
    return array


def check_names(given: Mapping[str, object], names: Sequence[str], what: str) -> None:
    """Raise a `ControllerError` for what is no mapping, and for the first name that is no signal of the controller."""
    check_mapping(given, what)
    for name in given:
        if name not in names:
            raise ControllerError(f"{what}: the controller has no signal {name!r}{did_you_mean(name, names)}")


def check_mapping(given: Mapping[str, object], what: str) -> None:
    """Raise a `ControllerError` for what does not go by names of signals."""
    if not isinstance(given, Mapping):
        raise ControllerError(f"{what}: {shortened(given)}; expected values by name of signal, {{'name': …}}")
