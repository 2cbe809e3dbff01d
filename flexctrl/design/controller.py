"""What the simulator asks of a controller, and how python-control systems become one."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np

from flexctrl.errors import ControllerError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import listed

__all__ = ["Controller", "IOSystemController", "LinearController", "as_controller"]


_VALUES, _METHODS = ("inputs", "outputs", "sample_time"), ("initial", "command", "rate", "update")
_WRITTEN = {
    "initial": "def initial(self): return np.zeros(0)",
    "command": "def command(self, t, x, y): return …",
}


@runtime_checkable
class Controller(Protocol):
    """A control law with named signals, evaluated by the simulator.

    Continuous (``sample_time == 0``): u(t) = command(t, x, y) at all times and dx/dt = rate(t, x, y).
    Sampled (``sample_time > 0``): at each instant t_k, u = command(t_k, x_k, y_k), held until t_{k+1},
    and x_{k+1} = update(t_k, x_k, y_k). All three are pure: nothing may be kept outside x.

    Only the method its time base needs is ever called, and `as_controller` supplies the other (and both, for
    a law without states), so an own controller may leave them out.

    Attributes
    ----------
    inputs : tuple of str
        Names of the plant outputs it reads, in the order of y.
    outputs : tuple of str
        Names of the plant inputs it commands, in the order of u.
    sample_time : float
        Seconds between samples; 0.0 for a continuous law.

    Notes
    -----
    A continuous controller may also have ``breaks``, a tuple of the instants (s) at which its command or a
    derivative of it jumps; an integrator ends a step on each of them.
    """

    @property
    def inputs(self) -> tuple[str, ...]: ...

    @property
    def outputs(self) -> tuple[str, ...]: ...

    @property
    def sample_time(self) -> float: ...

    def initial(self) -> np.ndarray:
        """Return its state at the start.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return what it commands.

        Parameters
        ----------
        t : float
            Time, s.
        x : numpy.ndarray, shape (n,)
            Its state.
        y : numpy.ndarray, shape (n_inputs,)
            Measured plant outputs.

        Returns
        -------
        numpy.ndarray, shape (n_outputs,)
            Plant inputs.
        """

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return dx/dt; continuous controllers only.

        Parameters
        ----------
        t, x, y
            As for `command`.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the state at the next sample; sampled controllers only.

        Parameters
        ----------
        t, x, y
            As for `command`, at the sample instant.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """


@frozen(eq=False)
class LinearController:
    """ẋ (or x at the next sample) = A x + B y,  u = C x + D y.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
        Shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs).
    inputs, outputs : tuple of str
        Names of y and of u.
    sample_time : float
        Seconds; 0.0 = continuous.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float = 0.0

    def __post_init__(self) -> None:
        n, m, p = len(self.A), len(self.inputs), len(self.outputs)
        for name, shape in {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}.items():
            matrix = np.array(getattr(self, name), dtype=float)
            if matrix.size and matrix.shape != shape:
                raise ControllerError(f"controller matrix {name} must have the shape {shape}, not {matrix.shape}")
            if not np.isfinite(matrix).all():
                raise ControllerError(f"controller matrix {name} has entries that are not finite")
            object.__setattr__(self, name, matrix.reshape(shape))

    def initial(self) -> np.ndarray:
        return np.zeros(len(self.A))

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u = self.D.dot(y)
        return u + self.C.dot(x) if x.size else u

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.A.dot(x) + self.B.dot(y) if x.size else x

    update = rate

    def sampled(self, sample_time: float) -> LinearController:
        """Return the exact discretisation for y held between samples (zero-order hold).

        Parameters
        ----------
        sample_time : float
            Seconds.

        Returns
        -------
        LinearController
            Its state and command at the sample instants are those of the continuous law whose y is held.
        """
        from scipy.linalg import expm

        n, m = self.B.shape
        block = np.zeros((n + m, n + m))
        block[:n] = np.hstack([self.A, self.B])
        step = expm(block * sample_time)[:n]
        return LinearController(step[:, :n], step[:, n:], self.C, self.D, self.inputs, self.outputs, sample_time)


@frozen(eq=False)
class IOSystemController:
    """A ``control.NonlinearIOSystem`` (a gain schedule, an own update function) as a controller.

    Attributes
    ----------
    system : control.NonlinearIOSystem
        Started from the zero state, with its own parameters.
    inputs, outputs : tuple of str
        Names of y and of u.
    sample_time : float
        Seconds; 0.0 = continuous.
    """

    system: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float = 0.0

    def initial(self) -> np.ndarray:
        return np.zeros(self.system.nstates or 0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.system.output(t, x, y), dtype=float)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.system.dynamics(t, x, y), dtype=float)

    update = rate


@frozen(eq=False)
class _Completed:
    """An own controller with the members it left out."""

    inner: Any
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float

    @property
    def breaks(self) -> tuple[float, ...]:
        return tuple(getattr(self.inner, "breaks", ()))

    @property
    def in_turn(self) -> int:
        return int(getattr(self.inner, "in_turn", 1))

    def initial(self) -> np.ndarray:
        return np.asarray(self.inner.initial())

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.inner.command(t, x, y)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.inner.rate(t, x, y) if x.size else x

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.inner.update(t, x, y) if x.size else x


def as_controller(
    controller: Any, plant_inputs: Collection[str] = (), plant_outputs: Collection[str] = ()
) -> Controller:
    """Return the controller behind a python-control system or an own object, its names checked.

    Signs are the law's own: a system from plant outputs to plant inputs is connected by name, u = C(y), so
    negative feedback has its minus sign inside (as in ``control.interconnect``).

    Parameters
    ----------
    controller : control.StateSpace, control.TransferFunction, control.NonlinearIOSystem or Controller
        python-control systems need named signals and a definite time base (``dt=0`` or seconds).
    plant_inputs, plant_outputs : collection of str
        The names the plant has; empty = names are not checked.

    Returns
    -------
    Controller
        Ready for the simulator; ``controller`` itself when it already is one.

    Raises
    ------
    ControllerError
        If it is no controller, has no definite time base, or a name is unknown to the plant.
    """
    plant_inputs, plant_outputs = listed(plant_inputs, "plant inputs"), listed(plant_outputs, "plant outputs")
    found = _from_control(controller) if _is_control_system(controller) else _from_object(controller)
    for name in found.outputs if plant_inputs else ():
        if name not in plant_inputs:
            hint = did_you_mean(name, plant_inputs)
            raise ControllerError(f"the controller commands {name!r}, which is no input of the plant{hint}")
    for name in found.inputs if plant_outputs else ():
        if name not in plant_outputs:
            hint = did_you_mean(name, plant_outputs)
            raise ControllerError(
                f"the controller reads {name!r}, which is no output of the plant{hint} "
                "(if it is a reference signal, bind it with Commanded(controller, {name: trajectory}))"
            )
    return found


def _is_control_system(candidate: object) -> bool:
    # Until control has been imported nobody can hold one of its systems: spares its import time.
    module = sys.modules.get("control")
    return module is not None and isinstance(candidate, module.InputOutputSystem)


def _from_control(system: Any) -> Controller:
    import control

    inputs, outputs = tuple(system.input_labels), tuple(system.output_labels)
    unnamed = [name for name in inputs + outputs if not name.isidentifier()]
    if unnamed:
        raise ControllerError(
            f"controller {system.name!r} has the signal {unnamed[0]!r}: give it inputs=[...] (names of plant "
            "outputs) and outputs=[...] (names of plant inputs)"
        )
    sample_time = _time_base(system)
    if isinstance(system, control.TransferFunction):
        system = _realised(system)
    if isinstance(system, control.StateSpace):
        return LinearController(system.A, system.B, system.C, system.D, inputs, outputs, sample_time)
    if isinstance(system, control.NonlinearIOSystem):
        return IOSystemController(system, inputs, outputs, sample_time)
    raise ControllerError(f"a {type(system).__name__} cannot be run in time; give a StateSpace or TransferFunction")


def _time_base(system: Any) -> float:
    if system.dt is True:
        raise ControllerError(
            f"controller {system.name!r} is sampled with an unspecified sample time (dt=True): give it in "
            "seconds, for example dt=0.01"
        )
    if system.dt is None and not _is_static(system):
        raise ControllerError(
            f"controller {system.name!r} has states but no time base (dt=None): say dt=0 (continuous) or dt=seconds"
        )
    return float(system.dt or 0.0)


def _is_static(system: Any) -> bool:
    if hasattr(system, "num_array"):
        return all(len(np.trim_zeros(q, "f")) == 1 for q in (*system.num_array.flat, *system.den_array.flat))
    return not system.nstates


def _realised(transfer: Any) -> Any:
    import control

    for num, den in zip(transfer.num_array.flat, transfer.den_array.flat, strict=True):
        if len(np.trim_zeros(num, "f")) > len(np.trim_zeros(den, "f")):
            raise ControllerError(
                f"controller {transfer.name!r} is improper (it differentiates): filter the derivative, "
                "kd s/(T s + 1), or read a rate output"
            )
    try:
        return control.ss(transfer)
    except control.ControlMIMONotImplemented as error:
        raise ControllerError(
            f"controller {transfer.name!r} has several inputs or outputs: give it as a StateSpace "
            "(or install the extra flexctrl[slicot])"
        ) from error


def _check_sample_time(candidate: Any) -> None:
    given = getattr(candidate, "sample_time", 0.0)
    try:
        known = 0.0 <= float(given) < math.inf
    except (TypeError, ValueError):
        known = False
    if not known:
        raise ControllerError(
            f"controller {type(candidate).__name__}: sample_time = {given!r}; expected the time between its "
            "samples [s], or 0 (or no sample_time at all) for a continuous controller"
        )


def _check_names(candidate: Any) -> None:
    for what in ("inputs", "outputs"):
        given = getattr(candidate, what, ())
        if isinstance(given, str) or not isinstance(given, Collection):
            raise ControllerError(
                f"controller {type(candidate).__name__}: {what} = {shortened(given)}; expected a tuple of names, as "
                f"({given if isinstance(given, str) else 'angle'!r},)"
            )


def _callable(candidate: Any, name: str) -> bool:
    return callable(getattr(candidate, name, None))


def _from_object(candidate: Any) -> Controller:
    if isinstance(candidate, type):
        name = candidate.__name__
        raise ControllerError(f"{name} is a class, no controller; make one, as {name}(…), and give that")
    _check_sample_time(candidate)
    _check_names(candidate)
    told = [*(n for n in _VALUES if hasattr(candidate, n)), *(n for n in _METHODS if _callable(candidate, n))]
    if len(told) == len(_VALUES) + len(_METHODS):  # what isinstance asks, ten times quicker
        return cast(Controller, candidate)
    missing = [name for name in ("inputs", "outputs", "initial", "command") if name not in told]
    if missing and hasattr(candidate, "build"):
        raise ControllerError(f"a {type(candidate).__name__} is no controller yet; give the scene's law, scene.law")
    if values := [name for name in missing if hasattr(candidate, name)]:
        raise ControllerError(
            f"controller {type(candidate).__name__}: its {values[0]} is {shortened(getattr(candidate, values[0]))}, no "
            f"method; write it as one: {_WRITTEN[values[0]]}"
        )
    if missing:
        raise ControllerError(
            f"a {type(candidate).__name__} is no controller, it has no {', '.join(missing)}; give a named "
            "control.StateSpace or TransferFunction, or an object as described by flexctrl.design.Controller"
        )
    sample_time = float(getattr(candidate, "sample_time", 0.0))
    needed = "update" if sample_time else "rate"
    if needed not in told and np.size(candidate.initial()):
        kind = f"sampled ({sample_time} s)" if sample_time else "continuous (no sample_time)"
        raise ControllerError(
            f"controller {type(candidate).__name__} is {kind} and has states: it needs {needed}(t, x, y)"
        )
    return _Completed(candidate, tuple(candidate.inputs), tuple(candidate.outputs), sample_time)
